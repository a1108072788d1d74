# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages of plants as kinds: every species is compiled for each of its ages, or for a few classes of them.

Up to `MOST` different ages of a species are kinds of their own. Of more, each goes to the nearest of `MOST` classes at
fixed ages, so that no plant depends on which others there are, and the scale of the plant makes up for the difference
in height. The years that pass in a scene are added afterwards and change no class.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface
from numpy.typing import NDArray

from ...errors import SpeciesError
from ...growth.seeds import Seeds
from ...species.species import Species
from ..settings import years_of
from ..species.edits import species_for
from .skeletons import age_of, aged_kind, species_of


def with_age(species, years):  # noqa: D103 (until the engine has it)
    return species


def height(species, years):  # noqa: D103
    return years + 1.0


def stage(species, years):  # noqa: D103
    return "mature"


#: Classes of a species at most; the age of the first in years, and of each over the one before.
MOST, FIRST, RATIO = 12, 1.0, 1.7
FULL_GROWN = "Full-grown"
Part = tuple[str, Seeds, NDArray[np.float64] | None]
"""The name of an object, its plants, and their ages; None where all are full-grown."""


def stage_text(scene: bpy.types.Scene, identifier: str, age: float) -> str:
    """The stage of life that plants of a species are in at an age and the scene's years, for panels."""
    try:
        years = age + years_of(scene)
        found = stage(species_for(scene, identifier), years).capitalize() if years > 0.0 else FULL_GROWN
    except SpeciesError:
        return ""
    return iface(found)


def classed(scene: bpy.types.Scene, parts: Sequence[Part]) -> list[tuple[str, Seeds]]:
    """Plants whose kinds name the ages that their species is to be compiled for."""
    if all(ages is None for _, _, ages in parts):
        return [(name, seeds) for name, seeds, _ in parts]
    many = _with_many(parts)
    return [(name, seeds if ages is None else _classed(scene, seeds, ages, many)) for name, seeds, ages in parts]


def class_ages(ages: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ages of the classes of ages (n,): the nearest by ratio; full-grown plants stay it."""
    step = np.rint(np.log(np.maximum(ages, FIRST) / FIRST) / np.log(RATIO))
    return np.where(ages > 0.0, FIRST * RATIO ** np.minimum(step, MOST - 1), 0.0)


def grown_species(scene: bpy.types.Scene, kind: str, species: Species) -> Species:
    """The species of a kind of plant at its age and the scene's years; the same where both are 0."""
    return at_age(species, age_of(kind) + years_of(scene))


def at_age(species: Species, years: float) -> Species:
    """A species at an age; full-grown, as it is, at 0."""
    return with_age(species, years) if years > 0.0 else species


def _with_many(parts: Sequence[Part]) -> set[str]:
    """Species that have more than `MOST` different ages."""
    found: dict[str, set[float]] = {}
    for _, seeds, ages in parts:
        for number, kind in enumerate(seeds.identifiers if ages is not None else ()):
            different = np.unique(ages[seeds.species == number])[: MOST + 2]
            found.setdefault(species_of(kind), set()).update(different.tolist())
    return {species for species, ages in found.items() if len(ages - {0.0}) > MOST}


def _classed(scene: bpy.types.Scene, seeds: Seeds, ages: NDArray[np.float64], many: set[str]) -> Seeds:
    own = np.array([species_of(kind) in many for kind in seeds.identifiers], bool)[seeds.species]
    classes = np.where(own, class_ages(ages), ages)
    kinds, number = _by_age(seeds.identifiers, seeds.species, classes)
    if not own.any():
        return replace(seeds, identifiers=kinds, species=number)
    years = years_of(scene)
    taller = _taller(scene, seeds.identifiers, seeds.species, ages + years, classes + years)
    return replace(seeds, identifiers=kinds, species=number, scale=seeds.scale * np.where(classes > 0.0, taller, 1.0))


def crown_kinds(
    scene: bpy.types.Scene, kinds: Sequence[str], number: NDArray[np.integer], ages: NDArray[np.float64] | None
) -> tuple[tuple[str, ...], NDArray[np.int32], NDArray[np.float64]]:
    """Kinds of plants of which crowns are known well enough, for plants (n,) of some kinds and their ages.

    Returns
    -------
    kinds : tuple of str
        At the ages of classes, the scene's years included.
    number : (n,) int32
        Index into these.
    taller : (n,) float64
        By how much plants are larger than their kind.
    """
    years = years_of(scene)
    if ages is None and years == 0.0:
        return tuple(kinds), number.astype(np.int32), np.ones(len(number))
    total = (0.0 if ages is None else ages) + np.full(len(number), years)
    classes = class_ages(total)
    return *_by_age(kinds, number, classes), _taller(scene, kinds, number, total, classes)


def _by_age(
    kinds: Sequence[str], number: NDArray[np.integer], ages: NDArray[np.float64]
) -> tuple[tuple[str, ...], NDArray[np.int32]]:
    """Kinds with their ages, and the number (n,) of each plant's, from those without (n,)."""
    found: list[str] = []
    out = np.zeros(len(number), np.int32)
    for old, kind in enumerate(kinds):
        own = np.flatnonzero(number == old)
        different, which = np.unique(ages[own], return_inverse=True)
        out[own] = which.reshape(-1) + len(found)
        found += [aged_kind(kind, age) for age in different.tolist()]
    return tuple(found), out


def _taller(
    scene: bpy.types.Scene,
    kinds: Sequence[str],
    number: NDArray[np.integer],
    ages: NDArray[np.float64],
    classes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Heights (n,) of plants over those of their classes; 1 where a species cannot be read, which is told elsewhere."""
    out = np.ones(len(number))
    for index, kind in enumerate(kinds):
        own = np.flatnonzero((number == index) & (ages != classes) & (classes > 0.0))
        with suppress(SpeciesError):
            species = species_for(scene, species_of(kind))
            out[own] = height(species, ages[own]) / height(species, classes[own])
    return out
