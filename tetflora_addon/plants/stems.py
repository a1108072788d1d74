# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole branches with their axes, which is all that wood and leaves are made from; an axis is worked out only once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, spread
from .axes import Axes
from .branches import Branches
from .rows import flare_rings


@dataclass(frozen=True)
class Stems(Arrays):
    """Whole branches and their axes.

    Attributes
    ----------
    branches : Branches of n
    lines : Axes of the same n
    """

    branches: Branches
    lines: Axes

    def knots(self, rows: NDArray[np.void]) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Where segments begin and end; a flared base has some more.

        Returns
        -------
        owner : (m,) int64
            Branch of each place, in order; those of a branch from base to tip.
        t : (m,) float64
            Fraction of its axis.
        position : (m, 3) float64
        """
        rings = rows["rings"][self.branches.row]
        owner, index = spread(self.lines.segments + rings + 1)
        knot = index if not rings.any() else np.maximum(index - np.take(rings, owner), 0)
        t = knot / np.take(self.lines.segments, owner)
        position = self.lines.knot(owner, knot)
        if rings.any():  # the first segment is cut where the flare bends most
            at = np.concatenate([[0.0], flare_rings(int(rings.max()))])
            cut = np.flatnonzero((index <= rings[owner]) & (index > 0) & (rings[owner] > 0))
            t[cut] = at[index[cut]]
            position[cut] = self.lines.at(owner[cut], t[cut])[0]
        return owner, t, position
