# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets and leaves that stand in the light as they are drawn, and where light is sampled on them.

Leaves sit in clusters, and so do the facets that stand for them: half of the light that an even cloud would let
through to its surfaces does not reach those of a crown. Where sheets are drawn, they and not their tetrahedra shadow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .light_clouds import Clouds

#: Sheets of a tetrahedron on which light from all sides is sampled, at most, and of all of them, about.
SAMPLES, ALL_SAMPLES = 8, 32_000
# Side of a pixel for one sheet: most sheets then lie in one pixel alone.
_ROOMY = 1.5


@dataclass(frozen=True)
class Sheets:
    """Facets, leaves or other small opaque quadrilaterals: m of them, in n tetrahedra.

    Attributes
    ----------
    corners : (m, 4, 3) float64
        Metres; a triangle repeats a corner.
    cell : (m,) int64
        Tetrahedron (index into the clouds) of each, none negative; the nearest where it lies in none.
    replaced : (n,) bool
        Tetrahedra that throw no shadow themselves, since their sheets do.
    """

    corners: NDArray[np.float64]
    cell: NDArray[np.int64]
    replaced: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.cell)

    @classmethod
    def none(cls, count: int) -> Sheets:
        """No sheets among a number of tetrahedra."""
        return cls(np.zeros((0, 4, 3)), np.zeros(0, np.int64), np.zeros(count, bool))

    @classmethod
    def of(cls, corners: NDArray[np.float64], cell: NDArray[np.integer], count: int) -> Sheets:
        """Sheets in place of all tetrahedra that have some; those with a negative ``cell`` belong to the first."""
        replaced = np.bincount(cell[cell >= 0], minlength=count) > 0
        return cls(corners, np.maximum(cell, 0).astype(np.int64), replaced)

    def pixels(self, limits: tuple[int, int]) -> int:
        """Longer side of a buffer that sees all sheets, of which a pixel is somewhat larger than one."""
        if not len(self):
            return limits[0]
        vector = np.cross(self.corners[:, 2] - self.corners[:, 0], self.corners[:, 3] - self.corners[:, 1])
        side = np.sqrt(np.median(np.linalg.norm(vector, axis=1)) / 2.0)
        reach = np.ptp(self.corners.reshape(-1, 3), axis=0).max()
        return int(np.clip(reach / max(_ROOMY * side, 1e-9), *limits))

    def thinned(self, most: int) -> tuple[Sheets, NDArray[np.int64]]:
        """At most so many sheets, larger as they are fewer, and the number (m,) of each of these among them, or −1."""
        step = -(-len(self) // most)
        if step <= 1:
            return self, np.arange(len(self))
        # Evenly among those of each tetrahedron, whatever their order means.
        order = np.argsort(self.cell, kind="stable")[step // 2 :: step]
        number = np.full(len(self), -1)
        number[order] = np.arange(len(order))
        corners = self.corners[order]
        middle = corners.mean(axis=1, keepdims=True)
        grown = middle + (corners - middle) * np.sqrt(len(self) / len(order))
        return Sheets(grown, self.cell[order], self.replaced), number

    def samples(self, clouds: Clouds) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], KeyMeans]:
        """Where light from all sides is sampled.

        Returns
        -------
        points : (k, 3) float64
            The key points of each tetrahedron without sheets, and the middles of some sheets of each other one.
        cells, sheets : (k,) int64
            As for `Illumination.direct`.
        keys : KeyMeans
            Which key point each counts for.
        """
        key = np.arange(4 * len(clouds))
        key = key[~self.replaced[key // 4]]
        order = np.argsort(self.cell, kind="stable")
        cell = self.cell[order]
        counts = np.bincount(cell, minlength=len(clouds))
        place = np.arange(len(cell)) - (np.cumsum(counts) - counts)[cell]
        # Evenly among those of a tetrahedron, whatever their order means.
        most = int(np.clip(ALL_SAMPLES // max(len(clouds), 1), 1, SAMPLES))
        step = np.maximum(-(-counts[cell] // most), 1)
        chosen = order[(place % step == 0) & self.replaced[cell]]
        middle = self.corners[chosen].mean(axis=1)
        nearest = np.argmax(clouds.weights(middle, self.cell[chosen]), axis=1)
        points = np.concatenate([clouds.key_points.reshape(-1, 3)[key], middle])
        cells = np.concatenate([key // 4, self.cell[chosen]])
        sheets = np.concatenate([np.full(len(key), -1), chosen])
        return points, cells, sheets, KeyMeans(np.concatenate([key, 4 * self.cell[chosen] + nearest]), len(clouds))


class KeyMeans:
    """Means of samples over what counts for each of the 4 n key points.

    Parameters
    ----------
    key : (k,) int64
        Key point of each sample.
    count : int
        Number n of tetrahedra.
    """

    def __init__(self, key: NDArray[np.int64], count: int) -> None:
        self._key, self._count = key, count
        self._number = np.bincount(key, minlength=4 * count).reshape(count, 4)

    def means(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Means (4 n, ...) of values (k, ...); a key point without samples has its tetrahedron's mean."""
        flat = values.reshape(len(values), -1)
        sums = np.stack([np.bincount(self._key, column, 4 * self._count) for column in flat.T], axis=1)
        sums, number = sums.reshape(self._count, 4, -1), self._number[..., None]
        every = sums.sum(axis=1, keepdims=True) / np.maximum(number.sum(axis=1, keepdims=True), 1)
        result = np.where(number > 0, sums / np.maximum(number, 1), every)
        return result.reshape(4 * self._count, *values.shape[1:])

    def by_cell(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Means (n, ...) over the samples of each tetrahedron, from those (4 n, ...) of its key points."""
        values = values.reshape(self._count, 4, *values.shape[1:])
        weight = np.where(self._number.any(axis=1, keepdims=True), self._number, 1)
        weight = weight.reshape(self._count, 4, *(1,) * (values.ndim - 2))
        return (values * weight).sum(axis=1) / weight.sum(axis=1)
