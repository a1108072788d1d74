# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of a stand, alive and dead, as structures of arrays, and random numbers of theirs.

What a simulation says: plants at several years, and what lies between these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, column, nested
from ..growth.hashing import child_key, key_of_seed, uniform
from .guilds import FULL, Guilds
from .light import Crowns
from .site import StandSite

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


#: How crowns lie beside their trunks: the middle is moved by this much of the radius and the offset.
_BESIDE = 0.6


class StandDraw(IntEnum):
    """What a random number of a plant, or of a place, is drawn for."""

    X = 1
    Y = 2
    PLANTABLE = 3
    GUILD = 4
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
    """Living plants.

    Attributes
    ----------
    number : (n,) int64
        In the order in which they came.
    key : (n,) uint64
        Of their random numbers.
    guild : (n,) int64
    x, y : (n,) float64
        Metres from the corner of the site.
    girth, height, base, radius : (n,) float64
        Metres; girth as `guilds` has it.
    east, north : (n,) float64
        Offset of the crown, as of `Records`.
    vigour : (n,) float64
        Growth of the last years over that of a free plant of the same girth.
    quality : (n,) float64
        How well it grows where it is, 0 to 1.
    strength : (n,) float64
        How well it grows by nature, about 1.
    age : (n,) float64
        Years.
    known : (n,) bool
        Whether it has a record.
    """

    number: NDArray[np.int64] = field(metadata=column(dtype=np.int64))
    key: NDArray[np.uint64] = field(metadata=column(dtype=np.uint64))
    guild: NDArray[np.int64] = field(metadata=column(dtype=np.int64))
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    girth: NDArray[np.float64]
    height: NDArray[np.float64]
    base: NDArray[np.float64]
    radius: NDArray[np.float64]
    east: NDArray[np.float64]
    north: NDArray[np.float64]
    vigour: NDArray[np.float64]
    quality: NDArray[np.float64]
    strength: NDArray[np.float64]
    age: NDArray[np.float64]
    known: NDArray[np.bool_] = field(metadata=column(dtype=bool))

    def crowns(self, guilds: Guilds) -> Crowns:
        """What takes light."""
        part = (self.height - self.base) / (FULL * self.height)
        area = np.pi * self.radius**2 * np.minimum(part, 1.0)
        leaves = area * np.take(guilds.leaves * guilds.extinction, self.guild)
        x = self.x + _BESIDE * self.radius * self.east
        y = self.y + _BESIDE * self.radius * self.north
        return Crowns(x, y, self.radius, self.base, self.height, leaves, np.take(guilds.top, self.guild))

    def leaf_area(self, guilds: Guilds) -> NDArray[np.float64]:
        """Leaf area (n,), m²."""
        return self.crowns(guilds).leaves / np.take(guilds.extinction, self.guild)

    def records(self, year: float, guilds: Guilds, site: StandSite) -> Records:
        """What they are now; ``plant`` is their number still."""
        number = len(self)
        return Records(
            self.number.astype(np.int32),
            np.full(number, year, np.float32),
            self.guild.astype(np.int32),
            (uniform(self.key, StandDraw.SEED) * 2.0**31).astype(np.int32),
            _positions(self.x, self.y, site),
            self.height.astype(np.float32),
            guilds.diameters(self.guild, self.girth).astype(np.float32),
            (2.0 * self.radius).astype(np.float32),
            self.base.astype(np.float32),
            np.stack([self.east, self.north], axis=1).astype(np.float32),
            np.zeros((number, 2), np.float32),
            np.zeros(number, np.float32),
        )


@dataclass(frozen=True)
class DeadPlants(Arrays):
    """Trees that stand dead or lie.

    Attributes
    ----------
    last : Records
        What they were at their death.
    died, falls, gone : (n,) float64
        Years.
    lean : (n, 2) float32
        Of their trunks when they lie.
    """

    last: Records = field(metadata=nested(Records))
    died: NDArray[np.float64]
    falls: NDArray[np.float64]
    gone: NDArray[np.float64]
    lean: NDArray[np.float32] = field(metadata=column(2, dtype=np.float32))

    def records(self, year: float) -> Records:
        """What they are in a year."""
        last = self.last
        lean = np.where((year > self.falls)[:, None], self.lean, np.float32(0.0))
        dead = (year - self.died).astype(np.float32)
        return Records(
            last.plant, np.full(len(last), year, np.float32), last.species, last.seed, last.position, last.height,
            last.diameter, last.crown_width, last.crown_base, last.offset, lean, dead,
        )  # fmt: skip


def _positions(x: NDArray, y: NDArray, site: StandSite) -> NDArray[np.float32]:
    return np.stack([site.west + x, site.south + y, site.ground(x, y)], axis=1).astype(np.float32)


def newcomers(
    key: NDArray[np.uint64], first: int, guild: NDArray, x: NDArray, y: NDArray, girth: NDArray, quality: NDArray,
    age: float, guilds: Guilds,
) -> Plants:  # fmt: skip
    """Young plants (n,) at places (n,) in metres from the corner; those of a girth stand as free ones do."""
    number, none = len(key), np.zeros(len(key))
    height = 0.8 * guilds.heights(guild, girth)
    # About normal, within half an inch of 1: the mean of two even numbers.
    strength = 1.0 + 0.3 * (uniform(key, StandDraw.STRENGTH) + uniform(child_key(key, 0), StandDraw.STRENGTH) - 1.0)
    return Plants(
        np.arange(first, first + number), key, guild.astype(np.int64), x, y, girth, height, 0.1 * height,
        0.8 * guilds.radii(guild, girth), none, none, np.full(number, 0.6), quality, strength, np.full(number, age),
        np.zeros(number, bool),
    )  # fmt: skip


def keys_of(seed: int, what: int) -> NDArray[np.uint64]:
    """Key of random numbers of a sort in a stand."""
    return child_key(key_of_seed(seed), 2**33 + what)
