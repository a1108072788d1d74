# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What covers the ground under plants: how well each place suits what grows in light or shade, or falls from crowns.

How much light of the sky standing plants leave, and where their leaves fall, are maps: grids of numbers over the
ground. Crowns are ellipsoids that are evenly filled with leaves. Light follows the law of Beer and Lambert along a few
directions; what falls is spread around the trunk, the wider the taller the plant. Sums run over plants in the order of
their places, so the order in which plants are given does not matter.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Self

import numpy as np

from ..arrays import Arrays, Floats, Integers, Integers32, bilinear, smoothstep, spread
from ..growth.hashing import child_key, key_of_seed
from ..jobs import mapped
from .plane import clumps

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

    def ordered(self) -> Self:
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
    def over(points: Floats, cell: float = _CELL, most: int = _MOST_CELLS) -> "Sheet":
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
    """Fraction (rows · columns,) of the sky's light on cells of ground, level at each plant; yields the work done."""
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
                chord = 2.0 * np.sqrt(np.maximum(b * b - a * ((u * u).sum(axis=1) - 1.0), 0.0)) / a / cosine
                depth += np.bincount(cell, thick[owner] * chord, minlength=len(depth))
                yield done
            light += weight / number * np.exp(-depth)
            done += weight / number
    return light


def fallen_on(sheet: Sheet, canopy: Canopy, kinds: int) -> Generator[float, None, Floats]:
    """Leaf area (kinds, rows · columns) that falls on cells by species, m² on a square meter; yields the work done."""
    canopy = canopy.ordered()
    out = np.zeros((kinds, sheet.rows * sheet.columns))
    reach = _BESIDE * canopy.radius + _DRIFT * (canopy.base + canopy.top) / 2.0
    # Never less than a cell, or plants between the middles of cells would shed nothing.
    reach = np.maximum(reach, 1.5 * sheet.cell)
    for kind in range(kinds):
        plants = np.flatnonzero((canopy.species == kind) & (canopy.area > 0.0))
        for owner, cell, away in sheet.pairs(canopy.position[plants, :2], reach[plants]):
            plant = plants[owner]
            rest = np.maximum(1.0 - (away * away).sum(axis=1) / reach[plant] ** 2, 0.0)
            falls = canopy.area[plant] * 3.0 / (np.pi * reach[plant] ** 2) * rest * rest
            out[kind] += np.bincount(cell, falls, minlength=out.shape[1])
            yield kind / kinds
    return out


#: How suitable places on the map (n, 2) are, (n,) from 0 to 1.
Suits = Callable[[Floats], Floats]

_PATCHES = 2**34  # keys of patches, away from those of plants and clumps
#: Fallen leaves that cover ground as far as it ever is, m² on a square meter; wood lies there too, but spread wider.
_LEAVES, _WOOD = 1.2, 3.0
_SMOTHERED = 0.45  # fraction of low plants that dense litter smothers
#: Leaves that lie on what is wholly suited to those that have just fallen, m² on a square meter: hardly any place under
#: any wood gets more.
FULL = 20.0
_LEAST = 0.15  # roots and shadow of a dense crown leave this much of what wants shade


class Habitat(Enum):
    """Where plants of a kind are found, with the size of their patches in meters and how much they keep to them."""

    ANYWHERE = (0.0, 0.0)
    LIGHT = (3.5, 0.25)
    HALF_SHADE = (2.4, 0.9)
    SHADE = (1.8, 0.85)
    LITTER = (1.1, 0.45)
    DEAD_WOOD = (6.0, 0.5)
    FALLEN = (1.0, 0.0)

    @property
    def falls(self) -> bool:
        """Whether it lies where it fell, and does not grow."""
        return self in (Habitat.LITTER, Habitat.DEAD_WOOD, Habitat.FALLEN)


@dataclass(frozen=True)
class Floor:
    """Maps of the ground under plants."""

    sheet: Sheet
    light: Floats  # (cells,): fraction of the light of the sky
    fallen: Floats  # (species, cells): leaves that fall, m² on a square meter

    def suits(self, habitat: Habitat, species: int | None, seed: int) -> Suits:
        """How suitable places are for a habitat.

        Parameters
        ----------
        species : int or None
            What sheds it; anything if None, nothing that stands if -1.
        seed : int
            Of the patches.
        """
        size, keeps = habitat.value
        key = child_key(key_of_seed(seed), _PATCHES + list(Habitat).index(habitat))
        values = self.map_of(habitat, species)

        def suitable(points: Floats) -> Floats:
            shares = self.sheet.at(values, points)
            return shares * clumps(points, size, keeps, key) if keeps else shares

        return suitable

    def map_of(self, habitat: Habitat, species: int | None) -> Floats:
        """The same for each cell, (cells,), without patches."""
        light = self.light
        if habitat is Habitat.LIGHT:
            return smoothstep(light, 0.12, 0.6)
        if habitat is Habitat.HALF_SHADE:
            return self._smothered() * smoothstep(light, 0.03, 0.2) * (1.0 - 0.85 * smoothstep(light, 0.45, 0.95))
        if habitat is Habitat.SHADE:
            shade = np.maximum(1.0 - smoothstep(light, 0.25, 0.85), 0.1)
            return self._smothered() * shade * np.maximum(smoothstep(light, 0.0, 0.06), _LEAST)
        if habitat.falls:
            whole = self.fallen.sum(axis=0)
            if species is not None and not 0 <= species < len(self.fallen):
                return np.zeros(len(light))
            fallen = whole if species is None else self.fallen[species]
            if habitat is Habitat.FALLEN:  # in the same amount, not only where they hide the ground
                return np.minimum(fallen / FULL, 1.0)
            covered = 1.0 - np.exp(-whole / (_LEAVES if habitat is Habitat.LITTER else _WOOD))
            return covered * fallen / np.maximum(whole, 1e-12)
        return np.ones(len(light))

    def _smothered(self) -> Floats:
        """What fallen leaves leave of low plants, (cells,)."""
        return 1.0 - _SMOTHERED * (1.0 - np.exp(-self.fallen.sum(axis=0) / _LEAVES))


def mapping(sheet: Sheet, canopy: Canopy, kinds: int) -> Generator[float, None, Floor]:
    """Light and what falls on the ground under plants; yields the fraction of the work that is done."""
    steps, parts = (light_on(sheet, canopy), fallen_on(sheet, canopy, kinds)), []
    for number, step in enumerate(steps):
        parts.append((yield from mapped(step, lambda done, before=number: (before + done) / len(steps))))
    return Floor(sheet, *parts)


@dataclass(frozen=True)
class Stratum:
    """One kind of plants of a ground cover, for the color of the ground."""

    suits: Floats  # (cells,)
    number: float  # plants on a square meter that suits
    area: float  # of one plant seen from above, m²
    color: Floats  # (3,): linear RGB


def covered(strata: Sequence[Stratum], cells: int) -> Floats:
    """Fraction (cells,) of the ground that plants hide from above, as if they were strewn by chance."""
    return 1.0 - np.exp(-sum((one.number * one.area * one.suits for one in strata), np.zeros(cells)))


def tinted(strata: Sequence[Stratum], soil: Floats, cells: int) -> Floats:
    """Mean linear RGB (cells, 3) of bare soil (3,) or (cells, 3) and what lies on it."""
    areas = [one.number * one.area * one.suits for one in strata]
    whole = sum(areas, np.full(cells, 1e-12))
    mean = sum((area[:, None] * one.color for area, one in zip(areas, strata, strict=True)), np.zeros((cells, 3)))
    hidden = covered(strata, cells)[:, None]
    return (1.0 - hidden) * soil + hidden * mean / whole[:, None]
