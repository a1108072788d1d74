# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What viewports preview, as far as it is known without a window: levels, plants, a frozen camera; and what stays."""

from __future__ import annotations

from functools import partial
from threading import Thread
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from devtools.layouts import Layout
from devtools.partition import partition
from panels.refine import TETFLORA_PT_refine
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender.runtime import _after_renders
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.viewport import auto, levels, overlay, state
from tetflora_addon.blender.viewport.levels import _on_timer, _on_update, level_steps, read_shapes
from tetflora_addon.preview import running

pytestmark = pytest.mark.usefixtures("clean_file")


def scene_of_plants(number=4):
    camera = add_camera((0.0, -40.0, 4.0))
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 160
    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 6.0, 2.0
    plants = [add_plant(f"plant {i}", seed=i, location=(3.0 * i - 5.0, 0.0, 0.0)) for i in range(number)]
    return scene, camera, plants


def compute():
    assert bpy.ops.tetflora.preview_levels() == {'FINISHED'}
    return state.find(bpy.context.scene)


def test_levels_are_those_of_refinement_and_leave_no_trace():
    scene, _, _ = scene_of_plants()
    before, statistics = datablocks(), scene.tetflora.statistics
    preview = compute()
    assert datablocks() == before
    assert scene.tetflora.statistics == statistics
    _, refinement = partition(scene, depsgraph())
    levels = preview.levels
    assert len(levels) == refinement.passes > 1
    assert levels.levels[-1].nodes.tolist() == refinement.nodes.tolist()
    assert levels.levels[-1].decision.tolist() == refinement.decision.tolist()
    assert scene.tetflora.preview.level == levels.levels[-1].number


def test_shells_are_refined_as_refine_does():
    scene, _, _ = scene_of_plants()
    coarse = len(compute().levels.levels[-1])
    scene.tetflora.proxy_kind = 'SHELLS'
    fine = compute().levels.levels[-1]
    _, refinement = partition(scene, depsgraph())
    assert fine.nodes.tolist() == refinement.nodes.tolist()
    assert len(fine) > coarse


def test_stopped_halfway_nothing_changes():
    scene, _, _ = scene_of_plants()
    kept = compute().levels
    steps = level_steps(scene, depsgraph())
    for _ in range(3):
        next(steps)
    steps.close()
    assert state.find(scene).levels is kept


def test_levels_are_outdated_when_the_camera_has_moved():
    scene, camera, _ = scene_of_plants()
    assert not state.is_outdated(scene)
    compute()
    assert not state.is_outdated(scene)
    camera.location.x += 2.0
    bpy.context.view_layer.update()
    assert state.is_outdated(scene)
    camera.location.x -= 2.0
    bpy.context.view_layer.update()
    assert not state.is_outdated(scene)
    scene.render.resolution_x = 200
    assert state.is_outdated(scene)


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [
        ("lens", "sensor_width", 20.0),
        ("lens", "clip_start", 0.2),
        ("focus", "use_dof", True),
        ("picture", "pixel_aspect_x", 2.0),
        ("picture", "use_multiview", True),
    ],
)
def test_levels_are_outdated_when_lens_or_picture_are_others(owner, name, value):
    scene, camera, _ = scene_of_plants()
    compute()
    setattr({"lens": camera.data, "focus": camera.data.dof, "picture": scene.render}[owner], name, value)
    assert state.is_outdated(scene)


def test_a_frozen_camera_stays_while_the_scenes_moves():
    scene, camera, _ = scene_of_plants()
    before = compute().levels
    scene.tetflora.preview.freeze = True
    assert state.find(scene).frozen is before.camera
    camera.location = (0.0, 30.0, 2.0)
    bpy.context.view_layer.update()
    assert not state.is_outdated(scene)
    again = compute().levels
    assert again is not before
    np.testing.assert_array_equal(again.camera.position, before.camera.position)
    assert again.levels[-1].nodes.tolist() == before.levels[-1].nodes.tolist()
    scene.tetflora.preview.freeze = False
    np.testing.assert_allclose(compute().levels.camera.position, (0.0, 30.0, 2.0))


def test_freezing_before_anything_is_computed_takes_the_camera_of_that_moment():
    scene, camera, _ = scene_of_plants()
    scene.tetflora.preview.freeze = True
    camera.location = (0.0, 30.0, 2.0)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(compute().levels.camera.position, (0.0, -40.0, 4.0), atol=1e-6)


def test_without_a_camera_the_button_says_so():
    add_plant()
    assert not bpy.ops.tetflora.preview_levels.poll()
    bpy.context.scene.tetflora.preview.freeze = True  # nothing to freeze: said in the panel
    assert state.find(bpy.context.scene).frozen is None
    assert "camera" in state.find(bpy.context.scene).message


def test_what_is_wrong_is_told():
    scene, _, plants = scene_of_plants()
    for plant in plants:
        plant.tetflora.species = "gone"
    with pytest.raises(errors.SceneError, match="gone"):
        list(level_steps(scene, depsgraph()))
    plants[1].tetflora.species = "bush"
    scene.tetflora.preview.plants = 'LIGHT'
    read_shapes(scene, depsgraph())
    assert "gone" in state.find(scene).message
    assert state.find(scene).shapes.plants == 1


def test_levels_can_be_forgotten():
    scene, _, _ = scene_of_plants()
    preview = compute()
    changes = preview.changes
    assert bpy.ops.tetflora.preview_levels(clear=True) == {'FINISHED'}
    assert preview.levels is None
    assert preview.changes > changes
    assert not state.is_outdated(scene)


@pytest.mark.parametrize(("form", "corners"), [('LIGHT', 3), ('BOUNDS', 2)])
def test_plants_are_shown_where_they_stand(form, corners):
    scene, _, plants = scene_of_plants()
    plants[0].tetflora.enabled = False
    before = datablocks()
    scene.tetflora.preview.plants = form
    shapes = read_shapes(scene, depsgraph())
    assert shapes.plants == shapes.of == len(plants) - 1
    assert shapes.indices.shape[1] == corners
    middles = shapes.positions.reshape(shapes.plants, -1, 3).mean(axis=1)
    expected = sorted(plant.location.x for plant in plants[1:])
    np.testing.assert_allclose(np.sort(middles[:, 0]), expected, atol=0.5)
    assert datablocks() == before
    scene.tetflora.preview.plants = 'NONE'
    assert state.find(scene).shapes is None


def test_while_the_timeline_runs_plants_are_read_once_and_at_rest_all_are_shown(monkeypatch):
    """From above three quarters of a wood are in view, of which some are shown, by day and by year; then all again."""
    number, rng = 400, np.random.default_rng(2)
    place = np.column_stack([rng.uniform(-40.0, 40.0, (number, 2)), np.zeros(number)])
    kinds, upright = np.arange(number, dtype=np.int32) % 2, np.tile([1.0, 0.0, 0.0, 0.0], (number, 1))
    field = write_field("wood", place, upright, np.ones(number), kinds, np.arange(number), ["birch", "spruce"])
    scene = bpy.context.scene
    scene.collection.objects.link(field)
    scene.tetflora.preview.plants, year = 'LIGHT', scene.tetflora.year
    year.enabled, year.day = True, 180.0
    before, preview = read_shapes(scene, depsgraph()), state.find(scene)
    views = [np.array([[0.025, 0, 0, 0.5], [0, 0.025, 0, 0], [0, 0, -0.01, 0], [0, 0, 0, 1.0]])]
    monkeypatch.setattr(levels, "shown", partial(running.shown, most=100))
    monkeypatch.setattr(levels, "_moved", lambda _: False)
    read, reads = levels.read_plants, []
    monkeypatch.setattr(levels, "read_plants", lambda *given: reads.append(given) or read(*given))
    seen = []
    for day, years in ((200.0, 0.0), (20.0, 0.0), (20.0, 5.0), (20.0, 60.0)):
        year.day, year.years = day, years
        levels._follow(scene, depsgraph(), preview, views)
        assert 60 < preview.shapes.plants < 140
        assert preview.shapes.of == number
        assert preview.shapes.positions[:, 0].max() < 40.0
        assert f"{preview.shapes.plants} of 400" in overlay.lines_of(scene, preview)[-1][0]
        seen.append((preview.shapes.colors.mean(axis=0), preview.shapes.positions[:, 2].max()))
    assert len(reads) == 1
    assert not np.allclose(seen[0][0], seen[1][0], atol=0.02)  # autumn's crowns are bare in winter
    assert seen[2][1] < 0.5 * seen[3][1]
    levels._follow(scene, depsgraph(), preview, [views[0] + np.diag([0, 0, 0, 9.0])])
    assert len(reads) == 1  # another view looks at the same plants
    for year.years in (60.0, 0.0):
        levels._follow(scene, depsgraph(), preview, [np.diag([0.025, 0.025, -0.01, 1.0]) + np.diag([9.0], 3)])
        assert preview.shapes is None or preview.shapes.plants == 0  # it looks past them
    year.day, year.years = 180.0, 0.0
    after = read_shapes(scene, depsgraph())
    assert preview.running is None
    np.testing.assert_array_equal(after.positions, before.positions)
    np.testing.assert_array_equal(after.colors, before.colors)


def test_while_the_timeline_runs_nothing_is_read_for_all_plants(monkeypatch):
    scene_of_plants()
    monkeypatch.setattr(levels, "timeline_moves", lambda: True)
    monkeypatch.setattr(levels, "read_shapes", lambda *_: pytest.fail("reads all plants"))
    assert _on_timer() > 0.0


def test_figures_say_what_is_shown():
    scene, camera, _ = scene_of_plants()
    preview = compute()
    settings = scene.tetflora.preview
    for level in preview.levels.levels:
        settings.level = level.number
        text = "\n".join(line for line, _ in overlay.lines_of(scene, preview))
        assert f"Level {level.number} of {preview.levels.levels[-1].number}" in text
        assert f"{level.figures.proxy:,} proxies" in text
        assert f"{level.figures.split:,} to split" in text
        assert f"{level.figures.polygons:,} explicit polygons" in text
    camera.location.x += 1.0
    depsgraph()
    assert "changed" in overlay.lines_of(scene, preview)[-1][0]
    settings.freeze = True
    assert "frozen" in overlay.lines_of(scene, preview)[-1][0]
    colors = {color for _, color in overlay.lines_of(scene, preview)}
    settings.color = 'VISIBILITY'
    assert {color for _, color in overlay.lines_of(scene, preview)} < colors


def test_undo_keeps_levels_and_lets_go_of_what_was_frozen():
    scene, _, _ = scene_of_plants()
    levels = compute().levels
    scene.tetflora.preview.plants = 'NONE'
    bpy.ops.ed.undo_push(message="before")
    scene.tetflora.preview.plants = 'LIGHT'
    read_shapes(scene, depsgraph())
    scene.tetflora.preview.freeze = True
    bpy.ops.ed.undo_push(message="frozen")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    state.on_undo(scene)  # as the handler does where there is a window
    preview = state.find(scene)
    assert preview.levels is levels
    assert (preview.frozen, preview.shapes) == (None, None)
    bpy.ops.ed.redo()
    state.on_undo(bpy.context.scene)
    assert preview.frozen is levels.camera


def test_settings_survive_the_file_and_what_is_shown_does_not(tmp_path):
    scene, _, _ = scene_of_plants()
    settings = scene.tetflora.preview
    compute()
    settings.plants, settings.color, settings.forms, settings.freeze = 'BOUNDS', 'LEVEL', {'PROXY'}, True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    assert state.find(scene).levels is not None
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    scene = bpy.context.scene
    settings = scene.tetflora.preview
    assert (settings.plants, settings.color, set(settings.forms), settings.freeze) == (
        'BOUNDS',
        'LEVEL',
        {'PROXY'},
        False,
    )
    found = state.find(scene)
    assert found is None or (found.levels, found.shapes, found.frozen) == (None, None, None)


def test_nothing_draws_or_waits_in_the_background():
    scene, _, _ = scene_of_plants()
    scene.tetflora.preview.plants = 'LIGHT'
    assert overlay._handles == []
    assert not bpy.app.timers.is_registered(_after_renders(_on_timer))


def test_a_scene_without_plants_is_not_read(monkeypatch):
    asked = []
    monkeypatch.setattr(levels, "schedule", lambda: asked.append(True))
    scene = bpy.context.scene
    assert scene.tetflora.preview.plants == 'LIGHT'
    _on_update(scene, SimpleNamespace(updates=[SimpleNamespace(id=scene)]))
    assert not asked
    update = SimpleNamespace(id=add_plant(), is_updated_transform=True, is_updated_geometry=False)
    _on_update(scene, SimpleNamespace(updates=[update]))
    assert asked


def test_every_setting_has_a_name_of_its_own():
    properties = state.TetFloraPreview.bl_rna.properties
    names = [p.name for p in properties if p.identifier not in {"rna_type", "name"}]
    assert len(names) == len(set(names)) == 8


def test_simple_shapes_make_way_for_refined_plants_where_these_are_seen(monkeypatch):
    scene, _, _ = scene_of_plants(1)
    scene.tetflora.preview.plants = 'LIGHT'
    read_shapes(scene, depsgraph())
    drawn = []
    monkeypatch.setattr(overlay, "_draw_plants", drawn.append)

    def is_drawn():
        drawn.clear()
        bpy.context.view_layer.update()
        overlay._in_space(bpy.context, state.find(scene))
        return bool(drawn)

    assert is_drawn()
    bpy.ops.tetflora.refine()
    assert not is_drawn()
    scene.tetflora.output.show_viewport = False
    assert is_drawn()
    scene.tetflora.output.show_viewport = True
    assert not is_drawn()
    bpy.context.view_layer.layer_collection.children["TetFlora"].hide_viewport = True  # the eye in the Outliner
    assert is_drawn()


def test_the_thread_of_a_render_does_not_touch_the_context(monkeypatch):
    """Blender crashes where it overrides that: a frame whose originals results hide, in the window."""
    scene, _, plants = scene_of_plants(2)
    scene.tetflora.preview.plants = 'LIGHT'
    read_shapes(scene, depsgraph())
    plants[0].hide_set(True)
    told = SimpleNamespace(updates=[SimpleNamespace(id=scene)], view_layer=bpy.context.view_layer)
    counted = []
    monkeypatch.setattr(levels, "shown_objects", lambda layer: counted.append(layer) or [])
    monkeypatch.setattr(levels, "schedule", lambda: None)
    thread = Thread(target=_on_update, args=(scene, told))
    thread.start()
    thread.join()
    assert not counted
    _on_update(scene, told)
    assert counted


@pytest.mark.parametrize("how", ["eye", "collection's eye", "monitor"])
def test_what_is_hidden_in_viewports_has_no_shape_there(monkeypatch, how):
    scene, _, plants = scene_of_plants(3)
    scene.tetflora.preview.plants = 'LIGHT'
    apart = bpy.data.collections.new("apart")
    scene.collection.children.link(apart)
    scene.collection.objects.unlink(plants[0])
    apart.objects.link(plants[0])
    assert read_shapes(scene, depsgraph()).of == 3
    monkeypatch.setattr(levels, "schedule", lambda: asked.append(True))
    asked, update = [], SimpleNamespace(id=scene)
    told = SimpleNamespace(updates=[update], view_layer=bpy.context.view_layer)
    _on_update(scene, told)
    assert not asked
    if how == "eye":
        plants[0].hide_set(True)
    elif how == "monitor":
        plants[0].hide_viewport = True
    else:
        bpy.context.view_layer.layer_collection.children["apart"].hide_viewport = True
    _on_update(scene, told)
    assert asked
    assert read_shapes(scene, depsgraph()).of == 2
    for plant in plants[1:]:
        plant.hide_set(True)
    read_shapes(scene, depsgraph())
    assert state.find(scene).shapes is None and "hidden in viewports" in state.find(scene).message


def test_results_say_that_a_layer_was_hidden_or_has_other_plants():
    scene, _, _ = scene_of_plants(1)
    select(add_mesh("ground", size=10.0))
    bpy.ops.tetflora.populate(count=4, species="bush")
    bpy.ops.tetflora.refine()
    layer = scene.tetflora.layers[0]
    layer.shown = False
    assert auto.changed_since(scene) == ["the layers", "the plants"]
    layer.shown = True
    assert auto.changed_since(scene) == []
    bpy.ops.tetflora.update_layers(which='ACTIVE', reroll=True)
    assert "the layers" in auto.changed_since(scene)
    bpy.ops.tetflora.refine()
    assert auto.changed_since(scene) == []


@pytest.mark.parametrize("how", ["eye", "monitor", "camera", "collection", "deleted", "another"])
def test_results_say_that_plants_were_hidden_shown_deleted_or_added(how):
    scene, _, plants = scene_of_plants(3)
    apart = bpy.data.collections.new("apart")
    scene.collection.children.link(apart)
    apart.objects.link(plants[0])
    scene.collection.objects.unlink(plants[0])
    bpy.ops.tetflora.refine()
    assert auto.changed_since(scene) == []
    if how == "eye":
        plants[0].hide_set(True)
    elif how in {"monitor", "camera"}:
        setattr(plants[0], "hide_viewport" if how == "monitor" else "hide_render", True)
    elif how == "collection":
        bpy.context.view_layer.layer_collection.children["apart"].hide_viewport = True
    elif how == "deleted":
        bpy.data.objects.remove(plants[0])
    else:
        add_plant("another")
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == ["the plants"]
    bpy.ops.tetflora.refine()
    assert auto.changed_since(scene) == []
    if how == "eye":
        plants[0].hide_set(False)
        assert auto.changed_since(scene) == ["the plants"]


def test_results_say_what_has_changed_since_they_were_made():
    scene, camera, _ = scene_of_plants(1)
    assert auto.changed_since(scene) == []
    bpy.ops.tetflora.refine()
    assert auto.changed_since(scene) == []
    camera.location.x += 1.0
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == ["the camera"]
    scene.tetflora.year.enabled = True
    scene.tetflora.cutoff *= 2.0
    assert auto.changed_since(scene) == ["the camera", "the day or year", "settings"]
    layout = Layout()
    region = SimpleNamespace(width=3000)
    names = ("scene", "view_layer", "preferences", "active_object", "mode")
    context = SimpleNamespace(region=region, **{name: getattr(bpy.context, name) for name in names})
    TETFLORA_PT_refine.draw(SimpleNamespace(layout=layout), context)
    said = " ".join(options.get("text", "") for name, _, options in layout.drawn if name == "label")
    assert "Out of date: the camera and more" in said
    bpy.ops.tetflora.refine()
    assert auto.changed_since(scene) == []
