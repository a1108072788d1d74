# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Wetness as a rule of populations, and zones: where kinds of land begin, end and blend."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.errors import SceneError
from tetflora_addon.planting.places import place
from tetflora_addon.planting.plane import Terrain
from tetflora_addon.planting.rules import Rules
from tetflora_addon.planting.site import Limits, Zone, distance_lines, soft_between
from tetflora_addon.planting.wetness import wet_ground


def _valley(side: float = 60.0, number: int = 30) -> np.ndarray:
    """Triangles of a valley that falls to the south."""
    x, y = np.meshgrid(np.linspace(0, side, number + 1), np.linspace(0, side, number + 1))
    p = np.stack([x, y, 0.4 * np.abs(x - side / 2) + 0.06 * y], axis=-1)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]
    return np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


VALLEY = _valley()
BUSY = Rules(by_density=True, density=0.5, seed=3)


def test_open_limits_change_nothing():
    """Rules and zones without limits leave all as it is, to the bit."""
    plain = place(Terrain(VALLEY), BUSY)
    for other in (
        place(Terrain(VALLEY), Rules(**(vars(BUSY) | {"wetness_softness": 0.7}))),
        place(Terrain(VALLEY), BUSY, zones=(Zone(Limits()), Zone(Limits(path_min=0.0)))),
    ):
        assert np.array_equal(plain.position, other.position) and np.array_equal(plain.seed, other.seed)


@given(st.floats(0.2, 0.8), st.floats(0.0, 0.5))
@settings(max_examples=8, deadline=None)
def test_what_is_too_dry_and_what_is_too_wet_are_all(limit, softness):
    """Plants above a limit and those below it, with the same seed, are those without a limit, where it is sharp; none
    is outside of the soft edge."""
    wet = wet_ground(VALLEY)
    low = place(Terrain(VALLEY), Rules(**(vars(BUSY) | {"wetness_max": limit, "wetness_softness": softness})))
    high = place(Terrain(VALLEY), Rules(**(vars(BUSY) | {"wetness_min": limit, "wetness_softness": softness})))
    assert (wet.at(low.position) <= limit + 0.5 * softness + 1e-9).all()
    assert (wet.at(high.position) >= limit - 0.5 * softness - 1e-9).all()
    if softness < 1e-9:
        assert len(low) + len(high) == len(place(Terrain(VALLEY), BUSY))


def test_impossible_wetness_is_refused():
    """Limits that exclude each other, and ground that is nowhere as wet."""
    with pytest.raises(SceneError, match=r"Min Wetness is 0\.8"):
        place(Terrain(VALLEY), Rules(wetness_min=0.8, wetness_max=0.2))
    dry = np.array([[[0, 0, 0], [30, 0, 20], [30, 30, 20]], [[0, 0, 0], [30, 30, 20], [0, 30, 0]]], float)
    with pytest.raises(SceneError, match="as wet as Min and Max Wetness"):
        place(Terrain(dry), Rules(count=50, wetness_min=0.99))


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 0.5))
@settings(max_examples=30, deadline=None)
def test_neighbors_along_a_limit_make_one(value, limit, softness):
    """What ends at a limit and what begins there add up to 1, but for the limit itself where it is sharp."""
    at = np.array([value])
    both = soft_between(at, -9, limit, softness, -9, 9) + soft_between(at, limit, 9, softness, -9, 9)
    assert both[0] == pytest.approx(1.0) or (value == limit and both[0] == 2.0)


def test_a_zone_and_its_inverse_share_the_ground():
    """Half of the plants stand in each where a mask is a half; masks, distances, slopes and altitudes limit."""
    rng = np.random.default_rng(1)
    weight = rng.uniform(size=VALLEY.shape[:2])
    lines = (np.array([[30.0, 0.0], [30.0, 60.0]]),)
    limits = Limits(altitude_max=9.0, altitude_softness=4.0, path_max=12.0, path_softness=6.0)
    zone = Zone(limits, weight=weight, lines=distance_lines(lines, limits))
    inverse = Zone(limits, weight, None, None, zone.lines, inverse=True)
    inside, outside = (place(Terrain(VALLEY), BUSY, zones=(z,)) for z in (zone, inverse))
    whole = len(place(Terrain(VALLEY), BUSY))
    assert abs(len(inside) + len(outside) - whole) < 4.0 * np.sqrt(whole)
    assert (np.abs(inside.position[:, 0] - 30.0) <= 15.0).all() and (inside.position[:, 2] <= 11.0).all()
    assert not len(place(Terrain(VALLEY), BUSY, zones=(Zone(Limits(slope_max=radians(5.0))),)))
    steep = place(Terrain(VALLEY), BUSY, zones=(Zone(Limits(slope_min=radians(5.0), slope_max=pi / 2)),))
    assert len(steep) == whole


def test_areas_do_not_move_masks():
    """Where large triangles are divided, places keep their mask."""
    square = np.array([[[0, 0, 0], [64, 0, 0], [64, 64, 0]], [[0, 0, 0], [64, 64, 0], [0, 64, 0]]], float)
    area = np.array([[8.0, 8.0], [56.0, 8.0], [56.0, 56.0], [8.0, 56.0]])
    east = square[..., 0] / 64.0  # the weight of a place is its x
    placed = place(Terrain(square, areas=(area,)), BUSY, zones=(Zone(Limits(), weight=(east > 0.99).astype(float)),))
    plain = place(Terrain(square, areas=(area,)), BUSY)
    assert 0.3 < len(placed) / len(plain) < 0.7
    assert placed.position[:, 0].mean() > plain.position[:, 0].mean() + 4.0
