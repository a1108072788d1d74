# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves through the year: each has a life of its own, tables say what is expected of all, and summer is summer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.errors import TetFloraError
from tetflora_addon.growth.hashing import key_of_seed
from tetflora_addon.growth.seasons import (
    AREA,
    PRESENT,
    Season,
    expected,
    leaf_colors_at,
    leaf_stages,
    leaf_table,
    plant_years,
    seasonal_rows,
)
from tetflora_addon.growth.wind import Wind
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.species import DAYS, LeafYear, Species, Year
from tetflora_addon.subplants.leaf_meshes import leaf_meshes
from tetflora_addon.subplants.pieces import expand

LEAF = LeafYear(
    appear=115,
    turn=282,
    fall=296,
    growth=30,
    fresh=(0.2, 0.35, 0.05),
    autumn=((0.6, 0.4, 0.03), (0.6, 0.25, 0.02), (0.4, 0.1, 0.02)),
    kept=0.1,
)
YEARS = st.builds(
    LeafYear,
    appear=st.floats(90, 150),
    turn=st.floats(250, 290),
    fall=st.floats(291, 320),
    appear_spread=st.floats(1.5, 8),
    growth=st.floats(1, 40),
    fresh=st.sampled_from([None, (0.2, 0.35, 0.05)]),
    turn_spread=st.floats(1.5, 10),
    turning=st.floats(0, 25),
    autumn=st.sampled_from([(), LEAF.autumn[:1], LEAF.autumn]),
    fall_spread=st.floats(0, 6),
    kept=st.sampled_from([0.0, 0.15]),
    turnover=st.sampled_from([1.0, 0.3]),
)
DAYS_OF_YEAR = st.floats(1, 365)


def with_year(leaf: LeafYear = LEAF, blossom: LeafYear | None = None, **changes: object) -> Species:
    species = species_from_dict(support.small(**changes), "small", "small.json")
    return replace(species, year=Year(leaf=leaf, blossom=blossom))


def leaves_of(flora: Flora, plants: int) -> tuple[float, int, np.ndarray]:
    """Area of the leaves of some plants, their faces, and their mean color."""
    seeds = support.plants(np.arange(plants))
    area, faces, color = 0.0, 0, np.zeros(3)
    for mesh in leaf_meshes(flora, 0, list(expand(flora, support.trunks(flora.rows, seeds)))):
        own = support.face_areas(mesh.buffers)
        area, faces = area + own.sum(), faces + len(own)
        color = color + own @ mesh.buffers.attributes["tf_color"][1]
    return area, faces, color / max(area, 1e-12)


def test_without_a_year_and_in_summer_a_flora_is_itself() -> None:
    plain = support.small_flora()
    assert plain.in_year(Season(20.0)) is plain
    flora = compile_species([with_year()])
    assert flora.in_year(Season(190.0)) is flora
    assert flora.in_year(Season(20.0)).in_year(Season(190.0)) is flora
    assert flora.in_year(Season(20.0)) is not flora


def test_the_wind_blows_in_winter_too() -> None:
    flora = compile_species([with_year()])
    winter = flora.in_year(Season(20.0))
    windy = winter.in_wind(Wind(8.0))
    assert windy.at_rest is winter
    assert windy.in_leaf is flora
    still, moved = (support.trunks(f.rows, support.plants(3)) for f in (winter, windy))
    np.testing.assert_array_equal(still.year, moved.year)


@settings(deadline=None, max_examples=20)
@given(YEARS, DAYS_OF_YEAR)
def test_tables_are_means_of_leaves(leaf: LeafYear, day: float) -> None:
    flora = compile_species([with_year(leaf)])
    rows = seasonal_rows(flora.rows, flora.species, Season(day, spread=0.0))
    row = np.flatnonzero(rows["leaves"][:, 0] > 0)[:1]
    key = key_of_seed(np.arange(20_000))
    stages = leaf_stages(rows, row, key, np.full(len(key), day))
    found = expected(leaf_table(leaf)[None], np.array([leaf.middle - DAYS / 2]), np.zeros(1, int), np.array([day]))
    area = np.where(stages.present, stages.size, 0.0) ** 2
    parts = stages.fresh * (1 - stages.turned) * (1 - stages.dead), stages.turned * (1 - stages.dead), stages.dead
    seen = [
        stages.present.mean(),
        np.where(stages.present, stages.size, 0).mean(),
        area.mean(),
        *((area * p).mean() for p in parts),
    ]
    np.testing.assert_allclose(
        seen, np.ravel(found), atol=0.025
    )  # five standard errors, and a step of the table where leaves are sudden


@settings(deadline=None, max_examples=12)
@given(YEARS, DAYS_OF_YEAR)
def test_plants_are_what_is_expected_of_them(leaf: LeafYear, day: float) -> None:
    flora = compile_species([with_year(leaf)]).in_year(Season(day))
    summer = leaves_of(flora.in_leaf, 40)
    area, faces, color = leaves_of(flora, 40)
    plants = support.trunks(flora.rows, support.plants(np.arange(40)))
    wanted = flora.leaf_areas(plants)
    assert area == pytest.approx(wanted.sum(), abs=0.1 * summer[0])
    assert faces == pytest.approx((flora.face_counts(plants) - flora.branch_faces(plants)).sum(), abs=0.1 * summer[1])
    if area > 0.2 * summer[0]:
        mean = wanted @ flora.leaf_colors(plants) / wanted.sum()
        np.testing.assert_allclose(color, mean, atol=0.03)


@settings(deadline=None, max_examples=25)
@given(YEARS, DAYS_OF_YEAR)
def test_a_year_is_a_circle_and_nothing_jumps(leaf: LeafYear, day: float) -> None:
    table, origin = leaf_table(leaf)[None], np.array([leaf.middle - DAYS / 2])
    days = np.array([day, day + DAYS, day - DAYS])
    found = expected(table, origin, np.zeros(3, int), days)
    np.testing.assert_allclose(found, np.tile(np.array(found)[:, :1], 3), atol=1e-9)
    assert ((leaf_table(leaf) >= -1e-12) & (leaf_table(leaf) <= 1 + 1e-12)).all()
    smooth = min(leaf.appear_spread, leaf.turn_spread) > 3
    if smooth:
        assert np.abs(np.diff(leaf_table(leaf)[AREA])).max() < 0.12


def test_each_leaf_appears_once_and_falls_once() -> None:
    flora = compile_species([with_year(replace(LEAF, kept=0.0))])
    rows = seasonal_rows(flora.rows, flora.species, Season(1.0))
    row = np.flatnonzero(rows["leaves"][:, 0] > 0)[:1]
    key = key_of_seed(np.arange(500))
    there = np.array([leaf_stages(rows, row, key, np.full(len(key), d)).present for d in np.arange(0.0, 365.0, 1.0)])
    assert (np.abs(np.diff(there.astype(int), axis=0)).sum(axis=0) == 2).all()
    size = np.array([leaf_stages(rows, row, key, np.full(len(key), d)).size for d in np.arange(100.0, 200.0)])
    assert (np.diff(size, axis=0)[there[100:199]] >= 0).all()


def test_plants_have_days_of_their_own_within_their_spread() -> None:
    flora = compile_species([with_year()])
    key = key_of_seed(np.arange(1000))
    row = np.zeros(1000, int)
    for day, spread, most in ((115.0, 1.0, 5.0), (290.0, 1.0, 7.0), (290.0, 0.0, 0.0), (115.0, 2.0, 10.0)):
        years = plant_years(seasonal_rows(flora.rows, flora.species, Season(day, spread=spread)), row, key)
        away = years[:, 0] - day
        assert np.abs(away).max() <= most
        assert np.abs(away).max() >= 0.95 * most
        assert abs(away.mean()) <= 0.1 * most


def test_north_is_later_in_spring_and_earlier_in_autumn_and_south_is_half_a_year_away() -> None:
    flora = compile_species([with_year(replace(LEAF, kept=0.0))])
    plants = support.trunks(flora.rows, support.plants(0))

    def share(day: float, latitude: float) -> float:
        there = flora.in_year(Season(day, latitude, 0.0))
        return float(there.leaf_areas(support.trunks(there.rows, support.plants(0)))[0] / flora.leaf_areas(plants)[0])

    for day in (120.0, 295.0):
        assert share(day, 42.0) > share(day, 50.0) > share(day, 58.0)
    assert share(120.0, -50.0) == pytest.approx(share(120.0 + DAYS / 2, 50.0))
    assert share(10.0, -50.0) == 1.0


def test_blossoms_have_a_year_of_their_own() -> None:
    short = LeafYear(appear=110, turn=122, fall=126, appear_spread=2, growth=4, turn_spread=2, turning=1, fall_spread=1)
    data = support.small(order1={"leaf_kind": "blossom"})
    data["blossom"] = {"model": "kite"}
    species = replace(species_from_dict(data, "small", "small.json"), year=Year(leaf=LEAF, blossom=short, spring=0.0))
    flora = compile_species([species])
    for day, leaf, blossom in ((118.0, None, True), (150.0, True, False), (60.0, False, False)):
        there = flora.in_year(Season(day))
        kinds = {
            mesh.kind
            for mesh in leaf_meshes(there, 0, list(expand(there, support.trunks(there.rows, support.plants(1)))))
        }
        assert (1 in kinds) == blossom
        if leaf is not None:
            assert (0 in kinds) == leaf or LEAF.kept > 0


def test_hues_of_plants_mix_the_colors_of_autumn_as_expected() -> None:
    flora = compile_species([with_year(replace(LEAF, turn=200, fall=330, kept=0.0))]).in_year(Season(270.0, spread=0.0))
    rows, row = flora.rows, np.flatnonzero(flora.rows["leaves"][:, 0] > 0)[:1]
    key = key_of_seed(np.arange(20_000))
    for hue in (0.0, 0.3, 1.0):
        stages = leaf_stages(rows, row, key, np.full(len(key), 270.0))
        assert stages.present.all()
        hues = np.full(len(key), hue)
        mean = leaf_colors_at(rows, row, np.full((len(key), 3), 0.5), stages, hues).mean(axis=0)
        trunk = support.trunks(rows, support.plants(0))
        year = np.array([[270.0, hue]])
        np.testing.assert_allclose(mean, flora.leaf_colors(replace(trunk, year=year))[0], atol=0.01)


@pytest.mark.parametrize("wrong", [{"day": np.nan}, {"latitude": 91.0}, {"spread": -1.0}, {"snow": 2.0}])
def test_a_season_that_is_none_is_refused(wrong: dict) -> None:
    with pytest.raises(TetFloraError, match="Seasons"):
        Season(**wrong)


def test_presence_of_evergreens_stays_high() -> None:
    table = leaf_table(replace(LEAF, turnover=0.25, kept=0.0))
    assert table[PRESENT].min() == pytest.approx(0.75)
    assert table[PRESENT].max() == pytest.approx(1.0)
