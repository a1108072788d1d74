# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Branches, or what grows on them as well, as a structure of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import gathered


@dataclass(frozen=True)
class Pose:
    """Where branches are.

    Attributes
    ----------
    position : (n, 3) float64
    frame : (n, 3, 3) float64
    sky : (n, 3) float64
    """

    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    sky: NDArray[np.float64]

    def take(self, index: NDArray | slice) -> Pose:
        """Selection by indices, mask or slice."""
        return Pose(*(gathered(getattr(self, f.name), index) for f in fields(self)))


@dataclass(frozen=True)
class Branches:
    """Branches (or sub-plants) as a structure of arrays.

    Attributes
    ----------
    row : (n,) int32
        Row of the parameter table: which kind of branch of which species.
    plant : (n,) int32
        Index of the plant that it belongs to.
    key : (n,) uint64
        Hash of the plant's seed and the path of child indices.
    position : (n, 3) float64
        Base, metres, world space.
    frame : (n, 3, 3) float64
        Columns are the local axes at the base; the branch sets out along the third, the first points away from the
        parent.
    length, radius : (n,) float64
        Length of the axis and radius at its base, metres.
    scale : (n,) float64
        Scale of the plant, which leaves take as well.
    vigour : (n,) float64
        Length as the crown's shape has it here, relative to the longest; numbers of branches and leaves may follow it.
    outward : (n,) float64
        Where it leaves its limb (the branch of order 1), 0 inside the crown to 1 outside; 0 for limbs and trunks
        themselves, along which it grows.
    sky : (n, 3) float64 or None
        In the wind: where the direction that was up without it has turned to. Plants grow towards that, so that wind
        moves them and does not change how they grow.
    later : Pose or None
        Position and frame a moment later, where it is asked how plants move.
    """

    row: NDArray[np.int32]
    plant: NDArray[np.int32]
    key: NDArray[np.uint64]
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    length: NDArray[np.float64]
    radius: NDArray[np.float64]
    scale: NDArray[np.float64]
    vigour: NDArray[np.float64]
    outward: NDArray[np.float64]
    sky: NDArray[np.float64] | None = None
    later: Pose | None = None

    def __len__(self) -> int:
        return len(self.row)

    def take(self, index: NDArray | slice) -> Branches:
        """Selection by indices, mask or slice."""
        now = (gathered(getattr(self, name), index) for name in _ARRAYS)
        sky = None if self.sky is None else gathered(self.sky, index)
        return Branches(*now, sky, None if self.later is None else self.later.take(index))

    def moved(self) -> Branches:
        """The same a moment later; only where that is known."""
        return replace(self, **vars(self.later), later=None)

    @classmethod
    def concatenate(cls, parts: Sequence[Branches]) -> Branches:
        """All branches of several in one."""
        now = (np.concatenate([getattr(p, name) for p in parts]) for name in _ARRAYS)
        some = [p for p in parts if len(p)]  # no branches know nothing of the wind, and need not
        sky = later = None
        if some and some[0].sky is not None:
            sky = np.concatenate([p.sky for p in some])
        if some and some[0].later is not None:
            later = Pose(*(np.concatenate([getattr(p.later, f.name) for p in some]) for f in fields(Pose)))
        return cls(*now, sky, later)

    @classmethod
    def empty(cls) -> Branches:
        """No branches."""
        floats = [np.zeros(s) for s in ((0, 3), (0, 3, 3), 0, 0, 0, 0, 0)]
        return cls(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, np.uint64), *floats)


_ARRAYS = tuple(f.name for f in fields(Branches) if f.name not in ("sky", "later"))
