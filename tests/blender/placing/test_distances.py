# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Distances follow the species until the artist sets one; files from before keep theirs."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, select
from tetflora_addon.blender.placing import brush, distances, rules
from tetflora_addon.species import catalog

pytestmark = pytest.mark.usefixtures("clean_file")


def _ground(size=60.0):
    ground = add_mesh("ground", size=size)
    select(ground)
    return ground


def _populate(**options):
    bpy.ops.tetflora.populate(**options)
    return rules.active_population(bpy.context.scene)


def _choose(settings, *species):
    settings.mix.clear()
    for identifier in species:
        settings.mix.add().species = identifier


def _least_gap():
    places = np.array([o.location[:2] for o in bpy.data.objects if o.tetflora.is_plant])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    return gaps[np.triu_indices(len(places), 1)].min()


def test_a_new_population_stands_as_its_species_need_it():
    settings = bpy.context.scene.tetflora.populate
    assert settings.distance_by_species
    _choose(settings, "birch")
    assert 3.0 <= distances.distance_of(settings) <= 4.0
    _choose(settings, "grass")
    assert distances.distance_of(settings) < 0.4
    _ground()
    population = _populate(species="birch", count=100)
    assert population.distance_by_species
    assert 3.0 <= distances.distance_of(population) == rules.rules_from(population)[0].min_distance <= 4.0
    assert 3.0 <= _least_gap() < 3.6
    before = distances.distance_of(population)
    _choose(population, "oak")
    assert rules.awaits_update(population)
    assert distances.distance_of(population) > 1.5 * before


def test_what_the_artist_sets_stays():
    settings = bpy.context.scene.tetflora.populate
    _choose(settings, "birch")
    settings.min_distance = 1.5
    assert not settings.distance_by_species
    _choose(settings, "oak")
    _ground()
    population = _populate(count=5)
    assert not population.distance_by_species
    assert distances.distance_of(population) == 1.5
    population = _populate(count=5, min_distance=0.0, species="grass")
    assert distances.distance_of(population) == 0.0
    population.distance_by_species = True
    assert distances.distance_of(population) > 0.1
    assert rules.awaits_update(population)


def test_switching_off_keeps_the_distance_that_was_shown():
    _ground()
    population = _populate(species="birch", count=5)
    shown = distances.distance_of(population)
    population.distance_by_species = False
    assert population.min_distance == pytest.approx(shown)
    assert not rules.awaits_update(population)
    population.distance_by_species = False  # once more changes nothing
    _choose(population, "oak")
    assert distances.distance_of(population) == pytest.approx(shown)


def test_a_copy_follows_as_its_original_does():
    _ground()
    scene = bpy.context.scene
    population = _populate(species="birch", count=5)
    bpy.ops.tetflora.duplicate_layer()
    copy = rules.active_population(scene)
    assert copy.uid != scene.tetflora.layers[0].uid
    assert copy.distance_by_species
    copy.min_distance = 1.25
    bpy.ops.tetflora.duplicate_layer()
    assert not rules.active_population(scene).distance_by_species
    assert distances.distance_of(rules.active_population(scene)) == 1.25
    assert population is not None


def test_densities_and_sizes_count():
    settings = bpy.context.scene.tetflora.populate
    _choose(settings, "birch")
    alone = distances.distance_of(settings)
    settings.scale_min = settings.scale_max = 2.0
    assert distances.distance_of(settings) == pytest.approx(2.0 * alone, rel=0.05)
    settings.by_density, settings.density = True, 2000.0
    assert distances.distance_of(settings) < 0.6


def test_the_brush_follows_what_it_paints():
    _ground()
    scene = bpy.context.scene
    painted, settings = scene.tetflora.brush, scene.tetflora.populate
    painted.density = 0.5
    painted.source, painted.species = 'ONE', "birch"
    birch = brush._brush_of(scene)[0].min_distance
    assert birch > 3.0
    painted.species = "grass"
    assert brush._brush_of(scene)[0].min_distance < 0.4
    painted.source = 'MIX'
    _choose(settings, "oak", "grass")
    assert brush._brush_of(scene)[0].min_distance > 2.0
    painted.density = 10_000.0
    painted.radius = 0.5
    assert brush._brush_of(scene)[0].min_distance < 0.05
    bpy.context.view_layer.update()
    bpy.ops.tetflora.paint_plants(mode='PAINT', stroke="0 0 1")
    assert painted.strokes == 1
    assert painted.distance_by_species
    painted.min_distance = 0.7
    assert brush._brush_of(scene)[0].min_distance == pytest.approx(0.7)


def test_species_that_cannot_be_compiled_have_a_distance_too():
    settings = bpy.context.scene.tetflora.populate
    _choose(settings, "gone")
    assert 0.5 < distances.distance_of(settings) < 5.0


def test_the_first_species_is_offered_first_everywhere():
    scene = bpy.context.scene
    assert next(iter(catalog.list_species())) == catalog.FIRST
    names = [info.name.lower() for info in catalog.list_species().values()]
    assert names[1:] == sorted(names[1:])
    bpy.ops.tetflora.add_plant()
    assert bpy.context.active_object.tetflora.species == catalog.FIRST
    _ground()
    population = _populate(count=3)
    assert [entry.species for entry in population.mix] == [catalog.FIRST]
    assert brush._brush_of(scene)[1] == (catalog.FIRST,)
    bpy.ops.tetflora.edit_list(owner="scene.tetflora", entries="leaf_objects", action='ADD')
    assert scene.tetflora.leaf_objects[0].species == catalog.FIRST
