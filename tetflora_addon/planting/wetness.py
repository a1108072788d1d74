# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How wet the ground is, from its shape alone: water runs downhill, gathers in hollows and stays where it is level.

Hollows are filled to where they flow over (Planchon & Darboux, "A fast, simple and versatile algorithm to fill the
depressions of digital elevation models", Catena 46, 2002); what is uphill of a cell follows from flow that spreads over
all lower neighbors (Freeman, "Calculating catchment area with divergent flow based on a regular grid", Computers &
Geosciences 17, 1991); wetness is the topographic index ln(a / tan β) (Beven & Kirkby, "A physically based, variable
contributing area model of basin hydrology", Hydrological Sciences Bulletin 24, 1979).
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from ..arrays import Floats
from .height_grid import HeightGrid, cell_for, height_grid

#: The topographic index, a in meters, that counts as dry and as wet: a ridge, and the floor of a valley with a brook.
DRY, WET = 2.0, 12.0
#: Finest cells of the ground that plants ask, meters, and their most.
_FINEST, _MOST = 1.0, 1_000_000
_LEVEL = 0.01  # tan β; less is as level
_DRAIN = 1e-6  # least fall of filled ground toward its outlet
_SPREAD = 1.1  # exponent of the fall (Freeman 1991): flow down a cone is even all around
# Neighbors of a cell: rows and columns away, and how far in cells.
_AROUND = tuple((i, j, float(np.hypot(i, j))) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)


def filled(height: Floats, cell: float) -> Floats:
    """Ground (h, w) without hollows, meters: each cell falls toward the border or toward NaN, from where water leaves.

    Notes
    -----
    All is flooded, and the flood sinks until each cell is as high as its ground, or a hair above its lowest neighbor.
    Rows are swept to and fro, then columns; the result does not depend on that.
    """
    ground = np.pad(height, 1, constant_values=np.nan)
    missing = np.isnan(ground)
    water = np.full(ground.shape, np.inf)
    for i, j, _ in _AROUND:
        outlet = ~missing[1:-1, 1:-1] & missing[1 + i : 1 + i + height.shape[0], 1 + j : 1 + j + height.shape[1]]
        water[1:-1, 1:-1][outlet] = height[outlet]
    ground = np.where(missing, np.inf, ground)  # what is not there holds no water back, and gives none
    while True:
        before = water.copy()
        for turned in (False, True):
            lines, floor = (water.T, ground.T) if turned else (water, ground)
            lines, floor = np.ascontiguousarray(lines), np.ascontiguousarray(floor)
            _sweep(lines, floor, range(1, len(lines) - 1), -1, cell)
            _sweep(lines, floor, range(len(lines) - 2, 0, -1), 1, cell)
            water = lines.T if turned else lines
        water = np.ascontiguousarray(water)
        if np.array_equal(before, water):
            break
    return np.where(np.isnan(height), np.nan, water[1:-1, 1:-1])


def _sweep(water: Floats, ground: Floats, lines: range, before: int, cell: float) -> None:
    """Let water of each line sink to the ground, or to a hair above that of the line before."""
    straight, oblique = _DRAIN * cell, _DRAIN * cell * np.sqrt(2.0)
    for line in lines:
        other, own = water[line + before], water[line, 1:-1]
        lowest = np.minimum(np.minimum(other[:-2], other[2:]) + oblique, other[1:-1] + straight)
        np.minimum(own, np.maximum(lowest, ground[line, 1:-1]), out=own)


def catchment(surface: Floats, cell: float) -> Floats:
    """Area that is uphill of each cell of a surface (h, w), with its own, (h, w) in m²; NaN where there is no ground.

    Cells without a lower neighbor are outlets. All of the area arrives at these.

    Notes
    -----
    A cell is done when all that flow into it are: as many rounds as the longest way of water has cells, each with only
    the cells that it finishes. What arrives is summed in the order of neighbors, so the result is the same anywhere.
    """
    rows, columns = surface.shape
    wide = columns + 2
    level = np.pad(np.where(np.isnan(surface), np.inf, surface), 1, constant_values=np.inf)
    there = np.isfinite(level)
    share = np.zeros((len(_AROUND), level.size))
    inner = (slice(1, -1), slice(1, -1))
    for k, (i, j, away) in enumerate(_AROUND):
        other = level[1 + i : 1 + i + rows, 1 + j : 1 + j + columns]
        with np.errstate(invalid="ignore"):
            fall = np.where(there[inner] & np.isfinite(other), level[inner] - other, 0.0) / (cell * away)
        share[k].reshape(level.shape)[inner] = np.maximum(fall, 0.0) ** _SPREAD
    total = share.sum(axis=0)
    share /= np.where(total > 0.0, total, 1.0)
    steps = np.array([i * wide + j for i, j, _ in _AROUND])
    waits = np.zeros(level.size, np.int64)
    for k, step in enumerate(steps.tolist()):
        giving = np.flatnonzero(share[k] > 0.0)
        waits[giving + step] += 1  # each cell once for one direction
    area = np.zeros(level.size)
    ready = np.flatnonzero(there.reshape(-1) & (waits == 0))
    while len(ready):
        came = np.full(len(ready), cell * cell)
        for k, step in enumerate(steps.tolist()):
            came += share[k, ready - step] * area[ready - step]
        area[ready] = came
        gives = share[:, ready] > 0.0
        reached = (ready + steps[:, None])[gives]
        np.subtract.at(waits, reached, 1)
        ready = np.unique(reached[waits[reached] == 0])
    return np.where(np.isnan(surface), np.nan, area.reshape(level.shape)[inner])


def steepness(surface: Floats, cell: float) -> Floats:
    """Tan β of each cell of a surface (h, w), from its neighbors to both sides where it has them; NaN stays."""
    around = np.pad(surface, 1, constant_values=np.nan)
    rises = []
    for line in (around[:, 1:-1], around[1:-1].T):
        below, above = line[1:-1] - line[:-2], line[2:] - line[1:-1]
        below, above = np.where(np.isnan(below), above, below), np.where(np.isnan(above), below, above)
        rises.append(np.nan_to_num(0.5 * (below + above)) / cell)
    return np.where(np.isnan(surface), np.nan, np.hypot(rises[0], rises[1].T))


def topographic_index(height: Floats, cell: float) -> Floats:
    """ln(a / tan β) of each cell, (h, w), a the area uphill for each meter of width; NaN where there is no ground.

    The larger of two: hollows keep what runs into them, and hollows are full and flow over.
    """
    index = [
        catchment(surface, cell) / cell / np.maximum(steepness(surface, cell), _LEVEL)
        for surface in (height, filled(height, cell))
    ]
    return np.log(np.maximum(*index))


def wetness(height: Floats, cell: float) -> Floats:
    """How wet each cell of a grid of heights (h, w) is, 0 for a ridge to 1 for the floor of a valley; NaN stays.

    Limits are fixed (`DRY`, `WET`): what is far away, and not uphill, changes nothing.
    """
    return np.clip((topographic_index(height, cell) - DRY) / (WET - DRY), 0.0, 1.0)


@dataclass(frozen=True)
class WetGround:
    """How wet a ground is."""

    grid: HeightGrid
    wetness: Floats  # (h, w): from 0 to 1, of each cell of the grid

    def at(self, points: Floats) -> Floats:
        """Wetness at places on the map (n, 2 or more), (n,); beyond all cells it is that of level ground."""
        return np.nan_to_num(self.grid.at(self.wetness, points), nan=0.5)


_kept: dict[bytes, WetGround] = {}  # the last one, by content: layers of plants ask for the same ground


def wet_ground(triangles: Floats) -> WetGround:
    """How wet a ground (t, 3, 3) is; that of the last one is kept."""
    key = blake2b(np.ascontiguousarray(triangles).data, digest_size=16).digest()
    made = _kept.get(key)  # other threads may forget it meanwhile
    if made is None:
        cell = cell_for(triangles, _FINEST, _MOST)
        grid = height_grid(triangles, cell)
        made = WetGround(grid, wetness(grid.height, cell))
        _kept.clear()
        _kept[key] = made
    return made
