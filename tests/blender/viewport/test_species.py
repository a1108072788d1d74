# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview: follows the editor, stays out of renders and files, and leaves nothing behind."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_plant, datablocks, select
from tetflora_addon.blender.runtime import _after_renders
from tetflora_addon.blender.scene import objects
from tetflora_addon.blender.viewport import points, species

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def preview():
    """Timers never fire here, so that the tests do what they would do."""
    yield species
    species.switch.forget()


def _toggle():
    manager = bpy.context.window_manager
    manager.tetflora_species = not manager.tetflora_species


def _switch_on(preview, species="bush"):
    editor = bpy.context.scene.tetflora.species_editor
    editor.species = species
    _toggle()
    preview.switch.refresh()
    return editor


def _objects():
    return [o for o in bpy.context.scene.objects if o.type == 'MESH']


def test_shows_the_plant_of_the_editor_at_the_cursor(preview):
    bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
    _switch_on(preview)
    (shown,) = _objects()
    assert tuple(shown.location) == (1.0, 2.0, 3.0)
    points = np.zeros((len(shown.data.vertices), 3), np.float32)
    shown.data.vertices.foreach_get("co", points.reshape(-1))
    select(add_plant(seed=1))
    bpy.ops.tetflora.make_plant_mesh()
    same = bpy.context.view_layer.objects.active.data
    expected = np.zeros((len(same.vertices), 3), np.float32)
    same.vertices.foreach_get("co", expected.reshape(-1))
    assert np.array_equal(points, expected)


def test_follows_changes_and_keeps_the_last_sound_plant(preview):
    editor = _switch_on(preview)
    timers, timer = bpy.app.timers, _after_renders(preview.switch.refresh)
    before, name = len(_objects()[0].data.polygons), _objects()[0].name
    for change in (
        lambda: setattr(editor, "preview_seed", 7),
        lambda: setattr(editor, "sides", 9),
        lambda: setattr(editor, "species_choice", "conifer"),
        bpy.ops.tetflora.duplicate_species,
    ):
        if timers.is_registered(timer):
            timers.unregister(timer)
        change()
        assert timers.is_registered(timer)
    preview.switch.refresh()
    (shown,) = _objects()
    assert shown.name == name
    after = len(shown.data.polygons)
    assert after != before
    editor.order_index = 1
    editor.length[1] = 15.0
    preview.switch.refresh()
    assert len(_objects()[0].data.polygons) == after
    message, failed = preview.message()
    assert failed
    assert "orders[1].length" in message
    assert len([m for m in bpy.data.meshes if m.users]) == 1


def test_a_huge_species_is_cut_off_and_says_so(preview, monkeypatch):
    monkeypatch.setattr(preview, "MOST_POLYGONS", 2_000)
    _switch_on(preview, "broadleaf_tree")
    assert 0 < len(_objects()[0].data.polygons) < 4_000
    assert "first" in preview.message()[0]


def test_takes_no_part_in_refinement_rendering_or_clearing(preview):
    add_camera()
    add_plant()
    _switch_on(preview)
    (shown,) = _objects()
    assert shown.hide_render
    assert shown.hide_select
    assert not list(o for o in objects.renderable_objects(bpy.context.view_layer) if o == shown)
    bpy.ops.tetflora.refine()
    bpy.ops.tetflora.clear()
    assert [o.name for o in _objects()] == [shown.name]


def test_is_not_saved(preview, tmp_path):
    _switch_on(preview)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    assert len(_objects()) == 1
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert (datablocks()["objects"], datablocks()["meshes"], datablocks()["collections"]) == ([], [], [])
    assert not preview.switch.shown_in(bpy.context.scene)


def test_not_saved_after_undo_either(preview, tmp_path):
    editor = _switch_on(preview)
    bpy.ops.ed.undo_push(message="before")
    editor.length[0] = 0.3
    bpy.ops.ed.undo_push(message="slider")
    bpy.ops.ed.undo()
    preview.switch.refresh()
    assert len(_objects()) == 1
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert datablocks()["objects"] == []


def test_undo_and_redo_meet_no_preview_that_changed_since(preview):
    # Blender keeps what is equal in two steps, with pointers to what is not: a mesh made in between was one of them.
    editor = _switch_on(preview, "beech")
    met = []
    handlers = bpy.app.handlers.undo_pre, bpy.app.handlers.redo_pre
    for handler in handlers:
        handler.append(lambda *_: met.append(len(_objects())))
    try:
        for order in "210":
            editor.order = order
            bpy.ops.ed.undo_push(message=f"order {order}")
        for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
            step()
            assert preview.switch.shown_in(bpy.context.scene)
            preview.switch.refresh()
            bpy.context.view_layer.update()
            assert len(_objects()) == 1
    finally:
        for handler in handlers:
            handler.pop()
    assert met == [0, 0, 0, 0]


def test_undo_brings_no_preview_back_that_was_switched_off(preview):
    bpy.ops.ed.undo_push(message="empty")
    _switch_on(preview)
    bpy.ops.ed.undo_push(message="with preview")
    _toggle()
    assert _objects() == []
    bpy.ops.ed.undo_push(message="without")
    bpy.ops.ed.undo()
    preview.switch.refresh()
    assert _objects() == []
    assert not bpy.data.collections


def test_leaves_nothing_of_itself(preview):
    before = datablocks()
    _switch_on(preview)
    _toggle()
    after = datablocks()
    for kind in ("objects", "meshes", "collections"):
        assert after[kind] == before[kind]


def test_loading_another_file_ends_it(preview):
    _switch_on(preview)
    session.clean_file()
    assert not preview.switch.shown_in(bpy.context.scene)
    preview.switch.refresh()
    assert _objects() == []


def test_previews_stay_with_a_scene_that_is_renamed(clean_file):
    scene, other = bpy.context.scene, bpy.data.scenes.new("other")
    for preview in (species, points):
        preview.switch.show(scene, True)
        scene.name, other.name = "renamed", "Scene"
        assert preview.switch.shown_in(scene) and not preview.switch.shown_in(other)
        preview.switch.show(scene, False)
        other.name, scene.name = "other", "Scene"
