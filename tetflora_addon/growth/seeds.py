# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds: all that is stored of a plant before it is needed (paper, section 5).

Beside it some have a crown shape, five numbers by which one plant differs from others of its kind because of how it
grew: a tree of a stand has a narrow crown far up, which leans to where the light is; one that is recorded in an
inventory has the crown that was measured.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Arrays, Floats, Integers, Integers32


@dataclass(frozen=True)
class Seeds(Arrays):
    """Plants at places: those of a scene, of a field, or of single objects."""

    #: Species that ``species`` counts through, as in the catalog; in a scene, kinds of plants.
    identifiers: tuple[str, ...]
    species: Integers32  # (n,): index into ``identifiers``
    seed: Integers  # (n,): random seed of each plant; any value
    position: Floats  # (n, 3): where the trunk leaves the ground, meters
    #: (n, 3, 3): rotation of each plant; its columns are the plant's axes in world space, +z along the upright trunk.
    frame: Floats
    scale: Floats  # (n,): uniform scale, greater than zero
    crown: Floats | None = None  # (n, 5): crown shapes, see `crown_shapes`; None where all plants are as described
    #: (n, 6): how plants move as a whole: meters a second, then the rotation vector about their foot, radians a second.
    #: None where all stand still.
    motion: Floats | None = None

    @classmethod
    def upright(cls, number: int, species: int = 0) -> Seeds:
        """So many plants of a species at the origin, of scale 1, with seeds from 0 on."""
        frame, kind = np.tile(np.eye(3), (number, 1, 1)), np.full(number, species, np.int32)
        return cls(("",), kind, np.arange(number), np.zeros((number, 3)), frame, np.ones(number))

    def counted_from(self, origin: Floats) -> Seeds:
        """The same plants in coordinates that begin at a place (3,) of the present ones."""
        return replace(self, position=self.position - origin) if origin.any() else self


#: Columns: factor on the lengths of limbs; bare fraction of the trunk, 0 as described; by which fraction limbs to the
#: east and to the north are longer, and those opposite shorter; factor on the radius of the trunk.
WIDTH, BASE, EAST, NORTH, THICKNESS = range(5)
#: A plant as its species describes it.
PLAIN = np.array([1.0, 0.0, 0.0, 0.0, 1.0])
#: Limits of each column.
LEAST = np.array([0.2, 0.0, -0.8, -0.8, 0.2])
MOST = np.array([3.0, 0.95, 0.8, 0.8, 5.0])


def farthest(forms: Floats | None) -> Floats | float:
    """How many times as far as described plants (n,) reach at most, by their crown shapes (n, 5)."""
    if forms is None:
        return 1.0
    return np.maximum(forms[:, WIDTH] * (1.0 + np.hypot(forms[:, EAST], forms[:, NORTH])), 1.0)


def crown_shapes(
    number: int,
    width: ArrayLike = 1.0,
    base: ArrayLike = 0.0,
    east: ArrayLike = 0.0,
    north: ArrayLike = 0.0,
    thickness: ArrayLike = 1.0,
) -> Floats:
    """Crown shapes (number, 5) of plants, within the limits; each argument is one number or (number,)."""
    out = np.empty((number, len(PLAIN)))
    for column, value in enumerate((width, base, east, north, thickness)):
        out[:, column] = np.clip(value, LEAST[column], MOST[column])
    return out
