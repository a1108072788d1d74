# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a stand grows: ground, soil and masks of meshes as the engine takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...planting.height_grid import HeightGrid, cell_for, height_grid
from ...planting.plane import inside_any
from ...planting.site import lines_of_paths
from ...planting.terrain import Terrain
from ...planting.wetness import wet_ground
from ...stands.site import StandSite

#: Finest cells of the ground, meters, and their most.
_FINEST, _MOST = 1.0, 500_000
_LEVEL = 0.4  # wetness of ground that is neither ridge nor valley


@dataclass(frozen=True)
class Soil:
    """Climate and soil as the settings say, see `properties.TetFloraStand`; ``slope_max`` in radians."""

    degree_days: float
    coldest_month: float
    moisture: float
    relief: float
    fertility: float
    slope_max: float


def stand_site(ground: Terrain, soil: Soil) -> tuple[StandSite, NDArray[np.float64]]:
    """The site of a stand, and the place (2,) in the world that its coordinates are counted from.

    Raises
    ------
    SceneError
        No plant can be anywhere.
    """
    triangles = ground.triangles
    grid, wetness = _grid(triangles, soil.relief)
    there = np.isfinite(grid.height)
    if not there.any():
        raise SceneError(
            f"The ground is too small for a stand: no square of {grid.cell:g} m of it is seen from above; use a larger "
            "mesh"
        )
    height = _whole(grid.height)
    rise = [
        np.gradient(height, grid.cell, axis=a) if n > 1 else np.zeros_like(height) for a, n in enumerate(height.shape)
    ]
    plantable = there & (np.hypot(*rise) <= np.tan(min(soil.slope_max, 1.57)))
    if not plantable.any():
        raise SceneError(
            f"All of the ground is steeper than Max Slope ({np.degrees(soil.slope_max):.0f}°); raise Max Slope or use "
            "another mesh"
        )
    plantable = plantable * _masks(ground, grid)
    if not plantable.any():
        raise SceneError("Vertex Group, Areas, Paths or the biome's limits leave no ground for the stand; change them")
    moisture = np.full(height.shape, soil.moisture) + soil.relief * (wetness - _LEVEL)
    site = StandSite(
        0.0,
        0.0,
        grid.cell,
        height,
        plantable,
        moisture,
        np.full(height.shape, soil.fertility),
        soil.degree_days,
        soil.coldest_month,
    )
    return site, np.array([grid.west, grid.south])


def _grid(triangles: NDArray[np.float64], relief: float) -> tuple[HeightGrid, NDArray[np.float64]]:
    """The ground as a grid, and how wet it is (h, w)."""
    if relief > 0.0:
        wet = wet_ground(triangles)
        return wet.grid, np.nan_to_num(wet.wetness, nan=_LEVEL)
    grid = height_grid(triangles, cell_for(triangles, _FINEST, _MOST))
    return grid, np.full(grid.height.shape, _LEVEL)


def _masks(ground: Terrain, grid: HeightGrid) -> NDArray[np.float64]:
    """How suitable cells are (h, w), by what is drawn on the ground."""
    rows, columns = grid.height.shape
    x, y = (corner + grid.cell * (np.arange(n) + 0.5) for corner, n in ((grid.west, columns), (grid.south, rows)))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    suitable = np.ones(len(middles))
    if ground.weight is not None:
        # Weights stand on the triangles as heights do.
        lifted = ground.triangles.copy()
        lifted[..., 2] = np.clip(ground.weight, 0.0, 1.0)
        weights = height_grid(lifted, grid.cell).height
        suitable *= np.nan_to_num(weights).reshape(-1)
    if ground.areas:
        suitable *= inside_any(middles, ground.areas)
    paths = lines_of_paths(ground.paths)
    if paths is not None:
        suitable *= paths.nearness(middles) >= 1.0
    return suitable.reshape(rows, columns)


def _whole(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights (h, w) with what is missing beside the ground going on level."""
    out = height.copy()
    for _ in range(3):
        gaps = np.isnan(out)
        if not gaps.any():
            return out
        around = np.pad(out, 1, constant_values=np.nan)
        rows, columns = out.shape
        beside = np.stack(
            [around[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] for i, j in ((0, 1), (0, -1), (1, 0), (-1, 0))]
        )
        known = ~np.isnan(beside)
        mean = np.where(known, beside, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        out = np.where(gaps & known.any(axis=0), mean, out)
    return np.where(np.isnan(out), np.nanmean(height), out)
