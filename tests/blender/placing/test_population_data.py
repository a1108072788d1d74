# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of layers as files have them: what is written comes back, and what cannot be is refused by its key."""

from __future__ import annotations

import json
import random

import bpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.attack import material
from tests.blender.scenes import add_mesh
from tetflora_addon import errors
from tetflora_addon.blender.placing import population_data, populations, properties
from tetflora_addon.files import parse_json

pytestmark = pytest.mark.usefixtures("clean_file")


def _add(**values):
    ground = bpy.data.objects.get("ground") or add_mesh("ground", size=10.0)
    population = populations.add_population(bpy.context.scene, [ground])
    for name, value in values.items():
        setattr(population, name, value)
    return population


def _values(population):
    """All settings as Blender stores them."""
    simple = {p.identifier: getattr(population, p.identifier) for p in population_data.simple_settings(population)}
    mix = [tuple(getattr(e, name) for name in population_data.ENTRY) for e in population.mix]
    return simple, mix, [e.object for e in population.grounds]


def _numbers(name):
    prop = properties.TetFloraLayer.bl_rna.properties[name]
    low, high = max(prop.hard_min, -1e6), min(prop.hard_max, 1e6)
    return st.integers(int(low), int(high)) if prop.type == 'INT' else st.floats(low, high, width=32)


def _read(data):
    """A new layer by what a file says, checked."""
    population_data.check_population("layer 1", data)
    read = populations.add_population(bpy.context.scene)
    population_data.fill_population(read, data, bpy.context.scene)
    return read


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(data=st.data())
def test_what_is_written_comes_back(data):
    population = _add(name=data.draw(st.text(st.characters(exclude_categories=("C",)), max_size=20)))
    for prop in population_data.simple_settings(population):
        if prop.type in {'INT', 'FLOAT'} and data.draw(st.booleans()):
            # Bounds that are no single-precision numbers are left to their ends.
            value = data.draw(_numbers(prop.identifier) if prop.subtype != 'ANGLE' else st.floats(0.0, 1.5))
            setattr(population, prop.identifier, value)
        elif prop.type == 'BOOLEAN':
            setattr(population, prop.identifier, data.draw(st.booleans()))
    for species in data.draw(st.lists(st.sampled_from(["bush", "conifer", "gone"]), max_size=3)):
        entry = population.mix.add()
        entry.species, entry.weight = species, data.draw(st.floats(0.0, 9.0, width=32))
        entry.companion_strength = data.draw(st.floats(-1.0, 1.0, width=32))
    before, name = _values(population), population.name
    written = json.loads(json.dumps(population_data.population_data(population)))
    assert written["name"] == name
    assert _values(_read(written)) == before
    bpy.context.scene.tetflora.layers.clear()


def test_images_and_collections_are_found_by_name_or_not_at_all():
    image, roads = bpy.data.images.new("mask", 4, 4), bpy.data.collections.new("roads")
    data = population_data.population_data(_add(image=image, paths=roads))
    bpy.data.collections.remove(roads)
    bpy.data.objects.remove(bpy.data.objects["ground"])
    read = _read(data)
    assert (read.image, read.paths, len(read.grounds)) == (image, None, 0)


def test_what_a_file_does_not_say_is_as_in_a_new_scene():
    bpy.context.scene.tetflora.populate.clumping = 0.5
    read = _read({"name": "x", "slope_max": 12.5})
    assert (read.clumping, read.count) == (0.0, 100)
    assert read.slope_max == pytest.approx(0.21816616)  # 12.5 degrees


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.pop("name"), 'layer 1 has no "name"'),
        (lambda d: d.update(name=5), '"name" is 5; it must be a string'),
        (lambda d: d.update(color=1), 'layer 1 has an unknown key "color"'),
        (lambda d: d.update(uid="a"), 'unknown key "uid"'),
        (lambda d: d.update(count=2.5), '"count" is 2.5; it must be a whole number'),
        (lambda d: d.update(count=0), '"count" is 0; it must be from 1 to'),
        (lambda d: d.update(count=True), '"count" is True'),
        (lambda d: d.update(slope_max=91), '"slope_max" is 91; it must be from 0 to 90'),
        (lambda d: d.update(use_altitude=1), '"use_altitude" is 1; it must be true or false'),
        (lambda d: d.update(as_field="TREES"), "it must be one of AUTOMATIC, EMPTIES, FIELD"),
        (lambda d: d.update(image=7), '"image" is 7; it must be a string'),
        (lambda d: d.update(grounds=[None]), '"grounds" is None'),
        (lambda d: d.update(seed=2**40), '"seed" is'),
        (lambda d: d.update(seed=10**400), '"seed" is inf; it must be a whole number'),
        (lambda d: d.update(slope_max=10**400), '"slope_max" is inf; it must be a finite number'),
        (lambda d: d.update(altitude_min=1e300), '"altitude_min" is 1e+300; it must be a finite number'),
        (lambda d: d.update(name="a\0b"), '"name" is \'a\\x00b\'; it must be one line'),
        (lambda d: d.update(uv_layer="a\nb"), '"uv_layer" is \'a\\nb\'; it must be one line'),
        (lambda d: d.update(name="a" * 2000), "it must be one line of at most 1000 characters"),
        (lambda d: d.update(grounds=["\ud800"]), "half of a surrogate pair"),
        (lambda d: d.update({"\x1b[2J" * 999: 1}), 'layer 1 has an unknown key " [2J'),
        (lambda d: d.update(species=[{"species": "../a"}]), 'species 1: "species" is \'../a\'; use only'),
        (
            lambda d: d.update(species=[{"species": "oak", "companion": "a b"}]),
            'species 1: "companion" is \'a b\'; use only letters',
        ),
        (lambda d: d.update(species=[{"weight": 1}]), 'species 1 has no "species"'),
        (lambda d: d.update(species=[{"species": "a", "weight": -1}]), 'species 1: "weight" is -1'),
    ],
)
def test_what_cannot_be_is_refused_by_its_key(change, says):
    data = population_data.population_data(_add())
    change(data)
    with pytest.raises(ValueError) as caught:
        population_data.check_population("layer 1", parse_json(json.dumps(data)))  # as a file has it
    assert says in str(caught.value)


def test_attack_on_layers_of_files():
    """Three hundred layers from a fixed seed: each can be read, or is refused and says why."""
    rng, read = random.Random(23), 0
    population = _add(image=bpy.data.images.new("mask", 4, 4))
    population.mix.add().species = "bush"
    data = population_data.population_data(population)
    for _ in range(300):
        bpy.context.scene.tetflora.layers.clear()
        try:
            mutated = parse_json(json.dumps(material.mutated(rng, data)))
            population_data.check_population("layer 1", mutated)
        except ValueError as error:
            assert errors.readable(str(error)) == str(error)
            continue
        read += 1
        _read(mutated)
    assert 10 < read < 290
