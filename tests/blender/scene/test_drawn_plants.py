# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants drawn by hand through the whole of Blender: reading the scene, refining, real meshes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scene.test_field_sizes import field_of
from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon import errors
from tetflora_addon.blender.job import plant_mesh, refine
from tetflora_addon.blender.scene import plants
from tetflora_addon.jobs import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def _form(name="drawn", height=4.0):
    """A mesh of edges: a leaning trunk with one limb."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(
        [(0, 0, 0), (0.5, 0, height / 2), (0.8, 0, height), (2.0, 1.0, 0.7 * height)], [(0, 1), (1, 2), (1, 3)], []
    )
    mesh.attributes.new("radius", 'FLOAT', 'POINT').data.foreach_set("value", [0.2, 0.15, 0.03, 0.02])
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    made.hide_render = True
    return made


def _positions(obj):
    points = np.zeros(3 * len(obj.data.vertices), np.float32)
    obj.data.attributes["position"].data.foreach_get("vector", points)
    return points.reshape(-1, 3)


def test_a_plant_with_a_form_is_refined_along_it():
    scene = bpy.context.scene
    add_camera()
    plant = add_plant("tree", "bush", 3, (0.0, 5.0, 0.0))
    plant.tetflora.skeleton = _form()
    scene.tetflora.expand_everything = True
    refine.refine(scene, depsgraph())
    bark = [o for o in scene.objects if o.get("tetflora_kind") == "bark"]
    points = np.concatenate([_positions(o) for o in bark]) - [0.0, 5.0, 0.0]
    for place in ((0.0, 0.0, 0.0), (0.5, 0.0, 2.0), (2.0, 1.0, 2.8)):
        assert np.linalg.norm(points - place, axis=1).min() < 0.3


def test_plants_of_one_species_with_and_without_a_form():
    """The same species twice: kinds of plants, not species, are compiled."""
    scene = bpy.context.scene
    add_camera()
    add_plant("grown", "bush", 1, (0.0, 5.0, 0.0))
    add_plant("drawn", "bush", 1, (3.0, 5.0, 0.0)).tetflora.skeleton = _form()
    seeds = plants.read_plants(scene, depsgraph())[0]
    assert len(seeds.identifiers) == 2
    statistics = refine.refine(scene, depsgraph())
    assert statistics.plants == 2
    names = {o.name.split(" leaf")[0] for o in scene.objects if o.get("tetflora_kind") == "leaf"}
    assert names == {"Bush"}


def test_a_drawn_plant_as_a_real_mesh():
    plant = add_plant("tree", "bush", 3, (1.0, 2.0, 0.0))
    plant.tetflora.skeleton = _form()
    (made,) = run_to_end(plant_mesh.make_plant_mesh_steps(bpy.context.scene, depsgraph(), [plant]))
    points = _positions(made)
    assert np.linalg.norm(points - [0.5, 0.0, 2.0], axis=1).min() < 0.3
    assert [m.name for m in made.data.materials] == ["TetFlora Bush bark", "TetFlora Bush leaf"]


def test_a_form_without_edges_is_named():
    empty = bpy.data.objects.new("nothing drawn", bpy.data.meshes.new("nothing drawn"))
    bpy.context.scene.collection.objects.link(empty)
    add_camera()
    add_plant("tree", "bush", 3).tetflora.skeleton = empty
    with pytest.raises(errors.SpeciesError, match="nothing drawn"):
        refine.refine(bpy.context.scene, depsgraph())


def test_drawn_plants_of_a_field_are_as_high_as_is_recorded():
    """They were as many times as high as their species would have to be that is drawn nowhere."""
    scene = bpy.context.scene
    add_camera()
    obj = field_of(2, kinds=("bush",), places=[[0, 5, 0], [40, 5, 0]], tf_height=('FLOAT', [8.0, 2.0]))
    obj.tetflora.field_species[0].skeleton = _form()
    np.testing.assert_allclose(plants.read_plants(scene, depsgraph())[0].scale, [2.0, 0.5], rtol=0.02)
    scene.tetflora.expand_everything = True
    refine.refine(scene, depsgraph())
    points = np.concatenate([_positions(o) for o in scene.objects if o.get("tetflora_kind") == "bark"])
    for own, height in ((points[:, 0] < 20.0, 8.0), (points[:, 0] > 20.0, 2.0)):
        assert points[own, 2].max() == pytest.approx(height, rel=0.03)
