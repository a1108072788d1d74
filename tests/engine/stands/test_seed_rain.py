# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds of a stand: as many fall as its crowns bear, as far from them as the species' seeds travel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.ecology import ecology_of
from tetflora_addon.stands.grow import Plants, SeedDispersal, planted
from tetflora_addon.stands.site import StandSite, StandSpecies, StandTraits

SIDE = 600.0
RADIUS = 3.0


def fallen(
    dispersal: float, radius: float = RADIUS, age: float = 500.0, east: float = 0.5, north: float = 0.5
) -> tuple[SeedDispersal, NDArray[np.float64]]:
    """Seeds on a square meter (rows, columns) around one beech at fractions of the ground, by itself in the middle."""
    beech = load_species("beech")
    traits = StandTraits([StandSpecies(replace(beech, ecology=replace(ecology_of(beech), dispersal=dispersal)))])
    site, suitability = StandSite(0.0, 0.0, SIDE / 120, np.zeros((120, 120))), np.ones((1, 120**2))
    plants: Plants = planted(site, traits, suitability, 1.0, 0).take(np.array([0]))
    one = replace(
        plants, x=np.array([SIDE * east]), y=np.array([SIDE * north]), radius=np.array([radius]), age=np.array([age])
    )
    rain = SeedDispersal(site, traits, suitability, 300.0, 0.0)
    return rain, rain.fallen(one).reshape(rain.rows, rain.columns)


@pytest.mark.parametrize("dispersal", [1.0, 12.0, 35.0, 80.0])
def test_as_many_seeds_fall_as_are_borne(dispersal: float) -> None:
    rain, seeds = fallen(dispersal)
    area = SIDE**2 / seeds.size
    assert seeds.sum() * area == pytest.approx(rain.traits.fecundity[0] * np.pi * RADIUS**2, rel=1e-3)
    assert (seeds >= 0).all()


@pytest.mark.parametrize("dispersal", [12.0, 20.0, 35.0, 80.0])
def test_seeds_travel_as_far_as_the_species_says(dispersal: float) -> None:
    """Their mean distance from the crown, as far as cells of the ground are small."""
    _, seeds = fallen(dispersal)
    middle = (np.arange(len(seeds)) + 0.5) * (SIDE / len(seeds)) - SIDE / 2
    away = np.hypot(*np.meshgrid(middle, middle))
    assert (seeds * away).sum() / seeds.sum() == pytest.approx(dispersal, rel=0.15)


@pytest.mark.parametrize("east", [0.0, 0.999, 1.0])
@pytest.mark.parametrize("north", [0.0, 0.999, 1.0])
def test_plants_at_the_border_bear_there(east: float, north: float) -> None:
    rain, seeds = fallen(1.0, east=east, north=north)
    place = np.unravel_index(np.argmax(seeds), seeds.shape)
    assert place == ((rain.rows - 1) * round(north), (rain.columns - 1) * round(east))


def test_seeds_go_to_all_sides_alike_and_fewer_the_farther() -> None:
    _, seeds = fallen(40.0)
    row, column = np.unravel_index(np.argmax(seeds), seeds.shape)
    np.testing.assert_allclose(seeds[row, column - 20 : column], seeds[row, column + 20 : column : -1], rtol=1e-9)
    np.testing.assert_allclose(seeds[row - 20 : row, column], seeds[row, column - 20 : column], rtol=1e-9)
    assert (np.diff(seeds[row, column : column + 15]) < 0).all()


def test_young_plants_bear_none_and_wide_crowns_more() -> None:
    assert fallen(20.0, age=2.0)[1].sum() == 0.0
    assert fallen(20.0, radius=6.0)[1].sum() == pytest.approx(4.0 * fallen(20.0)[1].sum(), rel=1e-3)
