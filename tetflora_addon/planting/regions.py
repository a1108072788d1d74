# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Areas and lines on the map: which points lie inside of closed curves, and how near they are to lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_SLABS = 4096  # at most, into which a polygon is cut
_CELLS = 4_000_000  # at most, of the grid of a set of lines
_ENTRIES = 3_000_000  # about as many pieces of lines are noted in the cells


def inside_any(points: NDArray[np.float64], polygons: Sequence[NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Which points lie in at least one polygon.

    Parameters
    ----------
    points : (n, 2) float64
    polygons : sequence of (k, 2) float64
        Closed; the last corner is followed by the first. Where one crosses itself, what is wound twice is outside.

    Returns
    -------
    (n,) bool
    """
    inside = np.zeros(len(points), bool)
    for polygon in polygons:
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        asked = np.flatnonzero(~inside & ((points >= low) & (points <= high)).all(axis=1))
        if len(asked):
            inside[asked] = _inside(points[asked], polygon)
    return inside


def _inside(points: NDArray[np.float64], polygon: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether a line to the east crosses the border an odd number of times; only edges of the own slab are asked."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    slabs, base = min(len(polygon), _SLABS), low.min()
    height = max((high.max() - base) / slabs, np.finfo(np.float64).tiny)

    def slab(y: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.clip((y - base) / height, 0, slabs - 1).astype(np.int64)

    first = slab(low)
    edge, offset = _repeated(slab(high) - first + 1)
    order = np.argsort(first[edge] + offset, kind="stable")
    begins = np.searchsorted((first[edge] + offset)[order], np.arange(slabs + 1))
    edge = edge[order]
    odd = np.zeros(len(points), bool)
    place, stop = begins[slab(points[:, 1])], begins[slab(points[:, 1]) + 1]
    asking = np.flatnonzero(place < stop)
    while len(asking):  # as often as the fullest slab has edges
        e, x, y = edge[place[asking]], points[asking, 0], points[asking, 1]
        spans = (start[e, 1] <= y) != (end[e, 1] <= y)
        rise = np.where(spans, end[e, 1] - start[e, 1], 1.0)
        odd[asking] ^= spans & (x < start[e, 0] + (y - start[e, 1]) * (end[e, 0] - start[e, 0]) / rise)
        place[asking] += 1
        asking = asking[place[asking] < stop[asking]]
    return odd


class Lines:
    """Straight pieces on the map, noted in the cells of a grid within their reach.

    A cell keeps only pieces that can be the nearest of any point in it, so that a long border costs no more than a
    short one.
    """

    def __init__(self, start: NDArray[np.float64], end: NDArray[np.float64], reach: NDArray[np.float64]) -> None:
        """Pieces from ``start`` to ``end``, (e, 2) each, and how far from them it matters, (e,) above 0; metres."""
        low = (np.minimum(start, end) - reach[:, None]).min(axis=0)
        span = (np.maximum(start, end) + reach[:, None]).max(axis=0) - low
        cell = max(reach.max() / 4.0, np.sqrt(span.prod() / _CELLS), span.max() / _CELLS)
        start, end, reach = _cut(start, end, reach, 2.0 * max(reach.max(), cell))
        reached = np.abs(end - start) + 2.0 * reach[:, None]
        while cell < span.max() and (reached / cell + 1.0).prod(axis=1).sum() > _ENTRIES:
            cell *= 1.5
        self.start, self.along, self.reach = start, end - start, reach
        self.low, self.cell = low, cell
        self.columns, self.rows = (np.floor(span / cell).astype(np.int64) + 1).tolist()
        first = self._column_row(np.minimum(start, end) - reach[:, None])
        last = self._column_row(np.maximum(start, end) + reach[:, None])
        wide = last - first + 1
        piece, offset = _repeated(wide.prod(axis=1))
        place = first[piece] + np.stack([offset % wide[piece, 0], offset // wide[piece, 0]], axis=1)
        number = place[:, 1] * self.columns + place[:, 0]
        # What is farther from a cell's middle than another's farthest place from it is nowhere in the cell the nearest.
        gap = self._gap(low + (place + 0.5) * cell, piece)
        half = cell * np.sqrt(0.5)
        surely = np.full(self.columns * self.rows, np.inf)
        np.minimum.at(surely, number, (gap + half) / reach[piece])
        useful = gap - half <= np.minimum(surely[number], 1.0) * reach[piece]
        order = np.argsort(number[useful], kind="stable")
        self.piece = piece[useful][order]
        self.begins = np.searchsorted(number[useful][order], np.arange(self.columns * self.rows + 1))

    def nearness(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Least ratio of distance to reach over all pieces, (n,) between 0 and 1; 1 where nothing is within reach."""
        ratio = np.ones(len(points))
        place = np.floor((points - self.low) / self.cell)
        within = np.flatnonzero(((place >= 0) & (place < (self.columns, self.rows))).all(axis=1))
        column, row = place[within].astype(np.int64).T
        at, stop = self.begins[row * self.columns + column], self.begins[row * self.columns + column + 1]
        while len(within):  # as often as the fullest cell has pieces
            open_ = at < stop
            within, at, stop = within[open_], at[open_], stop[open_]
            piece = self.piece[at]
            ratio[within] = np.minimum(ratio[within], self._gap(points[within], piece) / self.reach[piece])
            at = at + 1
        return ratio

    def _column_row(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        place = np.floor((points - self.low) / self.cell).astype(np.int64)
        return np.clip(place, 0, (self.columns - 1, self.rows - 1))

    def _gap(self, points: NDArray[np.float64], piece: NDArray[np.int64]) -> NDArray[np.float64]:
        """Distance of each point from its piece, metres."""
        start, along = self.start[piece], self.along[piece]
        length = np.maximum((along * along).sum(axis=1), np.finfo(np.float64).tiny)
        share = np.clip(((points - start) * along).sum(axis=1) / length, 0.0, 1.0)
        rest = points - start - share[:, None] * along
        return np.hypot(rest[:, 0], rest[:, 1])


def _cut(
    start: NDArray[np.float64], end: NDArray[np.float64], reach: NDArray[np.float64], longest: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Pieces of at most the given length in the place of long ones."""
    parts = np.ceil(np.linalg.norm(end - start, axis=1) / longest).astype(np.int64).clip(min=1)
    piece, offset = _repeated(parts)
    step = ((end - start) / parts[:, None])[piece]
    begin = start[piece] + offset[:, None] * step
    return begin, begin + step, reach[piece]


def _repeated(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each index as often as its count says, and which time it is, from 0."""
    index = np.repeat(np.arange(len(counts)), counts)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
