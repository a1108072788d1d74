# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages of the plants of a population follow from their seeds, around the age that is asked for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.planting.places import plant_ages

SEEDS = np.arange(20_000)


@given(st.lists(st.integers(0, 2**31 - 1), min_size=1, max_size=30), st.floats(0.1, 500), st.floats(0, 1))
def test_an_age_is_the_plants_own_whoever_else_there_is(seeds, age, spread):
    together = plant_ages(seeds, age, spread)
    np.testing.assert_array_equal(together, [plant_ages([seed], age, spread)[0] for seed in seeds])
    assert together.dtype == np.float32
    assert (together > 0.0).all()


def test_without_spread_all_are_of_one_age():
    assert set(plant_ages(SEEDS, 12.5, 0.0).tolist()) == {12.5}


@pytest.mark.parametrize("spread", [0.1, 0.5, 1.0])
def test_half_are_older_and_two_in_three_within_the_spread(spread):
    ages = plant_ages(SEEDS, 40.0, spread)
    assert np.median(ages) == pytest.approx(40.0, rel=0.02)
    within = (ages > 40.0 / (1.0 + spread)) & (ages < 40.0 * (1.0 + spread))
    assert within.mean() == pytest.approx(0.683, abs=0.02)
    assert ages.max() <= 40.0 * (1.0 + spread) ** 2.5 * 1.0001
