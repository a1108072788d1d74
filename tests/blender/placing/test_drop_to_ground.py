# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drop to Ground, and species and seeds of fields."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender import attributes
from tetflora_addon.blender.placing import ground, plant_objects
from tetflora_addon.blender.scene import fields
from tetflora_addon.errors import SceneError
from tetflora_addon.planting import places

pytestmark = pytest.mark.usefixtures("clean_file")


def _field(positions=((0.0, 0.0, 4.0), (2.0, 0.0, -3.0), (90.0, 0.0, 1.0)), species=("bush", "conifer"), kinds=None):
    positions = np.array(positions)
    number = len(positions)
    placement = places.Placement(
        position=positions,
        azimuth=np.zeros(number),
        scale=np.ones(number),
        species=np.array(kinds or [i % len(species) for i in range(number)], np.int32),
        seed=np.arange(number, dtype=np.int32) + 5,
        wanted=number,
    )
    return plant_objects.add_field(bpy.context.scene, placement, species)


def _read(field):
    graph = depsgraph()
    return fields.read_field(field, graph, attributes.world_matrix(field, graph)[None])


def test_plants_fall_and_rise_to_the_nearest_ground(capfd):
    add_mesh("ground", size=20.0)
    add_mesh("ledge", size=1.0, z=5.0)
    plants = [
        add_plant("above", location=(10.0, 0.0, 7.0)),
        add_plant("below", location=(10.0, 3.0, -2.0)),
        add_plant("under the ledge", location=(0.0, 0.0, 4.0)),
        add_plant("on it", location=(5.0, 5.0, 0.0)),
        add_plant("nowhere", location=(90.0, 0.0, 3.0)),
    ]
    other = add_plant("not selected", location=(9.0, 9.0, 9.0))
    select(*plants)
    assert bpy.ops.tetflora.drop_to_ground() == {'FINISHED'}
    assert [round(p.location.z, 5) for p in plants] == [0.0, 0.0, 5.0, 0.0, 3.0]
    assert [tuple(p.location)[:2] for p in plants[:2]] == [(10.0, 0.0), (10.0, 3.0)]
    assert other.location.z == 9.0
    reported = capfd.readouterr()
    assert "3 plants moved to the ground; 1 plant had no ground below or above" in reported.out + reported.err


def test_children_and_their_parents_both_arrive():
    add_mesh("ground", size=20.0)
    parent = add_plant("a parent", location=(1.0, 0.0, 8.0))
    child = add_plant("a child", location=(3.0, 0.0, 2.0))
    child.parent = parent
    bpy.context.view_layer.update()
    select(parent, child)
    bpy.ops.tetflora.drop_to_ground()
    bpy.context.view_layer.update()
    assert parent.matrix_world.translation.z == pytest.approx(0.0, abs=1e-5)
    assert child.matrix_world.translation.z == pytest.approx(0.0, abs=1e-5)


def test_points_of_a_field_fall_wherever_the_field_is():
    add_mesh("ground", size=20.0, z=1.0)
    field = _field()
    field.location, field.rotation_euler = (1.0, 2.0, 3.0), (0.0, 0.0, 0.7)
    before = _read(field)
    select(field)
    assert bpy.ops.tetflora.drop_to_ground() == {'FINISHED'}
    after = _read(field)
    assert np.allclose(after.position[:2, 2], 1.0, atol=1e-4)
    assert np.allclose(after.position[:, :2], before.position[:, :2], atol=1e-4)
    assert after.position[2, 2] == pytest.approx(before.position[2, 2])
    assert np.array_equal(after.seed, before.seed)


def test_without_ground_nothing_happens():
    select(add_plant("alone", location=(0.0, 0.0, 4.0)))
    with pytest.raises(RuntimeError, match="No mesh is visible below"):
        bpy.ops.tetflora.drop_to_ground()


def _steps(number=1000):
    """The steps for a field of many plants 4 m above the ground, and a plant that is an object."""
    add_mesh("ground", size=20.0)
    field, plant = _field([(0.0, 0.0, 4.0)] * number), add_plant("plant", location=(3.0, 0.0, 2.0))
    return ground.drop_steps(bpy.context.scene, depsgraph(), [plant], [field]), field, plant


def test_nothing_has_moved_where_the_search_is_stopped():
    steps, field, plant = _steps()
    fractions = [next(steps).fraction for _ in range(4)]
    assert fractions == sorted(fractions)
    assert 0.0 < fractions[-1] < 1.0
    steps.close()
    assert plant.location.z == 2.0
    assert np.allclose(_read(field).position[:, 2], 4.0)


def test_a_plant_that_is_deleted_meanwhile_is_named():
    steps, field, plant = _steps()
    next(steps), next(steps)
    bpy.data.objects.remove(plant)
    with pytest.raises(SceneError, match='Dropping plants was stopped because "plant" was deleted'):
        next(steps)
    assert np.allclose(_read(field).position[:, 2], 4.0)


def test_the_species_of_fields_changes_with_that_of_plants():
    field, plant = _field(kinds=[0, 1, 0]), add_plant("plant", species="conifer")
    before = _read(field)
    select(field, plant)
    assert bpy.ops.tetflora.assign_species(species="fern") == {'FINISHED'}
    after = _read(field)
    assert plant.tetflora.species == "fern"
    assert [entry.species for entry in field.tetflora.field_species] == ["fern"]
    assert {after.identifiers[i] for i in after.species} == {"fern"}
    assert np.array_equal(after.seed, before.seed)
    assert np.array_equal(after.position, before.position)


def test_a_field_of_nodes_keeps_its_numbers():
    field = add_mesh("foreign")
    field.tetflora.is_field = True
    for species in ("bush", "conifer"):
        field.tetflora.field_species.add().species = species
    field.data.attributes.new("species", 'INT', 'POINT').data.foreach_set("value", np.array([0, 1, 1, 0], np.int32))
    select(field)
    bpy.ops.tetflora.assign_species(species="fern")
    assert [entry.species for entry in field.tetflora.field_species] == ["fern", "fern"]
    assert [d.value for d in field.data.attributes["species"].data] == [0, 1, 1, 0]


def test_fields_are_re_rolled_and_each_roll_is_another():
    field = _field()
    select(field)
    seen = [_read(field).seed.tolist()]
    for roll in (0, 1):
        field.tetflora.seed = 0
        assert bpy.ops.tetflora.reseed(roll=roll) == {'FINISHED'}
        seen.append(_read(field).seed.tolist())
    field.tetflora.seed = 0
    bpy.ops.tetflora.reseed(roll=1)
    assert _read(field).seed.tolist() == seen[2]
    assert len({tuple(s) for s in seen}) == 3
