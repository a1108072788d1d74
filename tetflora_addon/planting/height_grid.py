# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground as a regular grid of heights: what water, light and growth ask of it is asked of neighboring cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Integers, Mask, spread
from ..errors import SceneError

#: Most cells of a grid, whatever its use.
MOST_CELLS = 16_000_000
_ENTRIES = 1_000_000  # about as many cells are looked at together


@dataclass(frozen=True)
class HeightGrid:
    """Heights at the middles of square cells.

    Cells lie on a lattice through the world's origin, so that they do not move when ground is added beside.
    """

    #: west and south: corner of the first cell, meters in world space.
    west: float
    south: float
    cell: float  # side of a cell, meters
    #: (h, w): of the highest surface, meters; the first row is the southernmost. NaN where there is no ground.
    height: Floats

    def at(self, values: Floats, points: Floats) -> Floats:
        """Values (h, w) of cells at places on the map (n, 2 or more), linear between middles, (n,).

        Cells of NaN do not count; NaN comes back where all four around a place are.
        """
        rows, columns = values.shape
        place = (points[:, :2] - (self.west, self.south)) / self.cell - 0.5
        low = np.floor(place)
        part = np.clip(place - low, 0.0, 1.0)
        low = low.astype(np.int64)
        total, weights = np.zeros(len(points)), np.zeros(len(points))
        for i in (0, 1):
            for j in (0, 1):
                value = values[np.clip(low[:, 1] + j, 0, rows - 1), np.clip(low[:, 0] + i, 0, columns - 1)]
                weight = np.abs(1 - i - part[:, 0]) * np.abs(1 - j - part[:, 1])
                known = ~np.isnan(value)
                total += np.where(known, weight * np.where(known, value, 0.0), 0.0)
                weights += np.where(known, weight, 0.0)
        return np.where(weights > 0.0, total / np.where(weights > 0.0, weights, 1.0), np.nan)


def cell_for(triangles: Floats, finest: float, most: int) -> float:
    """Side of cells, meters: the finest, doubled until the ground (t, 3, 3) has no more than ``most`` of them."""
    span = np.ptp(triangles[..., :2].reshape(-1, 2), axis=0)
    cell = finest
    while (np.floor(span / cell) + 2.0).prod() > most:
        cell *= 2.0
    return cell


def height_grid(triangles: Floats, cell: float) -> HeightGrid:
    """Heights of the highest of all triangles.

    Parameters
    ----------
    triangles : (t, 3, 3) float64
        Corners, meters in world space; walls, which have no area on the map, do not count.
    cell : float
        Meters.

    Raises
    ------
    SceneError
        More than `MOST_CELLS`.
    """
    flat = triangles[..., :2].reshape(-1, 2)
    first = np.floor(flat.min(axis=0) / cell)
    columns, rows = np.maximum(np.ceil(flat.max(axis=0) / cell) - first, 1.0).tolist()
    if rows * columns > MOST_CELLS:
        raise SceneError(
            f"The ground is {rows * columns:,.0f} cells of {cell:g} m large; the limit is {MOST_CELLS:,}. "
            "Use larger cells or less ground"
        )
    rows, columns = int(rows), int(columns)
    west, south = (first * cell).tolist()
    # In cells, so that the middle of column j of row i is (j, i).
    corners = triangles.copy()
    corners[..., :2] = (triangles[..., :2] - (west, south)) / cell - 0.5
    slope, upright = _planes(corners)
    corners, slope = corners[upright], slope[upright]
    top = np.full(rows * columns, -np.inf)
    lowest = np.clip(np.ceil(corners[..., 1].min(axis=1) - _HAIR), 0, rows - 1).astype(np.int64)
    highest = np.clip(np.floor(corners[..., 1].max(axis=1) + _HAIR), -1, rows - 1).astype(np.int64)
    number = np.maximum(highest - lowest + 1, 0)
    at = 0
    ends = np.cumsum(number)
    while at < len(corners):  # some thousand rows of triangles together
        stop = max(at + 1, int(np.searchsorted(ends, (ends[at - 1] if at else 0) + _ENTRIES)))
        own, offset = spread(number[at:stop])
        _draw(corners, slope, own + at, lowest[own + at] + offset, columns, top)
        at = stop
    height = np.where(np.isneginf(top), np.nan, top).reshape(rows, columns)
    return HeightGrid(west, south, cell, height)


_HAIR = 1e-9  # of a cell: middles on a border belong to both sides


def _planes(corners: Floats) -> tuple[Floats, Mask]:
    """Rise of triangles along x and y, (t, 2), and which have an area on the map."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    size = np.abs(u[:, :2]).max(axis=1) + np.abs(v[:, :2]).max(axis=1)
    upright = np.abs(area) > 1e-12 * np.maximum(size * size, 1e-12)
    area = np.where(upright, area, 1.0)
    east = (u[:, 2] * v[:, 1] - v[:, 2] * u[:, 1]) / area
    north = (v[:, 2] * u[:, 0] - u[:, 2] * v[:, 0]) / area
    return np.stack([east, north], axis=1), upright


def _draw(corners: Floats, slope: Floats, own: Integers, row: Integers, columns: int, top: Floats) -> None:
    """Raise the cells of rows (k,) of the triangles ``own`` (k,) to these, in ``top`` (cells,)."""
    left, right = np.full(len(own), np.inf), np.full(len(own), -np.inf)
    for corner in range(3):
        a, b = corners[own, corner, :2], corners[own, (corner + 1) % 3, :2]
        rise = b[:, 1] - a[:, 1]
        meets = (np.minimum(a[:, 1], b[:, 1]) <= row + _HAIR) & (np.maximum(a[:, 1], b[:, 1]) >= row - _HAIR)
        along = np.clip((row - a[:, 1]) / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)
        x = a[:, 0] + along * (b[:, 0] - a[:, 0])
        # A level edge lies in the row with both of its ends.
        other = np.where(rise == 0.0, b[:, 0], x)
        left = np.where(meets, np.minimum(left, np.minimum(x, other)), left)
        right = np.where(meets, np.maximum(right, np.maximum(x, other)), right)
    met = left <= right
    own, row, left, right = own[met], row[met], left[met], right[met]
    first = np.clip(np.ceil(left - _HAIR), 0, columns).astype(np.int64)
    last = np.clip(np.floor(right + _HAIR), -1, columns - 1).astype(np.int64)
    number = np.maximum(last - first + 1, 0)
    ends = np.cumsum(number)
    at = 0
    while at < len(own):
        stop = max(at + 1, int(np.searchsorted(ends, (ends[at - 1] if at else 0) + _ENTRIES)))
        span, offset = spread(number[at:stop])
        span = span + at
        column, mine = first[span] + offset, own[span]
        corner = corners[mine, 0]
        height = corner[:, 2] + slope[mine, 0] * (column - corner[:, 0]) + slope[mine, 1] * (row[span] - corner[:, 1])
        # Planes of slivers are steep, and a hair beside them may be far above.
        height = np.clip(height, corners[mine, :, 2].min(axis=1), corners[mine, :, 2].max(axis=1))
        np.maximum.at(top, row[span] * columns + column, height)
        at = stop
