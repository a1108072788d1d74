# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds: all that is stored of a plant before it is needed (paper, section 5).

Beside it some have a crown shape, six numbers by which one plant differs from others of its kind because of how it
grew: a tree of a stand has a narrow crown far up, which leans to the light; one of an inventory has the crown measured.

Of what has begun to grow from them there are `Branches`.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Keys, column


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
    crown: Floats | None = None  # (n, 6): crown shapes, see `crown_shapes`; None where all plants are as described
    #: (n, 6): how plants move as a whole: meters a second, then the rotation vector about their foot, radians a second.
    #: None where all stand still.
    motion: Floats | None = None

    @classmethod
    def upright(cls, number: int, species: int = 0) -> Self:
        """So many plants of a species at the origin, of scale 1, with seeds from 0 on."""
        frame, kind = np.tile(np.eye(3), (number, 1, 1)), np.full(number, species, np.int32)
        return cls(("",), kind, np.arange(number), np.zeros((number, 3)), frame, np.ones(number))

    def counted_from(self, origin: Floats) -> Self:
        """The same plants in coordinates that begin at a place (3,) of the present ones."""
        return replace(self, position=self.position - origin) if origin.any() else self


#: Columns: factor on the lengths of limbs; bare fraction of the trunk, 0 as described; by which fraction limbs to the
#: east and to the north are longer, and those opposite shorter; factor on the radius of the trunk, and on the numbers
#: of what limbs bear, branches and leaves.
WIDTH, BASE, EAST, NORTH, THICKNESS, LEAVES = range(6)
#: A plant as its species describes it.
PLAIN = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 1.0])
#: Limits of each column.
LEAST = np.array([0.2, 0.0, -0.8, -0.8, 0.2, 0.01])
MOST = np.array([3.0, 0.95, 0.8, 0.8, 5.0, 6.0])


def farthest(forms: Floats | None) -> Floats | float:
    """How many times as far as described plants (n,) reach at most, by their crown shapes (n, 6)."""
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
    leaves: ArrayLike = 1.0,
) -> Floats:
    """Crown shapes (number, 6) of plants, within the limits; each argument is one number or (number,)."""
    out = np.empty((number, len(PLAIN)))
    for k, value in enumerate((width, base, east, north, thickness, leaves)):
        out[:, k] = np.clip(value, LEAST[k], MOST[k])
    return out


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
    #: (n, 3, 3): columns are axes at the base; the branch sets out along the third, the first is away from the parent.
    frame: Floats = column(3, 3)
    #: length and radius, (n,): length of the axis and radius at its base, meters.
    length: Floats
    radius: Floats
    scale: Floats  # (n,): scale of the plant, which leaves take as well
    #: (n,): length by the crown's shape, relative to the longest; numbers of branches and leaves may follow it.
    vigor: Floats
    #: (n,): where it leaves its limb (the branch of order 1), 0 inside the crown to 1 outside; 0 for limbs and trunks
    #: themselves, along which it grows.
    outward: Floats
    #: (n, 3): in the wind: where the direction that was up without it has turned to. Plants grow toward that, so that
    #: wind moves them and does not change how they grow.
    sky: Floats | None = None
    later: Pose | None = None  # position and frame a moment later, where it is asked how plants move
    #: (n, 2): on a day of the year: the day for the plant, and its place among the autumn colors of its species.
    year: Floats | None = None
    #: (n, 6): where plants have crown shapes: what trunks and their stems know of these, see `crown_effects`; of all
    #: others the factor on their length in the first column, that on what they bear in the last, and 0.
    crown: Floats32 | None = None

    @classmethod
    def apart(cls, row: int, key: NDArray, frame: NDArray, length: float, scale: float) -> Self:
        """Branches (n,) of one row at the origin, of radius 1, as long as any and each a plant of its own."""
        one, kind = np.ones(len(key)), np.full(len(key), row, np.int32)
        plant, place = np.arange(len(key), dtype=np.int32), np.zeros((len(key), 3))
        return cls(kind, plant, key, place, frame, length * one, one, scale * one, one, 0.0 * one)

    def moved(self) -> Self:
        """The same a moment later; only where that is known."""
        return replace(self, **vars(self.later), later=None)
