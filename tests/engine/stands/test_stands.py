# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands: light is shared and not made, plants grow and die for good, and all is the same in any number of threads."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon import parallel
from tetflora_addon.errors import TetFloraError
from tetflora_addon.jobs import run_to_end
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.species import Ecology
from tetflora_addon.stands.grow import LYING, Records, StandSettings, begun, grow, grown, planted
from tetflora_addon.stands.light import Crowns, LightGrid
from tetflora_addon.stands.site import StandSite, StandSpecies, StandTraits

SIDE = 40.0
MIXED = [StandSpecies(load_species(name)) for name in ("beech", "birch")]
YEARS = StandSettings(years=60, interval=10, density=6000.0, recruits=500.0, seed=3)


def even_site(size: float, **settings: float) -> StandSite:
    """A level square of so many meters, in cells of 5 m."""
    return StandSite(0.0, 0.0, 5.0, np.zeros((round(size / 5.0), round(size / 5.0))), **settings)


def half_planted(settings: StandSettings = YEARS) -> StandSite:
    """Ground on a slope, of which the western half can be planted."""
    rows = np.linspace(0.0, 8.0, 20)[:, None] * np.ones(20)
    plantable = (np.arange(20) < 10) * np.ones((20, 1))
    return StandSite(-10.0, 5.0, SIDE / 20, rows, plantable)


@cache
def records() -> Records:
    return run_to_end(grow(half_planted(), MIXED, YEARS))


def crowns(number: int, seed: int) -> Crowns:
    """Crowns of all sizes in a grid of 24 x 17 columns of a meter, and around it."""
    draw = np.random.default_rng(seed).random((7, number))
    height = 0.2 + 20 * draw[0] ** 2
    base = height * 0.9 * draw[1]
    return Crowns(
        24 * draw[2], 17 * draw[3], 0.05 + 5 * draw[4], base, height, 40 * draw[5] ** 3, (draw[6] > 0.5).astype(float)
    )


def same(a: Records, b: Records) -> bool:
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(Records))


@settings(max_examples=12, deadline=None)
@given(number=st.integers(1, 120), seed=st.integers(0, 2**30))
def test_crowns_take_all_light_that_does_not_reach_the_ground(number: int, seed: int) -> None:
    grid, some = LightGrid(17, 24, 1.0), crowns(number, seed)
    # Nothing grows in the lowest layer: what is there is what reaches the ground.
    some = replace(some, base=some.base + 1.0, height=some.height + 1.0)
    strips = grid.fill(some)
    taken = np.concatenate([grid.taken(i) for i in range(len(strips))])
    assert sorted(np.concatenate(strips)) == list(range(number))
    assert (taken >= 0).all()
    ground = grid.at(np.arange(24.0).repeat(17) + 0.5, np.tile(np.arange(17.0) + 0.5, 24), np.zeros(24 * 17))
    assert (ground <= 1.0 + 1e-5).all() and (ground >= 0).all()
    assert taken.sum() + ground.sum() == pytest.approx(24 * 17, rel=1e-4)


def test_the_order_of_crowns_does_not_matter() -> None:
    grid, other, some = LightGrid(17, 24, 1.0), LightGrid(17, 24, 1.0), crowns(80, 1)
    turned = Crowns(*(getattr(some, f.name)[::-1] for f in fields(Crowns)))
    grid.fill(some)
    other.fill(turned)
    assert np.array_equal(grid.light, other.light)


def test_less_light_never_makes_more() -> None:
    traits = StandTraits([MIXED[0]])
    site = even_site(SIDE)
    suitability = np.stack([site.suitability(needs) for needs in traits.needs])
    plants = planted(site, traits, suitability, 400.0, 1)
    open_, closed = LightGrid(40, 40, 1.0), LightGrid(40, 40, 1.0)
    own = plants.crowns(traits)
    roof = Crowns(*(np.array([v]) for v in (20.0, 20.0, 22.0, 9.0, 12.0, 3000.0, 0.0)))
    joined = Crowns(*(np.concatenate([getattr(own, f.name), getattr(roof, f.name)]) for f in fields(Crowns)))
    after = []
    for grid, some in ((open_, own), (closed, joined)):
        strips = grid.fill(some)
        taken = np.zeros(len(some.x))
        for i, index in enumerate(strips):
            taken[index] = grid.taken(i)
        after.append(grown(plants, own, taken[: len(plants)], grid, traits, slice(0, len(plants))))
    assert (after[0].basal >= after[1].basal).all() and after[0].basal.sum() > 1.05 * after[1].basal.sum()
    assert (after[0].vigor >= after[1].vigor).all()
    assert (after[1].basal >= plants.basal).all() and (after[1].height >= plants.height).all()


@pytest.mark.parametrize("threads", [1, 3])
def test_the_same_bytes_in_any_number_of_threads_and_chunks(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tetflora_addon.stands.light._BAND_CELLS", 300)
    monkeypatch.setattr("tetflora_addon.stands.light._STRIP_CELLS", 400)
    monkeypatch.setattr("tetflora_addon.stands.light._STRIP_ROWS", 4 + threads)
    monkeypatch.setattr("tetflora_addon.stands.grow._BLOCK", 100 * threads)
    parallel.set_threads(threads)
    try:
        assert same(run_to_end(grow(half_planted(), MIXED, YEARS)), records())
    finally:
        parallel.set_threads(0)


def test_plants_stay_where_they_may_be_and_are_sound() -> None:
    rows = records()
    x, y, z = rows.position.T
    assert (x >= -10.0).all() and (x <= 10.0 + 1e-4).all() and (y >= 5.0).all() and (y <= 45.0 + 1e-4).all()
    assert z.min() >= 0.0 and z.max() <= 8.0
    assert (rows.height >= YEARS.min_height - 1e-5).all()
    assert (rows.crown_base < rows.height).all() and (rows.crown_width > 0).all()
    assert (np.abs(rows.offset) <= 0.6 + 1e-6).all()
    assert {0, 1} == set(rows.species.tolist())


def test_crowns_reach_down_the_slope_and_into_the_open() -> None:
    # It rises to the north, and the eastern half is bare.
    last = records().at(60.0)
    tall = last.take(np.flatnonzero((last.height > 8.0) & (last.dead == 0)))
    assert tall.offset[:, 1].mean() < -0.03
    edge = tall.take(np.flatnonzero(tall.position[:, 0] > 8.0))
    assert edge.offset[:, 0].mean() > 0.1


def test_the_dead_stay_dead_and_fall_once() -> None:
    rows = records()
    again = rows.plant[1:] == rows.plant[:-1]
    assert (rows.plant[1:] >= rows.plant[:-1]).all() and rows.plant[0] == 0
    assert (rows.year[1:][again] > rows.year[:-1][again]).all()
    assert (rows.dead[1:] >= rows.dead[:-1])[again].all()
    assert (rows.lying[1:] >= rows.lying[:-1])[again].all()
    assert rows.lying.any() and (rows.dead[rows.lying] > 0).all()
    assert np.allclose(np.linalg.norm(rows.lean[rows.lying], axis=1), 1.05 * LYING, rtol=1e-4)
    alive = rows.dead == 0
    grows = again & alive[1:] & alive[:-1]
    assert (rows.height[1:] >= rows.height[:-1])[grows].all() and (rows.diameter[1:] >= rows.diameter[:-1])[grows].all()
    # What is dead has the size that it died with.
    assert np.array_equal(rows.height[1:][again & ~alive[1:]], rows.height[:-1][again & ~alive[1:]])


def test_thin_dead_trees_break_as_they_fall() -> None:
    rows = records()
    assert rows.diameter[rows.lying].min() >= 0.1 > rows.diameter[rows.dead > 0].min()


def test_dead_trees_fall_onto_the_ground() -> None:
    """Not across its border, where their tips hung in the air, but where there is room on neither side."""
    site, rows = half_planted(), records()
    lying = rows.take(np.flatnonzero(rows.lying))
    way = lying.lean / np.linalg.norm(lying.lean, axis=1)[:, None] * lying.height[:, None]
    foot = lying.position[:, :2] - (site.west, site.south)
    there, other = site.holds(*(foot + way).T), site.holds(*(foot - way).T)
    assert there.mean() > 0.75 and not (other & ~there).any()


def test_saplings_in_the_shade_have_crowns() -> None:
    """Of three tenths of their height at least: rods without leaves had been left of some."""
    last = records().at(60.0)
    young = last.take(np.flatnonzero((last.dead == 0) & (last.height < 3.0)))
    assert len(young) > 10
    assert (young.crown_width >= 0.299 * young.height).all()


def test_a_year_between_two_records_lies_between_them() -> None:
    rows = records()
    for year in (0.0, 10.0, 33.0, 60.0):
        there = rows.at(year)
        assert len(set(there.plant.tolist())) == len(there)
        exact = rows.take(np.flatnonzero(rows.year == year))
        assert set(exact.plant.tolist()) <= set(there.plant.tolist())
        known = there.take(np.isin(there.plant, exact.plant))
        assert np.allclose(known.height, exact.height) and np.array_equal(known.dead, exact.dead)
    before, now, after = (rows.at(year) for year in (33.0, 33.5, 34.0))
    all_there = np.intersect1d(np.intersect1d(before.plant, now.plant), after.plant)
    low, middle, high = (one.take(np.isin(one.plant, all_there)).height for one in (before, now, after))
    assert ((middle >= low - 1e-4) & (middle <= high + 1e-4)).all()
    assert len(rows.at(-1.0)) == 0 and len(rows.at(61.0)) == 0


def test_dense_stands_thin_themselves() -> None:
    stand = begun(even_site(60.0), MIXED[:1], StandSettings(years=70, interval=0, density=8000.0, recruits=0.0))
    traits, thinned = stand.traits, []
    for year in range(70):
        stand.step(year)
        plants = stand.plants
        thinned.append((len(plants), (traits.mass_factor[plants.species] * plants.basal**2 * plants.height).mean()))
    number, mass = np.log(np.array(thinned)[25:]).T
    assert -1.8 < np.polyfit(number, mass, 1)[0] < -1.2
    leaves = (plants.crowns(traits).leaves / traits.extinction[plants.species]).sum() / 3600.0
    assert 4.5 < leaves < 8.0


def test_a_disturbance_kills_all_and_others_follow_in_the_light() -> None:
    """Before it the stand is as without; after it trees are dead, stand or lie, and what lives came from seed."""
    short = replace(YEARS, years=46, interval=0)
    undisturbed = run_to_end(grow(half_planted(), MIXED, replace(short, years=40)))
    rows = run_to_end(grow(half_planted(), MIXED, replace(short, disturbance=6)))
    killed = rows.dead == 6
    assert set(rows.height[killed].tolist()) <= set(undisturbed.height[undisturbed.dead == 0].tolist())
    assert 0 < rows.lying[killed].sum() < killed.sum()
    alive = rows.take(np.flatnonzero(rows.dead == 0))
    assert len(alive) and alive.height.max() < 0.5 * rows.height[killed].max()
    lit = run_to_end(grow(half_planted(), MIXED, short))
    young = lit.height[lit.dead == 0] < alive.height.max()
    assert (alive.species == 1).sum() > (lit.species[lit.dead == 0][young] == 1).sum()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"years": 0}, "Years"),
        ({"disturbance": 61}, "Disturbance"),
        ({"density": np.nan}, "Planted"),
        ({"cell": 0.0}, "Cell"),
        ({"density": 1e6}, "Planted"),
        ({"density": 0.0, "recruits": 0.0}, "Nothing is planted"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(TetFloraError, match=words):
        run_to_end(grow(even_site(500.0), MIXED, replace(YEARS, **changes)))


def test_sites_that_cannot_be_are_refused() -> None:
    with pytest.raises(TetFloraError, match="moisture"):
        StandSite(0, 0, 1.0, np.zeros((3, 3)), moisture=np.zeros((2, 3)))
    with pytest.raises(TetFloraError, match="climate"):
        run_to_end(grow(even_site(20.0, coldest_month=-40.0), MIXED[:1], YEARS))


def test_a_stand_in_which_nothing_is_tall_enough_has_no_records() -> None:
    assert not len(run_to_end(grow(even_site(20.0), MIXED, replace(YEARS, years=2, min_height=150.0))))


def test_species_suit_their_climate() -> None:
    needs = Ecology(degree_days=600.0, coldest_month=-10.0, drought=3.0, waterlogging=1.0)
    high = StandSite(0, 0, 1.0, np.linspace(0, 2500, 50)[None, :], degree_days=1700.0, coldest_month=0.0)
    suitability = high.suitability(needs)
    assert (np.diff(suitability) <= 0).all() and suitability[0] > 0.8 and suitability[-1] == 0.0
    wet = np.linspace(0, 1, 50)[None, :]
    fresh = StandSite(0, 0, 1.0, 0 * wet, moisture=wet).suitability(needs)
    assert fresh[0] == 0.0 and fresh[-1] < 0.5 < fresh.max()
