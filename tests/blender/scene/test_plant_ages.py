# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages of plants, populations and fields: stored by each, and kinds of plants for what is compiled."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devtools.layouts import Layout
from panels import plants as panel
from tests.blender.scene.test_fields import _field
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender.job import contents, forecast, frame_cache, plant_mesh, refine
from tetflora_addon.blender.placing import canopy, distances, plant_objects, populations, rules
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.blender.scene import ages, fields, skeletons
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.blender.viewport import levels
from tetflora_addon.jobs import run_to_end
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.kinds import Kind

SPECIES = "conifer"


@pytest.fixture
def scene(clean_file):
    add_camera(location=(0.0, -30.0, 6.0))
    return bpy.context.scene


def seeds(scene):
    graph = depsgraph()
    return read_plants(scene, graph)[0]


def row_of_plants(plants_ages, species=SPECIES):
    made = []
    for number, age in enumerate(plants_ages):
        made.append(add_plant(f"plant {number:02d}", species, seed=number, location=(3.0 * number, 0.0, 0.0)))
        made[-1].tetflora.age = age
    return made


def by_plant(found):
    """Kind and scale of each plant by its seed."""
    kinds = [found.identifiers[i] for i in found.species.tolist()]
    return {int(s): (k, float(z)) for s, k, z in zip(found.seed, kinds, found.scale, strict=True)}


@given(st.text("abc_", min_size=1), st.one_of(st.none(), st.text("de. ", min_size=1)), st.floats(0, 1e4))
def test_a_kind_tells_its_parts(species, form, age):
    kind = str(Kind(species, form or "", age))
    assert Kind.read(kind).species == species
    assert Kind.read(kind).age == age
    assert (kind == species) == (form is None and age == 0.0)


def test_forms_and_ages_do_not_get_into_each_others_way(scene):
    mesh = bpy.data.meshes.new("form")
    mesh.from_pydata([(0, 0, 0), (0, 0, 3)], [(0, 1)], [])
    form = bpy.data.objects.new("form", mesh)
    scene.collection.objects.link(form)
    (plant,) = row_of_plants([7.0])
    plant.tetflora.skeleton = form
    (kind,) = seeds(scene).identifiers
    assert (Kind.read(kind).species, skeletons.skeleton_object_of(kind), Kind.read(kind).age) == (SPECIES, form, 7.0)
    assert contents.estimate(scene, depsgraph()).polygons_full > 0


def test_few_ages_are_exact(scene):
    given = [0.0, *np.linspace(1.0, 60.0, ages.MOST).tolist()]
    row_of_plants(given)
    found = by_plant(seeds(scene))
    assert [Kind.read(found[n][0]).age for n in range(len(given))] == pytest.approx(given, rel=1e-6)
    assert {scale for _, scale in found.values()} == {1.0}


def test_of_many_ages_one_more_changes_no_other(scene):
    given = np.linspace(1.0, 60.0, 30).tolist()
    row_of_plants(given)
    before = by_plant(seeds(scene))
    assert len({kind for kind, _ in before.values()}) <= ages.MOST
    more = add_plant("one more", SPECIES, seed=99)
    more.tetflora.age = 33.3
    after = by_plant(seeds(scene))
    assert {s: after[s] for s in before} == before


def test_many_ages_keep_the_heights_of_all(scene):
    given = np.linspace(1.0, 60.0, 30)
    row_of_plants(given.tolist())
    species = load_species(SPECIES)
    for years in (0.0, 7.5):
        scene.tetflora.year.years = years
        found = by_plant(seeds(scene))
        own = np.array([Kind.read(found[n][0]).age for n in range(30)])
        scale = np.array([found[n][1] for n in range(30)])
        stands = scale * ages.heights(species, own + years)
        np.testing.assert_allclose(stands, ages.heights(species, given.astype(np.float32) + years), rtol=1e-6)
    assert scale.max() < 1.4
    assert scale.min() > 0.7


def test_years_are_added_and_change_no_kind(scene):
    row_of_plants([0.0, 5.0])
    full = contents.estimate(scene, depsgraph()).polygons_full
    kinds = seeds(scene).identifiers
    scene.tetflora.year.years = 3.0
    assert seeds(scene).identifiers == kinds
    graph = depsgraph()
    loaded = contents.load_for(kinds, scene, graph)
    assert loaded == [ages.at_age(load_species(SPECIES), years) for years in (3.0, 8.0)]
    assert contents.estimate(scene, graph).polygons_full < full / 2


def test_full_grown_plants_are_the_species_itself(scene):
    row_of_plants([0.0, 0.0])
    assert seeds(scene).identifiers == (SPECIES,)
    assert contents.load_for((SPECIES,), scene, depsgraph()) == [load_species(SPECIES)]


@pytest.mark.parametrize("age", [math.nan, -1.0, math.inf])
def test_an_impossible_age_is_said_by_name(scene, age):
    add_plant("bad one")
    system = bpy.data.objects["bad one"]
    if hasattr(system, "bl_system_properties_get"):
        system.bl_system_properties_get(do_create=True)["tetflora"]["age"] = age
    else:
        system["tetflora"]["age"] = age
    with pytest.raises(errors.SceneError, match=r'"bad one": Age is .*; it must be from 0 to 10,000 years'):
        seeds(scene)
    assert forecast.forecast(scene, bpy.context.view_layer) is not None


@pytest.mark.parametrize("name", ["age", "tf_age"])
def test_points_have_ages(scene, name):
    field = _field(kinds=(SPECIES,), seed=('INT', [0, 1, 2]), **{name: ('FLOAT', [0.0, 4.0, 9.5])})
    field.tetflora.age = 50.0
    found = by_plant(seeds(scene))
    assert [Kind.read(found[n][0]).age for n in range(3)] == [0.0, 4.0, 9.5]
    field.data.attributes.remove(field.data.attributes[name])
    found = by_plant(seeds(scene))
    assert {Kind.read(kind).age for kind, _ in found.values()} == {50.0}


def test_a_field_is_the_plants_that_it_stands_for(scene):
    row_of_plants(np.linspace(2.0, 70.0, 25).tolist())
    before = by_plant(seeds(scene))
    field = plant_objects.field_from_plants(scene, depsgraph(), list(scene.objects)[1:])
    assert fields.has_ages(field)
    assert by_plant(seeds(scene)) == before
    back = plant_objects.plants_from_field(scene, depsgraph(), field, 100)
    assert by_plant(seeds(scene)) == before
    assert len(back) == 25


def test_wrong_attributes_are_refused_by_name(scene):
    field = _field(kinds=(SPECIES,), age=('FLOAT', [1.0, math.nan, -2.0]))
    with pytest.raises(errors.SceneError, match=r'"field": 2 of 3 points have an age that is not from 0 to .*point 1'):
        seeds(scene)
    field.data.attributes.remove(field.data.attributes["age"])
    field.data.attributes.new("age", 'FLOAT_VECTOR', 'POINT')
    with pytest.raises(errors.SceneError, match='"field": attribute "age" is FLOAT_VECTOR on POINT; a field requires'):
        seeds(scene)


def test_instances_of_a_plant_have_its_age(scene):
    held = bpy.data.collections.new("held")
    plant = add_plant("inner", SPECIES, collection=held)
    plant.tetflora.age = 6.0
    shown = bpy.data.objects.new("shown", None)
    shown.instance_type, shown.instance_collection = 'COLLECTION', held
    scene.collection.objects.link(shown)
    (kind,) = seeds(scene).identifiers
    assert Kind.read(kind).age == 6.0


def populated(scene, **settings):
    ground = add_mesh("ground", size=30.0)
    population = populations.add_population(scene, [ground])
    population.mix.add().species = SPECIES
    population.count = 60
    population.min_distance = 0.5
    for name, value in settings.items():
        setattr(population, name, value)
    return population, run_to_end(populations.make_plants_steps(scene, depsgraph(), population))


def test_young_plants_are_placed_closer(scene):
    population = populations.add_population(scene, [])
    population.mix.add().species = SPECIES
    grown = distances.distance_of(population)
    population.age = 5.0
    assert distances.distance_of(population) < 0.7 * grown


@pytest.mark.parametrize("store", ['EMPTIES', 'FIELD'])
def test_a_population_has_the_ages_of_its_rule(scene, store):
    population, made = populated(scene, age=40.0, age_spread=0.3, as_field=store)
    if store == 'FIELD':
        (field,) = made.objects
        found = fields.read_aged_field(field, depsgraph(), np.eye(4)[None])[1]
    else:
        found = fields.stored_ages(made.objects)
    assert 30.0 < np.median(found) < 50.0
    assert len(np.unique(found)) == made.number
    assert 0.4 < ((found > 40.0 / 1.3) & (found < 40.0 * 1.3)).mean() < 0.9
    assert not rules.awaits_update(population)
    population.age_spread = 0.0
    assert rules.awaits_update(population)
    run_to_end(populations.make_plants_steps(scene, depsgraph(), population))
    assert {Kind.read(kind).age for kind in seeds(scene).identifiers} == {40.0}


def test_populations_without_ages_are_as_before(scene):
    population, made = populated(scene, as_field='FIELD')
    assert not fields.has_ages(made.objects[0])
    assert made.objects[0].tetflora.age == 0.0
    before = rules.fingerprint(population)
    population.age_spread = 0.5
    population.property_unset("age_spread")
    assert rules.fingerprint(population) == before


def test_young_plants_are_small_in_all_that_knows_them(scene):
    (plant,) = row_of_plants([0.0])
    scene.tetflora.preview.plants = 'LIGHT'

    def sizes():
        height = np.ptp(levels.read_shapes(scene, depsgraph()).positions[:, 2])
        stand = run_to_end(forecast._count(scene, bpy.context.view_layer))
        above = canopy.canopy_of(scene, depsgraph())[0]
        (mesh,) = run_to_end(plant_mesh.make_plant_mesh_steps(scene, depsgraph(), [plant]))
        tall = mesh.dimensions.z
        bpy.data.objects.remove(mesh)
        plant.tetflora.enabled = True
        return np.array([height, stand.crowns[0].height * stand.scale[0], above.top[0], tall])

    plant_objects.show_age(plant)
    arrow = plant.empty_display_size

    grown = sizes()
    plant.tetflora.age = 5.0
    assert plant.empty_display_size < 0.5 * arrow
    assert (sizes() < 0.5 * grown).all()
    plant.tetflora.age = 0.0
    scene.tetflora.year.years = 5.0
    assert (sizes() < 0.5 * grown).all()


def test_an_age_counts_for_what_is_kept(scene):
    (plant,) = row_of_plants([0.0])
    graph = depsgraph()
    before = frame_cache.scene_digest(scene, graph)
    plant.tetflora.age = 5.0
    assert frame_cache.scene_digest(scene, depsgraph()) != before


def test_the_panel_tells_the_stage(scene):
    (plant,) = row_of_plants([0.0])
    select(plant)
    told = {}
    for age in (0.0, 1.0, 9_000.0):
        plant.tetflora.age = age
        layout = Layout()
        panel.TETFLORA_PT_object.draw(type("Panel", (), {"layout": layout})(), bpy.context)
        told[age] = [options.get("text") for name, _, options in layout.drawn if name == "label"]
    assert "Full-grown" in told[0.0]
    assert "Seedling" in told[1.0]
    assert "Dead" in told[9_000.0]


@pytest.mark.fine
def test_ages_of_a_species_share_meshes(scene):
    scene.render.resolution_x = scene.render.resolution_y = 120
    row_of_plants([0.0, 0.0])
    refine.refine(scene, depsgraph())
    before = {o.name for c in result_collections(scene, 'VIEW') for o in c.all_objects if " 0" in o.name}
    bpy.data.objects["plant 00"].tetflora.age = 30.0
    statistics = refine.refine(scene, depsgraph())
    (made,) = result_collections(scene, 'VIEW')
    meshes = [o for o in made.all_objects if o.type == 'MESH' and ("leaf" in o.name or "bark" in o.name)]
    assert {o.name for o in meshes} == {name for name in before if "leaf" in name or "bark" in name}
    assert sum(len(o.data.polygons) for o in meshes) == statistics.polygons_meshed


def test_a_dead_tree_takes_no_bark_from_the_living(scene):
    """Bark of the dead comes off; others of their species keep theirs, and both have a material of their own."""
    scene.render.resolution_x = scene.render.resolution_y = 120
    row_of_plants([300.0, 40.0], "birch")
    for _ in range(2):
        refine.refine(scene, depsgraph())
        (made,) = result_collections(scene, 'VIEW')
        shown = [slot.material for o in made.all_objects if " bark " in o.name for slot in o.material_slots]
        barks = [node.node_tree.name for m in shown for node in m.node_tree.nodes if getattr(node, "node_tree", None)]
        kinds = {name for name in barks if name.endswith(" Bark")}
        assert kinds == {"TetFlora Fibrous Bark", "TetFlora Peeling Bark"}
    assert {m.name for m in bpy.data.materials if " bark" in m.name} == {
        "TetFlora Birch bark",
        "TetFlora Birch dead bark",
    }
