# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ecology of species: read with errors that name the key, there for all, and without effect on plants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.errors import SpeciesError
from tetflora_addon.species.ages import ages_of
from tetflora_addon.species.catalog import load_species, species_from_dict
from tetflora_addon.species.ecology import ecology_of
from tetflora_addon.species.species import Ecology
from tetflora_addon.stands.site import StandSpecies, StandTraits


@pytest.mark.parametrize(
    ("ecology", "words"),
    [
        ({"shad": 3}, 'ecology.shad: unknown key; did you mean "shade"'),
        ({"shade": 6}, "ecology.shade: must be from 0 to 5"),
        ({"crown_width": 3}, "ecology.crown_width: must be a pair"),
        ({"height_curve": [1, "x"]}, r"ecology.height_curve\[1\]: must be a number"),
        (7, "ecology: must be an object"),
    ],
)
def test_mistakes_are_named(ecology: object, words: str) -> None:
    with pytest.raises(SpeciesError, match=words):
        species_from_dict(support.small(ecology=ecology), "small", "small.json")


def test_a_file_may_say_some_of_it() -> None:
    species = species_from_dict(support.small(ecology={"shade": 1, "crown_width": [1, 20]}), "small", "small.json")
    assert species.ecology == Ecology(shade=1.0, crown_width=(1.0, 20.0)) == ecology_of(species)
    assert species_from_dict(support.small(), "small", "small.json").ecology is None


@pytest.mark.parametrize("name", support.SPECIES)
def test_every_species_can_grow_in_a_stand(name: str) -> None:
    species = load_species(name)
    needs, traits = ecology_of(species), StandTraits([StandSpecies(species)])
    basal = np.linspace(0.0, 1.2 * needs.diameter, 200)
    zero = np.zeros(200, np.int64)
    heights, radii = traits.heights(zero, basal), traits.radii(zero, basal)
    assert heights[0] == 0 and (np.diff(heights) >= 0).all() and 0.5 * needs.height < heights[-1] <= needs.height
    assert (np.diff(radii) >= 0).all() and radii[-1] < 0.8 * needs.height + 4.0
    assert traits.free[0] > 0.1
    # What is described is no larger than the largest, where the file says more than its size.
    assert species.ecology is None or needs.source


@pytest.mark.parametrize("name", ["oak", "hazel", "palm", "ash"])
def test_what_is_not_described_follows_from_one_lifespan(name: str) -> None:
    """A trunk thickens in a stand within the years after which the same plant, as it grows by its age, dies."""
    plain = replace(load_species(name), ages=None, ecology=None)
    ages, needs = ages_of(plain), ecology_of(plain)
    assert ecology_of(replace(plain, ages=ages)) == needs
    longer = ecology_of(replace(plain, ages=replace(ages, lifespan=20.0 * ages.lifespan)))
    for one, lifespan in ((needs, ages.lifespan), (longer, 20.0 * ages.lifespan)):
        years = one.diameter / one.diameter_increment
        assert years == pytest.approx(0.35 * lifespan) or (one.diameter_increment == 0.02 and years > 0.35 * lifespan)
    assert longer.diameter_increment < 0.02


def test_it_changes_no_plant() -> None:
    species = load_species("beech")
    other = replace(species, ecology=None)
    assert compile_species([species]).rows.tobytes() == compile_species([other]).rows.tobytes()
