# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Random choices that are spread evenly: in proportion, none left out, any run as good as all."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.growth.hashing import evenly, key_of_seed, systematic, thinned


@given(st.integers(1, 400), st.integers(0, 10**6))
def test_one_number_in_each_part_of_the_interval(count: int, seed: int) -> None:
    found = evenly(key_of_seed(seed + np.arange(count)), 1)
    assert (np.sort((found * count).astype(int)) == np.arange(count)).all()


@given(st.integers(1, 300), st.integers(1, 300))
def test_thinning_takes_from_all_along(number: int, places: int) -> None:
    """The k-th of p is from the k-th p-th of all: nothing is left out for long, nothing twice unless there are few."""
    index = thinned(number, places)
    assert (index >= 0).all() and (index < number).all()
    runs = np.arange(places) * number / places
    assert (index >= np.floor(runs)).all() and (index <= runs + number / places).all()


@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(16, 128))
def test_systematic_draws_are_in_proportion(seed: int, groups: int, number: int) -> None:
    """Each thing is drawn as often as its weight says, within one; nothing without weight; each group for itself."""
    random = np.random.default_rng(seed)
    n = 40 * groups
    weight, group, sort = random.random(n) * (random.random(n) < 0.8), np.arange(n) % groups, random.random(n)
    pick = systematic(weight, group, sort, np.full(groups, number)).reshape(groups, number)
    assert (group[pick] == np.arange(groups)[:, None]).all()
    total = np.bincount(group, weight)[group]
    assert (np.abs(np.bincount(pick.ravel(), minlength=n) - number * weight / total) <= 1 + 1e-9).all()
    assert (weight[pick] > 0).all()


def test_a_group_without_members_draws_from_all() -> None:
    weight = np.array([1.0, 3.0, 0.0])
    pick = systematic(weight, np.array([0, 0, 2]), np.arange(3.0), np.full(3, 64)).reshape(3, 64)
    assert [(pick[g] == 1).mean() for g in range(3)] == [0.75, 0.75, 0.75]


def test_any_run_of_draws_is_spread_over_all() -> None:
    """Means over any 32 of 1024 draws are those over all, much closer than chance would have them."""
    value = np.linspace(0, 1, 5000)
    drawn = value[systematic(np.ones(5000), np.zeros(5000, int), value, np.array([1024]))]
    runs = np.lib.stride_tricks.sliding_window_view(drawn, 32).mean(axis=1)
    assert np.abs(runs - 0.5).max() < 0.07  # by chance more than twice that
