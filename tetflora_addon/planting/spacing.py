# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which points lie near others, and how to keep points apart: grids whose cells are as large as the distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NO_DISTANCE = 1e-4  # metres; less is none, and its cells could not be counted

# Points that are too close lie at most two cells apart. The own cell comes first: whoever is there is near.
_NEAR = sorted(
    ((i, j) for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) < 4), key=lambda s: s[0] ** 2 + s[1] ** 2
)


class Neighbours:
    """Points on the map, (m, 2), that others are asked to keep near or far."""

    def __init__(self, points: NDArray[np.float64], distance: float) -> None:
        """Sort the points by cell; the distance is at least `NO_DISTANCE`, metres."""
        self.distance = distance
        self.cell = distance / np.sqrt(2.0)
        cells = _cells(points, self.cell)
        order = np.argsort(cells)
        self.points, cells = points[order], cells[order]
        first = np.flatnonzero(np.diff(cells, prepend=cells[:1] - 1))
        self.cells, self.first = cells[first], np.append(first, len(points))

    def near(self, points: NDArray[np.float64], least: int = 1) -> NDArray[np.bool_]:
        """Which points, (n, 2), are closer than the distance to at least so many of the others, (n,)."""
        if not len(self.points) or not len(points):
            return np.zeros(len(points), bool)
        met_so_far = np.zeros(len(points), np.int64)
        far = np.arange(len(points))
        for step in _NEAR:
            wanted = _cells(points[far], self.cell, step)
            place = np.minimum(np.searchsorted(self.cells, wanted), len(self.cells) - 1)
            met = np.flatnonzero(self.cells[place] == wanted)
            asking, place, end = far[met], self.first[place[met]], self.first[place[met] + 1]
            while len(asking):  # as often as the fullest cell holds points
                gap = points[asking] - self.points[place]
                met_so_far[asking] += gap[:, 0] ** 2 + gap[:, 1] ** 2 < self.distance**2
                place = place + 1
                more = (place < end) & (met_so_far[asking] < least)
                asking, place, end = asking[more], place[more], end[more]
            far = far[met_so_far[far] < least]
        return met_so_far >= least


class Spacing:
    """Keeps points apart with a grid whose cells hold one point at most.

    Cells are as large as the distance is on their diagonal, so two points of a cell are always too close, and points
    that are too close lie at most two cells apart.

    Attributes
    ----------
    distance : float
        Metres.
    points : (m, 2) float64
        Those that stand; they may crowd cells.
    """

    def __init__(self, distance: float, occupied: NDArray[np.float64]) -> None:
        self.distance = distance
        self.cell = distance / np.sqrt(2.0)
        self.points = occupied

    @property
    def free(self) -> bool:
        """Whether there is no distance to keep."""
        return self.distance < NO_DISTANCE

    def admit(self, candidates: NDArray[np.float64], most: int) -> NDArray[np.int64]:
        """Indices of candidates, (k,) and at most ``most``, that keep their distance; earlier ones go first."""
        if self.free:
            return np.arange(min(most, len(candidates)))
        undecided = np.flatnonzero(~Neighbours(self.points, self.distance).near(candidates))
        chosen = []
        while len(undecided):
            # One speaker a cell, the earliest; those with no earlier speaker nearby are in.
            _, first = np.unique(_cells(candidates[undecided], self.cell), return_index=True)
            speakers = np.sort(undecided[first])
            winners = speakers[~self._outranked(candidates[speakers])]
            chosen.append(winners)
            undecided = undecided[~Neighbours(candidates[winners], self.distance).near(candidates[undecided])]
        kept = np.sort(np.concatenate(chosen))[:most] if chosen else np.zeros(0, np.int64)
        self.points = np.concatenate([self.points, candidates[kept]])
        return kept

    def _outranked(self, speakers: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which speakers, one a cell and in order of rank, have an earlier one too close."""
        outranked = np.zeros(len(speakers), bool)
        own = _cells(speakers, self.cell)
        order = np.argsort(own)
        cells = own[order]
        for step in _NEAR:
            wanted = _cells(speakers, self.cell, step)
            place = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
            other = order[place]
            met = np.flatnonzero((cells[place] == wanted) & (other < np.arange(len(speakers))))
            gap = speakers[met] - speakers[other[met]]
            outranked[met] |= gap[:, 0] ** 2 + gap[:, 1] ** 2 < self.distance**2
        return outranked


def _cells(points: NDArray[np.float64], cell: float, step: tuple[int, int] = (0, 0)) -> NDArray[np.int64]:
    place = np.floor(points / cell).astype(np.int64) + np.array(step)
    return place[:, 0] * np.int64(2**32) + place[:, 1]
