# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populations as files: what is written comes back, and what is broken is refused by file and key."""

from __future__ import annotations

import json
import os
import random
import sys
from pathlib import Path

import bpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.attack import material
from tests.blender.scenes import add_mesh, select
from tetflora_addon import errors
from tetflora_addon.blender.placing import population_data, population_files, populations, properties

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
    prop = properties.TetFloraPopulation.bl_rna.properties[name]
    low, high = max(prop.hard_min, -1e6), min(prop.hard_max, 1e6)
    return st.integers(int(low), int(high)) if prop.type == 'INT' else st.floats(low, high, width=32)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(data=st.data())
def test_what_is_written_comes_back(tmp_path, data):
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
        (lambda d: d.update(version=2), '"version" must be 1'),
        (lambda d: d.update(version=True), "not True"),
        (lambda d: d.update(more=1), 'the file has an unknown key "more"'),
        (lambda d: d.update(populations={}), "populations is dict; it must be a list"),
        (lambda d: d["populations"].append(3), "population 2 is int"),
        (lambda d: d["populations"][0].pop("name"), 'population 1 has no "name"'),
        (lambda d: d["populations"][0].update(name=5), '"name" is 5; it must be a string'),
        (lambda d: d["populations"][0].update(color=1), 'population 1 has an unknown key "color"'),
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
        (lambda d: d["populations"][0].update(seed=10**400), '"seed" is inf; it must be a whole number'),
        (lambda d: d["populations"][0].update(slope_max=10**400), '"slope_max" is inf; it must be a finite number'),
        (
            lambda d: d["populations"][0].update(altitude_min=1e300),
            '"altitude_min" is 1e+300; it must be a finite number',
        ),
        (lambda d: d["populations"][0].update(name="a\0b"), '"name" is \'a\\x00b\'; it must be one line'),
        (lambda d: d["populations"][0].update(uv_layer="a\nb"), '"uv_layer" is \'a\\nb\'; it must be one line'),
        (lambda d: d["populations"][0].update(name="a" * 2000), "it must be one line of at most 1000 characters"),
        (lambda d: d["populations"][0].update(grounds=["\ud800"]), "half of a surrogate pair"),
        (lambda d: d["populations"][0].update({"\x1b[2J" * 999: 1}), 'population 1 has an unknown key " [2J'),
        (
            lambda d: d["populations"][0].update(species=[{"species": "../a"}]),
            'species 1: "species" is \'../a\'; use only',
        ),
        (
            lambda d: d["populations"][0].update(species=[{"species": "oak", "companion": "a b"}]),
            'species 1: "companion" is \'a b\'; use only letters',
        ),
        (
            lambda d: d["populations"].extend([{"name": "a"}] * 1000),
            "populations has 1,001 entries; 1,000 is the limit",
        ),
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


def _good(number):
    return {"format": "TetFlora populations", "version": 1, "populations": [{"name": f"p{n}"} for n in range(number)]}


def test_all_populations_of_a_file_come_or_none(tmp_path, monkeypatch):
    """Whatever stops it, and however far it has come: the list and the active population are as they were."""
    _add(), _add()
    group = bpy.context.scene.tetflora
    group.populations_index = 0
    before = [p.uid for p in group.populations]
    (tmp_path / "p.json").write_text(json.dumps(_good(5)), encoding="utf-8")
    filled, real = [], population_files.fill_population

    def fill(population, *rest):
        filled.append(1)
        real(population, *rest)
        if len(filled) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(population_files, "fill_population", fill)
    with pytest.raises(KeyboardInterrupt):
        population_files.read_populations(bpy.context.scene, tmp_path / "p.json")
    assert [p.uid for p in group.populations] == before
    assert group.populations_index == 0
    assert population_files.read_populations(bpy.context.scene, tmp_path / "p.json") == (5, [])
    assert len(group.populations) == 7


def test_attack_on_population_files(tmp_path):
    """Three hundred files from a fixed seed: each adds all of its populations, or none and says why."""
    rng, read = random.Random(23), 0
    ground = add_mesh("ground")
    population = _add(image=bpy.data.images.new("mask", 4, 4))
    population.mix.add().species = "bush"
    data = population_files.as_data([population, population])
    group = bpy.context.scene.tetflora
    for _ in range(300):
        group.populations.clear()
        text = json.dumps(material.mutated(rng, data))
        (tmp_path / "p.json").write_text(text, encoding="utf-8")
        try:
            number, _ = population_files.read_populations(bpy.context.scene, tmp_path / "p.json", [ground])
        except errors.SceneError as error:
            assert str(error).startswith("p.json: ")
            assert errors.readable(str(error)) == str(error)
            assert len(group.populations) == 0
            continue
        read += 1
        assert len(group.populations) == number
    assert 10 < read < 290


@pytest.mark.skipif(os.name == "nt", reason="links and pipes as Unix has them")
def test_links_pipes_and_files_without_end_are_refused(tmp_path):
    (tmp_path / "sound.json").write_text(json.dumps(_good(1)), encoding="utf-8")
    (tmp_path / "link.json").symlink_to(tmp_path / "sound.json")
    (tmp_path / "zero.json").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.json")
    with (tmp_path / "large.json").open("wb") as file:
        file.truncate(1 << 40)
    for name, why in (
        ("link", "a link"),
        ("zero", "a link"),
        ("pipe", "not a regular"),
        ("large", "larger than 4,000,000"),
    ):
        with pytest.raises(errors.SceneError, match=rf"{name}\.json: cannot read the file: .*{why}"):
            population_files.read_populations(bpy.context.scene, tmp_path / f"{name}.json")
    for path in (Path("a\0b.json"), tmp_path / "\ud800.json"):
        with pytest.raises(errors.SceneError, match="no file can have such a name"):
            population_files.read_populations(bpy.context.scene, path)
        with pytest.raises(errors.SceneError, match="no file can have such a name"):
            population_files.write_populations([_add()], path)
    population_files.write_populations([_add(slope_max=0.5)], tmp_path / "link.json")
    assert json.loads((tmp_path / "sound.json").read_text(encoding="utf-8")) == _good(1)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names themselves")
def test_paths_that_are_no_text_are_used_and_told(tmp_path):
    """A folder of an old disk, in another encoding."""
    _add()
    folder = tmp_path / os.fsdecode(b"Gr\xf6\xdfe\x1b")
    folder.mkdir()
    assert bpy.ops.tetflora.export_populations(filepath=str(folder / "p.json")) == {'FINISHED'}
    assert bpy.ops.tetflora.import_populations(filepath=str(folder / "p.json")) == {'FINISHED'}
    with pytest.raises(RuntimeError, match="cannot read the file"):
        bpy.ops.tetflora.import_populations(filepath=str(folder / os.fsdecode(b"\xff.json")))
    assert len(bpy.context.scene.tetflora.populations) == 2
