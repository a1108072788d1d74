# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of recorded sizes as kinds, scales and crown shapes.

A plant that stands still is of the class of heights that is nearest: each is 1.5 times the one below, and the scale
makes up for what is left. Classes belong to the species alone, so that no plant depends on others.

A plant whose crown is narrow for its height and begins far up grew between neighbors: it is of a dense stand's *habit*,
with a slim trunk and short limbs. Taller ones than full-grown are old only if they are as thick.

Where a stand grows in an animation, plants must not jump from class to class. There, plants that are born, die and end
up alike are a *cohort*: one kind, whose age goes on as those of its plants do on the mean; scales make up for the
difference in height. What a plant belongs to follows from its whole life, so that a frame alone is that of the film.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ..arrays import Arrays, Floats, Integers, Mask
from ..errors import SpeciesError
from ..growth.growth import radius_at, trunks
from ..growth.seeds import LEAVES, PLAIN, THICKNESS, Seeds, crown_shapes
from ..species.ages import BARE, NARROWER, ages_of, with_age, with_habit
from ..species.ecology import crown_leaves, ecology_of, one_sided
from ..species.kinds import MOST_YEARS, Kind
from ..species.species import Ages, Species
from .flora import compile_species
from .sizes import fitted, measured

#: Height of a class over that of the one below, and classes below that of full-grown plants.
_STEP, _BELOW = 1.5, 9
_NODES = 512  # of heights by age, from a thousandth of a year on
#: Years since death that stand for others, as far as plants change: leaves, twigs, boughs and limbs are gone.
_SINCE = np.array([1.0, 6.0, 25.0])
#: Of plants that grow: cohorts of a species at most; what counts as far apart: years of birth, ratio of the ages at the
#: end and of lengths of life; years between points of the curve of a cohort, and between classes of death.
_COHORTS, _APART, _STRETCH, _DEATHS = 12, (20.0, np.log(1.6), np.log(1.8)), 5.0, 20.0
_BREAST, _TALL = 1.3, 1.5  # height of the diameter, and least height of a plant that has one, meters
_DIES = 0.999  # part of its life after which a plant that dies early no longer grows
_PLANTS = 32  # that are measured of each class
_MEASURED = 1  # times that a plant is, to fit it
_WOODY = 3.0  # meters of height that plants reach whose leaves follow their crowns
#: Crown width for the height over that of a free plant below which one grew between neighbors: halfway, by ratio; of
#: what dense stands leave bare, the part from which on. Least part of the leaves on its twigs: the crown says how many.
CROWDED, _RAISED, _LEAFY = (1.0 - NARROWER) ** 0.5, 0.25, 0.5


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

    #: height, diameter, width, base: (n,): Of the plant, its trunk at 1.3 m, its crown on average, its lowest limb
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


def heights(species: Species, years: Floats) -> Floats:
    """Heights (n,) at ages (n,), over that at the full age."""
    return np.interp(np.log(np.maximum(years, 1e-3)), *_heights(ages_of(species)))


def ages_of_heights(species: Species, ratio: Floats) -> Floats:
    """Ages (n,) at which plants have heights (n,), over that at the full age; the oldest of health for taller ones."""
    ages = ages_of(species)
    log_years, ratios = _heights(ages)
    rising = log_years <= np.log(ages.full if ages.scaled else ages.decline * ages.lifespan)
    return np.where(ratio == 1.0, ages.full, np.exp(np.interp(ratio, ratios[rising], log_years[rising])))


def at_age(species: Species, years: float, dead: float = 0.0, crowded: bool = False) -> Species:
    """A species at an age, full-grown at 0; or so many years after it has died at that age; that of a dense stand."""
    if crowded:
        dense = at_age(of_dense_stand(species), years or ages_of(species).full, dead)
        if dead <= 0.0:
            return replace(dense, crowded=True)
        # Dead ones have no leaves; what was measured of free ones holds.
        return replace(dense, aged=dense.aged and (species, dense.aged[1]))
    if dead <= 0.0:
        return with_age(species, years) if years > 0.0 else species
    ages = ages_of(species)
    if ages.scaled:
        return at_age(species, years)
    years = years or ages.full
    dying = replace(species, ages=replace(ages, lifespan=years / _DIES, decline=_DIES))
    # What was measured of dead plants of the species holds for those that died young.
    return replace(with_age(dying, years / _DIES + dead), aged=(species, ages.lifespan + dead))


def crowds(species: Species) -> bool:
    """Whether plants of a species may grow between neighbors: not herbs, stools, palms and plants of one axis."""
    limbs = species.orders[1].length.mean if len(species.orders) > 1 else np.inf
    return ecology_of(species).height >= _WOODY and limbs <= 1.0


def of_dense_stand(species: Species) -> Species:
    """A species as it grows between neighbors."""
    return replace(with_habit(replace(species, stand_leaves=max(species.stand_leaves, _LEAFY)), 1.0), habit=0.0)


def sized(
    seeds: Seeds, ages: Floats | None, sizes: Sizes | None, find: Callable[[str], Species | None]
) -> tuple[Seeds, Floats | None]:
    """Plants (n,) of kinds that suit recorded sizes, and ages left to others; unknown species stay as they are."""
    if sizes is None:
        return seeds, ages
    kinds, number = list(seeds.identifiers), seeds.species.copy()
    scale, crown = seeds.scale.copy(), np.tile(PLAIN, (len(seeds), 1))
    left = None if ages is None else ages.copy()
    for index, kind in enumerate(seeds.identifiers):
        row = np.flatnonzero((seeds.species == index) & ((sizes.height > 0.0) | (sizes.dead > 0.0)))
        if not len(row):
            continue
        with suppress(SpeciesError):
            if (species := find(kind)) is None:
                continue
            if Kind.read(kind).skeleton:  # it is as it was drawn
                scale[row] *= measure_of(species).fitted(seeds.take(row), sizes.take(row))[0]
                continue
            recorded = sizes.take(row)
            stages, which = np.unique(_stages(species, recorded, index), axis=0, return_inverse=True)
            for n, (age, dead, crowded) in enumerate(stages.tolist()):
                here = which.reshape(-1) == n
                these = row[here]
                measure = (_still if recorded.lives is None or dead else _grown)(species, age, bool(crowded))
                own_scale, own_crown = measure.fitted(seeds.take(these), recorded.take(here))
                scale[these] *= own_scale
                crown[these], number[these] = own_crown, len(kinds)
                kinds.append(str(Kind.read(kind).aged(age, dead, bool(crowded))))
            if left is not None:
                left[row] = 0.0
    crown = None if (crown == PLAIN).all() else crown
    seeds = replace(seeds, identifiers=tuple(kinds), species=number, scale=scale, crown=crown)
    return seeds, None if left is None or not left.any() else left


def fits_of(seeds: Seeds, sizes: Sizes, find: Callable[[str], Species]) -> Floats:
    """Factors (n, 2) with which plants (n,) have exactly the heights and crown widths of their sizes (`Sizes.fit`)."""
    out = np.ones((len(seeds), 2))
    plain, _ = sized(seeds, None, replace(sizes, fit=out), find)
    crown = np.tile(PLAIN, (len(seeds), 1)) if plain.crown is None else plain.crown
    for number, text in enumerate(plain.identifiers):
        row, kind = np.flatnonzero((plain.species == number) & (sizes.height > 0.0)), Kind.read(text)
        if len(row) and kind.age and not kind.dead:
            flora = _still(find(kind.species), kind.age, kind.crowded).flora
            one = replace(plain.take(row), identifiers=(text,), species=np.zeros(len(row), np.int32), crown=crown[row])
            tall, wide = (sizes.height * seeds.scale)[row], (sizes.width * seeds.scale)[row]
            # What has no width keeps that of its kind.
            bare, known = np.flatnonzero(wide <= 0.0), np.flatnonzero(wide > 0.0)
            out[row[bare], 0] = tall[bare] / measured(flora, one.take(bare))[0]
            scale, limbs = fitted(flora, one.take(known), tall[known], wide[known], _MEASURED).T
            out[row[known]] = np.stack([scale, scale * limbs], axis=1)
    return out


def kinds_of_sizes(species: Species, sizes: Sizes) -> list[Species]:
    """A species in all stages that plants of recorded sizes (n,) are shown in when they stand still."""
    stages = np.unique(_stages(species, sizes, 0), axis=0).tolist()
    return [at_age(species, age, since, bool(close)) for age, dead, close in stages for since in {0.0, dead}]


def _stages(species: Species, sizes: Sizes, number: int) -> Floats:
    """Age, years since death, and whether it is crowded (n, 3), of the kind of each plant by its ``number``."""
    ages = ages_of(species)
    full = measure_of(species).height
    dead, height = sizes.dead, np.where(sizes.height > 0.0, sizes.height, full)
    if ages.scaled:
        return np.tile([ages.full, 0.0, 0.0], (len(height), 1))
    if sizes.lives is None:
        # Trunks as thick as old ones, or of a diameter that is not known.
        trunk, old = species.orders[0], ages.diameters(ages.decline * ages.lifespan)
        thick = sizes.diameter > 2.0 * trunk.thickness.mean * trunk.length.mean * old**0.5
        thick |= sizes.diameter <= 0.0
        ratio = np.where(thick, height / full, np.minimum(height / full, 1.0))
        years, older = (_class_ages(species, ratio, every) for every in (1, 2))
        gone = _SINCE[np.argmin(np.abs(np.log(np.maximum(dead, 0.1)[:, None] / _SINCE)), axis=1)]
    else:
        years = _cohort_ages(species, sizes.lives, number, full)[sizes.plant]
        now, older = sizes.lives.now, _class_ages(species, height / full, 3)  # leafless, they differ less
        gone = np.maximum(now - _DEATHS * np.rint((now - dead) / _DEATHS), 0.01)
    died = dead > 0.0
    return np.column_stack([np.where(died, older, years), np.where(died, gone, 0.0), _crowded(species, sizes, number)])


def _crowded(species: Species, sizes: Sizes, number: int) -> Mask:
    """Which plants (n,) grew between neighbors, by the crowns that they have at last."""
    if not crowds(species):
        return np.zeros(len(sizes), bool)
    measure, life, chosen = measure_of(species), sizes, np.arange(len(sizes))
    if sizes.lives is not None:
        life = sizes.lives
        known = np.flatnonzero((life.species == number) & (life.width > 0.0))
        last = np.zeros(len(life.year), np.int64)
        last[life.first[known]] = known  # of several records the last stays
        chosen = last[sizes.plant]
    height, width, base = (values[chosen] for values in (life.height, life.width, life.base))
    low = species.orders[0].branch_start.mean
    raised = (base <= 0.0) | (base > (low + _RAISED * BARE * (1.0 - low)) * height)
    return raised & (width > 0.0) & (width * measure.height < CROWDED * height * measure.width)


def _cohort_ages(species: Species, lives: Lives, number: int, full: float) -> Floats:
    """Present age of the cohort of each plant of a kind, at its first record; of all records (n,)."""
    records = np.flatnonzero((lives.species == number) & (lives.dead <= 0.0) & (lives.height > 0.0))
    out = np.ones(len(lives.year))
    if not len(records):
        return out
    year, age = lives.year[records], ages_of_heights(species, np.maximum(lives.height[records], 1e-3) / full)
    begins = np.flatnonzero(np.diff(lives.first[records], prepend=-1))
    ends = np.append(begins[1:], len(records)) - 1
    birth = year[begins] - age[begins]
    life = np.stack([birth, np.log(age[ends]), np.log(np.maximum(year[ends] - birth, 1.0))], axis=1) / _APART
    # The most frequent lives are cohorts, and each plant is of the nearest one.
    cells, count = np.unique(np.rint(life), axis=0, return_counts=True)
    main = cells[np.argsort(-count, kind="stable")[:_COHORTS]]
    cohort = np.argmin(np.stack([((life - one) ** 2).sum(axis=1) for one in main]), axis=0)
    # Mean ages by spans of years, of all records; they only rise.
    lengths = np.diff(np.append(begins, len(records)))
    spans = int((year.max() - year.min()) / _STRETCH) + 1
    cell = np.repeat(cohort, lengths) * spans + ((year - year.min()) / _STRETCH).astype(np.int64)
    sums = (np.bincount(cell, values, len(main) * spans) for values in (None, year, np.log(age)))
    weight, years, log_age = (values.reshape(-1, spans) for values in sums)
    present = np.ones(len(main))
    for n in range(len(main)):
        filled = weight[n] > 0
        if filled.any():
            curve = np.maximum.accumulate(log_age[n, filled] / weight[n, filled])
            present[n] = np.exp(np.interp(lives.now, years[n, filled] / weight[n, filled], curve))
    out[lives.first[records[begins]]] = present[cohort]
    return out


def _class_ages(species: Species, ratio: Floats, every: int) -> Floats:
    """Ages (n,) of the nearest classes to heights (n,) over that at the full age; one of so many classes counts."""
    classes = _classes(species, every)
    return ages_of_heights(species, classes[np.searchsorted(np.sqrt(classes[1:] * classes[:-1]), ratio)])


def _classes(species: Species, every: int) -> Floats:
    """Heights of classes over that at the full age."""
    ages = ages_of(species)
    highest = ages.heights(ages.decline * ages.lifespan)
    classes = _STEP ** np.arange(-_BELOW // every * every, np.log(highest) / np.log(_STEP) - 0.3, every)
    return np.append(classes, highest) if highest > 1.0 else classes


class Measure:
    """Sizes of a compiled species at one age, for trunks that are not bent to some length by chance."""

    def __init__(self, species: Species, ratios: tuple[float, float] | None = None) -> None:
        self.flora, self._ratios = compile_species([species]), ratios  # flora: of this species alone
        self._seeds = Seeds.upright(_PLANTS)
        self._lengths = trunks(self.flora.rows, self._seeds).length
        self.length = float(self._lengths.mean())
        self._typical = species.orders[0].length.mean

    @cached_property
    def ratios(self) -> tuple[float, float]:
        """Height and crown width over the typical length of a trunk."""
        if self._ratios is not None:
            return self._ratios
        part = self.length / self._typical
        return tuple(part * float((size / self._lengths).mean()) for size in measured(self.flora, self._seeds))

    @property
    def height(self) -> float:
        """Of a plant on average, meters."""
        return self._typical * self.ratios[0]

    @property
    def width(self) -> float:
        """Of a crown on average, meters."""
        return self._typical * self.ratios[1]

    def fitted(self, seeds: Seeds, sizes: Sizes) -> tuple[Floats, Floats]:
        """Scales (n,) and crown shapes (n, 6) with which plants have their recorded sizes."""
        none = np.zeros(len(seeds), np.int32)
        one = replace(seeds, identifiers=("",), species=none, scale=np.ones(len(seeds)), crown=None)
        chance = trunks(self.flora.rows, one).length / self.length
        known = sizes.height > 0.0
        scale = np.where(known, sizes.height * sizes.fit[:, 0] / (self.height * chance), 1.0)
        width = sizes.width * sizes.fit[:, 1] / (self.width * chance * scale)
        wide = known & (sizes.width > 0.0)
        base = np.where(known, sizes.base / np.maximum(sizes.height, 1e-9), 0.0)
        forms = crown_shapes(len(seeds), np.where(wide, width, 1.0), base, *np.where(known, sizes.offset.T, 0.0))
        has = (sizes.diameter > 0.0) & (sizes.height > _TALL)
        if has.any():
            shaped = trunks(self.flora.rows, replace(one, scale=scale, crown=forms))
            place = np.minimum(_BREAST / shaped.length, 0.95)
            diameter = 2.0 * radius_at(self.flora.rows, shaped, place)
            forms[:, THICKNESS] = np.where(has & (place < 0.95), sizes.diameter / np.maximum(diameter, 1e-9), 1.0)
        if wide.any():
            species = self.flora.species[0]
            needs = ecology_of(species if species.aged is None else species.aged[0])
            none, every = (forms * np.where(np.arange(forms.shape[1]) == LEAVES, part, 1.0) for part in (0.0, 1.0))
            plants = (trunks(self.flora.rows, replace(one, scale=scale, crown=form)) for form in (none, every))
            bare, drawn = (one_sided(species) * self.flora.leaf_areas(plant) for plant in plants)
            wanted = crown_leaves(needs.leaves, *np.where(wide, [sizes.height, sizes.base, sizes.width / 2], 1.0))
            leafy = wide & (drawn > bare) & (needs.height >= _WOODY)
            forms[:, LEAVES] = np.where(leafy, (wanted - bare) / np.where(leafy, drawn - bare, 1.0), 1.0)
        return scale, crown_shapes(len(seeds), *forms.T)


@lru_cache(maxsize=512)
def measure_of(species: Species) -> Measure:
    """What is known of a species at its age; found once."""
    return Measure(species)


def _still(species: Species, years: float, crowded: bool) -> Measure:
    return measure_of(at_age(species, years, 0.0, crowded))


def _grown(species: Species, years: float, crowded: bool) -> Measure:
    """The same of a species at some age of an animation, where nothing may jump: between those of two classes."""
    ages = ages_of_heights(species, _classes(species, 1))
    high = int(np.clip(np.searchsorted(ages, years), 1, len(ages) - 1))
    low = ages[high - 1]
    part = float(np.clip(np.log(years / low) / np.log(ages[high] / low), 0.0, 1.0))
    ends = np.log([_still(species, age, crowded).ratios for age in ages[high - 1 : high + 1].tolist()])
    return Measure(at_age(species, years, 0.0, crowded), tuple(np.exp(ends[0] + part * (ends[1] - ends[0])).tolist()))


@lru_cache(maxsize=64)
def _heights(ages: Ages) -> tuple[Floats, Floats]:
    """Logarithms of ages and heights; the same ones whatever plants there are."""
    years = np.geomspace(1e-3, 2.0 * MOST_YEARS, _NODES)
    ratios = np.array([ages.heights(year) for year in years.tolist()])
    return np.log(years), np.minimum(ratios, 1.0) if ages.scaled else ratios
