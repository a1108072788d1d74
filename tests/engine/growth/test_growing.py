# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Growth with age: branches keep their place, none is sudden, and averages and bounds are those of every age."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.compiled.test_bounds import outside
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.growth.growth import branch_counts, children, trunks
from tetflora_addon.growth.rows import DEAD_ORDER
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.refinement.contents import subplant_totals
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.species import Ages, NodeLaw, Species
from tetflora_addon.subplants.pieces import wood_areas

AGE = {"full": 40, "height": [0.04, 1.2], "diameter": [0.03, 1.3], "lifespan": 160, "flowers": 8}
FORKED = {"forks": [2.3, 0.4], "fork_at": 0.3, "fork_levels": 2}


def species(**changes: Any) -> Species:
    """A small tree that grows."""
    return species_from_dict(support.small(**{"age": AGE, **changes}), "grower", "grower.json")


def rich() -> Species:
    """One with everything at once."""
    return species_from_dict({**support.RICH, "age": AGE}, "rich", "rich.json")


def at_age(one: Species, years: float) -> Flora:
    return compile_species([with_age(one, years)])


def limbs(flora: Flora, number: int) -> tuple[Branches, Branches]:
    """Trunks of some plants, and the living limbs on them and on the stems beyond their forks."""
    trunk = level = support.trunks(flora.rows, support.plants(np.arange(number)))
    found = []
    while len(level):
        level, _ = children(flora.rows, level)
        found.append(level.take(np.flatnonzero(flora.rows["order"][level.row] == 1)))
        level = level.take(np.flatnonzero(flora.rows["order"][level.row] == 0))
    return trunk, Branches.concatenate(found)


@given(
    place=st.floats(0, 2),
    begin=st.floats(0, 0.9),
    power=st.floats(0.2, 1),
    whole=st.floats(0.1, 200),
    below=st.floats(0.1, 200),
)
def test_nodes_and_places_are_inverse(place: float, begin: float, power: float, whole: float, below: float) -> None:
    law = NodeLaw(begin, 1.0, power, whole, below)
    assert law.place_of(law.number_at(place)) == pytest.approx(place, abs=1e-6 + 0.01 * begin)
    assert law.number_at(place + 0.01) >= law.number_at(place)


@pytest.mark.parametrize("forks", [{}, FORKED], ids=["straight", "forked"])
@pytest.mark.parametrize(("young", "old"), [(6, 9), (12, 20), (25, 39), (38, 60)])
def test_limbs_stay_where_they_are(forks: dict[str, Any], young: float, old: float) -> None:
    """Those of both ages are the same individuals at the same height, in the same direction from the trunk."""
    straight = {"curvature": [0, 0], "angle": [0, 0], "fork_angle": [0, 0], "branch_start": [0.2, 0.05]}
    one = species(order0={**straight, **forks})
    (_, before), (_, after) = (limbs(at_age(one, years), 40) for years in (young, old))
    shared, i, j = np.intersect1d(before.key, after.key, return_indices=True)
    assert len(np.unique(before.key)) == len(before.key)
    assert len(shared) > 0.25 * len(before)
    at_tip = before.position[i, 2] > 0.999 * before.position[:, 2].max()
    rise = np.abs(after.position[j, 2] - before.position[i, 2])[~at_tip]
    assert rise.max() < 1e-9 + 2e-3 * 3.5
    turn = [np.arctan2(one.frame[k, 1, 0], one.frame[k, 0, 0]) for one, k in ((before, i), (after, j))]
    assert np.abs(np.angle(np.exp(1j * (turn[1] - turn[0])))).max() < 1e-6


def test_limbs_appear_and_go_short() -> None:
    """From one year to the next, what is new or gone is short; and so are twigs on the limbs that both years have."""
    one = species(order1={"count_by_length": 0.6}, order2={"count_by_length": 0.5})
    longest = 0.35 * 3.5
    (_, last) = limbs(at_age(one, 20.0), 60)
    for years in np.arange(20.1, 21.0, 0.1):
        _, now = limbs(at_age(one, float(years)), 60)
        for some, others in ((now, last), (last, now)):
            alone = ~np.isin(some.key, others.key)
            assert some.length[alone].max(initial=0.0) < 0.12 * longest
        last = now


def test_close_to_the_full_age_plants_are_as_described() -> None:
    one = species(
        order0=FORKED, spur={"length": 0.05, "thickness": 0.1, "leaves": 3}, order1={"spurs": 2, "count_by_length": 0.5}
    )
    (_, described), (_, nearly) = (limbs(flora, 40) for flora in (compile_species([one]), at_age(one, 40 - 1e-7)))
    shared, i, j = np.intersect1d(described.key, nearly.key, return_indices=True)
    assert len(shared) > 0.99 * max(len(described), len(nearly))
    np.testing.assert_allclose(nearly.position[j], described.position[i], atol=1e-5)
    np.testing.assert_allclose(nearly.length[j], described.length[i], rtol=0.02, atol=1e-3)


@pytest.mark.parametrize("years", [1.0, 4.0, 12.0, 30.0, 70.0, 150.0, 165.0])
def test_averages_are_those_of_grown_plants(years: float) -> None:
    """Counts, areas of leaves and of wood, over some hundred plants."""
    flora = at_age(rich(), years)
    number = int(np.clip(1.2e6 / flora.polygons[0], 60, 400))
    trunk, pieces = support.grown(flora, support.plants(np.arange(number)))
    tips = pieces.take(pieces.t1 == 1)
    owner, _, size = support.leaves_of(flora, tips.branches)
    row = tips.branches.row[owner]
    plant = tips.branches.plant[owner]
    area = np.bincount(plant, size**2 * flora.leaf.area[row], number)
    expected = flora.leaf_areas(trunk)
    noise = 4 * area.std() / np.sqrt(number)
    assert abs(area.mean() - expected.mean()) <= noise + 0.01 * expected.mean()
    wood = (
        np.bincount(pieces.branches.plant, wood_areas(flora, pieces), number) / subplant_totals(flora, trunk).wood_area
    )
    assert abs(wood.mean() - 1) < 4 * wood.std() / np.sqrt(number) + 0.01


@pytest.mark.parametrize("sort", [0, 2])
@pytest.mark.parametrize("years", [3.0, 15.0, 33.0, 80.0])
def test_numbers_of_children_are_as_expected(years: float, sort: int) -> None:
    flora = at_age(rich(), years)
    level = support.trunks(flora.rows, support.plants(np.arange(4000)))
    counts = branch_counts(flora.rows, level, sort)
    expected = flora.rows["count"][0, sort, 0]
    assert abs(counts.mean() - expected) < 4 * counts.std() / np.sqrt(4000) + 0.01 * expected + 1e-9


@given(years=st.floats(0.2, 200), seed=st.integers(0, 1000))
@settings(deadline=None, max_examples=4)
def test_every_vertex_is_inside_the_bound(years: float, seed: int) -> None:
    flora = at_age(rich(), years)
    trunk = support.trunks(flora.rows, support.plants(np.arange(seed, seed + 2)))
    assert outside(flora, trunk) < 1e-6
    level, _ = children(flora.rows, trunk)
    assert outside(flora, level.take(np.s_[:: max(1, len(level) // 6)])) < 1e-6


def test_forks_are_not_there_before_the_trunk_is() -> None:
    """And stay at their height from then on, while radii change without a step."""
    one = species(order0={**FORKED, "curvature": [0, 0], "angle": [0, 0]})
    young, old = (at_age(one, years) for years in (5.0, 30.0))
    assert (young.rows["order"] == 0).sum() == 1 < (old.rows["order"] == 0).sum()
    heights = []
    for years in (22.0, 30.0, 60.0):
        flora = at_age(one, years)
        trunk = trunks(flora.rows, support.plants(np.arange(20)))
        heights.append(trunk.length)
    np.testing.assert_allclose(heights[1:], [heights[0]] * 2, rtol=1e-9)


def test_dead_branches_do_not_move() -> None:
    one = replace(rich(), ages=Ages(40, (0.04, 1.2), (0.03, 1.3), 160))
    found = []
    for years in (20.0, 30.0):
        flora = at_age(one, years)
        level = support.trunks(flora.rows, support.plants(np.arange(60)))
        level, _ = children(flora.rows, level)
        found.append(level.take(np.flatnonzero(flora.rows["order"][level.row] == DEAD_ORDER)))
    shared, i, j = np.intersect1d(found[0].key, found[1].key, return_indices=True)
    assert len(shared) > 5
    move = found[1].position[j, 2] - found[0].position[i, 2]
    assert np.abs(move).max() < 0.05
