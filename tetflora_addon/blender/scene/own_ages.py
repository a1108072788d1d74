# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages and sizes that plants and fields have of their own, as they are stored."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Arrays, Floats, Integers, Mask
from ...errors import SceneError

MOST_YEARS = 10_000.0
#: Attribute of fields whose plants differ in their ages; one with `field_points.PREFIX` overrides it.
AGE = "age"


def stored_ages(plants: Sequence[bpy.types.Object]) -> Floats | None:
    """Ages (n,) of plants that are objects, or of fields without the attribute; None where all are full-grown.

    Raises
    ------
    SceneError
        An age that a script has stored and no slider gives; names the object.
    """
    ages = np.array([obj.tetflora.age for obj in plants], dtype=np.float64)
    bad = np.flatnonzero(~sound_ages(ages))
    if len(bad):
        raise SceneError(
            f'"{plants[bad[0]].name}": Age is {ages[bad[0]]:g}; it must be from 0 to {MOST_YEARS:,.0f} years. Set it '
            "again in the TetFlora tab of the sidebar"
        )
    return ages if ages.any() else None


def has_ages(field: bpy.types.Object) -> bool:
    """Whether points of a field have ages of their own, as far as they are stored."""
    return any(name in field.data.attributes for name in (f"tf_{AGE}", AGE))


def sound_ages(ages: NDArray[np.floating]) -> Mask:
    """Which ages are numbers within the limits."""
    return (ages >= 0.0) & (ages <= MOST_YEARS)


@dataclass(frozen=True)
class Lives:
    """All records (n,) of a history, and the year that is looked at."""

    now: float
    #: year, height, width, base, dead: (n,): As of `Sizes`
    year: Floats
    height: Floats
    width: Floats
    base: Floats
    dead: Floats
    first: Integers  # (n,): first record of the same plant; its records follow each other
    species: Integers  # (n,): number of the kind in the field


@dataclass(frozen=True)
class Sizes(Arrays):
    """Sizes of plants (n,), meters in the field's space; 0 is not known."""

    #: height, diameter, width, base: (n,): Of the plant, of its trunk at 1.3 m, mean width of its crown, height of its
    #: lowest limb
    height: Floats
    diameter: Floats
    width: Floats
    base: Floats
    dead: Floats  # (n,): years since it died; 0 alive
    offset: Floats  # (n, 2): by which fraction limbs to the east and north are longer
    fit: Floats  # (n, 2): factors on height and crown width that make up for what is random in the plant
    #: (n,): First record of the plant among those of ``lives``, where a history is to be animated
    plant: Integers | None = None
    lives: Lives | None = None  # all of that history
