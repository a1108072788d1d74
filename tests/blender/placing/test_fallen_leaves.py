# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground Cover through the year: fallen leaves in the amount that trees have shed, and snow on the ground."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.placing.test_ground_cover import _cover, _covers, _field, _group, _wood
from tests.blender.scenes import depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import snow
from tetflora_addon.blender.placing import cover
from tetflora_addon.blender.placing.canopy import canopy_of
from tetflora_addon.blender.placing.terrain import MASKS, read_ground
from tetflora_addon.blender.scene import fields, plants
from tetflora_addon.blender.scene.crowns import crown_for
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.planting.cover import Sheet, mapping
from tetflora_addon.species.litter import shed_share

pytestmark = pytest.mark.usefixtures("clean_file")


def _strewn():
    return [p for p in _covers() if p.name == cover.FALLEN_LEAVES]


def _all_places(populations_of):
    return {p.name: fields.read_field(_field(p), depsgraph(), np.eye(4)[None]).position for p in populations_of}


def test_what_the_trees_shed_lies_on_the_ground_in_the_same_amount():
    ground = _wood(size=20.0, count=40, species="birch, oak")
    _group().year.enabled = True
    _cover()
    canopy, above = canopy_of(bpy.context.scene, depsgraph())
    triangles = read_ground([ground], depsgraph(), **dict.fromkeys(MASKS)).triangles
    floor = run_to_end(mapping(Sheet.over(triangles.reshape(-1, 3)), canopy, len(above)))
    (strewn,) = _strewn()
    for name in ("birch", "oak"):
        area = floor.fallen[above.index(name)].sum() * floor.sheet.cell**2  # the rest falls beside the ground
        assert area > 0.5 * canopy.area[canopy.species == above.index(name)].sum()
        patches = fields.read_field(_field(strewn), depsgraph(), np.eye(4)[None])
        own = patches.species == [e.species for e in _field(strewn).tetflora.field_species].index(f"{name}_leaves")
        one = crown_for(bpy.context.scene, f"{name}_leaves").leaves
        share = shed_share(species_for(bpy.context.scene, name))
        assert one * (patches.scale[own] ** 2).sum() == pytest.approx(share * area, rel=0.08)


def test_what_covers_the_ground_keeps_its_places_when_leaves_are_strewn():
    _wood()
    _cover()
    before = _all_places(_covers())
    _group().year.enabled = True
    for _ in range(2):
        _cover()
        assert [p.name for p in _covers()] == ["Ground cover", cover.FALLEN_LEAVES]
        after = _all_places(_covers())
        for name, places in before.items():
            np.testing.assert_array_equal(after[name], places)
        before = after
    assert [entry.species for entry in _strewn()[0].mix] == ["birch_leaves"]  # spruces keep their needles


def test_fallen_leaves_are_there_from_autumn_to_spring_only():
    _wood()
    _cover()
    scene, year = bpy.context.scene, _group().year

    def species():
        return set(plants.read_plants(scene, depsgraph())[0].identifiers)

    without = species()
    year.enabled, year.day = True, 196.0
    _cover()
    assert species() == without
    for day in (300.0, 360.0, 30.0):
        year.day = day
        assert species() == without | {"birch_leaves"}
    for day in (160.0, 250.0):
        year.day = day
        assert species() == without
    year.day, year.latitude = 345.0, -50.0  # summer there
    assert species() == without
    year.day, year.latitude, year.enabled = 300.0, 50.0, False
    assert species() == without


def test_evergreen_woods_have_no_fallen_leaves():
    _wood(species="spruce")
    _group().year.enabled = True
    _cover()
    assert not _strewn()
    assert not any(e.identifier.endswith("_leaves") for e in _group().species_edits)


def test_snow_comes_on_the_ground_when_asked_for():
    ground = _wood()
    with pytest.raises(RuntimeError, match="no material"):
        bpy.ops.tetflora.ground_snow()
    own = bpy.data.materials.new("mine")
    compat.shader_tree(own)
    ground.data.materials.append(own)
    assert bpy.ops.tetflora.ground_snow() == {'FINISHED'}
    assert any(node.type == 'GROUP' and node.node_tree.name == snow.SNOW for node in own.node_tree.nodes)
    assert bpy.ops.tetflora.ground_snow() == {'CANCELLED'}
