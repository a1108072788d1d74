# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a population's plants stand by the settings that it has now: what the list shows beside their number."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_mesh, select
from tetflora_addon.blender.placing import populations, rules
from tetflora_addon.blender.viewport import points

pytestmark = pytest.mark.usefixtures("clean_file")


def _population():
    return bpy.context.scene.tetflora.layers[0]


def _outdated():
    return rules.awaits_update(_population())


def _populate():
    select(add_mesh("ground", size=10.0))
    bpy.ops.tetflora.populate(count=20, species="bush:2, conifer")
    return _population()


def _other(prop, population):
    """A value that a setting does not have now."""
    value = getattr(population, prop.identifier)
    if prop.type == 'POINTER':
        images = prop.fixed_type.identifier == "Image"
        return bpy.data.images.new("mask", 2, 2) if images else bpy.data.collections.new("curves")
    if prop.type == 'BOOLEAN':
        return not value
    if prop.type == 'ENUM':
        return next(item.identifier for item in prop.enum_items if item.identifier != value)
    if prop.type == 'STRING':
        return "another"
    return value - 0.5 if prop.type == 'FLOAT' and value - 0.5 >= prop.hard_min else value + 1


def test_every_setting_counts_and_taking_it_back_too():
    population = _populate()
    population.distance_by_species = False
    assert not _outdated()
    simple = [p for p in rules.settings_of(population) if p.type != 'COLLECTION']
    simple = [p for p in simple if p.identifier != "distance_by_species"]  # only the distance itself counts
    assert len(simple) > 25
    for prop in simple:
        before = getattr(population, prop.identifier)
        setattr(population, prop.identifier, _other(prop, population))
        assert _outdated(), prop.identifier
        setattr(population, prop.identifier, before)
        assert not _outdated(), prop.identifier


def test_species_companions_and_grounds_count():
    population = _populate()
    entry = population.mix[1]
    for name, value in (("weight", 3.0), ("species", "birch"), ("companion", "bush"), ("companion_strength", 0.5)):
        before = getattr(entry, name)
        setattr(entry, name, value)
        assert _outdated(), name
        setattr(entry, name, before)
        assert not _outdated(), name
    populations.set_grounds(population, [add_mesh("other ground")])
    assert _outdated()


@pytest.mark.parametrize("options", [{}, {"which": 'ACTIVE', "reroll": True}])
def test_placing_settles_it(options):
    _populate().count = 12
    assert _outdated()
    bpy.ops.tetflora.update_layers(**options)
    assert not _outdated()


def test_frozen_plants_are_as_they_shall_be():
    population = _populate()
    population.frozen = True
    population.count = 3
    assert not _outdated()
    population.frozen = False
    assert _outdated()


def test_a_name_and_what_became_of_it_are_no_settings():
    population = _populate()
    population.name, population.message = "Bushes", "no room"
    assert not _outdated()


def test_populations_know_what_was_removed():
    population = _populate()
    select(*populations.own_objects(bpy.context.scene, population)[:3])
    bpy.ops.tetflora.remove_plants(which='SELECTED')
    assert population.made == 17
    bpy.ops.tetflora.remove_plants(which='ALL')
    assert population.made == 0


def test_the_panel_tells_the_plants_that_are_there_or_that_an_update_would_place():
    status = points.status
    waits = rules.awaits_update
    population = _populate()
    rules.note_erased(population, [(0.0, 0.0)], 5.0)
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    assert 0 < population.made < 20
    assert (status(population), waits(population)) == (f"{population.made} plants, as empties", False)
    population.count = 33
    assert (status(population), waits(population)) == ("33 plants, as empties", True)
    population.by_density = True
    assert (status(population), waits(population)) == ("As many plants as fit", True)
    bpy.ops.tetflora.update_layers(which='ACTIVE', forget_erased=True)
    assert (status(population), waits(population)) == (f"{population.made:,} plants, as empties", False)
    bpy.ops.tetflora.duplicate_layer()
    assert waits(bpy.context.scene.tetflora.layers[1])
    assert not waits(bpy.context.scene.tetflora.populate)


def test_it_is_known_in_a_file_that_is_opened(tmp_path):
    _populate().density = 123.4
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "forest.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "forest.blend"))
    assert not _outdated()
    _population().density += 1.0
    assert _outdated()


@pytest.mark.parametrize("store", ['EMPTIES', 'FIELD'])
def test_a_layer_whose_plants_were_all_deleted_is_due(store):
    population = _populate()
    population.as_field = store
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    own = populations.own_objects(bpy.context.scene, population)
    elsewhere = bpy.data.collections.new("elsewhere")
    bpy.context.scene.collection.children.link(elsewhere)
    for obj in own:  # plants that were only moved are there
        population.collection.objects.unlink(obj)
        elsewhere.objects.link(obj)
    assert not rules.awaits_update(population)
    select(*own)
    bpy.ops.object.delete()
    assert rules.awaits_update(population)
    assert bpy.ops.tetflora.update_layers() == {'FINISHED'}
    assert len(own) and populations.own_number(populations.own_objects(bpy.context.scene, population)) == 20
