# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which blade leaves have follows from their outline, so no species file needs to say."""

from dataclasses import replace

import numpy as np
import pytest

from tetflora_addon.blender.results import leaf_objects
from tetflora_addon.leaves import models, outlines, surfaces
from tetflora_addon.species import catalog

pytestmark = pytest.mark.usefixtures("clean_file")

SHIPPED = {
    "oak": "lobed",
    "black_oak": "lobed",
    "maple": "palmate",
    "beech": "pinnate",
    "birch": "pinnate",
    "aspen": "pinnate",
    "willow": "narrow",
    "bamboo": "parallel",
    "grass": "parallel",
    "palm": "parallel",
    "spruce": "needle",
    "scots_pine": "needle",
    "cypress": "needle",
    "fern": "pinnate",
    "rowan": "pinnate",
}


@pytest.mark.parametrize("identifier", list(SHIPPED))
def test_shipped_species(identifier):
    species = catalog.load_species(identifier)
    assert leaf_objects._blade_kind(species.leaf[0], species.leaf_transmission) == SHIPPED[identifier]


@pytest.mark.parametrize("identifier", ["oak", "maple", "beech", "birch", "willow"])
def test_outlines_and_far_polygons_agree(identifier):
    species = catalog.load_species(identifier)
    far = replace(species.leaf[0], shape=None)
    assert leaf_objects._blade_kind(far, species.leaf_transmission) == SHIPPED[identifier]


def test_compound_leaves_have_the_blade_of_their_leaflets():
    shape = surfaces.Compound(leaflet=outlines.Blade(width=0.4))
    model = replace(catalog.load_species("rowan").leaf[0], shape=shape)
    assert leaf_objects._blade_kind(model, 0.4) == "pinnate"


def test_blossoms_have_petals_and_fruit_is_plain():
    open_flower = models.LEAF_MODELS["blossom"]
    assert leaf_objects._blade_kind(open_flower, 0.4, "blossom") == "petal"
    assert leaf_objects._blade_kind(open_flower, 0.1, "blossom") == "plain"


def test_a_finely_toothed_leaf_is_not_lobed():
    """Its teeth take little of its hull."""
    turn = 2 * np.pi * np.arange(80) / 80
    far = 0.5 + 0.012 * (np.arange(80) % 2)
    toothed = np.stack([0.6 * far * np.sin(turn), 0.5 + far * np.cos(turn), 0 * turn], axis=1)
    model = models.leaf_model(toothed, [list(range(80))])
    assert leaf_objects._blade_kind(model, 0.4) == "pinnate"


def test_the_material_knows_the_length_of_leaves_and_parallel_veins_their_width():
    grass = catalog.load_species("grass")
    made = leaf_objects._species_leaf_material(grass, "leaf")
    group = next(n for n in made.node_tree.nodes if n.type == 'GROUP' and "Leaf Length" in n.inputs)
    assert group.inputs["Leaf Length"].default_value == pytest.approx(0.42, rel=0.01)
    width = np.ptp(grass.leaf[0].uv[:, 0])
    assert group.inputs["Veins"].default_value * width == pytest.approx(11.0, rel=0.1)


def test_veins_are_as_many_as_ends_of_the_margin_or_follow_the_width():
    """Pairs as floras have them; a blade whose margin has a wave for each vein swells between them, others lie flat."""
    relief = {}
    for identifier, pairs in {"beech": (5, 9), "birch": (6, 8), "aspen": (4, 7), "hornbeam": (9, 15)}.items():
        made = leaf_objects._species_leaf_material(catalog.load_species(identifier), "leaf")
        group = next(n for n in made.node_tree.nodes if n.type == 'GROUP' and "Leaf Length" in n.inputs)
        # The first vein leaves the midrib at the base, and the last well before the tip.
        assert pairs[0] <= group.inputs["Veins"].default_value / 1.15 - 0.5 <= pairs[1]
        relief[identifier] = group.inputs["Relief"].default_value
    assert relief["beech"] > 1.5 * max(relief["birch"], relief["aspen"]) > 0.0


def test_leaflets_have_their_own_length():
    """The relief of a leaflet is measured by the leaflet, whose UV map it has to itself."""
    rowan = catalog.load_species("rowan")
    made = leaf_objects._species_leaf_material(rowan, "leaf")
    group = next(n for n in made.node_tree.nodes if n.type == 'GROUP' and "Leaf Length" in n.inputs)
    # Rowan leaves, pinnate, are 10 to 22 cm long, and most of a species' are in the sun.
    assert group.inputs["Leaf Length"].default_value == pytest.approx(0.2 * rowan.leaf[0].shape.length, rel=0.2)


@pytest.mark.parametrize("identifier", ["fern", "rowan"])
def test_many_short_parts_without_an_outline_are_plain(identifier):
    far = replace(catalog.load_species(identifier).leaf[0], shape=None)
    assert leaf_objects._blade_kind(far, 0.4) == "plain"
