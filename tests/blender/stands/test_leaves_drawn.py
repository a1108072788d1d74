# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of stands are drawn with the leaf area that takes light in the stand, and grown ones have it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.leaf_area import drawn_against_grid, drawn_leaves
from devtools.leaf_area import allometry
from tetflora_addon.growth.hashing import key_of_seed
from tetflora_addon.species.catalog import load_species
from tetflora_addon.stands.grow import Plants, newcomers
from tetflora_addon.stands.site import StandSite, StandSpecies, StandTraits


def plants_of(traits: StandTraits) -> Plants:
    """A young, a middle-aged and an old tree of the only species: free, between neighbors, and high above others."""
    basal = traits.first[0] + traits.diameter[0] * np.array([0.08, 0.25, 0.5])
    zero = np.zeros(3, np.int64)
    made = newcomers(key_of_seed(np.arange(3)), 0, zero, 0.0 * basal, 0.0 * basal, basal, 1.0 + zero, 10.0, traits)
    height = made.height
    return replace(made, radius=made.radius * [1.2, 0.7, 0.9], base=height * [0.1, 0.5, 0.6], east=0.1 + 0.0 * basal)


@pytest.mark.parametrize("identifier", sorted(allometry()["open"]))
def test_what_is_drawn_has_the_leaves_that_take_light(identifier: str) -> None:
    traits = StandTraits([StandSpecies(load_species(identifier))])
    plants = plants_of(traits)
    taken = plants.crowns(traits).leaves / traits.extinction[0]
    site = StandSite(0.0, 0.0, 5.0, np.zeros((2, 2)))
    assert drawn_leaves(identifier, plants, traits, site) == pytest.approx(taken, rel=0.05)


def test_trees_with_few_twigs_have_as_many_between_neighbors_as_take_light() -> None:
    """Shapes of crowns make up to six times as many; four were too few for tupelos of forty years."""
    assert drawn_against_grid("black_tupelo", 40) < 0.01
