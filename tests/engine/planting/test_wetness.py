# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground as a grid of heights, and where water gathers on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.errors import SceneError
from tetflora_addon.planting import wetness as wet
from tetflora_addon.planting.wetness import cell_for, height_grid


def _middles(rows: int, columns: int, cell: float) -> tuple[np.ndarray, np.ndarray]:
    return np.meshgrid((np.arange(columns) + 0.5) * cell, (np.arange(rows) + 0.5) * cell)


def _triangles(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    p = np.stack([x, y, z], axis=-1)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]
    return np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


@given(
    st.floats(-2, 2), st.floats(-2, 2), st.floats(0.3, 3.0), st.integers(1, 12), st.floats(-40, 40), st.floats(-40, 40)
)
@settings(max_examples=40, deadline=None)
def test_a_plane_is_a_plane_of_heights(east, north, cell, number, west, south):
    """Whatever the triangles: each middle has its height, nothing is missing inside and nothing there is outside."""
    x, y = np.meshgrid(west + np.linspace(0, 17.3, number + 1), south + np.linspace(0, 11.9, number + 1))
    grid = height_grid(_triangles(x, y, east * x + north * y), cell)
    rows, columns = grid.height.shape
    middle_x, middle_y = _middles(rows, columns, cell)
    middle_x, middle_y = middle_x + grid.west, middle_y + grid.south
    inside = (
        (middle_x > west + 1e-6)
        & (middle_x < west + 17.3 - 1e-6)
        & (middle_y > south + 1e-6)
        & (middle_y < south + 11.9 - 1e-6)
    )
    assert not np.isnan(grid.height[inside]).any()
    known = ~np.isnan(grid.height)
    assert np.allclose(grid.height[known], (east * middle_x + north * middle_y)[known], atol=1e-6)
    assert (grid.west / cell) % 1.0 == pytest.approx(0.0, abs=1e-6) or (grid.west / cell) % 1.0 > 1.0 - 1e-6
    points = np.stack([middle_x[known], middle_y[known]], axis=1)
    assert np.allclose(grid.at(grid.height, points), grid.height[known])


def test_the_highest_surface_counts():
    """A bridge hides the ground; a wall has no area; what has none at all is missing."""
    x, y = np.meshgrid([0.0, 10.0], [0.0, 10.0])
    ground, bridge = _triangles(x, y, 0.0 * x), _triangles(x * 0.5, y, 0.0 * x + 3.0)
    wall = np.array([[[0.0, 0, 0], [10, 0, 0], [0, 0, 50]]])
    grid = height_grid(np.concatenate([bridge, ground, wall]), 1.0)
    assert (grid.height[:10, :5] == 3.0).all() and (grid.height[:10, 6:10] == 0.0).all()
    assert np.isnan(grid.height[10:]).all()
    with pytest.raises(SceneError, match="larger cells"):
        height_grid(ground, 1e-4)
    assert (10.0 / cell_for(ground, 1e-3, 10_000) + 2.0) ** 2 <= 10_000


def _bumps(seed: int, rows: int = 24, columns: int = 31) -> np.ndarray:
    height = np.random.default_rng(seed).uniform(0.0, 4.0, (rows, columns))
    height[5:9, 11:14] = np.nan
    return height


@given(st.integers(0, 2**31))
@settings(max_examples=25, deadline=None)
def test_no_water_is_lost(seed):
    """Filled ground has no hollows, is never lower, and what falls on it arrives at outlets."""
    height = _bumps(seed)
    surface = wet._filled(height, 2.0)
    there = ~np.isnan(height)
    assert (np.isnan(surface) == ~there).all() and (surface[there] >= height[there]).all()
    around = np.pad(surface, 1, constant_values=-np.inf)
    around = np.where(np.isnan(around), -np.inf, around)
    rows, columns = height.shape
    others = [around[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] for i, j, _ in wet._AROUND]
    assert (np.min(others, axis=0)[there] < surface[there]).all(), "each cell has a lower neighbor or a border"
    area = wet._catchment(surface, 2.0)
    inner = [np.where(np.isneginf(o), np.inf, o) for o in others]
    outlets = there & ~(np.min(inner, axis=0) < surface)
    assert area[outlets].sum() == pytest.approx(4.0 * there.sum())
    assert (area[there] >= 4.0).all()


def test_a_plane_gathers_by_its_length():
    """What is uphill of a meter of width is the distance from the top."""
    _, y = _middles(40, 60, 2.0)
    area = wet._catchment(wet._filled(-0.2 * y, 2.0), 2.0)
    assert np.allclose(area[:, 25:35] / 2.0, (2.0 * np.arange(1, 41))[:, None], rtol=0.05)
    assert np.allclose(wet.steepness(-0.2 * y, 2.0), 0.2)


def test_a_cone_sheds_evenly():
    """Uphill of a meter at the radius r are π r² of its top over 2 π r, all around."""
    x, y = _middles(81, 81, 1.0)
    radius = np.hypot(x - 40.5, y - 40.5)
    area = wet._catchment(-0.3 * radius, 1.0)
    ring = (radius > 24.0) & (radius < 32.0)
    ratio = area[ring] / (0.5 * radius[ring])
    assert 0.9 < ratio.mean() < 1.35 and ratio.std() / ratio.mean() < 0.2


def test_valleys_are_wet_and_ridges_dry():
    """Wetness falls from the floor of a valley to its ridges, and grows down the valley; a hollow is wet."""
    x, y = _middles(100, 81, 2.0)
    across = np.abs(x - 81.0)
    valley = wet.wetness(0.3 * across - 0.05 * y, 2.0)
    floor, slope = valley[20:, 38:43].max(axis=1), valley[20:, 20]
    assert (floor > slope + 0.2).all() and floor[-10:].mean() > floor[:10].mean()
    assert (slope > valley[20:, 0]).all()
    bowl = wet.wetness(np.minimum(0.02 * np.hypot(x - 80, y - 100) ** 2 / 10.0, 2.0), 2.0)
    assert bowl[50, 40] > 0.6
    assert (valley >= 0.0).all() and (valley <= 1.0).all()


@given(st.integers(0, 2**31))
@settings(max_examples=10, deadline=None)
def test_what_is_not_uphill_changes_nothing(seed):
    """More ground below a falling slope leaves the wetness above as it is, to the bit; so does turning the map."""
    rough = 0.2 * np.random.default_rng(seed).uniform(size=(40, 20))
    slope = np.arange(40.0)[::-1, None] + rough  # falls to the north, without hollows
    assert np.array_equal(wet.wetness(slope, 1.0)[:28], wet.wetness(slope[:30], 1.0)[:28])
    around = wet.topographic_index(_bumps(seed), 1.0)
    turned = wet.topographic_index(np.rot90(_bumps(seed)), 1.0)
    assert np.allclose(np.rot90(around), turned, equal_nan=True)
