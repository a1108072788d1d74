# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes: shipped files are sound, what they say is planted, what is saved comes back, and neighbors blend."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from operators.layers import TETFLORA_OT_save_biome
from tests.blender.scenes import add_mesh, datablocks, depsgraph, select
from tetflora_addon.blender.biomes import adding, files, library
from tetflora_addon.blender.file_library import as_text
from tetflora_addon.blender.placing import populations, rules
from tetflora_addon.blender.preferences import preferences
from tetflora_addon.blender.settings import with_identity
from tetflora_addon.blender.species.edits import catalog
from tetflora_addon.blender.stands.growing import keep_year
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.errors import SceneError, TetFloraError
from tetflora_addon.species import catalog as species_catalog
from tetflora_addon.species.litter import FALLEN, KIND

pytestmark = pytest.mark.usefixtures("clean_file")

SHIPPED = sorted(library.builtin_folder().glob("*.json"))
SMALL = {
    "format": "TetFlora biome",
    "version": 1,
    "name": "Small",
    "description": "For tests",
    "ground": {"earth": [0.2, 0.1, 0.05], "turf_share": 0.25},
    "species": {
        "blue_bush": {"of": "bush", "name": "Blue Bush", "every_order": {"leaf_color": [[0.1, 0.1, 0.3], [0, 0, 0.1]]}}
    },
    "layers": [
        {
            "kind": "population", "name": "Bushes", "by_density": True, "density": 900.0, "min_distance": 0.8,
            "slope_max": 30.0, "species": [{"species": "blue_bush", "weight": 3.0}, {"species": "bush"}],
        },
        {
            "kind": "cover", "name": "Floor", "by_density": True, "density": 20000.0, "min_distance": 0.0, "tilt": 1.0,
            "as_field": "FIELD",
            "species": [
                {"species": "wood_grass", "weight": 2.0, "habitat": "LIGHT"},
                {"species": "blue_bush_litter", "habitat": "LITTER", "shed_by": "blue_bush"},
            ],
        },
    ],
}  # fmt: skip


STAND = {
    "kind": "stand",
    "name": "Birches",
    "years": 9,
    "interval": 0,
    "density": 900.0,
    "slope_max": 35.0,
    "species": [{"species": "birch", "planted": 2.0, "incoming_seeds": 0.0}],
}


@pytest.fixture(autouse=True)
def own_folder(tmp_path):
    own = preferences()
    own.species_folder = str(tmp_path / "species")
    library.look_again()
    yield
    own.species_folder = ""
    library.look_again()


def scene():
    return bpy.context.scene


def small(**changes) -> files.Biome:
    return files._checked(copy.deepcopy({**SMALL, **changes}), "small")


def biomes():
    return rules.biomes_in(scene())


def add(biome: files.Biome, *grounds: bpy.types.Object, seed: int = 0) -> adding.BiomeResult:
    return run_to_end(adding.add_biome_steps(scene(), depsgraph(), biome, list(grounds), seed))


def places(uid: str) -> np.ndarray:
    """Where the plants of a biome stand, (n, 3)."""
    found = [np.zeros((0, 3))]
    for layer in files.layers_of(scene(), uid):
        for obj in populations.own_objects(scene(), layer):
            own = np.zeros((len(obj.data.vertices), 3)) if obj.tetflora.is_field else np.array([obj.location])
            if obj.tetflora.is_field:
                obj.data.vertices.foreach_get("co", flat := np.zeros(own.size, np.float32))
                own = flat.reshape(-1, 3)
            found.append(own)
    return np.concatenate(found)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_biomes_are_sound(path):
    """They pass the checks, need only species that there are, and have a small picture."""
    biome, known = files.read_biome(path), catalog()
    pages = files.pages_of(scene(), biome)
    for layer in biome.layers:
        for part in layer["species"]:
            name, shed_by = part["species"], part.get("shed_by", "")
            if shed_by:
                assert shed_by in known or shed_by in pages
                assert name.removeprefix(f"{shed_by}_") in (*FALLEN, KIND)
            else:
                assert name in known or name in pages
    assert set(pages).isdisjoint(known), "species of a biome have names of their own"
    assert as_text(json.loads(path.read_text(encoding="utf-8"))) == path.read_text(encoding="utf-8")
    picture = library.picture_file(path)
    assert picture is not None and picture.stat().st_size <= 20_000
    assert biome.description and library.biomes()[path.stem].name == biome.name


def test_files_that_have_not_changed_are_read_once(tmp_path, monkeypatch):
    """Panels ask for biomes while they are drawn."""
    own = tmp_path / "species" / "biomes"
    own.mkdir(parents=True)
    (own / "mine.json").write_text('{"name": "One"}', encoding="utf-8")
    read, before = [], species_catalog.read_whole
    monkeypatch.setattr(species_catalog, "read_whole", lambda path, most: read.append(path.stem) or before(path, most))
    assert library.biomes()["mine"].name == "One"
    read.clear()
    assert library.biomes()["mine"].name == "One" and read == []
    (own / "mine.json").write_text('{"name": "Another"}', encoding="utf-8")
    assert library.biomes()["mine"].name == "Another" and read == ["mine"]


@pytest.mark.parametrize(
    "name", ["alpine_treeline", "beech_fern", "birch_pine", "oak_savanna", "riparian_willow", "spruce_forest"]
)
def test_trees_of_woods_compete(name):
    """No tree of a shipped wood is merely placed, and what lies under them fell from the species that grow there."""
    biome = files.read_biome(library.builtin_folder() / f"{name}.json")
    grown = {part["species"] for layer in biome.layers if layer["kind"] == "stand" for part in layer["species"]}
    placed = {part["species"] for layer in biome.layers if layer["kind"] == "population" for part in layer["species"]}
    shed_by = {part["shed_by"] for layer in biome.layers for part in layer["species"] if part.get("shed_by")}
    assert grown and grown.isdisjoint(placed) and shed_by <= grown


def test_there_are_twelve():
    """And the panel always has one to add, whatever the file says."""
    assert len(SHIPPED) == 12
    group = scene().tetflora
    assert group.new_biome == next(iter(library.biomes()))
    group.new_biome = "park"
    assert (group.new_biome, group.biome_file) == ("park", "park")
    group.biome_file = "gone"
    assert group.new_biome in library.biomes()


def test_a_biome_makes_what_its_file_says():
    """Layers with their names, numbers, species, covers and soil; the same seed makes the same, another another."""
    land = add_mesh("ground", size=10.0)
    added = add(small(), land)
    assert [name for name, _ in added.layers] == ["Bushes", "Floor"]
    assert 10 <= added.layers[0][1] <= 60 and 100 <= added.layers[1][1] <= 900
    (biome,) = biomes()
    bushes, floor = files.layers_of(scene(), biome.uid)
    assert [entry.object for entry in bushes.grounds] == [land] and not bushes.covers and floor.covers
    assert {"blue_bush", "blue_bush_litter"} <= {edit.identifier for edit in scene().tetflora.species_edits}
    assert bushes.min_distance == pytest.approx(0.8) and bushes.slope_max == pytest.approx(np.radians(30.0))
    assert land.material_slots[0].material is not None
    first = places(biome.uid)
    adding.remove_biome(scene(), biome)
    assert not scene().tetflora.layers and not [o for o in scene().objects if o is not land]
    add(small(), land)
    assert np.array_equal(places(biomes()[0].uid), first)
    adding.remove_biome(scene(), biomes()[0])
    add(small(), land, seed=1)
    assert not np.array_equal(places(biomes()[0].uid), first)


@pytest.mark.parametrize(("name", "offered"), [("Park", "My Park"), ("Small", "Small")])
def test_a_biome_is_not_offered_to_be_saved_in_place_of_a_shipped_one(name, offered):
    """Its file would have the name of the shipped one, and hide that in the menu."""
    add(small(name=name), add_mesh("ground", size=6.0))
    tool = SimpleNamespace(name="")
    manager = SimpleNamespace(invoke_props_dialog=lambda _: {'RUNNING_MODAL'})
    context = SimpleNamespace(scene=scene(), window_manager=manager)
    assert TETFLORA_OT_save_biome.invoke(tool, context, None) == {'RUNNING_MODAL'}
    assert tool.name == offered


def test_what_is_saved_comes_back():
    """Layers, limits, species of this file and the ground, by way of the user's folder."""
    land = add_mesh("ground", size=6.0)
    given = small(limits={"slope_max": 42.0, "wetness_min": 0.25, "altitude_max": 30.0})
    add(given, land)
    biomes()[0].wetness_min = 0.0
    path = files.save_biome(scene(), "Small", "For tests", picture=False, replace=False)
    read = files.read_biome(library.biomes()["small"].path)
    assert path == library.biomes()["small"].path and library.biomes()["small"].is_own
    assert [{k: v for k, v in layer.items() if k not in {"seed", "grounds"}} for layer in read.layers] == given.layers
    assert all(layer["grounds"] == ["ground"] for layer in read.layers)
    assert read.limits == {"slope_max": 42.0, "altitude_max": 30.0} and read.ground == given.ground
    assert files.pages_of(scene(), read) == files.pages_of(scene(), given)
    with pytest.raises(SceneError, match="already has"):
        files.save_biome(scene(), "Small", "", picture=False, replace=False)
    library.OWN_FILES.delete("small")
    assert "small" not in library.biomes()
    with pytest.raises(SceneError, match="built-in"):
        library.OWN_FILES.delete("meadow")


def test_a_biome_whose_picture_another_program_has_open_stays(monkeypatch):
    """As Windows has it, where what is open cannot be deleted: it is there as a whole, or gone."""
    add(small(), add_mesh("ground", size=6.0))
    path = files.save_biome(scene(), "Small", "", picture=False, replace=False)
    picture, unlink = path.with_suffix(".png"), Path.unlink
    picture.write_bytes(b"")

    def held(self, missing_ok=False):
        if self == picture:
            raise PermissionError(13, "The process cannot access the file because it is being used by another process")
        unlink(self, missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", held)
        with pytest.raises(SceneError, match=r"Cannot delete small\.json: .* used by another process"):
            library.OWN_FILES.delete("small")
    assert path.exists() and library.biomes()["small"].is_own
    library.OWN_FILES.delete("small")
    assert not path.exists() and not picture.exists() and "small" not in library.biomes()


def test_a_stand_is_a_layer():
    """It grows before the others, keeps to the limits, comes back from a file, and goes with the biome."""
    land = add_mesh("ground", size=10.0)
    group = land.vertex_groups.new(name="west")
    group.add([0, 3], 1.0, 'ADD')
    added = add(small(layers=[STAND, *SMALL["layers"]]), land)
    assert [name for name, _ in added.layers] == ["Birches", "Bushes", "Floor"] and added.layers[0][1] > 5
    (biome,) = biomes()
    (field,) = files.stands_of(scene(), biome.uid)
    path = files.save_biome(scene(), "With a stand", "", picture=False, replace=False)
    assert files.read_biome(path).layers[0] == STAND
    biome.vertex_group = "west"
    number = len(field.data.vertices)
    run_to_end(adding.plant_biome_steps(scene(), depsgraph(), biome))
    assert 0 < len(field.data.vertices) < number
    adding.remove_biome(scene(), biomes()[0])
    assert [o for o in scene().objects if o.tetflora.is_field] == []


def test_stands_that_are_not_the_biomes_to_change_stay():
    """One of which a year was kept, and one that came from elsewhere."""
    land = add_mesh("ground", size=10.0)
    add(small(layers=[STAND, SMALL["layers"][0]]), land)
    (biome,) = biomes()
    (field,) = files.stands_of(scene(), biome.uid)
    keep_year(field)
    mesh, foreign = field.data, field.copy()
    foreign.tetflora.stand.biome = "of another file"
    scene().collection.objects.link(foreign)
    run_to_end(adding.plant_biome_steps(scene(), depsgraph(), biome))
    assert field.data == mesh
    steps = adding.add_biome_steps(scene(), depsgraph(), small(), [land], 1)
    for _ in range(4):
        next(steps)
    steps.close()
    adding.remove_biome(scene(), biomes()[0])
    assert {o for o in scene().objects if o.tetflora.is_field} == {field, foreign}


def test_a_stand_that_cannot_grow_keeps_no_other_layer_from_its_plants():
    """When the biome is added, where nothing of it is left, and when it is updated without the stand's ground."""
    land, bushes = add_mesh("ground", size=10.0), SMALL["layers"][0]
    added = add(small(layers=[{**STAND, "density": 0.0, "recruits": 0.0, "outside": 0.0}, bushes]), land)
    assert [name for name, _ in added.layers] == ["Bushes"]
    (said,) = added.bare
    assert "Birches" in said and "Nothing is planted" in said
    biome = biomes()[0]
    assert files.stands_of(scene(), biome.uid) == []
    adding.remove_biome(scene(), biome)
    add(small(layers=[STAND, bushes]), land)
    (biome,) = biomes()
    (field,) = files.stands_of(scene(), biome.uid)
    mesh = field.data
    field.tetflora.stand.grounds.clear()
    updated = run_to_end(adding.plant_biome_steps(scene(), depsgraph(), biome))
    assert [name for name, _ in updated.layers] == ["Bushes"] and field.data == mesh
    (said,) = updated.bare
    assert "Birches" in said and "no ground" in said


def test_a_layer_without_a_place_is_told():
    rare = {**SMALL["layers"][0], "name": "Rare", "density": 1e-6}
    added = add(small(layers=[rare, SMALL["layers"][0]]), add_mesh("ground", size=10.0))
    assert [name for name, _ in added.layers] == ["Bushes"]
    assert [text[:19] for text in added.bare] == ["Rare: a density of "]


def test_neighbors_blend():
    """A biome with limits takes its part; one without leaves it, as much as the mask says; nothing else changes."""
    land = add_mesh("ground", size=10.0)
    group = land.vertex_groups.new(name="west")
    group.add([0, 3], 1.0, 'ADD')
    floor = small(layers=[SMALL["layers"][1] | {"species": [{"species": "wood_grass"}]}], species={})
    add(floor, land)
    meadow = biomes()[0].uid
    before = places(meadow)
    run_to_end(adding.plant_biome_steps(scene(), depsgraph(), with_identity(scene().tetflora.layers, meadow)))
    assert np.array_equal(places(meadow), before), "planting again changes nothing"
    add(replace(floor, name="Other"), land)
    other = biomes()[1]
    other.vertex_group = "west"
    from tetflora_addon.blender.placing.rules import awaits_update

    assert awaits_update(files.layers_of(scene(), meadow)[0]), "the mask of one is the other's limit"
    for uid in (meadow, other.uid):
        run_to_end(adding.plant_biome_steps(scene(), depsgraph(), with_identity(scene().tetflora.layers, uid)))
    east, west = places(meadow), places(with_identity(scene().tetflora.layers, biomes()[1].uid).uid)
    assert abs(len(east) + len(west) - len(before)) < 5.0 * np.sqrt(len(before))
    assert east[:, 0].mean() > 2.0 and west[:, 0].mean() < -2.0
    with_identity(scene().tetflora.layers, meadow).gives_way = False
    run_to_end(adding.plant_biome_steps(scene(), depsgraph(), with_identity(scene().tetflora.layers, meadow)))
    assert np.array_equal(places(meadow), before)


def test_a_biome_that_follows_lines_gets_one():
    """Its plants stand along a curve that the artist may move."""
    land = add_mesh("ground", size=15.0)
    add(small(limits={"path_max": 2.0, "path_softness": 0.5}), land)
    (biome,) = biomes()
    assert biome.paths is not None
    found = places(biome.uid)
    assert len(found) > 20 and np.abs(found[:, 1]).max() < 8.0


def _broken():
    def changed(**changes):
        return {**SMALL, **changes}

    def in_layer(**changes):
        return changed(layers=[{**SMALL["layers"][0], **changes}])

    return [
        (changed(format="TetFlora populations"), '"format"'),
        (changed(version=2), "update the extension"),
        (changed(name="  "), '"name" is empty'),
        (changed(layers=[]), '"layers" is empty'),
        (changed(more=1), 'unknown key "more"'),
        (changed(limits={"slope_max": 120}), '"limits": "slope_max"'),
        (changed(limits={"wet": 1}), 'unknown key "wet"'),
        (changed(ground={"earth": [0.1, 0.2]}), "three numbers"),
        (changed(ground={"hills": "high"}), '"ground": "hills"'),
        (changed(season={"day": 400}), '"season": "day"'),
        (changed(species={"../a": {"of": "bush"}}), "cannot name a species"),
        (changed(species={"a": {"of": 3}}), '"of"'),
        (changed(species={"a": {"name": "A"}}), "missing"),
        (in_layer(kind="tree"), '"kind"'),
        (changed(layers=[{**STAND, "years": 0}]), '"years"'),
        (changed(layers=[{**STAND, "species": [{"species": "birch", "incoming_seeds": "some"}]}]), '"incoming_seeds"'),
        (in_layer(density="many"), '"density"'),
        (in_layer(species=[]), 'no "species"'),
        (in_layer(species=[{"species": "bush", "weight": -1}]), '"weight"'),
        (in_layer(wetness_min=1.5), '"wetness_min"'),
    ]


@pytest.mark.parametrize(("data", "said"), _broken(), ids=lambda value: value if isinstance(value, str) else "")
def test_broken_files_are_refused(tmp_path, data, said):
    """By the names of file and key; nothing is imported."""
    path = tmp_path / "broken.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(SceneError, match=r"broken\.json") as error:
        files.import_biome(path, replace=False)
    assert said in str(error.value) and "broken" not in library.biomes()


_JUNK = (None, True, -1, 1e308, float("nan"), 10**400, "", "x" * 2000, "\0", [], {}, [None], {"of": "bush"})


def _nodes(data, path=()):
    """Ways to all values of decoded JSON."""
    keys = data.keys() if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in keys:
        yield (*path, key)
        yield from _nodes(data[key], (*path, key))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_mutated_files_are_read_or_refused(tmp_path, data):
    """Whatever one value is replaced with: a biome whose species can be made, or an error that says why not."""
    mutated = copy.deepcopy({**SMALL, "layers": [STAND, *SMALL["layers"]], "limits": {"slope_max": 40.0}})
    *way, last = data.draw(st.sampled_from(sorted(_nodes(mutated), key=repr)))
    at = mutated
    for key in way:
        at = at[key]
    at[last] = data.draw(st.sampled_from(_JUNK))
    path = tmp_path / "mutated.json"
    path.write_text(json.dumps(mutated), encoding="utf-8")
    try:
        files.pages_of(scene(), files.read_biome(path))
    except TetFloraError as error:
        assert str(error)


@pytest.mark.parametrize("orders", [None, True, 7, "x", {}, [None], [3], [[]]])
def test_orders_that_are_none_are_refused_where_every_order_is_to_change(tmp_path, orders):
    data = copy.deepcopy(SMALL)
    data["species"]["blue_bush"]["orders"] = orders
    path = tmp_path / "mutated.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(TetFloraError, match=r'species "blue_bush".*orders'):
        files.pages_of(scene(), files.read_biome(path))


def test_nothing_is_left_of_what_fails(monkeypatch):
    """An unknown species, a broken one, ground where nothing can grow, and Esc in the middle of a layer."""
    land = add_mesh("ground", size=6.0)
    depsgraph()
    before = datablocks(), len(scene().tetflora.species_edits)
    unknown = [{**SMALL["layers"][0], "species": [{"species": "no_such"}]}]
    steep = [{**layer, "slope_min": 80.0, "slope_max": 90.0} for layer in SMALL["layers"]]
    for changes, said in (
        ({"layers": unknown}, "no_such"),
        ({"species": {"blue_bush": {"of": "bush", "habit": 7}}}, "habit"),
        ({"layers": steep}, "slope"),
    ):
        with pytest.raises(Exception, match=said):
            add(small(**changes), land)
        assert (datablocks(), len(scene().tetflora.species_edits)) == before
        assert not scene().tetflora.layers and not biomes()
    steps = adding.add_biome_steps(scene(), depsgraph(), small(layers=[STAND, *SMALL["layers"]]), [land])
    for step in steps:
        if step.message.startswith("Floor"):
            break
    assert scene().render.use_lock_interface  # a stand has grown
    steps.close()
    assert (datablocks(), len(scene().tetflora.species_edits)) == before and not biomes()
    assert not scene().render.use_lock_interface


def test_the_button_makes_land_where_there_is_none(monkeypatch):
    """On the selected ground otherwise; the startup's cube is none."""
    monkeypatch.setattr(adding, "SIDE", 8.0)
    path = library.OWN_FILES.place("small")
    path.write_text(as_text(SMALL), encoding="utf-8")
    library.look_again()
    assert bpy.ops.tetflora.add_biome(biome="small") == {'FINISHED'}
    land = bpy.context.object
    assert land.dimensions.x == pytest.approx(8.0) and land.tetflora.is_occluder
    select(land)
    assert bpy.ops.tetflora.add_biome(biome="small", seed=3) == {'FINISHED'}
    assert [entry.object for entry in biomes()[1].grounds] == [land]
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert bpy.ops.tetflora.remove_layer() == {'FINISHED'} and len(biomes()) == 1


def test_masks_and_paths_are_saved_by_their_names_and_found_again():
    """As between two shots of one film; where a name is missing, the layer has no such limit."""
    land = add_mesh("land", size=20.0)
    roads = adding.make_line(scene(), "roads", [land])
    population = populations.add_population(scene(), [land], name="Trees")
    population.paths, population.vertex_group, population.uv_layer = roads, "meadow", "Map"
    population.mix.add().species = "bush"
    land.vertex_groups.new(name="meadow").add(range(4), 1.0, 'REPLACE')
    land.data.uv_layers.new(name="Map")
    path = files.save_biome(scene(), "Masked", "", False, False)
    read = files.read_biome(path)
    assert read.layers[0]["paths"] == "roads" and read.layers[0]["grounds"] == ["land"]
    hill = add_mesh("hill", size=20.0)
    for grounds, masks, own in (([land], ("meadow", "Map"), [land]), ([hill], ("", ""), [hill])):
        add(read, *grounds)
        layer = scene().tetflora.layers[-1]
        assert layer.paths == roads and (layer.vertex_group, layer.uv_layer) == masks
        assert [entry.object for entry in layer.grounds] == own
    add(read, land, hill)  # the layer was on one of them
    assert [entry.object for entry in scene().tetflora.layers[-1].grounds] == [land]


def test_the_mask_of_a_biome_itself_is_saved_and_found_again():
    land, hill, image = add_mesh("land", size=20.0), add_mesh("hill", size=20.0), bpy.data.images.new("where", 4, 4)
    image.pixels[:] = [1.0] * 64
    for obj in (land, hill):
        obj.data.uv_layers.new(name="Map")
    land.vertex_groups.new(name="meadow").add(range(2), 1.0, 'REPLACE')
    add(files._checked(SMALL, "small"), land)
    biome = biomes()[0]
    biome.vertex_group, biome.invert_group, biome.image = "meadow", True, image
    scene().tetflora.layers_index = 0
    read = files.read_biome(files.save_biome(scene(), "Masked", "", False, False))
    assert read.mask == {"vertex_group": "meadow", "invert_group": True, "image": "where"}
    for grounds, group in ((land, "meadow"), (hill, "")):
        add(read, grounds)
        assert (biomes()[-1].vertex_group, biomes()[-1].image) == (group, image)
    with pytest.raises(ValueError, match='"mask" has an unknown key'):
        files._checked(SMALL | {"mask": {"slope": 1.0}}, "small")


@pytest.mark.parametrize("which", ['ACTIVE', 'DUE'])
def test_a_biome_that_has_not_changed_comes_again_as_it_was(which):
    """Bushes of the second layer, which are about to go, keep no bush of the first away."""
    bushes = SMALL["layers"][0] | {"density": 400.0, "min_distance": 3.0}
    biome = small(layers=[bushes, bushes | {"name": "More", "density": 2000.0, "min_distance": 0.5}])
    add(biome, add_mesh("ground", size=20.0))
    before = places(biomes()[0].uid)
    scene().tetflora.layers_index = 0
    for layer in scene().tetflora.layers:
        layer.placed_by = "" if which == 'DUE' else layer.placed_by
    assert bpy.ops.tetflora.update_layers(which=which) == {'FINISHED'}
    after = places(biomes()[0].uid)
    assert len(before) > 50 and before.tolist() == after.tolist()
