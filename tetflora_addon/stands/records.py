# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a simulation says: plants at several years, and what lies between these."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, column

#: Tangent of the lean from which on a plant counts as lying.
LYING = 20.0


@dataclass(frozen=True)
class Records(Arrays):
    """Plants at a year, one row each; all rows of a plant are neighbours, years ascending.

    Attributes
    ----------
    plant : (n,) int32
        Number of the plant, ascending.
    year : (n,) float32
        Of the simulation.
    species : (n,) int32
        Index into the guilds.
    seed : (n,) int32
        From which it is drawn.
    position : (n, 3) float32
        Foot of the trunk in the world, metres.
    height, diameter, crown_width, crown_base : (n,) float32
        Metres; the diameter is that at 1.3 m, 0 for what is smaller, the width the mean of all directions, and the base
        the height of the lowest limb.
    offset : (n, 2) float32
        By which fraction limbs to the east and to the north are longer, and those opposite shorter.
    lean : (n, 2) float32
        Tangents of the trunk's tilt to the east and to the north; `LYING` or more long where it lies.
    dead : (n,) float32
        Years since death, 0 of what is alive.
    """

    plant: NDArray[np.int32] = field(metadata=column(dtype=np.int32))
    year: NDArray[np.float32] = field(metadata=column(dtype=np.float32))
    species: NDArray[np.int32] = field(metadata=column(dtype=np.int32))
    seed: NDArray[np.int32] = field(metadata=column(dtype=np.int32))
    position: NDArray[np.float32] = field(metadata=column(3, dtype=np.float32))
    height: NDArray[np.float32] = field(metadata=column(dtype=np.float32))
    diameter: NDArray[np.float32] = field(metadata=column(dtype=np.float32))
    crown_width: NDArray[np.float32] = field(metadata=column(dtype=np.float32))
    crown_base: NDArray[np.float32] = field(metadata=column(dtype=np.float32))
    offset: NDArray[np.float32] = field(metadata=column(2, dtype=np.float32))
    lean: NDArray[np.float32] = field(metadata=column(2, dtype=np.float32))
    dead: NDArray[np.float32] = field(metadata=column(dtype=np.float32))

    @property
    def lying(self) -> NDArray[np.bool_]:
        """Which lie (n,)."""
        return (self.lean * self.lean).sum(axis=1) >= (LYING * 0.999) ** 2

    def at(self, year: float) -> Records:
        """Plants that are there in a year, one row each: linear between two records.

        Before the first and after the last record of a plant it is not there.
        """
        year = np.float32(year)
        late = self.year >= year
        # The first row of a plant that is not before the year: of the same plant, the row before it is earlier.
        before = np.empty(len(self), bool)
        before[1:], before[:1] = (self.plant[1:] == self.plant[:-1]) & ~late[:-1], False
        after = np.flatnonzero(late & (before | (self.year == year)))
        there = np.where(before[after], after - 1, after)
        first, second = self.take(there), self.take(after)
        span = np.where(after > there, second.year - first.year, 1.0)
        part = np.where(after > there, (year - first.year) / span, 0.0).astype(np.float32)
        mixed = {
            name: (a := getattr(first, name)) + (getattr(second, name) - a) * (part if a.ndim == 1 else part[:, None])
            for name in ("position", "height", "diameter", "crown_width", "crown_base", "offset", "lean", "dead")
        }
        exact = part == 1.0
        for name, value in mixed.items():
            value[exact] = getattr(second, name)[exact]
        years = np.full(len(after), year, np.float32)
        return Records(first.plant, years, first.species, first.seed, **mixed)


def in_order(rows: Records) -> Records:
    """The same rows with those of each plant together, years ascending."""
    return rows.take(np.lexsort((rows.year, rows.plant)))
