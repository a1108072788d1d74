# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants in other files: their species go with collections that are linked, overridden or appended."""

from __future__ import annotations

import json

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph
from tetflora_addon.blender.assets.marks import stop_using, use_as_species
from tetflora_addon.blender.assets.places import _plant_places
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.placing.plant_objects import link_field
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.blender.species.asset_species import asset_species
from tetflora_addon.blender.species.edits import (
    catalog,
    change_species,
    pack,
    revert_species,
    species_data,
    species_for,
    store_species,
)

pytestmark = pytest.mark.usefixtures("clean_file")
PLANTS = "TetFlora plants"


@pytest.fixture
def library(tmp_path):
    """A file with a species of its own as a plant and in a field, and a shipped one that was changed."""
    scene = bpy.context.scene
    store_species(scene, "bush_litter", {**species_data(scene, "bush"), "name": "Litter"})
    change_species(scene, "conifer", lambda data: data.update(name="Blue Conifer"))
    outer, inner = bpy.data.collections.new(PLANTS), bpy.data.collections.new("Population")
    scene.collection.children.link(outer)
    outer.children.link(inner)
    for n, species in enumerate(("bush", "bush_litter", "conifer")):
        plant = add_plant(species, species, n, (2.0 * n, 0.0, 0.0))
        scene.collection.objects.unlink(plant)
        inner.objects.link(plant)
    rows = np.array([[0.0, 5.0, 0.0], [2.0, 5.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]] * 2), np.ones(2)
    field = write_field("field", *rows, np.array([0, 1]), np.array([1, 2]), ["bush", "bush_litter"])
    link_field(scene, field, inner)
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert "bush_litter" not in catalog()
    return path


def bring(path, link):
    """The collection of plants, in this file."""
    with bpy.data.libraries.load(path, link=link) as (_, wanted):
        wanted.collections = [PLANTS]
    bpy.context.scene.collection.children.link(wanted.collections[0])
    return wanted.collections[0]


def small_picture():
    scene = bpy.context.scene
    add_camera((0.0, -60.0, 2.0))
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 50.0, 8.0


def species_seen():
    seeds = read_plants(bpy.context.scene, depsgraph())[0]
    return [seeds.identifiers[i] for i in np.sort(seeds.species)]


def check():
    """All plants are there with their species, and are refined."""
    small_picture()
    assert species_seen() == ["bush"] * 2 + ["bush_litter"] * 2 + ["conifer"]
    assert species_for(bpy.context.scene, "conifer").name == "Blue Conifer"
    statistics = refine.refine(bpy.context.scene, depsgraph())
    assert (statistics.plants, statistics.left_out) == (5, "")


def test_linked_plants_have_their_species(library):
    bring(library, link=True)
    check()
    other = bpy.data.scenes.new("other")
    assert species_for(other, "bush_litter").name == "Litter"


def test_overridden_plants_have_their_species(library):
    linked = bring(library, link=True)
    linked.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer)
    bpy.context.scene.collection.children.unlink(linked)
    assert all(o.override_library for o in bpy.context.scene.objects)
    check()


def test_appended_plants_bring_their_species_and_hand_them_on(library, tmp_path):
    bring(library, link=False)
    assert {e.identifier for e in bpy.context.scene.tetflora.species_edits} == {"bush_litter", "conifer"}
    check()
    path = str(tmp_path / "second.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bring(path, link=True)
    check()


@pytest.fixture
def models(tmp_path):
    """A file with plants that are models: an object, and a collection of variants."""
    scene, outer = bpy.context.scene, bpy.data.collections.new(PLANTS)
    scene.collection.children.link(outer)
    variants = bpy.data.collections.new("variants")
    variants.objects.link(add_mesh("one", size=0.4))
    for n, model in enumerate((add_mesh("model", size=0.3), variants)):
        species = use_as_species(scene, depsgraph(), model, variants=True).identifier
        plant = add_plant(f"plant {n}", species, n, (2.0 * n, 0.0, 0.0))
        scene.collection.objects.unlink(plant)
        outer.objects.link(plant)
    path = str(tmp_path / "models.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    return path


def models_seen():
    """Names of what plants look like, after they are refined as well."""
    found = [(p.target.shown.name, len(p)) for p in _plant_places(bpy.context.scene, depsgraph())]
    small_picture()
    bpy.context.scene.tetflora.asset_detail = 'REFINE'
    assert refine.refine(bpy.context.scene, depsgraph()).instances == 2
    return sorted(found)


@pytest.mark.parametrize("link", [True, False])
def test_plants_that_are_models_have_them(models, link, tmp_path):
    bring(models, link)
    assert models_seen() == [("model", 1), ("one", 1)]
    path = str(tmp_path / "second.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert len(_plant_places(bpy.context.scene, depsgraph())) == 2


def test_a_model_that_is_used_no_more_does_not_come_back(models):
    collection = bring(models, link=False)
    stop_using(bpy.data.objects["model"])
    assert len(collection.tetflora_assets) == len(asset_species()) == 1
    for plant in list(collection.objects):
        bpy.data.objects.remove(plant)
    pack()
    assert not len(collection.tetflora_assets)


def test_what_is_reverted_does_not_come_back(library):
    bring(library, link=False)
    assert species_for(bpy.context.scene, "conifer").name == "Blue Conifer"
    revert_species("bush_litter")
    revert_species("conifer")
    assert "bush_litter" not in catalog()
    assert species_for(bpy.context.scene, "conifer").name != "Blue Conifer"


def test_only_what_nobody_knows_is_left_out_and_named(library):
    collection = bring(library, link=False)
    revert_species("bush_litter")
    assert species_seen() == ["bush"] * 2 + ["conifer"]
    small_picture()
    statistics = refine.refine(bpy.context.scene, depsgraph())
    assert statistics.plants == 3
    assert statistics.left_out.startswith('Left out "bush_litter", "field": unknown species "bush_litter"')
    assert collection.name == PLANTS


def test_pages_that_are_no_species_are_passed_over(library):
    collection = bring(library, link=False)
    assert {e.identifier for e in bpy.context.scene.tetflora.species_edits} == {"bush_litter", "conifer"}
    for text in ("{", "[]", json.dumps({"../x": "{}", "y": 3}), "\0"):
        collection["tetflora_pages"] = text
        assert {"y", "../x"}.isdisjoint(catalog())
