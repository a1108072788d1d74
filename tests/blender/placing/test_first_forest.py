# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""First Forest: complete, reproducible, and never at the cost of what was there."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from panels import refine
from tests.blender.scenes import add_camera, add_mesh, datablocks
from tetflora_addon.blender import preferences, settings
from tetflora_addon.blender.job import contents
from tetflora_addon.blender.placing import cover, first_forest

pytestmark = pytest.mark.usefixtures("clean_file", "little_cover")


@pytest.fixture
def little_cover(monkeypatch):
    """Of its plants of ground cover only some stand; no test counts them."""
    monkeypatch.setattr(cover, "MOST", 500)


def _plant(**options):
    assert bpy.ops.tetflora.first_forest(**options) == {'FINISHED'}
    return bpy.context.scene


def _plants(scene):
    return [o for o in scene.objects if o.tetflora.is_plant]


def _startup():
    """What a new file of Blender holds."""
    mesh = bpy.data.meshes.new("Cube")
    corners = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    collection = bpy.context.scene.collection.objects
    for obj in (
        bpy.data.objects.new("Cube", mesh),
        bpy.data.objects.new("Light", bpy.data.lights.new("Light", 'POINT')),
        bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")),
    ):
        collection.link(obj)
    bpy.context.view_layer.update()
    return bpy.context.scene


def test_an_empty_scene_becomes_a_forest(capfd):
    before = bpy.context.scene
    scene = _plant()
    assert scene == before
    plants = _plants(scene)
    assert f"Created a forest of {len(plants)} plants and ground cover. Press F12" in capfd.readouterr().out
    assert 60 <= len(plants) <= 100
    assert 3 <= len({o.tetflora.species for o in plants}) <= 4
    places = np.array([o.location for o in plants])
    assert np.allclose(places[:, 2], first_forest.height(places[:, 0], places[:, 1]), atol=1e-4)
    assert np.abs(places[:, 0] - first_forest.path(places[:, 1])).min() > 2.0  # the path is free
    camera = scene.camera
    assert camera.location.z - first_forest.height(*camera.location[:2]) == pytest.approx(1.7, abs=1e-4)
    assert scene.world is not None
    assert [o.type for o in scene.objects if o.type == 'LIGHT'] == ['LIGHT']
    assert {c.name for c in scene.collection.children} == {"First forest", "TetFlora plants"}


def test_plants_stand_within_the_ground_that_is_seen():
    scene = _plant()
    bpy_ground = scene.objects["Forest ground"]
    low, high = np.array(bpy_ground.bound_box).min(axis=0), np.array(bpy_ground.bound_box).max(axis=0)
    places = np.array([o.location for o in _plants(scene)])
    assert (places[:, :2] > low[:2]).all()
    assert (places[:, :2] < high[:2]).all()
    assert scene.camera.location.y > low[1]
    assert bpy_ground.tetflora.is_occluder


def test_the_same_seed_is_the_same_forest():
    for a, b, c in zip(first_forest.places(3), first_forest.places(3), first_forest.places(4), strict=True):
        assert np.array_equal(a, b)
        assert not np.array_equal(a, c)


def test_the_untouched_startup_scene_is_used_and_its_cube_only_hidden():
    before = _startup()
    assert first_forest.is_startup(before)
    scene = _plant()
    assert scene == before
    assert {"Cube", "Camera", "Light"} <= set(scene.objects.keys())
    assert scene.objects["Cube"].hide_render
    assert scene.camera.name == "Forest camera"
    assert len(bpy.data.scenes) == 1


@pytest.mark.parametrize("touched", ["moved", "modeled", "renamed", "more"])
def test_anything_else_is_no_startup_scene(touched):
    scene = _startup()
    cube = scene.objects["Cube"]
    if touched == "moved":
        cube.location.x = 1.0
    elif touched == "modeled":
        cube.data.vertices[0].co.x = -3.0
    elif touched == "renamed":
        cube.name = "House"
    else:
        add_mesh("more")
    bpy.context.view_layer.update()
    assert not first_forest.is_startup(scene)


def test_anything_else_keeps_its_scene():
    scene = _startup()
    scene.objects["Cube"].location.x = 1.0
    bpy.context.view_layer.update()
    world = scene.world = bpy.data.worlds.new("mine")
    before, known = {o.name: (o.hide_render, o.hide_viewport) for o in scene.objects}, datablocks()
    bpy.ops.tetflora.first_forest()
    assert {o.name: (o.hide_render, o.hide_viewport) for o in scene.objects} == before
    assert scene.world == world
    made = next(s for s in bpy.data.scenes if s != scene)
    assert len(_plants(made)) > 60
    assert not _plants(scene)
    after = datablocks()
    assert all(set(names) <= set(after[kind]) for kind, names in known.items())


def test_a_world_that_was_there_is_kept():
    bpy.context.scene.world = bpy.data.worlds.new("mine")
    _plant()
    assert bpy.data.worlds["mine"].use_fake_user


def test_quality_of_new_scenes_and_memory_come_from_the_preferences():
    chosen = preferences.preferences()
    chosen.new_quality, chosen.max_memory = 'DRAFT', 3.0
    try:
        add_camera()
        bpy.ops.tetflora.add_plant(species="bush")
        group = bpy.context.scene.tetflora
        assert group.quality == 'DRAFT'
        # From the first plant on the scene decides.
        group.quality = 'PREVIEW'
        bpy.ops.tetflora.add_plant(species="bush")
        assert group.quality == 'PREVIEW'
        # Memory is the machine's, and not stored in the file; a script may set it for a scene.
        assert not group.is_property_set("max_memory")
        assert contents.settings_from(bpy.context.scene).max_memory == pytest.approx(3.0)
        group.max_memory = 2.0
        assert contents.settings_from(bpy.context.scene).max_memory == pytest.approx(2.0)
        other = bpy.data.scenes.new("own")
        other.tetflora.cutoff = 7.0
        settings.begin(other)
        assert other.tetflora.cutoff == 7.0
        assert other.tetflora.leaf_limit != group.leaf_limit
    finally:
        chosen.new_quality, chosen.max_memory = 'FINAL', 0.0


def test_its_ground_is_selected_so_that_populate_goes_on_from_there():
    _startup()
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    bpy.data.objects["Cube"].select_set(True)
    scene = _plant()
    active = scene.view_layers[0].objects.active
    assert active.type == 'MESH' and active.tetflora.is_occluder
    assert [o.name for o in scene.view_layers[0].objects.selected] == [active.name]
    assert bpy.ops.tetflora.populate.poll()


def test_populate_and_the_brush_go_on_with_its_species():
    bpy.ops.tetflora.first_forest()
    forest = {o.tetflora.species: 0 for o in bpy.context.scene.objects if o.tetflora.is_plant}
    assert len(forest) == 4
    assert {e.species for e in bpy.context.scene.tetflora.populate.mix} == set(forest)
    before = set(bpy.data.objects)
    bpy.context.scene.tetflora.brush.density = 20.0
    bpy.context.view_layer.update()
    bpy.ops.tetflora.paint_plants(mode='PAINT', stroke="-20 60 2")
    painted = {o.tetflora.species for o in set(bpy.data.objects) - before}
    assert len(painted) > 1
    assert painted <= set(forest)


def test_the_tab_says_what_comes_next_and_stops_when_it_is_done():
    scene = bpy.context.scene
    hint = refine.hint
    assert hint(scene) == ""
    bpy.ops.tetflora.first_forest()
    scene = bpy.context.scene
    assert hint(scene) == "F12 renders, Refine shows it here"
    scene.render.resolution_percentage = 5
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert hint(scene) == ""
    bpy.ops.tetflora.keep_results()
    assert not scene.tetflora.refine_at_render
    assert hint(scene) == ""  # what is kept is rendered
    bpy.data.collections.remove(bpy.data.collections["TetFlora kept"])
    assert hint(scene) == "Not refined: renders show no plants"
    bpy.ops.tetflora.remove_plants(which='ALL')
    assert hint(scene) == ""


def test_settings_that_are_not_those_of_a_new_scene_are_kept():
    scene = bpy.context.scene
    scene.render.engine = 'BLENDER_WORKBENCH'
    scene.render.resolution_x, scene.view_settings.exposure, scene.cycles.samples = 4000, -1.0, 7
    assert _plant() == scene
    assert (scene.render.engine, scene.render.resolution_x, scene.cycles.samples) == ('BLENDER_WORKBENCH', 4000, 7)
    assert scene.view_settings.exposure == -1.0
    assert (scene.render.resolution_y, scene.render.resolution_percentage) == (720, 50)
    assert len(bpy.data.scenes) == 1


def test_a_scene_with_a_camera_alone_keeps_all_of_its_settings():
    scene = bpy.context.scene
    add_camera()

    def settings():
        render, cycles = scene.render, scene.cycles
        size = render.resolution_x, render.resolution_y, render.resolution_percentage
        return render.engine, *size, cycles.samples, cycles.max_bounces, scene.view_settings.exposure

    before = settings()
    assert _plant() != scene
    assert settings() == before
