# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populations as files: what is written comes back, and what is broken is refused by file and key."""

from __future__ import annotations

import json

import bpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.blender.scenes import add_mesh, select
from tetflora_addon import errors
from tetflora_addon.blender.placing import population_files, populations, properties

pytestmark = pytest.mark.usefixtures("clean_file")


def _add(**values):
    ground = bpy.data.objects.get("ground") or add_mesh("ground", size=10.0)
    population = populations.add_population(bpy.context.scene, [ground])
    for name, value in values.items():
        setattr(population, name, value)
    return population


def _values(population):
    """All settings as Blender stores them."""
    simple = {p.identifier: getattr(population, p.identifier) for p in population_files._simple_settings(population)}
    mix = [tuple(getattr(e, name) for name in population_files._MIX) for e in population.mix]
    return simple, mix, [e.object for e in population.grounds]


def _numbers(name):
    prop = properties.TetFloraPopulation.bl_rna.properties[name]
    low, high = max(prop.hard_min, -1e6), min(prop.hard_max, 1e6)
    return st.integers(int(low), int(high)) if prop.type == 'INT' else st.floats(low, high, width=32)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(data=st.data())
def test_what_is_written_comes_back(tmp_path, data):
    population = _add(name=data.draw(st.text(st.characters(exclude_categories=("C",)), max_size=20)))
    for prop in population_files._simple_settings(population):
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
    path = population_files.write_populations([population], tmp_path / "p.json")
    number, missing = population_files.read_populations(bpy.context.scene, path)
    assert (number, missing) == (1, [])
    group = bpy.context.scene.tetflora
    read = group.populations[len(group.populations) - 1]
    assert _values(read) == before
    assert read.name.startswith(name)
    assert read.uid != group.populations[len(group.populations) - 2].uid
    group.populations.clear()


def test_images_and_collections_are_found_by_name_or_said_to_be_missing(tmp_path):
    image, roads = bpy.data.images.new("mask", 4, 4), bpy.data.collections.new("roads")
    _add(image=image, paths=roads)
    bpy.ops.tetflora.export_populations(filepath=str(tmp_path / "p.json"))
    bpy.data.collections.remove(roads)
    ground, other = bpy.data.objects["ground"], add_mesh("other")
    bpy.data.objects.remove(ground)
    select(other)
    bpy.ops.tetflora.import_populations(filepath=str(tmp_path / "p.json"))
    read = bpy.context.scene.tetflora.populations[1]
    assert (read.image, read.paths) == (image, None)
    assert [e.object for e in read.grounds] == [other]
    (tmp_path / "q.json").write_text((tmp_path / "p.json").read_text(encoding="utf-8"), encoding="utf-8")
    _, missing = population_files.read_populations(bpy.context.scene, tmp_path / "q.json")
    assert missing == ['the collection "roads"', 'the ground "ground"']


def test_what_a_file_does_not_say_is_as_in_a_new_scene(tmp_path):
    bpy.context.scene.tetflora.populate.clumping = 0.5
    path = tmp_path / "p.json"
    text = {"format": "TetFlora populations", "version": 1, "populations": [{"name": "x", "slope_max": 12.5}]}
    path.write_text(json.dumps(text), encoding="utf-8")
    population_files.read_populations(bpy.context.scene, path)
    read = bpy.context.scene.tetflora.populations[0]
    assert (read.clumping, read.count) == (0.0, 100)
    assert read.slope_max == pytest.approx(0.21816616)  # 12.5 degrees


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.pop("version"), 'the file has no "version"'),
        (lambda d: d.update(format="else"), '"format" is'),
        (lambda d: d.update(version=2), '"version" is 2'),
        (lambda d: d.update(version=True), '"version" is True'),
        (lambda d: d.update(more=1), 'the file has an unknown key "more"'),
        (lambda d: d.update(populations={}), "populations is dict; it must be a list"),
        (lambda d: d["populations"].append(3), "population 2 is int"),
        (lambda d: d["populations"][0].pop("name"), 'population 1 has no "name"'),
        (lambda d: d["populations"][0].update(name=5), '"name" is 5; it must be a string'),
        (lambda d: d["populations"][0].update(colour=1), 'population 1 has an unknown key "colour"'),
        (lambda d: d["populations"][0].update(uid="a"), 'unknown key "uid"'),
        (lambda d: d["populations"][0].update(count=2.5), '"count" is 2.5; it must be a whole number'),
        (lambda d: d["populations"][0].update(count=0), '"count" is 0; it must be from 1 to'),
        (lambda d: d["populations"][0].update(count=True), '"count" is True'),
        (lambda d: d["populations"][0].update(slope_max=91), '"slope_max" is 91; it must be from 0 to 90'),
        (lambda d: d["populations"][0].update(use_altitude=1), '"use_altitude" is 1; it must be true or false'),
        (lambda d: d["populations"][0].update(as_field="TREES"), "it must be one of AUTOMATIC, EMPTIES, FIELD"),
        (lambda d: d["populations"][0].update(image=7), '"image" is 7; it must be a string'),
        (lambda d: d["populations"][0].update(grounds=[None]), '"grounds" is None'),
        (lambda d: d["populations"][0].update(seed=2**40), '"seed" is'),
        (lambda d: d["populations"][0].update(species=[{"weight": 1}]), 'species 1 has no "species"'),
        (lambda d: d["populations"][0].update(species=[{"species": "a", "weight": -1}]), 'species 1: "weight" is -1'),
    ],
)
def test_broken_files_are_refused_by_file_and_key_and_change_nothing(tmp_path, change, says):
    _add()
    data = population_files.as_data(bpy.context.scene.tetflora.populations)
    change(data)
    path = tmp_path / "broken.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(errors.SceneError, match=r"^broken\.json: ") as caught:
        population_files.read_populations(bpy.context.scene, path)
    assert says in str(caught.value)
    assert len(bpy.context.scene.tetflora.populations) == 1


@pytest.mark.parametrize("text", ["", "{", '{"format": NaN}', "[" * 100_000, "\ud800".encode("utf-8", "surrogatepass")])
def test_what_is_no_json_is_refused(tmp_path, text):
    path = tmp_path / "broken.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(errors.SceneError, match=r"broken\.json: is not valid JSON"):
        population_files.read_populations(bpy.context.scene, path)
    with pytest.raises(errors.SceneError, match=r"none\.json: cannot read the file"):
        population_files.read_populations(bpy.context.scene, tmp_path / "none.json")
