# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A population's plants that are made a field, and back, stay the population's: its update replaces them."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_mesh, add_plant, select
from tetflora_addon.blender.placing import populations

pytestmark = pytest.mark.usefixtures("clean_file")


def _scene():
    return bpy.context.scene


def _population(number=0):
    return _scene().tetflora.layers[number]


def _own(number=0):
    return populations.own_objects(_scene(), _population(number))


def _plants():
    """How many plants the scene has, in fields and by themselves."""
    return populations.own_number(o for o in _scene().objects if o.tetflora.is_plant or o.tetflora.is_field)


def _populate(count=20, ground=None):
    select(ground or add_mesh("ground", size=15.0))
    bpy.ops.tetflora.populate(count=count, species="bush, conifer", min_distance=0.5)
    bpy.context.view_layer.update()


@pytest.mark.parametrize("chosen", [20, 8])
def test_a_field_of_its_plants_is_replaced_by_an_update(chosen):
    _populate()
    home = _population().collection
    select(*_own()[:chosen])
    bpy.ops.tetflora.convert_plants(to='FIELD')
    field = bpy.context.active_object
    assert field.tetflora.is_field
    assert field in _own()
    assert list(field.users_collection) == [_population().collection] == [home]
    assert populations.own_number(_own()) == _plants() == 20
    _population().count = 12
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    assert _plants() == 12


def test_objects_of_its_field_are_replaced_by_an_update():
    _populate()
    _population().as_field = 'FIELD'
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    (field,) = _own()
    select(field)
    bpy.ops.tetflora.convert_plants(to='OBJECTS')
    assert len(_own()) == _plants() == 20
    assert set(_own()) == set(_population().collection.objects)
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    assert _plants() == 20


def test_a_field_of_several_owners_is_the_artists():
    _populate()
    hand = add_plant("by hand", location=(30.0, 0.0, 0.0))
    copy = _own()[-1].copy()
    _scene().collection.objects.link(copy)
    for other in (hand, copy):
        select(*_own()[:3], other)
        bpy.ops.tetflora.convert_plants(to='FIELD')
        assert bpy.context.active_object.tetflora.population == ""
        assert bpy.context.active_object not in _own()
    assert len(_own()) == 14
