# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants made real meshes: the very polygons of the plant, in its place, the artist's from then on."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon import memory
from tetflora_addon.blender.job import plant_mesh
from tetflora_addon.blender.results.hiding import hide_originals
from tetflora_addon.blender.worker import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def _points(obj):
    found = np.zeros((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", found.reshape(-1))
    matrix = np.array(obj.matrix_world)
    return found @ matrix[:3, :3].T + matrix[:3, 3]


def _faces(obj):
    """Vertices of all faces in world space as a set that does not depend on their order."""
    points, polygons = _points(obj), obj.data.polygons
    return np.array([points[list(p.vertices)].mean(axis=0) for p in polygons])


def test_the_mesh_is_the_plant_that_expanding_everything_gives():
    plant = add_plant(seed=3, location=(4.0, 2.0, 1.0), scale=(1.5, 1.5, 1.5), rotation_euler=(0.3, -0.2, 1.0))
    add_camera((0.0, -2000.0, 2.0))  # from where all is as coarse as in a mesh for no camera
    select(plant)
    assert bpy.ops.tetflora.make_plant_mesh() == {'FINISHED'}
    made = bpy.context.view_layer.objects.active
    plant.tetflora.enabled = True
    bpy.context.scene.tetflora.expand_everything = True
    bpy.ops.tetflora.refine()
    whole = [o for o in bpy.data.objects if o.get("tetflora_kind", "species") != "species"]
    expected = np.concatenate([_faces(o) for o in sorted(whole, key=lambda o: o["tetflora_kind"])])
    assert np.abs(_faces(made) - expected).max() < 1e-4


def test_esc_takes_back_what_was_made():
    plants = [add_plant(f"plant {i}", location=(3.0 * i, 0.0, 0.0)) for i in range(3)]
    plants[0].tetflora.enabled = False
    before = {o.name: o.tetflora.enabled for o in bpy.data.objects}
    steps = plant_mesh.make_plant_mesh_steps(bpy.context.scene, depsgraph(), plants)
    told = [0]
    while told[-1] < 2:  # some steps only wait for the thread
        told.append(round(next(steps).fraction * 3))
    assert sorted(set(told)) == [0, 1, 2]
    assert told == sorted(told)
    assert len(bpy.data.objects) == 5
    steps.close()
    assert {o.name: o.tetflora.enabled for o in bpy.data.objects} == before
    assert len(bpy.data.meshes) == 0


def test_it_is_the_artists_and_survives_clear():
    plant, other = add_plant("Oak", location=(1.0, 0.0, 0.0)), add_plant("other", location=(5.0, 0.0, 0.0))
    add_camera()
    select(plant)
    bpy.ops.tetflora.make_plant_mesh()
    made = bpy.context.view_layer.objects.active
    assert made.name == "Oak mesh"
    assert bpy.context.selected_objects == [made]
    assert not made.tetflora.is_plant
    assert not plant.tetflora.enabled
    assert other.tetflora.enabled
    assert list(made.users_collection) == list(plant.users_collection)
    bpy.ops.tetflora.refine()
    polygons = len(made.data.polygons)
    bpy.ops.tetflora.clear()
    assert len(bpy.data.objects["Oak mesh"].data.polygons) == polygons
    names = [m.name for m in made.data.materials]
    assert names == ["TetFlora Bush bark", "TetFlora Bush leaf"]
    assert all(m.node_tree.nodes for m in made.data.materials)


def test_it_looks_as_the_plant_does_to_renders():
    scene, plant, lit = bpy.context.scene, add_plant(), bpy.data.collections.new("lit")
    plant.is_holdout, plant.is_shadow_catcher, plant.hide_render = True, True, True
    plant.visible_shadow = plant.visible_camera = False
    plant.pass_index, plant.lightgroup, plant.color = 7, "key", (0.2, 0.4, 0.6, 1.0)
    plant.light_linking.receiver_collection = lit
    select(plant)
    hide_originals(scene, 'VIEW', [plant])  # as results do, which is not the artist's doing
    (made,) = run_to_end(plant_mesh.make_plant_mesh_steps(scene, depsgraph(), [plant]))
    names = ("is_holdout", "is_shadow_catcher", "visible_shadow", "visible_camera", "visible_glossy", "pass_index")
    for name in (*names, "lightgroup", "hide_render"):
        assert getattr(made, name) == getattr(plant, name), name
    assert made.light_linking.receiver_collection == lit
    assert list(made.color) == list(plant.color)
    assert not made.hide_viewport
    assert "tetflora" not in " ".join(made.keys())


def test_wood_is_smooth_and_leaves_are_flat_with_materials_of_their_own():
    select(add_plant())
    bpy.ops.tetflora.make_plant_mesh()
    mesh = bpy.context.view_layer.objects.active.data
    count = len(mesh.polygons)
    smooth, slot = np.zeros(count, bool), np.zeros(count, np.int32)
    mesh.polygons.foreach_get("use_smooth", smooth)
    mesh.polygons.foreach_get("material_index", slot)
    passes = np.zeros(count, np.float32)
    mesh.attributes["tf_transmission"].data.foreach_get("value", passes)
    assert set(slot) == {0, 1}
    assert np.array_equal(smooth, slot == 0)
    assert np.array_equal(passes > 0, slot == 1)
    assert not mesh.validate()


def test_plants_of_one_seed_give_separate_meshes_in_their_places():
    carrier = add_mesh("carrier")
    carrier.location = (10.0, 0.0, 0.0)
    plants = [add_plant(f"p{i}", seed=7, location=(3.0 * i, 0.0, 0.0)) for i in range(2)]
    plants[1].parent = carrier
    select(*plants)
    bpy.ops.tetflora.make_plant_mesh()
    first, second = (bpy.data.objects[f"p{i} mesh"] for i in range(2))
    assert first.data != second.data
    assert np.abs(_points(second) - _points(first) - (13.0, 0.0, 0.0)).max() < 1e-4
    carrier.location.x = 20.0
    depsgraph()
    assert np.abs(_points(second) - _points(first) - (23.0, 0.0, 0.0)).max() < 1e-4


def test_undo_brings_the_plant_back():
    select(add_plant("Oak"))
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.tetflora.make_plant_mesh()
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert "Oak mesh" not in bpy.context.scene.objects
    assert bpy.data.objects["Oak"].tetflora.enabled


def test_refused_whole_with_a_reason(monkeypatch):
    good, bad = add_plant("good"), add_plant("bad", scale=(0.0, 0.0, 0.0))
    select(good, bad)
    before = len(bpy.data.meshes)
    with pytest.raises(RuntimeError, match='"bad": zero scale'):
        bpy.ops.tetflora.make_plant_mesh()
    select(good)
    monkeypatch.setattr(memory, "LEAST", 1000.0)
    bpy.context.scene.tetflora.max_memory = 0.001
    with pytest.raises(RuntimeError, match=r"A mesh of a plant would .* Max Memory .*select fewer"):
        bpy.ops.tetflora.make_plant_mesh()
    assert len(bpy.data.meshes) == before
    assert good.tetflora.enabled
    select(add_mesh("mesh"))
    assert not bpy.ops.tetflora.make_plant_mesh.poll()
