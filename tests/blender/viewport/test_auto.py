# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine Automatically: it follows changes, drops what is overtaken, and does nothing where nothing has changed."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks
from tetflora_addon import jobs
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results import collection, output
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.blender.viewport import auto, levels
from tetflora_addon.jobs import Progress


@pytest.fixture
def scene(clean_file):
    add_camera(location=(0.0, -30.0, 3.0))
    for i in range(3):
        add_plant(f"tree {i}", seed=i, location=(4.0 * i - 4.0, 0.0, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 48, 36
    bpy.context.view_layer.update()
    yield scene
    bpy.context.scene.tetflora.auto_refine = False


def settle(monkeypatch) -> int:
    """Let time pass until nothing is left to do; the number of slices of work."""
    monkeypatch.setattr(auto, "QUIET", 0.0)
    monkeypatch.setattr(auto, "SLICE", 0.0)
    auto._state.due = 0.0
    slices = 0
    while auto.tick() is not None:
        slices += 1
        assert slices < 10_000
    return slices


def changed(scene):
    """Have Blender tell its handlers that the scene has changed, and no object in it."""
    scene.render.resolution_percentage = scene.render.resolution_percentage
    bpy.context.view_layer.update()


def faces(scene):
    return sum(len(o.data.polygons) for c in results(scene) for o in c.objects if o.type == 'MESH')


def results(scene):
    return collection.result_collections(scene, 'VIEW')


def unfinished():
    """Results that are in no scene yet."""
    return [c for c in bpy.data.collections if output.PURPOSE in c and not c.users]


def test_it_refines_when_it_is_switched_on(scene, monkeypatch):
    assert not results(scene)
    scene.tetflora.auto_refine = True
    assert settle(monkeypatch) > 5
    assert len(results(scene)) == 1
    assert auto.message() == ""


def test_nothing_is_done_where_nothing_has_changed(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    made = results(scene)[0]
    auto.schedule(scene)
    assert settle(monkeypatch) == 0
    assert results(scene) == [made]


@pytest.mark.parametrize("what", ["mesh", "collection"])
def test_it_comes_to_rest_where_a_mesh_is_disabled_in_viewports(scene, monkeypatch, what):
    """To read it, it is enabled for a moment: nothing has changed thereby."""
    sheet, home = add_mesh("sheet"), bpy.data.collections.new("home")
    scene.collection.children.link(home)
    home.objects.link(sheet)
    scene.collection.objects.unlink(sheet)
    sheet.modifiers.new("array", 'ARRAY').count = 3
    sheet.tetflora.is_explicit = True
    disabled = sheet if what == "mesh" else home
    disabled.hide_viewport = True
    bpy.context.view_layer.update()
    scene.tetflora.auto_refine = True
    assert settle(monkeypatch) > 5
    made = results(scene)[0]
    changed(scene)
    assert settle(monkeypatch) == 0
    assert results(scene) == [made]
    bpy.context.view_layer.update()
    assert settle(monkeypatch) == 0
    assert disabled.hide_viewport and not sheet.hide_get() and sheet.users_collection == (home,)


@pytest.mark.parametrize("change", ["camera", "plant", "cutoff", "seed", "new", "form"])
def test_what_changes_is_refined_again(scene, monkeypatch, change):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    made = results(scene)[0].name_full
    uid = results(scene)[0].session_uid
    plant = bpy.data.objects["tree 1"]
    if change == "camera":
        scene.camera.location.x += 1.0
    elif change == "plant":
        plant.location.x += 1.0
    elif change == "cutoff":
        scene.tetflora.cutoff *= 2.0
    elif change == "seed":
        plant.tetflora.seed += 1
    elif change == "form":
        scene.tetflora.proxy_kind = 'MICROSURFACES'
    else:
        add_plant("another", seed=9, location=(0.0, 5.0, 0.0))
    bpy.context.view_layer.update()
    assert settle(monkeypatch) > 0
    assert len(results(scene)) == 1
    assert results(scene)[0].session_uid != uid, made


@pytest.mark.parametrize("change", ["percentage", "aspect", "engine", "material", "leaf"])
def test_settings_that_results_depend_on_are_heard(scene, monkeypatch, change):
    """Blender says no more of them than that the scene has changed."""
    scene.render.engine = 'CYCLES'
    material, leaf = bpy.data.materials.new("own"), add_mesh("leaf")
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    heard = []
    monkeypatch.setattr(auto, "schedule", heard.append)
    changed(scene)
    heard.clear()
    changed(scene)
    assert not heard
    if change == "percentage":
        scene.render.resolution_percentage = 50
    elif change == "aspect":
        scene.render.pixel_aspect_x = 2.0
    elif change == "engine":
        scene.render.engine = compat.eevee_engine()
    elif change == "material":
        entry = scene.tetflora.output.species.add()
        entry.species, entry.leaf = "bush", material
    else:
        entry = scene.tetflora.leaf_objects.add()
        entry.species, entry.leaf = "bush", leaf
    changed(scene)
    assert heard == [scene]


def test_what_has_nothing_to_do_with_plants_starts_nothing(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    made = results(scene)[0]
    add_mesh("box")
    bpy.data.materials.new("paint")
    bpy.context.view_layer.update()
    auto.schedule(scene)
    assert settle(monkeypatch) == 0
    assert results(scene) == [made]


def test_a_change_in_the_middle_drops_what_is_half_made(scene, monkeypatch):
    before = datablocks()
    scene.tetflora.auto_refine = True
    monkeypatch.setattr(auto, "SLICE", 0.0)
    auto._state.due = 0.0
    for _ in range(400):
        auto.tick()
        if unfinished() and unfinished()[0].objects:
            break
    assert unfinished() and not results(scene)
    auto.on_interruption()
    assert datablocks() == before
    assert settle(monkeypatch) > 5
    assert results(scene)


def test_switched_off_it_keeps_what_is_there_and_stops(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    scene.tetflora.auto_refine = False
    scene.camera.location.x += 3.0
    assert auto.tick() is None
    assert len(results(scene)) == 1


def test_where_no_plant_is_left_the_line_says_no_more_than_fits(scene, monkeypatch):
    """What to do was behind it: Blender cut the middle of both."""
    for plant in [o for o in scene.objects if o.tetflora.is_plant]:
        bpy.data.objects.remove(plant)
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    assert auto.message() == "No plants to render"


def test_what_cannot_be_refined_is_said(scene, monkeypatch):
    bpy.data.objects["tree 0"].tetflora.species = "quercus"
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    assert "quercus" in auto.message()
    assert results(scene)  # of the others
    bpy.data.objects["tree 0"].tetflora.species = "bush"
    auto.schedule(scene)
    settle(monkeypatch)
    assert auto.message() == ""
    assert results(scene)


@pytest.mark.parametrize("moved", [False, True])
def test_only_a_change_of_plants_stops_the_job_not_the_flags_that_results_update(scene, monkeypatch, moved):
    scene.tetflora.auto_refine = True
    changed(scene)  # settings as they are
    monkeypatch.setattr(auto, "SLICE", 0.0)
    auto._state.due = 0.0
    for _ in range(5):
        auto.tick()
    job = auto._state.steps
    assert job is not None
    if moved:
        bpy.data.objects["tree 1"].location.x += 1.0
    else:  # Blender then updates flags of every object, as it does for results
        scene.collection.children.link(bpy.data.collections.new("other"))
    bpy.context.view_layer.update()
    assert (auto._state.steps is job) == (not moved)
    settle(monkeypatch)
    assert len(results(scene)) == 1


def test_a_plant_hidden_while_it_works_is_heard_afterwards(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    changed(scene)
    monkeypatch.setattr(auto, "SLICE", 0.0)
    auto._state.due = 0.0
    for _ in range(5):
        auto.tick()
    bpy.data.objects["tree 1"].hide_render = True
    bpy.context.view_layer.update()
    settle(monkeypatch)
    assert auto.changed_since(scene) == ["the plants"]  # as in the window, a moment after any change
    assert settle(monkeypatch) > 0
    assert json.loads(scene.tetflora.statistics)["plants"] == 2


@pytest.mark.parametrize("hides", [True, False])
def test_a_plant_that_is_hidden_by_its_eye_is_refined_anew_once(scene, monkeypatch, hides):
    tree = bpy.data.objects["tree 1"]
    tree.hide_set(not hides)
    scene.tetflora.auto_refine = True
    changed(scene)
    settle(monkeypatch)
    bpy.context.view_layer.update()
    auto._state.scene = 0  # nothing is left to do
    tree.hide_set(hides)  # as H does, of which Blender tells nobody
    bpy.context.view_layer.update()
    assert auto.changed_since(scene) == ["the plants"]  # as in the window, a moment after any change
    assert settle(monkeypatch) > 0
    assert any(o.hide_viewport for c in results(scene) for o in c.objects) == hides
    auto._state.scene = 0
    assert auto.changed_since(scene) == []
    assert settle(monkeypatch) == 0


def half_make(scene, monkeypatch):
    """Have it work until there are results that are not done."""
    monkeypatch.setattr(auto, "SLICE", 0.0)
    changed(scene)  # settings as they are
    auto.schedule(scene)
    auto._state.due = 0.0
    while not unfinished() or not unfinished()[0].objects:
        assert auto.tick() is not None


def test_clear_takes_away_what_is_half_made_too(scene, monkeypatch):
    before = datablocks()
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    scene.tetflora.cutoff *= 2.0
    half_make(scene, monkeypatch)
    assert bpy.ops.tetflora.clear() == {'FINISHED'}
    assert datablocks() == before
    assert auto.message() == ""
    assert settle(monkeypatch) > 0  # it works on


def test_what_refine_has_made_is_not_made_again(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    scene.tetflora.cutoff *= 2.0
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    made = results(scene)
    auto.schedule(scene)
    assert settle(monkeypatch) == 0
    assert results(scene) == made
    scene.tetflora.cutoff /= 2.0
    auto.schedule(scene)
    assert settle(monkeypatch) > 0


def test_refine_is_alone(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    half_make(scene, monkeypatch)
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert len(results(scene)) == 1
    scene.tetflora.cutoff *= 2.0
    half_make(scene, monkeypatch)
    with auto.paused():  # as the operator does between redraws
        assert auto.tick() == auto._BUSY
        assert len(results(scene)) == 1
    assert settle(monkeypatch) > 0


def test_only_what_is_done_is_kept(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    half_make(scene, monkeypatch)
    with pytest.raises(RuntimeError, match="No results to keep"):
        bpy.ops.tetflora.keep_results()
    assert not results(scene)
    settle(monkeypatch)
    made = {obj.name for obj in results(scene)[0].objects}
    scene.tetflora.cutoff *= 2.0
    half_make(scene, monkeypatch)
    assert bpy.ops.tetflora.keep_results() == {'FINISHED'}
    assert not results(scene)
    assert {obj.name for obj in scene.objects if "tetflora_kind" in obj} == made


def test_after_an_unexpected_error_it_says_so_and_can_begin_anew(scene, monkeypatch):
    def broken(*_arguments, **_options):
        yield Progress(0.0, "Reading the scene")
        raise ZeroDivisionError("of another's making")

    scene.tetflora.auto_refine = True
    with monkeypatch.context() as patch:
        patch.setattr(refine, "refine_steps", broken)
        with pytest.raises(ZeroDivisionError):
            settle(monkeypatch)
    assert "another's making" in auto.message()
    auto.schedule(scene)
    assert settle(monkeypatch) > 0
    assert results(scene) and auto.message() == ""


@pytest.mark.parametrize("what", ["tree 1", "camera", "results"])
def test_what_is_deleted_in_the_middle_is_noticed(scene, monkeypatch, what):
    before = datablocks()
    scene.tetflora.auto_refine = True
    half_make(scene, monkeypatch)
    if what == "results":
        bpy.data.collections.remove(unfinished()[0])
    else:
        bpy.data.objects.remove(bpy.data.objects[what])
    settle(monkeypatch)
    if what == "camera":
        assert "camera" in auto.message()
        assert not results(scene)
        assert {kind: [n for n in names if n != what] for kind, names in before.items()} == datablocks() | {
            "cameras": []
        }
    else:
        assert len(results(scene)) == 1
        assert json.loads(scene.tetflora.statistics)["plants"] == 3 - (what == "tree 1")
        assert sum(o.name.startswith("TetFlora proxies") for o in bpy.data.objects) <= 1


def test_undo_and_redo_meet_no_results_that_they_do_not_know(scene, monkeypatch):
    # Blender keeps the scene where it is equal in two steps: it pointed to results made after both, which undo frees.
    scene.tetflora.auto_refine = True
    settle(monkeypatch)
    bpy.ops.ed.undo_push(message="refined")
    for number in range(3):
        bpy.data.objects["tree 0"].location.x += 1.0
        bpy.ops.ed.undo_push(message=f"move {number}")
    settle(monkeypatch)
    met = []
    handlers = bpy.app.handlers.undo_pre, bpy.app.handlers.redo_pre
    for handler in handlers:
        handler.append(lambda *_: met.append(len(results(bpy.context.scene))))
    try:
        for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
            step()
            bpy.context.view_layer.update()
            assert settle(monkeypatch) > 0
            assert len(results(bpy.context.scene)) == 1
            assert len(bpy.data.collections) == 1
    finally:
        for handler in handlers:
            handler.pop()
    assert met == [0, 0, 0, 0]


def test_it_follows_the_viewport(scene, monkeypatch):
    """Without a camera in the scene, and anew whenever the view is turned."""
    graph = bpy.context.evaluated_depsgraph_get()
    near = read_camera(scene, graph)
    views = [near]
    monkeypatch.setattr(auto, "view_camera", lambda _: views[-1])
    scene.camera = None
    scene.tetflora.follow_viewport = scene.tetflora.auto_refine = True
    auto.watch()
    settle(monkeypatch)
    assert auto.message() == ""
    uid, made = results(scene)[0].session_uid, faces(scene)
    auto.watch()
    assert settle(monkeypatch) == 0
    views.append(replace(near, position=near.position + 200.0 * near.frame[:, 2]))
    auto.watch()
    assert settle(monkeypatch) > 5
    assert results(scene)[0].session_uid != uid
    assert faces(scene) < made
    views[-1] = None  # a viewport that looks through the camera
    auto.watch()
    settle(monkeypatch)
    assert "camera" in auto.message()


def test_without_refine_automatically_nobody_looks_at_the_viewport(scene, monkeypatch):
    monkeypatch.setattr(auto, "view_camera", lambda _: pytest.fail("looked"))
    scene.tetflora.follow_viewport = True
    assert auto.watch() is None


def test_a_scene_that_is_renamed_is_still_refined_and_not_once_more(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    monkeypatch.setattr(auto, "QUIET", 0.0)
    monkeypatch.setattr(auto, "SLICE", 0.0)
    auto._state.due = 0.0
    assert auto.tick() is not None and auto._state.steps is not None  # it is at work
    scene.name = "renamed"
    bpy.data.scenes.new("Scene")  # another takes its name
    assert settle(monkeypatch) > 0
    assert results(scene) and not results(bpy.data.scenes["Scene"])
    scene.name = "renamed again"
    auto.schedule(scene)
    assert settle(monkeypatch) == 0


@pytest.fixture
def shading(scene, monkeypatch):
    """Sets the shading of the window's viewport, of which there is none here, and lets the timer look at it."""
    rendered = [False]
    monkeypatch.setattr(auto, "is_rendered", lambda _: rendered[0])
    levels.read_shapes(scene, bpy.context.evaluated_depsgraph_get())

    def shade(kind: str) -> bool:
        rendered[0] = kind == 'RENDERED'
        auto.watch()
        return bpy.context.scene.tetflora.auto_refine  # undo makes another scene

    yield shade
    shade('SOLID')


def test_rendered_shading_switches_it_on_for_the_viewport_and_another_one_off(scene, shading, monkeypatch):
    views = [read_camera(scene, bpy.context.evaluated_depsgraph_get())]
    monkeypatch.setattr(auto, "view_camera", lambda _: views[-1])
    scene.camera = None
    assert not shading('SOLID') and shading('RENDERED')
    assert settle(monkeypatch) > 5
    made = results(scene)
    assert len(made) == 1
    assert shading('RENDERED') and not shading('SOLID')
    assert results(scene) == made


def test_what_the_artist_switches_stays_as_it_is(scene, shading):
    scene.tetflora.auto_refine = True
    assert shading('RENDERED') and shading('SOLID')
    scene.tetflora.auto_refine = False
    assert shading('RENDERED')
    scene.tetflora.auto_refine = False
    assert not shading('RENDERED'), "it would not let itself be switched off"
    assert not shading('SOLID') and shading('RENDERED')


def test_scenes_without_plants_are_left_alone_in_rendered_shading(scene, shading):
    plants = [bpy.data.objects[f"tree {number}"] for number in range(3)]
    bpy.data.batch_remove(plants)
    levels.read_shapes(scene, bpy.context.evaluated_depsgraph_get())
    assert not shading('RENDERED')
    add_plant("first")
    bpy.context.view_layer.update()
    levels.read_shapes(scene, bpy.context.evaluated_depsgraph_get())
    assert shading('RENDERED')


def test_what_rendered_shading_switched_on_is_off_in_a_file_because_blender_opens_it_in_solid(scene, shading, tmp_path):
    assert shading('RENDERED')
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    assert shading('RENDERED')
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not bpy.context.scene.tetflora.auto_refine and not shading('SOLID')


def test_a_file_in_which_the_artist_has_it_on_is_refined_when_it_is_opened(scene, monkeypatch, tmp_path):
    scene.tetflora.auto_refine = True
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.context.scene.tetflora.auto_refine
    assert settle(monkeypatch) > 5
    assert results(bpy.context.scene)


def test_while_the_artist_edits_it_does_not_claim_to_work(scene, monkeypatch):
    scene.tetflora.auto_refine = True
    half_make(scene, monkeypatch)
    assert "%" in auto.message()
    bpy.context.view_layer.objects.active = add_mesh("ground")
    bpy.ops.object.mode_set(mode='EDIT')
    auto._state.due = 0.0
    assert auto.tick() == auto._BUSY and auto.message() == "Waits for Object Mode"
    bpy.ops.object.mode_set(mode='OBJECT')
    settle(monkeypatch)
    assert auto.message() == "" and results(scene)


def test_undo_of_a_step_before_leaves_it_as_the_shading_has_it(scene, shading):
    bpy.ops.ed.undo_push(message="before")
    shading('RENDERED')
    add_plant("another", seed=9)
    bpy.ops.ed.undo_push(message="while it is rendered")
    bpy.ops.ed.undo()
    assert shading('RENDERED') and not shading('SOLID')
    bpy.ops.ed.redo()  # a step in which it was on
    assert not shading('SOLID')


def test_a_slice_never_waits_for_the_engine_however_long_the_window_took_to_draw(scene, monkeypatch):
    asked = []

    def waiting():
        while True:
            asked.append(True)
            yield Progress(0.5, "computing", waiting=True)

    monkeypatch.setattr(jobs.time, "sleep", lambda _: pytest.fail("the window stands still"))
    scene.tetflora.auto_refine = True
    auto._state.steps = waiting()
    auto._state.pace._left -= 9.0  # the last redraw took so long
    assert auto.tick() is not None
    assert len(asked) == 1
    auto.stop()


def turned(camera, angle, by=0.0):
    """A view turned around what it looks at, 40 m ahead, and so many meters nearer to that."""
    c, s = math.cos(angle), math.sin(angle)
    frame = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)]) @ camera.frame
    middle = camera.position - 40.0 * camera.frame[:, 2]
    return replace(camera, frame=frame, position=middle + (40.0 - by) * frame[:, 2])


@pytest.mark.parametrize(
    ("angle", "by", "expected"),
    [(0.0, 0.0, True), (0.01, 0.0, True), (0.0, 12.0, True), (0.2, 0, False), (0, -8, False)],
)
def test_views_are_alike_from_the_same_side_and_within_the_image(scene, angle, by, expected):
    before = read_camera(scene, bpy.context.evaluated_depsgraph_get())
    assert auto.alike(before, turned(before, angle, by), 40.0 - by) == expected


def test_results_go_as_soon_as_the_view_has_moved_much_and_stay_where_it_has_not(scene, monkeypatch):
    views = [read_camera(scene, bpy.context.evaluated_depsgraph_get())]
    looks = []
    original = refine.refine_steps
    monkeypatch.setattr(auto, "view_camera", lambda _: views[-1])
    monkeypatch.setattr(
        refine, "refine_steps", lambda *a, first_look, **k: looks.append(first_look) or original(*a, **k)
    )
    scene.tetflora.follow_viewport = scene.tetflora.auto_refine = True
    auto.watch()
    settle(monkeypatch)
    made = results(scene)
    views.append(turned(views[0], 0.001))
    auto.watch()
    assert results(scene) == made
    settle(monkeypatch)
    assert len(results(scene)) == 1
    views.append(turned(views[0], 0.5))
    auto.watch()
    assert not results(scene)
    settle(monkeypatch)
    assert len(results(scene)) == 1
    assert looks == [True, False, True], "what is sharp must not become coarse for a little"
    auto.schedule(scene)  # as where Blender tells of the results
    settle(monkeypatch)
    views.append(turned(views[0], 0.501))
    auto.watch()
    settle(monkeypatch)
    assert looks == [True, False, True, False]


def test_results_stay_where_nothing_would_stand_for_them(scene, monkeypatch):
    views = [read_camera(scene, bpy.context.evaluated_depsgraph_get())]
    monkeypatch.setattr(auto, "view_camera", lambda _: views[-1])
    scene.tetflora.follow_viewport = scene.tetflora.auto_refine = True
    auto.watch()
    settle(monkeypatch)
    made = results(scene)
    scene.tetflora.preview.plants = 'NONE'
    views.append(turned(views[0], 0.5))
    auto.watch()
    assert results(scene) == made
    scene.tetflora.preview.plants = 'LIGHT'
    views.append(turned(views[0], 0.6))
    with auto.paused():  # Refine works with them
        auto.watch()
        assert results(scene) == made
    views.append(turned(views[0], 0.7))
    auto.watch()
    assert not results(scene)
