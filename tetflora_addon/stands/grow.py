# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grow a stand: year after year plants shade each other, grow, die, fall, and seeds of the others come up.

Random numbers are hashes of seed, plant and year, and sums are of whole numbers: any number of threads gives the same.

Wood grows in proportion to the light that leaves take, less what the leaves cost (Monteith, "Climate and the efficiency
of crop production in Britain", 1977). Trunks grow taller for their basal diameter where it is dark beside them, crowns
widen where it is light, limbs die where it is dark. A plant that grows much less than one of its basal diameter that
stands free dies soon; how much less depends on its tolerance of shade. All else, such as how many are left, follows.

Plants come planted, or from seeds of the plants around and of the woods outside, where there is light. Alive and dead
they are structures of arrays; records are what a simulation says of them at several years.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Keys, Mask, column, nested
from ..errors import TetFloraError
from ..growth.hashing import child_key, key_of_seed, uniform
from ..jobs import Job, Progress
from ..parallel import blocks, on_all_cores
from ..parameters import script_setting, setting, within
from ..species.ecology import crown_leaves
from .light import Crowns, LightGrid
from .site import StandSite, StandSpecies, StandTraits

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

    def at(self, year: float) -> Self:
        """Plants that are there in a year, one row each: linear between two records.

        Before the first and after the last record of a plant it is not there.
        """
        year = np.float32(year)
        late = self.year >= year
        # The first row of a plant that is not before the year: of the same plant, the row before it is earlier.
        before = np.empty(len(self), bool)
        before[1:], before[:1] = (self.plant[1:] == self.plant[:-1]) & ~late[:-1], False
        after = np.flatnonzero(late & (before | (self.year == year)))
        earlier = np.where(before[after], after - 1, after)
        first, second = self.take(earlier), self.take(after)
        span = np.where(after > earlier, second.year - first.year, 1.0)
        part = np.where(after > earlier, (year - first.year) / span, 0.0).astype(np.float32)
        mixed = {
            name: (a := getattr(first, name)) + (getattr(second, name) - a) * (part if a.ndim == 1 else part[:, None])
            for name in ("position", "height", "diameter", "crown_width", "crown_base", "offset", "lean", "dead")
        }
        exact = part == 1.0
        for name, value in mixed.items():
            value[exact] = getattr(second, name)[exact]
        return replace(first, year=np.full(len(after), year, np.float32), **mixed)


def in_order(rows: Records) -> Records:
    """The same rows with those of each plant together, years ascending."""
    return rows.take(np.lexsort((rows.year, rows.plant)))


#: How crowns lie beside their trunks: the middle is moved by this much of the radius and the offset.
_ASIDE = 0.6


class StandDraw(IntEnum):
    """What a random number of a plant, or of a place, is drawn for."""

    X, Y, PLANTABLE, SPECIES, STRENGTH, SEED, DEATH, OLD, FALL, LEAN, LIE, COME = range(1, 13)


@dataclass(frozen=True)
class Plants(Arrays):
    """Living plants."""

    number: Integers = column(dtype=np.int64)  # (n,): in the order in which they came
    key: Keys = column(dtype=np.uint64)  # (n,): of their random numbers
    species: Integers = column(dtype=np.int64)  # (n,)
    #: x and y, (n,): meters from the corner of the site.
    x: Floats
    y: Floats
    #: basal, height, base and radius, (n,): meters; basal diameter as `site` has it.
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
        leaves = np.take(traits.leaves * traits.extinction, self.species)
        leaves = crown_leaves(leaves, self.height, self.base, self.radius)
        x = self.x + _ASIDE * self.radius * self.east
        y = self.y + _ASIDE * self.radius * self.north
        return Crowns(x, y, self.radius, self.base, self.height, leaves, np.take(traits.crown_conicity, self.species))

    def records(self, year: float, traits: StandTraits, site: StandSite) -> Records:
        """What they are now; ``plant`` is their number still."""
        diameter, offset = traits.diameters(self.species, self.basal), np.stack([self.east, self.north], axis=1)
        identity = self.number, np.full(len(self), year), self.species, uniform(self.key, StandDraw.SEED) * 2.0**31
        crown = diameter, np.maximum(2.0 * self.radius, _SLIM[0] * np.minimum(self.height, _SLIM[1])), self.base, offset
        upright = np.zeros((len(self), 2)), np.zeros(len(self))
        place = np.stack([site.west + self.x, site.south + self.y, site.ground(self.x, self.y)], axis=1)
        return Records.typed(*identity, place.astype(np.float32), self.height, *crown, *upright)


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


#: Height for the basal diameter over that in a closed stand: where light beside the crown is full, and where is none.
_SLENDER_LIT, _SLENDER_DARK = 0.72, 1.14
#: Light beside a crown in which it begins to widen, for shade tolerance 0 and 5; how much more for its fastest.
_SIDE, _SIDE_MORE = (0.61, 0.26), 0.35
#: Where that is: in lengths of a dome and of a cone below the top, and so much of the height at most counts as length.
_BESIDE, _LONG = (0.65, 0.85), 0.45
_DARK = 1.5  # light beside it, over that in which limbs die, below which it narrows
#: Fractions of the radius, or of what is lacking, by which a crown narrows and widens in a year.
_NARROWS, _WIDENS = 0.05, 0.12
#: Width of a crown as recorded, over the height, at least: shaded saplings are no bare rods; and up to which height.
_SLIM = 0.3, 3.0
#: Fraction of the crown that dies from below in a year where it is quite dark; shortest crown, over the height.
_RISES, _SHORTEST = 0.3, 0.12
#: Offset for a small difference of light on two sides over its sum, over the most; the most; what comes in a year.
_LEANS, _MOST_OFFSET, _TURNS = 6.0, 0.6, 0.08
#: Light over that of a free plant in which plants grow about half as fast as they can at all.
_HALF_LIT = 0.1
_LARGEST = 1.3  # girth at which plants cease to become thicker, over the largest that are known
_RECENT = 0.3  # part of the vigor that is this year's
#: Vigor below which plants are likely to die, for shade tolerance 0 and 5, and the chance where it is 0.
_WEAK, _DIES = (0.2, 0.025), 0.15
#: Chance to die for other reasons: of so many in a lifespan, for each that is left; when the old die, in lifespans.
_OTHERS, _OLD = 1.0, (0.8, 1.15)
#: Trees that stand dead: least diameter and height; years until they fall, and are gone, for 40 cm; what breaks then.
_KEPT_DIAMETER, _KEPT_HEIGHT = 0.05, 2.0
_STANDS, _LIES, _DEAD_DIAMETER, _BREAKS = (2.0, 22.0), (8.0, 40.0), 0.4, 0.1


def grown(
    plants: Plants, crowns: Crowns, taken: NDArray, light: LightGrid, traits: StandTraits, block: slice
) -> Plants:
    """A block of plants a year later, by the crowns of all (n,) and the light (n,) that each of these takes, m²."""
    one = plants.take(block)
    x, y, radius, base, height = (v[block] for v in (crowns.x, crowns.y, crowns.radius, crowns.base, crowns.height))
    species, taken = one.species, taken[block]

    def of_species(values: NDArray) -> NDArray:
        return np.take(values, species)

    away = radius + 0.5 * light.cell
    deep = _BESIDE[0] + (_BESIDE[1] - _BESIDE[0]) * of_species(traits.crown_conicity)
    middle = height - deep * np.minimum(height - base, _LONG * height)
    places = ((away, 0.0), (-away, 0.0), (0.0, away), (0.0, -away))
    east, west, north, south = (light.at(x + dx, y + dy, middle, (x, y)) for dx, dy in places)
    side = 0.25 * (east + west + north + south)
    below = light.at(x, y, base)
    for dx, dy in places:
        below += light.at(x + 0.5 * dx, y + 0.5 * dy, base, (x, y))
    below *= 0.2

    free = np.pi * traits.radii(species, one.basal) ** 2 * of_species(traits.free)
    net = taken - of_species(traits.cost) * crowns.leaves[block]
    lit = np.clip(net / np.maximum(free, 1e-9), 0.0, 1.5)
    vigor = (1.0 - _RECENT) * one.vigor + _RECENT * lit
    rate = of_species(traits.light_use_efficiency) * one.quality * one.strength
    basal = one.basal + _increment(one, np.maximum(net, 0.0) * rate, lit, traits)
    dark = 1.0 - np.clip(side, 0.0, 1.0)
    slender = _SLENDER_LIT + (_SLENDER_DARK - _SLENDER_LIT) * dark
    short = 0.4 + 0.6 * np.sqrt(one.quality)
    tall = np.maximum(height, slender * short * traits.heights(species, basal))

    widest = traits.radii(species, basal)
    level = _SIDE[0] + (_SIDE[1] - _SIDE[0]) / 5.0 * of_species(traits.shade)
    open_ = np.clip((side - level) / _SIDE_MORE, 0.0, 1.0)
    closed = np.clip(1.0 - side / (_DARK * of_species(traits.light_compensation)), 0.0, 1.0)
    widens = np.minimum(widest - traits.radii(species, one.basal) + _WIDENS * (widest - radius), widest - radius)
    wide = radius + np.maximum(widens, 0.0) * open_ - _NARROWS * radius * closed
    wide = np.minimum(wide, widest)

    limit = of_species(traits.light_compensation)
    died = np.clip(1.0 - below / limit, 0.0, 1.0) * (tall - height + _RISES * (height - base))
    low = np.minimum(base + died, (1.0 - _SHORTEST) * tall)
    east = one.east + _TURNS * (_offset(east, west) - one.east)
    north = one.north + _TURNS * (_offset(north, south) - one.north)
    crown = {"base": low, "radius": wide, "east": east, "north": north}
    return replace(one, basal=basal, height=tall, vigor=vigor, age=one.age + 1.0, **crown)


def _offset(a: Floats, b: Floats) -> Floats:
    """Offset (n,) toward the light on one side, where there is such light on two."""
    more = _LEANS * (a - b) / (a + b + 0.2)
    return _MOST_OFFSET * more / (1.0 + np.abs(more))


def _increment(one: Plants, wood: NDArray, lit: NDArray, traits: StandTraits) -> Floats:
    """By how much plants (n,) become thicker that make so much wood, kg, and have so much of the light of free ones."""
    step = 0.002
    low, high = (traits.heights(one.species, one.basal + thicker) for thicker in (0.0, step))
    rise = np.maximum(high - low, 0.0) / step
    more = np.take(traits.mass_factor, one.species) * one.basal * (2.0 * one.height + one.basal * rise)
    most = np.take(traits.diameter_increment, one.species) * one.quality * one.strength
    most *= np.minimum((1.0 + _HALF_LIT) * lit / (lit + _HALF_LIT), 1.0)
    large = (one.basal / (_LARGEST * np.take(traits.diameter, one.species))) ** 2
    return np.minimum(wood * np.maximum(1.0 - large**2, 0.0) / np.maximum(more, 1e-9), most)


def dying(one: Plants, traits: StandTraits, year: int) -> Mask:
    """Which plants (n,) die in a year."""
    species = one.species
    weak = np.take(_WEAK[0] + (_WEAK[1] - _WEAK[0]) / 5.0 * traits.shade, species)
    stressed = _DIES * np.maximum(1.0 - one.vigor / weak, 0.0)
    lifespan = np.take(traits.lifespan, species)
    chance = stressed + _OTHERS / lifespan
    old = _OLD[0] + (_OLD[1] - _OLD[0]) * uniform(one.key, StandDraw.OLD)
    return (uniform(child_key(one.key, year), StandDraw.DEATH) < chance) | (one.age > old * lifespan)


def fallen(plants: Plants, last: Records, site: StandSite, slope: tuple[NDArray, NDArray], year: float) -> DeadPlants:
    """What is left of plants that die in a year: trees that stand dead, and fall rather down the slope, onto ground."""
    kept = np.flatnonzero((last.diameter >= _KEPT_DIAMETER) & (last.height >= _KEPT_HEIGHT))
    plants, last = plants.take(kept), last.take(kept)
    cells = site.cells(plants.x, plants.y)
    lasts = np.sqrt(last.diameter.astype(np.float64) / _DEAD_DIAMETER)
    stands = np.floor((_STANDS[0] + (_STANDS[1] - _STANDS[0]) * uniform(plants.key, StandDraw.FALL) ** 2) * lasts) + 1.0
    lies = np.floor((_LIES[0] + (_LIES[1] - _LIES[0]) * uniform(plants.key, StandDraw.LIE)) * lasts) + 1.0
    lies[last.diameter < _BREAKS] = 0.0
    turn = uniform(plants.key, StandDraw.LEAN)
    # Directions on a square, which needs no sine: rounded to a circle by its own length.
    along = 1.0 - np.abs(((4.0 * turn - 2.0) % 2.0) - 1.0) * 2.0
    across = np.where(turn < 0.5, 1.0, -1.0) * (1.0 - np.abs(along))
    east, north = across - 3.0 * slope[0][cells], along - 3.0 * slope[1][cells]
    way = np.stack([east, north]) / np.maximum(np.sqrt(east**2 + north**2), 1e-6)
    foot, reach = np.stack([plants.x, plants.y]), way * last.height
    back = ~site.holds(*(foot + reach)) & site.holds(*(foot - reach))
    lean = (1.05 * LYING * np.where(back, -way, way).T).astype(np.float32)
    return DeadPlants(last, np.full(len(kept), float(year)), year + stands, year + stands + lies, lean)


#: Most plants at once.
MOST_PLANTS = 12_000_000
_PLANTED, _SOWN = 0, 1
#: Of planted plants and those from seeds: part of the basal diameter of one that is 1.3 m high; and age, years.
_PLANTED_DIAMETER, _SOWN_DIAMETER = 0.35, 0.25
_PLANTED_AGE, _SOWN_AGE = 3.0, 3.0
#: Meters of the grid on which seeds are spread, at least; and seeds per m² that make half as many plants as can come.
_SEED_CELL, _HALF = 4.0, 20.0
_OUTSIDE = 0.1  # part of the ground beyond that is below crowns of each species that bear seeds


def planted(site: StandSite, traits: StandTraits, suitability: Floats, density: float, seed: int) -> Plants:
    """So many plants on a hectare, each somewhere in a square of its own, by how well species grow (g, cells)."""
    if density <= 0.0 or traits.planted.sum() <= 0.0:
        return Plants.empty()
    width, depth = site.size
    side = 100.0 / np.sqrt(density)
    columns, rows = max(round(width / side), 1), max(round(depth / side), 1)
    if columns * rows > MOST_PLANTS:
        raise TetFloraError(
            f"{columns * rows:,} plants would be planted, the limit is {MOST_PLANTS:,}; lower Planted, or choose a "
            "smaller ground"
        )
    index = np.arange(columns * rows)
    key = child_key(keys_of(seed, _PLANTED), index)
    x = (index % columns + 0.1 + 0.8 * uniform(key, StandDraw.X)) * (width / columns)
    y = (index // columns + 0.1 + 0.8 * uniform(key, StandDraw.Y)) * (depth / rows)
    limits = np.cumsum(traits.planted) / traits.planted.sum()
    species = np.minimum(np.searchsorted(limits, uniform(key, StandDraw.SPECIES), side="right"), len(limits) - 1)
    cells = site.cells(x, y)
    quality = suitability[species, cells]
    kept = np.flatnonzero((quality > 0.0) & (uniform(key, StandDraw.PLANTABLE) < site.plantable.ravel()[cells]))
    basal = _PLANTED_DIAMETER * traits.first[species]
    return newcomers(key[kept], 0, species[kept], x[kept], y[kept], basal[kept], quality[kept], _PLANTED_AGE, traits)


class SeedDispersal:
    """Seeds that fall on a site, and where they can become plants."""

    def __init__(self, site: StandSite, traits: StandTraits, suitability: Floats, most: float, outside: float) -> None:
        """Of a site, for species that grow so well on its cells (g, cells).

        At ``most`` so many plants come on a hectare and year; ``outside`` is a factor on the seeds from there.
        """
        self.site, self.traits, self.suitability, self.most = site, traits, suitability, most
        width, depth = site.size
        self.columns, self.rows = max(round(width / _SEED_CELL), 1), max(round(depth / _SEED_CELL), 1)
        self.outside = outside * _OUTSIDE * traits.incoming_seeds * traits.fecundity

    def fallen(self, plants: Plants) -> Floats:
        """Seeds (g, cells) on a square meter and year."""
        width, depth = self.site.size
        column = np.minimum((plants.x * (self.columns / width)).astype(np.int64), self.columns - 1)
        row = np.minimum((plants.y * (self.rows / depth)).astype(np.int64), self.rows - 1)
        place = row * self.columns + column
        area = width * depth / (self.rows * self.columns)
        out = np.empty((len(self.outside), self.rows, self.columns))
        bears = plants.age >= np.take(self.traits.mature, plants.species)
        # Whole numbers, whose sum does not depend on the order: hundredths of a square meter of crown.
        crown = np.rint(np.where(bears, 100.0 * np.pi * plants.radius**2, 0.0))
        for species in range(len(self.outside)):
            alike = plants.species == species
            sums = np.bincount(place[alike], crown[alike], self.rows * self.columns).reshape(self.rows, self.columns)
            # About a normal distribution, whose mean distance is √(π / 2) standard deviations.
            width = np.sqrt(1.0 + 12.0 / np.pi * self.traits.dispersal[species] ** 2 / area)
            for axis in (0, 1, 0, 1):
                sums = _smoothed(sums, round((width - 1.0) / 2.0), axis)
            out[species] = sums * (0.01 * self.traits.fecundity[species] / area) + self.outside[species]
        return out.reshape(len(self.outside), -1)

    def plants(self, plants: Plants, light: LightGrid, year: int, first: int, seed: int) -> Plants:
        """Plants that come in a year; ``light`` is what there is below the others."""
        site = self.site
        width, depth = site.size
        rows, columns = (max(round(size / light.cell), 1) for size in (depth, width))
        cells = rows * columns
        key = child_key(keys_of(seed, _SOWN), np.arange(cells) + year * cells)
        come = uniform(key, StandDraw.COME)
        # One plant at most in each cell and year: only where the dice allow it, all else is asked.
        most = min(self.most * (width * depth / cells) / 1e4, 1.0)
        index = np.flatnonzero(come < most)
        key, come = key[index], come[index] / most
        x = (index % columns + uniform(key, StandDraw.X)) * (width / columns)
        y = (index // columns + uniform(key, StandDraw.Y)) * (depth / rows)
        here = site.cells(x, y)
        ground = light.at(x, y, np.zeros(len(x)))
        column = np.minimum((x * (self.columns / width)).astype(np.int64), self.columns - 1)
        row = np.minimum((y * (self.rows / depth)).astype(np.int64), self.rows - 1)
        seeds = self.fallen(plants)[:, row * self.columns + column]
        # Light that seedlings need, and that in which they do well, falls with the tolerance of shade.
        least = (0.9 * self.traits.light_compensation)[:, None]
        lit = np.clip((ground[None, :] - least) / (3.0 * least), 0.0, 1.0)
        able = seeds * lit * self.suitability[:, here]
        total = able.sum(axis=0)
        chance = total / (total + _HALF) * site.plantable.ravel()[here]
        kept = np.flatnonzero(come < chance)
        limits = np.cumsum(able[:, kept], axis=0)
        species = (uniform(key[kept], StandDraw.SPECIES) * total[kept] >= limits).sum(axis=0)
        species = np.minimum(species, len(self.outside) - 1)
        quality = self.suitability[species, here[kept]]
        basal = _SOWN_DIAMETER * self.traits.first[species]
        return newcomers(key[kept], first, species, x[kept], y[kept], basal, quality, _SOWN_AGE, self.traits)


def _smoothed(values: Floats, reach: int, axis: int) -> Floats:
    """Means of the cells within a reach along an axis; what leaves on one side enters on the other."""
    size = values.shape[axis]
    reach = min(reach, (size - 1) // 2)
    if reach < 1:
        return values
    wide = np.pad(values, [(reach + 1, reach) if one == axis else (0, 0) for one in (0, 1)], "wrap")
    sums = np.cumsum(wide, axis)
    span = 2 * reach + 1
    return (sums.take(range(span, span + size), axis) - sums.take(range(size), axis)) / span


_BLOCK = 1 << 15  # plants that are looked at together
#: Most records of a stand, some 70 bytes each here and again in the file.
MOST_RECORDS = 20_000_000
_MARGIN = 12.0  # meters of open ground beyond open edges
_LEVEL = 0.5  # meters between the highest and the lowest ground up to which it counts as level


@dataclass(frozen=True)
class StandSettings:
    """How a stand grows. Fields with a label are properties of the scene, and documented by their tooltips."""

    years: int = setting(80, "Years", "How long the stand grows", min=1, soft_max=300, max=2000)
    interval: int = script_setting(5, min=0)  # years between two records of the stand; 0 keeps the last year only
    seed: int = setting(0, "Seed", "A different seed gives a different stand")
    density: float = setting(
        2500.0, "Planted", "Young plants per hectare at the start; 0 leaves the ground bare", **within(0.0, 20_000.0)
    )
    recruits: float = setting(
        300.0,
        "Seedlings",
        "Most plants that come up from seed per hectare and year; light and soil allow fewer. 0 for none",
        **within(0.0, 2000.0),
    )
    outside: float = setting(
        1.0,
        "Incoming Seeds",
        "Factor on the seeds that arrive from beyond the ground; at 0, only the stand itself bears seeds",
        **within(0.0, 10.0),
    )
    disturbance: int = script_setting(0, min=0, max=2000)  # years before the end when all trees die; 0: never
    min_height: float = script_setting(1.0, min=0.0)  # meters; lower plants are not part of the result
    cell: float = script_setting(1.0, min=0.1)  # width, meters, of the columns in which light is computed
    #: Light comes in from all sides, as at the edge of a wood. Otherwise the stand goes on beyond the ground, and what
    #: grows at one side shades what grows at the opposite one.
    open_edges: bool = script_setting(False)


def grow(site: StandSite, species: Sequence[StandSpecies], settings: StandSettings) -> Job[Records]:
    """Grow a stand; a job, which yields after each year and returns its records.

    Of plants at year 0, each ``interval`` years (0: only at the end), and whenever one appears, dies, falls or is gone.

    Raises
    ------
    TetFloraError
        A setting cannot be, or the ground is too large; names it.
    """
    stand = begun(site, species, settings)
    for year in range(settings.years):
        yield Progress(year / settings.years, f"Growing the stand: year {year} of {settings.years}")
        stand.step(year)
    return stand.finished()


def begun(site: StandSite, species: Sequence[StandSpecies], settings: StandSettings) -> "GrowingStand":
    """A stand at its beginning, which whoever has it steps from year to year; see `grow`."""
    _check(settings)
    return GrowingStand(site, StandTraits(species), settings)


def _check(settings: StandSettings) -> None:
    for name, value, low, high in (
        ("Years", settings.years, 1, 2000),
        ("Interval", settings.interval, 0, 2000),
        ("Planted", settings.density, 0, 1e7),
        ("Seedlings", settings.recruits, 0, 1e6),
        ("Incoming Seeds", settings.outside, 0, 1e6),
        ("Disturbance", settings.disturbance, 0, settings.years),
        ("Min Height", settings.min_height, 0, 200),
        ("Cell", settings.cell, 0.05, 50),
    ):
        if not low <= value <= high:  # false for NaN as well
            raise TetFloraError(f"{name} of a stand must be from {low:g} to {high:g}, not {value:g}")


class GrowingStand:
    """A stand in a year: ``plants`` that live, and ``dead`` ones."""

    def __init__(self, site: StandSite, traits: StandTraits, settings: StandSettings) -> None:
        self.site, self.traits, self.settings = site, traits, settings
        width, depth = site.size
        margin = _MARGIN if settings.open_edges else 0.0
        rows, columns = (max(round((size + 2.0 * margin) / settings.cell), 3) for size in (depth, width))
        # Columns are square: the last row and column may lie a little beyond the ground.
        cell = max((width + 2.0 * margin) / columns, (depth + 2.0 * margin) / rows)
        ground = None
        if np.ptp(site.height) > _LEVEL:
            x, y = np.meshgrid((np.arange(columns) + 0.5) * cell - margin, (np.arange(rows) + 0.5) * cell - margin)
            ground = site.ground(x.ravel(), y.ravel())
        self.light = LightGrid(rows, columns, cell, margin, ground)
        suitability = np.stack([site.suitability(needs) for needs in traits.needs])
        if not suitability.any():
            raise TetFloraError(
                "None of the species can grow in this climate and soil; change Degree Days, Coldest Month or species"
            )
        self.slope = site.slope()
        self.plants = planted(site, traits, suitability, settings.density, settings.seed)
        if not len(self.plants) and settings.recruits * settings.outside * traits.incoming_seeds.sum() <= 0.0:
            raise TetFloraError("Nothing is planted and no seeds come; raise Planted, or Seedlings and Incoming Seeds")
        self.seeds = SeedDispersal(site, traits, suitability, settings.recruits, settings.outside)
        self.count, self.dead, self.kept = len(self.plants), DeadPlants.empty(), []

    def step(self, year: int) -> None:
        """One year."""
        every = self.settings.interval
        record = every > 0 and year % every == 0
        plants = self._recorded(year, record)
        self._decay(year, record)
        crowns = plants.crowns(self.traits)
        strips = self.light.fill(crowns)
        taken, disturbed = np.zeros(len(plants)), year == self.settings.years - self.settings.disturbance
        for index, light in zip(strips, on_all_cores(self.light.taken, range(len(strips))), strict=True):
            taken[index] = light

        def changed(block: slice) -> tuple[Plants, Mask]:
            after = grown(plants, crowns, taken, self.light, self.traits, block)
            return after, dying(after, self.traits, year) | disturbed

        parts = list(on_all_cores(changed, blocks(len(plants), _BLOCK)))
        sown = self.settings.recruits > 0.0
        new = self.seeds.plants(plants, self.light, year, self.count, self.settings.seed) if sown else Plants.empty()
        if parts:
            self._die(plants.take(np.flatnonzero(np.concatenate([part[1] for part in parts]))), year, record)
            plants = Plants.concatenate([part[0].take(~part[1]) for part in parts])
        self.plants = Plants.concatenate([plants, new])
        self.count += len(new)
        if sum(map(len, self.kept)) > MOST_RECORDS:
            remedy = "raise Interval or Min Height, or use a smaller ground"
            raise TetFloraError(f"The stand has over {MOST_RECORDS:,} records; {remedy}")
        if len(self.plants) > MOST_PLANTS:
            raise TetFloraError(f"The stand has over {MOST_PLANTS:,} plants; lower Seedlings, or use a smaller ground")

    def _recorded(self, year: int, record: bool) -> Plants:
        """Plants, of which those that are tall enough are recorded, or only those that are new."""
        plants = self.plants
        if not self.settings.interval:
            return plants
        tall = plants.height >= self.settings.min_height
        index = np.flatnonzero(tall if record else tall & ~plants.known)
        if len(index):
            self.kept.append(plants.take(index).records(year, self.traits, self.site))
            plants = replace(plants, known=plants.known | tall)
        return plants

    def _die(self, plants: Plants, year: int, record: bool) -> None:
        """Plants that do not see the next year."""
        last = plants.records(year, self.traits, self.site)
        if self.settings.interval and not record:
            self.kept.append(last.take(np.flatnonzero(plants.known)))
        tall = np.flatnonzero(plants.height >= self.settings.min_height)
        plants, last = plants.take(tall), last.take(tall)
        self.dead = DeadPlants.concatenate([self.dead, fallen(plants, last, self.site, self.slope, year)])

    def _decay(self, year: int, record: bool) -> None:
        """Dead trees: some fall, some are gone."""
        dead = self.dead
        if self.settings.interval and len(dead):
            # Records of the year in which one falls, of the next, when it lies, and of its last.
            recorded = record | (dead.falls == year) | (dead.falls == year - 1) | (dead.gone == year)
            self.kept.append(dead.take(np.flatnonzero(recorded & (dead.died < year))).records(year))
        self.dead = dead.take(np.flatnonzero(dead.gone > year))

    def finished(self) -> Records:
        """Records of the whole, with plants numbered from 0."""
        year = self.settings.years
        self._decay(year, False)
        end = [self.plants.records(year, self.traits, self.site), self.dead.records(year)]
        tall = np.flatnonzero(end[0].height >= self.settings.min_height)
        first = in_order(Records.concatenate([*self.kept, end[0].take(tall), end[1]]))
        if not len(first):
            return first
        # A dead tree that falls in the last year is recorded twice: the same row.
        first = first.take(np.flatnonzero(np.append(True, (np.diff(first.plant) != 0) | (np.diff(first.year) != 0))))
        return replace(first, plant=(np.cumsum(np.append(True, np.diff(first.plant) != 0)) - 1).astype(np.int32))
