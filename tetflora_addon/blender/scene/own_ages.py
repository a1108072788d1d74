# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages and sizes that plants and fields have of their own, as they are stored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Arrays
from ...errors import SceneError

MOST_YEARS = 10_000.0
#: Attribute of fields whose plants differ in their ages; one with `field_points.PREFIX` overrides it.
AGE = "age"
#: The age of a plant, for property groups.
AGE_PROPERTY = {
    "name": "Age",
    "description": "Age in years; 0 is full-grown, as the species describes it. Species that are assets have none",
    "default": 0.0,
    "min": 0.0,
    "soft_max": 200.0,
    "max": MOST_YEARS,
    "step": 100,
    "precision": 1,
}


def stored_ages(plants: Sequence[bpy.types.Object]) -> NDArray[np.float64] | None:
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


def sound_ages(ages: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which ages are numbers within the limits."""
    return (ages >= 0.0) & (ages <= MOST_YEARS)


@dataclass(frozen=True)
class Lives:
    """All records (n,) of a history, and the year that is looked at.

    Attributes
    ----------
    year, height, dead : (n,) float64
        As of `Sizes`.
    first : (n,) int64
        First record of the same plant; its records follow each other.
    species : (n,) int64
        Number of the kind in the field.
    """

    now: float
    year: NDArray[np.float64]
    height: NDArray[np.float64]
    dead: NDArray[np.float64]
    first: NDArray[np.int64]
    species: NDArray[np.int64]


@dataclass(frozen=True)
class Sizes(Arrays):
    """Sizes of plants (n,), meters in the field's space; 0 is not known.

    Attributes
    ----------
    height, diameter, width, base : (n,) float64
        Of the plant, of its trunk at 1.3 m, mean width of its crown, height of its lowest limb.
    dead : (n,) float64
        Years since it died; 0 alive.
    offset : (n, 2) float64
        By which fraction limbs to the east and north are longer.
    fit : (n, 2) float64
        Factors on height and crown width that make up for what is random in the plant.
    plant : (n,) int64 or None
        First record of the plant among those of ``lives``, where a history is to be animated.
    lives : Lives or None
        All of that history.
    """

    height: NDArray[np.float64]
    diameter: NDArray[np.float64]
    width: NDArray[np.float64]
    base: NDArray[np.float64]
    dead: NDArray[np.float64]
    offset: NDArray[np.float64]
    fit: NDArray[np.float64]
    plant: NDArray[np.int64] | None = None
    lives: Lives | None = None
