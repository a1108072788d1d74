# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Branches, or what grows on them as well, as a structure of arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers32, Keys, column


@dataclass(frozen=True)
class Pose(Arrays):
    """Where branches are."""

    position: Floats  # (n, 3)
    frame: Floats  # (n, 3, 3)
    sky: Floats  # (n, 3)


@dataclass(frozen=True)
class Branches(Arrays):
    """Branches (or sub-plants) as a structure of arrays."""

    row: Integers32 = column(dtype=np.int32)  # (n,): row of the parameter table: which kind of branch of which species
    plant: Integers32 = column(dtype=np.int32)  # (n,): index of the plant that it belongs to
    key: Keys = column(dtype=np.uint64)  # (n,): hash of the plant's seed and the path of child indices
    position: Floats = column(3)  # (n, 3): base, meters, world space
    #: (n, 3, 3): columns are the local axes at the base; the branch sets out along the third, the first points away
    #: from the parent.
    frame: Floats = column(3, 3)
    #: length and radius, (n,): length of the axis and radius at its base, meters.
    length: Floats
    radius: Floats
    scale: Floats  # (n,): scale of the plant, which leaves take as well
    #: (n,): length as the crown's shape has it here, relative to the longest; numbers of branches and leaves may follow
    #: it.
    vigor: Floats
    #: (n,): where it leaves its limb (the branch of order 1), 0 inside the crown to 1 outside; 0 for limbs and trunks
    #: themselves, along which it grows.
    outward: Floats
    #: (n, 3): in the wind: where the direction that was up without it has turned to. Plants grow toward that, so that
    #: wind moves them and does not change how they grow.
    sky: Floats | None = None
    later: Pose | None = None  # position and frame a moment later, where it is asked how plants move
    #: (n, 2): on a day of the year: the day that it is for the plant, and its place among the autumn colors of its
    #: species.
    year: Floats | None = None
    #: (n, 5): where plants have crown shapes: what trunks and their stems know of these, see `crown_effects`; of all
    #: others the factor on their length in the first column, and 0.
    crown: Floats32 | None = None

    @classmethod
    def apart(cls, row: int, key: NDArray, frame: NDArray, length: float, scale: float) -> Branches:
        """Branches (n,) of one row at the origin, of radius 1, as long as any and each a plant of its own."""
        one, kind = np.ones(len(key)), np.full(len(key), row, np.int32)
        plant, place = np.arange(len(key), dtype=np.int32), np.zeros((len(key), 3))
        return cls(kind, plant, key, place, frame, length * one, one, scale * one, one, 0.0 * one)

    def moved(self) -> Branches:
        """The same a moment later; only where that is known."""
        return replace(self, **vars(self.later), later=None)
