# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The year of the shipped species: dates and leaf area as published, bare winters, and summers that are summer."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from devtools import leaf_area
from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.hashing import key_of_seed
from tetflora_addon.growth.rows import build_rows
from tetflora_addon.growth.seasons import (
    DRY,
    PRESENT,
    Season,
    expected,
    leaf_table,
    may_change,
    plant_years,
    seasonal_rows,
)
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.species import DAYS, LeafYear, Species

#: Species that are the same all year: nothing of them comes and goes that is described.
CONSTANT = {"agave", "dead_tree", "moss", "palm"}
#: Species of lands where the latitude of the others' summer is not theirs.
SOUTHERN = {"bamboo", "cypress", "holm_oak", "mango", "olive", "prickly_pear", "stone_pine"}
YEARS = tuple(name for name in support.SPECIES if name not in CONSTANT)
DECIDUOUS = tuple(name for name in YEARS if (leaf := load_species(name).year.leaf) is not None and leaf.turnover == 1)
EVERGREEN = tuple(name for name in YEARS if (leaf := load_species(name).year.leaf) is not None and leaf.turnover < 1)
#: Days from the break of a bud to a leaf whose blade can be seen whole.
_UNFOLDING = 5.0
COURSES = leaf_area.published()["curves"]
DATES = leaf_area.published()["dates"]


@cache
def rows_of(name: str) -> tuple[np.ndarray, Species]:
    species = load_species(name)
    return build_rows([species]), species


def changes(name: str, day: float, latitude: float) -> bool:
    """Whether a leaf of some plant of a species may look otherwise than without a year."""
    plain, species = rows_of(name)
    rows = seasonal_rows(plain, [species], Season(day, latitude))
    leafy = np.flatnonzero((rows["leaf_kind"] == 0) & (rows["leaves"].sum(axis=1) > 0))
    plants = plant_years(rows, np.zeros(500, np.int64), key_of_seed(np.arange(500)))
    row = np.tile(leafy, len(plants))
    return may_change(rows, row, np.repeat(plants, len(leafy), axis=0))


def expect(leaf: LeafYear, day: float, what: int) -> float:
    tables, origin = leaf_table(leaf)[None], np.array([leaf.middle - DAYS / 2])
    return float(expected(tables, origin, np.zeros(1, np.int64), np.array([day]), (what,))[0][0])


@pytest.mark.parametrize("name", support.SPECIES)
def test_every_species_says_when_its_leaves_come_and_go_and_who_says_so(name: str) -> None:
    year = load_species(name).year
    assert (year is None) == (name in CONSTANT)
    if year is not None:
        assert year.source
        assert year.leaf or year.blossom


@pytest.mark.parametrize("name", YEARS)
@pytest.mark.parametrize("latitude", [20.0, 40.0, 50.0, 60.0])
def test_leaves_appear_turn_and_fall_in_that_order(name: str, latitude: float) -> None:
    year = load_species(name).year.at_latitude(latitude)
    for leaf in (year.leaf, year.blossom):
        if leaf is not None:
            assert leaf.appear < leaf.turn <= leaf.fall < leaf.appear + DAYS


@pytest.mark.parametrize("name", YEARS)
def test_colors_are_those_of_leaves(name: str) -> None:
    species = load_species(name)
    leaf = species.year.leaf
    if leaf is None:
        return
    for color in (*leaf.autumn, leaf.dry, leaf.fresh or leaf.dry):
        assert max(color) <= 0.5  # a leaf reflects no more
        assert max(color) > color[2]  # and none is blue
    for red, green, _ in (*leaf.autumn, leaf.dry):
        assert red >= 0.8 * green
    if leaf.fresh is not None:
        summer = np.mean(
            [o.leaf_color.mean for o in species.orders if o.leaves.mean > 0 and o.leaf_kind == "leaf"], axis=0
        )
        assert sum(leaf.fresh) > summer.sum()


@pytest.mark.parametrize("name", DECIDUOUS)
def test_deciduous_plants_are_bare_in_january_but_for_dead_leaves(name: str) -> None:
    for latitude in (40.0, 50.0, 60.0):
        leaf = load_species(name).year.at_latitude(latitude).leaf
        late = 1e-9 if latitude >= 50 else 0.01  # in the south the last leaves of some are still falling
        assert expect(leaf, 15.0, PRESENT) == pytest.approx(leaf.kept, abs=late)
        assert expect(leaf, 15.0, DRY) == pytest.approx(leaf.kept, abs=late)


@pytest.mark.parametrize("name", EVERGREEN)
def test_evergreens_keep_leaves_all_year(name: str) -> None:
    leaf = load_species(name).year.leaf
    herb = name in ("flower", "grass", "wood_grass", "wood_sorrel")
    assert leaf_table(leaf)[PRESENT].min() >= (0.2 if herb else 0.5) - 1e-9


@pytest.mark.parametrize("name", [name for name in YEARS if name not in SOUTHERN])
def test_on_the_day_that_scenes_begin_with_all_leaves_are_as_without_a_year(name: str) -> None:
    assert not changes(name, Season().day, Season().latitude)
    assert any(changes(name, day, 50.0) for day in (20.0, 130.0, 300.0))


@pytest.mark.parametrize("name", [name for name in YEARS if load_species(name).year.leaf is not None])
def test_there_is_a_summer_at_home(name: str) -> None:
    home = load_species(name).year.latitude
    assert not all(changes(name, day, home) for day in np.arange(170.0, 240.0, 2.0))


@pytest.mark.parametrize("name", DECIDUOUS)
def test_leaves_are_full_grown_at_midsummer(name: str) -> None:
    for latitude, day in ((40.0, 182.0), (50.0, 185.0), (60.0, 207.0)):
        year = load_species(name).year.at_latitude(latitude)
        assert leaf_area.leaf_area(year, year.leaf, np.array([day]))[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("name", DECIDUOUS)
def test_farther_north_leaves_come_later_and_go_earlier(name: str) -> None:
    year = load_species(name).year
    year = replace(year, leaf=replace(year.leaf, kept=0.0))
    area = [
        leaf_area.leaf_area(moved, moved.leaf, np.array([year.leaf.appear + 12.0, year.leaf.fall]))
        for moved in (year.at_latitude(year.latitude + north) for north in (-4.0, 0.0, 4.0))
    ]
    assert (np.diff(area, axis=0) < 0).all()


@pytest.mark.parametrize("name", DECIDUOUS)
def test_far_in_the_south_the_first_and_the_last_leaves_stay_apart(name: str) -> None:
    """By 2.8 standard deviations of all three dates, as far as their own year is not longer."""
    leaf = load_species(name).year.leaf
    moved = load_species(name).year.at_latitude(0.0).leaf
    longest = DAYS - 2.8 * (leaf.appear_spread + leaf.turn_spread + leaf.fall_spread)
    assert moved.fall - moved.appear <= max(longest, leaf.fall - leaf.appear) + 1e-9
    assert moved.appear < moved.turn <= moved.fall


@pytest.mark.parametrize("course", COURSES, ids=lambda course: course["species"])
def test_leaf_area_through_the_year_is_the_published_one(course: dict[str, Any]) -> None:
    assert np.abs(leaf_area.errors(course)).max() <= 0.1


@pytest.mark.parametrize("date", DATES, ids=lambda date: f"{date['species']}-{date['phase']}-{date['day']}")
def test_dates_are_those_published(date: dict[str, Any]) -> None:
    year = load_species(date["species"]).year.at_latitude(date.get("latitude", 50.0))
    own = year.leaf.appear + _UNFOLDING if date["phase"] == "unfold" else getattr(year.leaf, date["phase"])
    assert abs(own - date["day"]) <= date["within"]


def test_curves_are_of_four_species_at_least_and_of_all_that_are_named() -> None:
    assert len({course["species"] for course in COURSES}) >= 4
    assert {"beech", "oak", "birch", "maple"} <= {course["species"] for course in COURSES}


@pytest.mark.parametrize(
    ("name", "there", "gone"),
    [
        ("cherry_blossom", 110.0, 135.0),
        ("wood_sorrel", 119.0, 160.0),
        ("flower", 190.0, 280.0),
        ("grass", 190.0, 130.0),
        ("hazel", 230.0, 300.0),
        ("rowan", 250.0, 130.0),
        ("reed", 300.0, 170.0),
        ("silver_fir", 220.0, 320.0),
        ("prickly_pear", 260.0, 100.0),
    ],
)
def test_blossoms_and_fruit_have_their_season(name: str, there: float, gone: float) -> None:
    blossom = load_species(name).year.blossom
    assert expect(blossom, there, PRESENT) >= 0.8
    assert expect(blossom, gone, PRESENT) <= blossom.kept + 0.05


def test_a_cherry_blooms_before_its_leaves() -> None:
    year = load_species("cherry_blossom").year
    assert leaf_area.leaf_area(year, year.leaf, np.array([year.blossom.appear + 5.0]))[0] < 0.15


def test_trees_with_blossoms_have_leaves_in_summer() -> None:
    """Leaves of a cherry that is described in blossom were a fiftieth of all: it was bare for the rest of the year."""
    for name in ("cherry_blossom", "rowan", "hazel", "mango", "spruce"):
        flora = compile_species([load_species(name)])
        described, summer = (
            one.leaf_areas(trunks(one.rows, support.plants(np.arange(10)))).mean()
            for one in (flora, flora.in_year(Season(200.0)))
        )
        assert summer > 0.5 * np.pi * crown_of(load_species(name)).radius ** 2, name
        assert summer > 0.1 * described, name
