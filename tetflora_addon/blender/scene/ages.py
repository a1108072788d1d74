# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages of plants as kinds: every species is compiled for each of its ages, or for a few classes of them.

Up to `MOST` different ages of a species are kinds of their own. Of more, each goes to the nearest of `MOST` classes at
fixed ages, so that no plant depends on which others there are, and the scale of the plant makes up for the difference
in height. The classes of a species are a geometric series from its first year, or from a tenth of the age at which it
is full-grown where that is less, to when the last limbs of a dead plant have fallen: each is some 1.6 times the one
before. The years that pass in a scene are added afterward and change no class.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from bpy.app.translations import pgettext_iface as iface
from bpy.types import Depsgraph, Scene
from numpy.typing import NDArray

from ...arrays import Floats, Integers, Integers32
from ...compiled.recorded_sizes import Sizes, at_age, heights, sized
from ...errors import SpeciesError
from ...growth.seeds import WIDTH, Seeds
from ...species.ages import NARROWER, ages_of, stage
from ...species.kinds import Kind, species_of
from ...species.species import Species
from ..settings import years_of
from ..species.edits import species_for
from .skeletons import read_skeleton, skeleton_object_of

#: Classes of a species at most, and years from its death to the last of them.
MOST, _FALLEN = 12, 40.0
FULL_GROWN = "Full-grown"
Part = tuple[str, Seeds, Floats | None, Sizes | None]
"""The name of an object, its plants, their ages, None where all are full-grown, and recorded sizes if there are any."""


def stage_text(scene: Scene, identifier: str, age: float) -> str:
    """The stage of life that plants of a species are in at an age and the scene's years, for panels; empty for none."""
    try:
        species, years = species_for(scene, identifier), age + years_of(scene)
        text = stage(species, years).capitalize() if years > 0.0 else FULL_GROWN
    except SpeciesError:
        return ""
    return iface(text)


def classed(scene: Scene, parts: Sequence[Part], depsgraph: Depsgraph | None = None) -> list[tuple[str, Seeds]]:
    """Plants whose kinds name the ages that their species is to be compiled for; recorded sizes need a depsgraph."""
    find = partial(drawn_species, scene, depsgraph=depsgraph)
    aged = [(name, *sized(*of_plants, find)) for name, *of_plants in parts]
    if all(ages is None for _, _, ages in aged):
        return [(name, seeds) for name, seeds, _ in aged]
    different: dict[str, set[float]] = {}
    for _, seeds, ages in aged:
        for number, kind in enumerate(seeds.identifiers if ages is not None else ()):
            years = np.unique(ages[seeds.species == number])[: MOST + 2]
            different.setdefault(species_of(kind), set()).update(years.tolist())
    many = {species for species, ages in different.items() if len(ages - {0.0}) > MOST}
    return [(name, seeds if ages is None else _classed(scene, seeds, ages, many)) for name, seeds, ages in aged]


def drawn_species(scene: Scene, kind: str, depsgraph: Depsgraph) -> Species:
    """The species of a kind of plant, with the skeleton that an object draws if the kind has one."""
    species, form = species_for(scene, species_of(kind)), skeleton_object_of(kind)
    return species if form is None else replace(species, skeleton=read_skeleton(form, depsgraph))


def finder(scene: Scene, kinds: Iterable[str], depsgraph: Depsgraph) -> Callable[[str], Species | None]:
    """What finds the species of some kinds without Blender."""
    known: dict[str, Species] = {}
    for kind in set(kinds):
        with suppress(SpeciesError):
            known[kind] = drawn_species(scene, kind, depsgraph)
    return known.get


def class_ages(species: Species, years: Floats) -> Floats:
    """Ages of the classes of ages (n,): the nearest by ratio; full-grown plants stay it."""
    ages = ages_of(species)
    first = min(1.0, ages.full / 10.0)
    ratio = ((ages.full if ages.scaled else ages.lifespan + _FALLEN) / first) ** (1.0 / (MOST - 1))
    step = np.clip(np.rint(np.log(np.maximum(years, first) / first) / np.log(ratio)), 0, MOST - 1)
    return np.where(years > 0.0, first * ratio**step, 0.0)


def plainly_aged(
    scene: Scene, seeds: Seeds, ages: Floats | None, sizes: Sizes | None, depsgraph: Depsgraph | None = None
) -> tuple[Seeds, Floats | None]:
    """As `sized`, with all ages (n,) beside kinds that name none; what died young is old and small.

    Those of a dense stand are free ones with narrow crowns.
    """
    seeds, ages = sized(seeds, ages, sizes, partial(drawn_species, scene, depsgraph=depsgraph))
    kinds = [Kind.read(kind) for kind in seeds.identifiers]
    if not any(kind.age for kind in kinds):
        return seeds, ages
    years, smaller = np.array([kind.age for kind in kinds]), np.ones(len(kinds))
    for index, kind in enumerate(kinds):
        with suppress(SpeciesError):
            if kind.dead > 0.0:
                species = species_for(scene, kind.species)
                years[index] = ages_of(species).lifespan + kind.dead
                smaller[index] = np.divide(*heights(species, np.array([kind.age, years[index]])))
    all_ages = years[seeds.species] + (0.0 if ages is None else ages)
    if seeds.crown is not None:
        close = np.array([kind.crowded for kind in kinds])[seeds.species]
        crown = seeds.crown.copy()
        crown[close, WIDTH] *= 1.0 - NARROWER
        seeds = replace(seeds, crown=crown)
    plain = tuple(str(kind.plain) for kind in kinds)
    return replace(seeds, identifiers=plain, scale=seeds.scale * smaller[seeds.species]), all_ages


def relative_heights(identifier: str, years: NDArray[np.floating]) -> Floats:
    """Heights (n,) of plants of a species at ages (n,) over that of the description, for what stands for them."""
    try:
        ratios = heights(species_for(None, identifier), years)
    except SpeciesError:
        return np.ones(len(years))
    return np.where(years > 0.0, ratios, 1.0)


def kind_species(species: Species, kind: str, years: float = 0.0) -> Species:
    """A species as plants of a kind are after so many years."""
    one = Kind.read(kind).later(years)
    return at_age(species, one.age, one.dead, one.crowded)


def _classed(scene: Scene, seeds: Seeds, ages: Floats, many: set[str]) -> Seeds:
    years, which = years_of(scene), [n for n, kind in enumerate(seeds.identifiers) if species_of(kind) in many]
    classes, taller = _in_classes(scene, seeds.identifiers, seeds.species, ages, years, which)
    kinds, number = _by_age(seeds.identifiers, seeds.species, classes)
    return replace(seeds, identifiers=kinds, species=number, scale=seeds.scale * taller if which else seeds.scale)


def crown_kinds(
    scene: Scene, kinds: Sequence[str], number: Integers, ages: Floats | None
) -> tuple[tuple[str, ...], Integers32, Floats]:
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
    which = [n for n, kind in enumerate(kinds) if not Kind.read(kind).age]
    total[~np.isin(number, which)] = 0.0
    older = [str(one.later(years)) if (one := Kind.read(kind)).age else kind for kind in kinds]
    classes, taller = _in_classes(scene, kinds, number, total, 0.0, which)
    return *_by_age(older, number, classes), taller


def _by_age(kinds: Sequence[str], number: Integers, ages: Floats) -> tuple[tuple[str, ...], Integers32]:
    """Kinds with their ages, and the number (n,) of each plant's, from those without (n,)."""
    aged: list[str] = []
    out = np.zeros(len(number), np.int32)
    for old, kind in enumerate(kinds):
        plants = np.flatnonzero(number == old)
        different, which = np.unique(ages[plants], return_inverse=True)
        out[plants] = which.reshape(-1) + len(aged)
        aged += [str(Kind.read(kind).aged(age)) for age in different.tolist()]
    return tuple(aged), out


def _in_classes(
    scene: Scene, kinds: Sequence[str], number: Integers, ages: Floats, years: float, which: Iterable[int]
) -> tuple[Floats, Floats]:
    """Ages of classes (n,) for plants (n,) of some of the kinds, and their heights over those (n,) in so many years.

    Species that cannot be read are left as they are, which is told elsewhere.
    """
    classes, taller = ages.copy(), np.ones(len(number))
    for index in which:
        plants = np.flatnonzero((number == index) & (ages > 0.0))
        with suppress(SpeciesError):
            species = species_for(scene, species_of(kinds[index]))
            classes[plants] = class_ages(species, ages[plants])
            taller[plants] = heights(species, ages[plants] + years) / heights(species, classes[plants] + years)
    return classes, np.maximum(taller, 1e-3)
