# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What standing plants do to the ground under them: how much light of the sky they leave, and where their leaves fall.

Both are maps: grids of numbers over the ground. Crowns are ellipsoids that are evenly filled with leaves. Light follows
the law of Beer and Lambert along a few directions; what falls is spread around the trunk, the wider the taller the
plant. Sums run over plants in the order of their places, so the order in which plants are given does not matter.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Arrays, Floats, Integers, Integers32, bilinear, spread

#: Directions of the sky that light comes from: degrees from the vertical, how many, and the weight of all of them.
DIRECTIONS = ((0.0, 1, 0.2), (32.0, 5, 0.5), (55.0, 5, 0.3))
#: Leaf area that faces a direction, of the whole (leaves that lie in all directions), and how much lighter clusters are
#: than the even fog of the same area.
FACING, CLUSTERED = 0.5, 0.75
#: How far leaves fall: crown radii, and fraction of the height from which they come.
_BESIDE, _DRIFT = 1.1, 0.22
_CELL, _MOST_CELLS = 0.5, 600_000
_PAIRS = 1_500_000  # of plants and cells, worked out together


@dataclass(frozen=True)
class Canopy(Arrays):
    """Plants that stand, as far as the ground under them is concerned."""

    position: Floats  # (n, 3): feet, meters
    radius: Floats  # (n,): of the crown, meters
    #: base and top, (n,): heights above the foot between which the crown is, meters.
    base: Floats
    top: Floats
    area: Floats  # (n,): one-sided area of the leaves, m²
    species: Integers32  # (n,)

    def ordered(self) -> Canopy:
        """The same plants by place, so that sums do not depend on the order in which they were given."""
        x, y, z = self.position.T
        return self.take(np.lexsort((self.area, self.species, z, y, x)))


@dataclass(frozen=True)
class Sheet:
    """A rectangle of the map in square cells."""

    low: Floats  # (2,): corner with the smallest coordinates, meters
    cell: float  # meters
    columns: int
    rows: int

    @staticmethod
    def over(points: Floats, cell: float = _CELL, most: int = _MOST_CELLS) -> Sheet:
        """A sheet over all points (n, 2) or more columns, with at most about so many cells."""
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        size = np.maximum(high - low, 1e-3)
        cell = max(cell, float(np.sqrt(size.prod() / most)), float(size.max()) / most)
        columns, rows = (int(n) for n in np.ceil(size / cell))
        return Sheet(low, cell, columns, rows)

    def at(self, values: Floats, points: Floats) -> Floats:
        """Values (n,) of cells (rows · columns,) at points (n, 2), linear between the middles."""
        return bilinear(values.reshape(self.rows, self.columns), (points - self.low) / self.cell - 0.5)

    def pairs(self, middle: Floats, reach: Floats) -> Iterator[tuple[Integers, Integers, Floats]]:
        """Cells whose middles may lie within a reach (n,) of points (n, 2), some points at a time.

        Yields
        ------
        owner, cell : (m,) int64
            Point and cell of each pair.
        away : (m, 2) float64
            From the point to the middle of the cell, meters.
        """
        size = (self.columns, self.rows)
        first = np.clip(np.ceil((middle - reach[:, None] - self.low) / self.cell - 0.5), 0, size).astype(np.int64)
        last = np.clip(np.floor((middle + reach[:, None] - self.low) / self.cell - 0.5) + 1, 0, size).astype(np.int64)
        wide = np.maximum(last - first, 0)
        count = wide.prod(axis=1)
        chunk = (np.cumsum(count) - count) // _PAIRS
        for number in np.unique(chunk[count > 0]).tolist():
            chosen = np.flatnonzero((chunk == number) & (count > 0))
            owner, offset = spread(count[chosen])
            owner = chosen[owner]
            place = first[owner] + np.stack([offset % wide[owner, 0], offset // wide[owner, 0]], axis=1)
            away = self.low + (place + 0.5) * self.cell - middle[owner]
            yield owner, place[:, 1] * self.columns + place[:, 0], away


def light_on(sheet: Sheet, canopy: Canopy) -> Generator[float, None, Floats]:
    """Fraction of the light of the sky that reaches each cell of the ground, (rows · columns,) from 0 to 1.

    Yields the fraction of the work that is done. The ground is taken to be level around each plant.
    """
    canopy = canopy.ordered()
    half = np.maximum((canopy.top - canopy.base) / 2.0, 1e-3)
    wide = np.maximum(canopy.radius, 1e-3)
    height = canopy.base + half
    # What a meter of crown takes, of leaves that fill the ellipsoid evenly.
    thick = FACING * CLUSTERED * canopy.area / (4.0 / 3.0 * np.pi * wide**2 * half)
    light, done = np.zeros(sheet.rows * sheet.columns), 0.0
    for degrees, number, weight in DIRECTIONS:
        tangent, cosine = np.tan(np.radians(degrees)), np.cos(np.radians(degrees))
        for turn in 2.0 * np.pi * np.arange(number) / number:
            aside = tangent * np.array([np.cos(turn), np.sin(turn)])
            depth = np.zeros(len(light))
            # The shadow's middle lies opposite to where the light comes from.
            middle = canopy.position[:, :2] - height[:, None] * aside
            for owner, cell, away in sheet.pairs(middle, np.hypot(wide, half * tangent)):
                # Where along the ray the ellipsoid is: with the ray's point level with the crown's middle at `away`.
                u = away / wide[owner, None]
                v = aside / wide[owner, None]
                a = (v * v).sum(axis=1) + 1.0 / half[owner] ** 2
                b = (u * v).sum(axis=1)
                inside = b * b - a * ((u * u).sum(axis=1) - 1.0)
                chord = 2.0 * np.sqrt(np.maximum(inside, 0.0)) / a / cosine
                depth += np.bincount(cell, thick[owner] * chord, minlength=len(depth))
                yield done
            light += weight / number * np.exp(-depth)
            done += weight / number
    return light


def fallen_on(sheet: Sheet, canopy: Canopy, kinds: int) -> Generator[float, None, Floats]:
    """Leaf area (kinds, rows · columns) that falls on each cell from the plants of each species, m² on a square meter.

    Yields the fraction of the work that is done.
    """
    canopy = canopy.ordered()
    out = np.zeros((kinds, sheet.rows * sheet.columns))
    reach = _BESIDE * canopy.radius + _DRIFT * (canopy.base + canopy.top) / 2.0
    # Never less than a cell, or plants between the middles of cells would shed nothing.
    reach = np.maximum(reach, 1.5 * sheet.cell)
    for kind in range(kinds):
        own = np.flatnonzero((canopy.species == kind) & (canopy.area > 0.0))
        for owner, cell, away in sheet.pairs(canopy.position[own, :2], reach[own]):
            plant = own[owner]
            rest = np.maximum(1.0 - (away * away).sum(axis=1) / reach[plant] ** 2, 0.0)
            falls = canopy.area[plant] * 3.0 / (np.pi * reach[plant] ** 2) * rest * rest
            out[kind] += np.bincount(cell, falls, minlength=out.shape[1])
            yield kind / kinds
    return out
