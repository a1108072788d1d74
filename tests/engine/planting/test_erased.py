# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Placements less what stands on places that stay bare."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.planting.places import place, without
from tetflora_addon.planting.plane import Path, Terrain
from tetflora_addon.planting.rules import Rules

SQUARE = 20.0 * np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=np.float64)
PLACED = place(Terrain(SQUARE), Rules(count=200, tilt=0.5))
COORDINATE = st.floats(-5.0, 25.0)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(COORDINATE, COORDINATE, st.floats(0.05, 8.0)), max_size=12))
def test_just_the_plants_within_the_circles_are_left_out(circles):
    left = without(PLACED, [Path(np.array([[x, y]]), radius) for x, y, radius in circles])
    bare = np.zeros(len(PLACED), bool)
    for x, y, radius in circles:
        bare |= np.hypot(*(PLACED.position[:, :2] - (x, y)).T) < radius
    assert left.erased == bare.sum()
    for name in ("position", "azimuth", "scale", "species", "seed", "up", "rotation"):
        assert np.array_equal(getattr(left, name), getattr(PLACED, name)[~bare])
    assert (left.wanted, left.reason) == (PLACED.wanted, PLACED.reason)


def test_what_is_left_out_adds_up():
    half = Path(np.array([[0.0, 10.0], [20.0, 10.0]]), 2.0)
    first = without(PLACED, [half])
    second = without(first, [Path(np.array([[10.0, 0.0]]), 5.0)])
    assert first.erased > 0
    assert second.erased == len(PLACED) - len(second) > first.erased
    assert without(first, [half]).erased == first.erased
