# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What covers the ground under plants: how well each place suits what grows in light or shade, or falls from crowns."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..arrays import Floats, smoothstep
from ..growth.hashing import child_key, key_of_seed
from ..jobs import mapped
from .canopy import Canopy, Sheet, fallen_on, light_on
from .plane import clumps

#: How suitable places on the map (n, 2) are, (n,) from 0 to 1.
Suits = Callable[[Floats], Floats]

_PATCHES = 2**34  # keys of patches, away from those of plants and clumps
#: Fallen leaves that cover ground as far as it is covered at all, m² on a square meter; wood lies where they do, but is
#: spread wider.
_LEAVES, _WOOD = 1.2, 3.0
#: Fraction of low plants that dense litter smothers.
_SMOTHERED = 0.45
#: Leaves that lie on what is wholly suited to those that have just fallen, m² on a square meter: hardly any place under
#: any wood gets more.
FULL = 20.0
#: Roots and shadow of a dense crown leave this much of what wants shade.
_LEAST = 0.15


class Habitat(Enum):
    """Where plants of a kind are found, with the size of their patches in meters and how much they keep to them."""

    ANYWHERE = (0.0, 0.0)
    LIGHT = (3.5, 0.75)
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
        habitat : Habitat
        species : int or None
            What sheds it; anything if None, nothing that stands if -1.
        seed : int
            Of the patches.
        """
        size, keeps = habitat.value
        key = child_key(key_of_seed(seed), _PATCHES + list(Habitat).index(habitat))
        values = self.map_of(habitat, species)

        def suitable(points: Floats) -> Floats:
            found = self.sheet.at(values, points)
            return found * clumps(points, size, keeps, key) if keeps else found

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
            own = whole if species is None else self.fallen[species]
            if habitat is Habitat.FALLEN:  # in the same amount, not only where they hide the ground
                return np.minimum(own / FULL, 1.0)
            covered = 1.0 - np.exp(-whole / (_LEAVES if habitat is Habitat.LITTER else _WOOD))
            return covered * own / np.maximum(whole, 1e-12)
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
    """Mean linear RGB (cells, 3) of bare soil (3,) and what lies on it."""
    areas = [one.number * one.area * one.suits for one in strata]
    whole = sum(areas, np.full(cells, 1e-12))
    mean = sum((area[:, None] * one.color for area, one in zip(areas, strata, strict=True)), np.zeros((cells, 3)))
    hidden = covered(strata, cells)[:, None]
    return (1.0 - hidden) * soil + hidden * mean / whole[:, None]
