# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of a stand, alive and dead, as structures of arrays, and random numbers of theirs.

What a simulation says: plants at several years, and what lies between these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Keys, Mask, column, nested
from ..growth.hashing import child_key, key_of_seed, uniform
from .light import Crowns
from .site import StandSite
from .traits import FULL, StandTraits

#: Tangent of the lean from which on a plant counts as lying.
LYING = 20.0


@dataclass(frozen=True)
class Records(Arrays):
    """Plants at a year, one row each; all rows of a plant are neighbors, years ascending."""

    plant: Integers32 = column(dtype=np.int32)  # (n,): number of the plant, ascending
    year: Floats32 = column(dtype=np.float32)  # (n,): of the simulation
    species: Integers32 = column(dtype=np.int32)  # (n,): index into the species
    seed: Integers32 = column(dtype=np.int32)  # (n,): from which it is drawn
    position: Floats32 = column(3, dtype=np.float32)  # (n, 3): foot of the trunk in the world, meters
    #: height, diameter, crown_width and crown_base, (n,): meters; the diameter is that at 1.3 m, 0 for what is smaller,
    #: the width the mean of all directions, and the base the height of the lowest limb.
    height: Floats32 = column(dtype=np.float32)
    diameter: Floats32 = column(dtype=np.float32)
    crown_width: Floats32 = column(dtype=np.float32)
    crown_base: Floats32 = column(dtype=np.float32)
    #: (n, 2): by which fraction limbs to the east and to the north are longer, and those opposite shorter.
    offset: Floats32 = column(2, dtype=np.float32)
    #: (n, 2): tangents of the trunk's tilt to the east and to the north; `LYING` or more long where it lies.
    lean: Floats32 = column(2, dtype=np.float32)
    dead: Floats32 = column(dtype=np.float32)  # (n,): years since death, 0 of what is alive

    @property
    def lying(self) -> Mask:
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
        return replace(first, year=years, **mixed)


def in_order(rows: Records) -> Records:
    """The same rows with those of each plant together, years ascending."""
    return rows.take(np.lexsort((rows.year, rows.plant)))


#: How crowns lie beside their trunks: the middle is moved by this much of the radius and the offset.
_BESIDE = 0.6


class StandDraw(IntEnum):
    """What a random number of a plant, or of a place, is drawn for."""

    X = 1
    Y = 2
    PLANTABLE = 3
    SPECIES = 4
    STRENGTH = 5
    SEED = 6
    DEATH = 7
    OLD = 8
    FALL = 9
    LEAN = 10
    LIE = 11
    COME = 12


@dataclass(frozen=True)
class Plants(Arrays):
    """Living plants."""

    number: Integers = column(dtype=np.int64)  # (n,): in the order in which they came
    key: Keys = column(dtype=np.uint64)  # (n,): of their random numbers
    species: Integers = column(dtype=np.int64)  # (n,)
    #: x and y, (n,): meters from the corner of the site.
    x: Floats
    y: Floats
    #: basal, height, base and radius, (n,): meters; basal diameter as `traits` has it.
    basal: Floats
    height: Floats
    base: Floats
    radius: Floats
    #: east and north, (n,): offset of the crown, as of `Records`.
    east: Floats
    north: Floats
    vigor: Floats  # (n,): growth of the last years over that of a free plant of the same basal diameter
    quality: Floats  # (n,): how well it grows where it is, 0 to 1
    strength: Floats  # (n,): how well it grows by nature, about 1
    age: Floats  # (n,): years
    known: Mask = column(dtype=bool)  # (n,): whether it has a record

    def crowns(self, traits: StandTraits) -> Crowns:
        """What takes light."""
        part = (self.height - self.base) / (FULL * self.height)
        area = np.pi * self.radius**2 * np.minimum(part, 1.0)
        leaves = area * np.take(traits.leaves * traits.extinction, self.species)
        x = self.x + _BESIDE * self.radius * self.east
        y = self.y + _BESIDE * self.radius * self.north
        return Crowns(x, y, self.radius, self.base, self.height, leaves, np.take(traits.crown_conicity, self.species))

    def records(self, year: float, traits: StandTraits, site: StandSite) -> Records:
        """What they are now; ``plant`` is their number still."""
        diameter, offset = traits.diameters(self.species, self.basal), np.stack([self.east, self.north], axis=1)
        identity = self.number, np.full(len(self), year), self.species, uniform(self.key, StandDraw.SEED) * 2.0**31
        crown = diameter, 2.0 * self.radius, self.base, offset
        upright = np.zeros((len(self), 2)), np.zeros(len(self))
        return Records.typed(*identity, _positions(self.x, self.y, site), self.height, *crown, *upright)


@dataclass(frozen=True)
class DeadPlants(Arrays):
    """Trees that stand dead or lie."""

    last: Records = nested(Records)  # what they were at their death
    #: died, falls and gone, (n,): years.
    died: Floats
    falls: Floats
    gone: Floats
    lean: Floats32 = column(2, dtype=np.float32)  # (n, 2): of their trunks when they lie

    def records(self, year: float) -> Records:
        """What they are in a year."""
        last = self.last
        lean = np.where((year > self.falls)[:, None], self.lean, np.float32(0.0))
        dead = (year - self.died).astype(np.float32)
        return replace(last, year=np.full(len(last), year, np.float32), lean=lean, dead=dead)


def _positions(x: NDArray, y: NDArray, site: StandSite) -> Floats32:
    return np.stack([site.west + x, site.south + y, site.ground(x, y)], axis=1).astype(np.float32)


def newcomers(
    key: Keys, first: int, species: NDArray, x: NDArray, y: NDArray, basal: NDArray, quality: NDArray,
    age: float, traits: StandTraits
) -> Plants:  # fmt: skip
    """Young plants (n,) at places (n,) in meters from the corner; those of a basal diameter stand as free ones do."""
    number, none = len(key), np.zeros(len(key))
    height = 0.8 * traits.heights(species, basal)
    # About normal, within half an inch of 1: the mean of two even numbers.
    strength = 1.0 + 0.3 * (uniform(key, StandDraw.STRENGTH) + uniform(child_key(key, 0), StandDraw.STRENGTH) - 1.0)
    return Plants(
        np.arange(first, first + number), key, species.astype(np.int64), x, y, basal, height, 0.1 * height,
        0.8 * traits.radii(species, basal), none, none, np.full(number, 0.6), quality, strength, np.full(number, age),
        np.zeros(number, bool),
    )  # fmt: skip


def keys_of(seed: int, what: int) -> Keys:
    """Key of random numbers of a sort in a stand."""
    return child_key(key_of_seed(seed), 2**33 + what)
