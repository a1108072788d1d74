# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a species is: ranges for each branch order and a sample leaf (paper, section 5).

`crown_ratio` gives the length of branches along their parent.

Its ecology is what it needs, how it grows beside others, and how it spreads; it changes no plant. Tolerances are those
of Niinemets and Valladares ("Tolerance to shade, drought, and waterlogging of temperate northern hemisphere trees and
shrubs", Ecological Monographs 76, 2006), from 0, none, to 5.

Its year is when its leaves appear, grow, turn and fall, in dates that are published, and their colors. Dates are days
of the year, 1 to 365, at a latitude that the species names. How far they move with the latitude is measured in Europe;
Hopkins' law of four days a degree ("Periodical events and natural law as guides to agricultural research and practice",
1918) is that of eastern North America.

Sizes follow the function of Chapman and Richards (F. J. Richards, "A flexible growth function for empirical use", 1959;
D. G. Chapman, 1961). Branches keep their place in meters while their parent grows beyond them. They are *nodes* on the
full-grown axis, numbered from where its crown begins; those of younger years, below, have negative numbers and stand
closer, because shoots were shorter then.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Integers, Mask
from ..leaves.models import LeafModel
from ..parameters import Color, Range, Rgb, described, limited, named
from .skeletons import Skeleton

_SHARP = 4.0
_CURVE = (0.0001, 0.2), (10, 5)  # limits of rates, 1/year, and powers of curves


@dataclass(frozen=True)
class Ages:
    """How a species grows; years. Curves are [rate, power], see `grown`."""

    full: float = limited(..., 0.1, 5000, "age at which it is as described")
    height: tuple[float, float] = limited((0.04, 1.2), *_CURVE, "curve of the height")
    diameter: tuple[float, float] = limited((0.03, 1.2), *_CURVE, "curve of the diameter of the trunk")
    lifespan: float = limited(200.0, 0.2, 20000, "age at which it dies")
    decline: float = limited(0.75, 0.05, 0.99, "fraction of the lifespan from which on it declines")
    base: float = limited(2.0, 1, 10, "the bare part of the trunk grows as this power of the height")
    spread: float = limited(0.72, 0.2, 2, "limbs grow as this power of the diameter of the trunk")
    leaves: float = limited(1.85, 0.5, 4, "leaf area grows as this power of the diameter of the trunk")
    flowers: float = limited(10.0, 0, 5000, "age from which on it bears short shoots with blossoms, cones or fruit")
    scaled: bool = described(False, "whether it only grows in size, without changing its form")
    source: str = described("", "where the curves are from")

    def heights(self, years: float) -> float:
        """Height over that at the full age; it stands still when the plant declines."""
        return grown(min(years, self.decline * self.lifespan), self.full, *self.height)

    def diameters(self, years: float) -> float:
        """Diameter of the trunk over that at the full age; it stands still at death."""
        return grown(min(years, self.lifespan), self.full, *self.diameter)

    def declined(self, years: float) -> float:
        """How far it has declined: 0 in good health, 1 dead; what only grows in size does not."""
        return 0.0 if self.scaled else float(np.clip((years / self.lifespan - self.decline) / (1 - self.decline), 0, 1))


def grown(years: float, full: float, rate: float, power: float) -> float:
    """Size at an age over that at the full age (Chapman and Richards)."""
    return (math.expm1(-rate * years) / math.expm1(-rate * full)) ** power


def rounded_least(a: float, b: float, full: float) -> float:
    """The smaller of two, rounded off; 1 where a is 1 and b is ``full``."""
    return ((a**-_SHARP + b**-_SHARP) / (1 + full**-_SHARP)) ** (-1 / _SHARP)


class NodeLaw(NamedTuple):
    """Numbers of nodes along full-grown axes (...), from where the crown begins; negative below that."""

    #: begin and end, (...): fractions of the full-grown length.
    begin: ArrayLike
    end: ArrayLike
    power: ArrayLike  # (...): the number of nodes below grows as this power of the length
    #: whole and below, (...): nodes from ``begin`` to ``end`` (and on, as densely), and from the foot to ``begin``.
    whole: ArrayLike
    below: ArrayLike

    def number_at(self, place: ArrayLike) -> Floats:
        """Number (...) of nodes up to places (...), fractions of the full-grown length."""
        if isinstance(place, float) and isinstance(self.begin, float):  # as below, in a tenth of the time
            if place >= self.begin:
                return self.whole * (place - self.begin) / max(self.end - self.begin, 1e-9)
            return self.below * (min(max(place / max(self.begin, 1e-9), 0.0), 1.0) ** self.power - 1)
        place, begin = np.asarray(place, np.float64), np.asarray(self.begin, np.float64)
        above = self.whole * (place - begin) / np.maximum(self.end - begin, 1e-9)
        part = np.clip(place / np.maximum(begin, 1e-9), 0, 1)
        return np.where(place >= begin, above, self.below * (part**self.power - 1))

    def place_of(self, node: ArrayLike) -> Floats:
        """Place (...) of nodes (...), the inverse of `number_at`."""
        node = np.asarray(node, np.float64)
        above = self.begin + (self.end - self.begin) * node / np.maximum(self.whole, 1e-9)
        part = np.clip(1 + node / np.maximum(self.below, 1e-9), 0, 1)
        return np.where(node >= 0, above, self.begin * part ** (1 / np.asarray(self.power)))


class Nodes(NamedTuple):
    """Where children of one sort are on axes that are not full-grown, see `law`."""

    #: whole and below: nodes between the begin and the end of the full-grown axis, and from its foot to there, over
    #: those that are alive now.
    whole: float
    below: float
    #: begin and end: where the first and the last are on the full-grown axis, as fractions of its length.
    begin: float
    end: float = 1.0
    power: float = 1.0  # the number of nodes below grows as this power of the length
    until: float = 1.0  # where the topmost are now, as a fraction of the present length
    kept: float = 1.0  # of those, from the lowest up, the fraction that is left
    #: extra and fresh: for each node so many more that live only for a while: on the topmost fraction of the others.
    extra: float = 0.0
    fresh: float = 0.0

    def law(self, number: float) -> NodeLaw:
        """The law of nodes of which so many are alive now."""
        return NodeLaw(self.begin, self.end, self.power, self.whole * number, self.below * number)

    def ends(self, law: NodeLaw, start: float, now: float) -> tuple[float, float, float]:
        """First, first short-lived and last place, see `NodeLaw`, on axes ``now`` long, ``start`` of which is bare."""
        first, top = law.number_at(np.array([start, self.until]) * now)
        last = first + self.kept * (top - first)
        return start * now, *law.place_of([last - self.fresh * (last - first), last]).tolist()


@dataclass(frozen=True)
class PartGrown:
    """How far the branches of an order have grown."""

    now: float  # their length over that when they are full-grown
    #: 1 where the number of nodes on a full-grown branch is known as a whole number, 0 where it changes with time.
    settled: float
    #: laterals, spurs and dead: their children.
    laterals: Nodes
    spurs: Nodes
    dead: Nodes
    #: Fractions of the children, from the lowest up and from the topmost down, that are about to die or just grow.
    ramps: tuple[float, float] = (0.0, 0.0)


#: Lower part of the children that live for a while: the sooner they go, the shorter; above, the later they came.
_FADING = 0.6
#: Middles of equal parts of a whole, over which expectations are means.
EVEN = (np.arange(256) + 0.5) / 256


def some_nodes(law: NodeLaw, ends: ArrayLike, extra: float) -> tuple[Floats, Floats, Mask]:
    """Places (512,) of children between ``ends``, see `Nodes.ends`, as many as stand for all.

    With them, how many each stands for (512,), 1 on the mean, and whether it lives for a while (512,).
    """
    base, fresh, tip = law.number_at(ends)
    weight = np.array([tip - base, extra * (tip - fresh)])
    node = np.concatenate([base + (tip - base) * EVEN, fresh + (tip - fresh) * EVEN])
    weight = np.repeat(weight / max(weight.mean(), 1e-12), len(EVEN))
    return law.place_of(node), weight, np.repeat([False, True], len(EVEN))


def faded(place: Floats, first: ArrayLike, long: ArrayLike, extra: Mask) -> Floats:
    """Factors (n,) on lengths of laterals at places (n,): the short-lived are on a part ``long`` from ``first`` on."""
    part = (place - first) / np.maximum(long, 1e-9)
    return np.where(extra, np.clip(np.minimum(part / _FADING, (1 - part) / (1 - _FADING)), 0, 1), 1.0)


def shortened(fraction: Floats, low: ArrayLike, high: ArrayLike) -> Floats:
    """Factor (...) on lengths of laterals at fractions (...) of their part of a branch, by ``ramps`` of `PartGrown`."""
    return np.clip(fraction / np.maximum(low, 1e-9), 0, 1) * np.clip((1 - fraction) / np.maximum(high, 1e-9), 0, 1)


DAYS = 365.0
"""Length of the year; a date beyond it is one of the next year."""
MAX_AUTUMN = 4
"""Autumn colors of a kind of leaf at most."""
#: Days by which spring comes later for each degree toward the pole (birch's bud burst in Europe from 44° to 68° N in
#: 2010, first leaves of others 1.6 to 2.7: results of the BEAGLE project), and by which autumn comes earlier: leaves
#: turn by .5 to 3 days a degree (Menzel, Estrella and Fabian, "Spatial and temporal variability of the phenological
#: seasons in Germany", 2001, and others).
_SPRING_DAYS, _AUTUMN_DAYS = 2.2, 2.0
_MIDSUMMER, _MIDWINTER = 190.0, 10.0
_FARTHEST = 2.8  # no leaf is farther from the mean than so many standard deviations


@dataclass(frozen=True)
class LeafYear:
    """The year of one kind of leaves; those of a plant differ by what their keys say.

    Days on which half of the leaves have done a thing come each later than the one before by less than a year; those
    beyond `DAYS` lie in the next year. Spreads are standard deviations among the leaves of a plant.
    """

    appear: float = limited(..., 1, DAYS, "day on which half of the leaves have appeared")
    turn: float = limited(..., 1, 2 * DAYS, "day on which half of them have changed their color")
    fall: float = limited(..., 1, 2 * DAYS, "day on which half of them have fallen")
    appear_spread: float = limited(4.0, 0, 60, "spread of the day on which they appear", "days")
    growth: float = limited(25.0, 0, 120, "time in which a leaf grows to its full size", "days")
    fresh: Rgb | None = described(None, "color of a leaf that has just appeared; as in summer without", "linear RGB")
    turn_spread: float = limited(8.0, 0, 60, "spread of the day on which they turn", "days")
    turning: float = limited(14.0, 0, 90, "time in which a leaf changes its color", "days")
    #: Linear RGB of leaves that have turned, at most `MAX_AUTUMN` of them; none for leaves that fall as they are.
    autumn: tuple[Rgb, ...] = ()
    fall_spread: float = limited(5.0, 0, 60, "spread of the day on which they fall beyond that of turning", "days")
    dry: Rgb = described((0.21, 0.115, 0.052), "color of dead leaves that hang on", "linear RGB")
    kept: float = limited(0.0, 0, 1, "fraction of the leaves that hang on, dry, until the next ones appear")
    turnover: float = limited(1.0, 0, 1, "fraction of the leaves that all this happens to each year; others stay")

    @property
    def middle(self) -> float:
        """Day in the middle of the leaves' life."""
        return (self.appear + self.fall) / 2

    @property
    def origin(self) -> float:
        """Day half a year before that, from which tables and the days of leaves are counted."""
        return self.middle - DAYS / 2


@dataclass(frozen=True)
class Year:
    """The year of a species; where it has none for leaves or blossoms, these are there all year."""

    latitude: float = limited(50.0, 0, 70, "latitude at which its dates hold", "degrees north")
    spring: float = limited(5.0, 0, 40, "time by which plants of one place are earlier or later at most", "days")
    autumn: float = limited(7.0, 0, 40, "the same in autumn", "days")
    leaf: LeafYear | None = None
    blossom: LeafYear | None = None
    #: Plants are gone while there are none, and in a summer without days.
    fallen: bool = described(False, "whether it is nothing but leaves that have fallen")
    source: str = described("", "where the dates are from")

    def of_kind(self, kind: int) -> LeafYear | None:
        """That of a kind of leaves, by its index in `species.LEAF_KINDS`."""
        return (self.leaf, self.blossom)[kind]

    def at_latitude(self, latitude: float) -> Self:
        """The same at another latitude of the northern hemisphere, degrees."""
        north = latitude - self.latitude
        if north == 0.0:
            return self
        leaf, blossom = (None if one is None else _moved(one, north) for one in (self.leaf, self.blossom))
        return replace(self, latitude=latitude, leaf=leaf, blossom=blossom)


def _moved(one: LeafYear, north: float) -> LeafYear:
    """Dates so many degrees farther north: those before midsummer later, those after it earlier, and never swapped.

    Where the year of the leaves would close, far in the south, the first and the last of them stay apart.
    """
    appear, turn, fall = (day + _days_north(day) * north for day in (one.appear, one.turn, one.fall))
    farthest = DAYS - _FARTHEST * (one.appear_spread + one.turn_spread + one.fall_spread)
    longest = max(farthest, one.fall - one.appear)
    over = max(0.0, fall - appear - longest) / 2
    appear, turn, fall = appear + over, turn - over, fall - over
    turn = max(turn, appear + one.growth)
    fall = min(max(fall, turn + one.turning / 2), appear + longest)
    return replace(one, appear=appear, turn=min(turn, fall), fall=fall)


def _days_north(day: float) -> float:
    """Days by which a date moves for a degree; nothing at midsummer and midwinter, between which it goes smoothly."""
    day = (day - _MIDWINTER) % DAYS
    half = _MIDSUMMER - _MIDWINTER
    spring = day < half
    place = day / half if spring else (day - half) / (DAYS - half)
    return min(1.0, 4.0 * min(place, 1.0 - place)) * (_SPRING_DAYS if spring else -_AUTUMN_DAYS)


@dataclass(frozen=True)
class Ecology:
    """What a species needs and does; where a number is from is said in ``source``."""

    shade: float = limited(2.7, 0, 5, "tolerance of shade, 0 none to 5")
    drought: float = limited(2.7, 0, 5, "tolerance of drought")
    waterlogging: float = limited(1.7, 0, 5, "tolerance of waterlogging")
    degree_days: float = limited(700.0, 0, 8000, "sum of daily mean temperatures over 5 °C that it needs at least")
    coldest_month: float = limited(-15.0, -70, 30, "coldest mean of a month that it survives", "°C")
    fertility: float = limited(0.4, 0, 1, "fertility of the soil below which it grows less")
    fecundity: float = limited(30.0, 0, 1e6, "seeds that can germinate, for each square meter of crown and year")
    dispersal: float = limited(25.0, 0.1, 1e5, "mean distance that seeds travel", "m")
    height: float = limited(32.0, 0.01, 130, "height of the largest on a good site", "m")
    diameter: float = limited(1.2, 0.001, 12, "diameter of the largest on a good site", "m")
    height_curve: tuple[float, float] = limited(
        (4.0, 0.9), 0.1, 1000, "b and c of heights in closed stands, 1.3 + (height − 1.3)(1 − exp(−b diameter))^c, in m"
    )
    crown_width: tuple[float, float] = limited(
        (1.2, 20.0), 0, 300, "width of the crown of a tree that stands free, first + second × diameter", "m"
    )
    crown_conicity: float = limited(0.3, 0, 1, "shape of the crown: 0 a dome, 1 a cone")
    leaves: float = limited(6.0, 0.05, 20, "leaf area over the ground below a crown that is free to its foot")
    extinction: float = limited(0.5, 0.1, 1, "fraction of the light that a thin layer of leaves takes, over its area")
    light_compensation: float = limited(0.08, 0.001, 0.9, "light at which the lowest limbs die, over that in the open")
    wood_density: float = limited(530.0, 20, 1400, "dry mass of the wood over its fresh volume", "kg/m³")
    form_factor: float = limited(0.6, 0.05, 3, "wood above ground, with limbs, over diameter² × π/4 × height")
    light_use_efficiency: float = limited(
        0.9, 0.001, 10, "dry wood that all light on a square meter makes in a year on a good site", "kg"
    )
    diameter_increment: float = limited(0.012, 1e-5, 0.1, "most by which the diameter grows in a year", "m")
    source: str = described("", "where the numbers are from")


LEAF_KINDS = ("leaf", "blossom")
LEAF_ENVELOPES = ("none", "sphere", "cylinder", "cone", "box")
"""Solids around a branch that leaves may fill."""
LEAF_INCLINATIONS = ("branch", "spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform")
"""How leaves stand: as the branch has it, or by a distribution of the angle between their normals and its axis."""
_RATIOS = {
    "conical": lambda r: 0.2 + 0.8 * r,
    "spherical": lambda r: 0.2 + 0.8 * np.sin(np.pi * r),
    "hemispherical": lambda r: 0.2 + 0.8 * np.sin(0.5 * np.pi * r),
    "cylindrical": np.ones_like,
    "tapered": lambda r: 0.5 + 0.5 * r,
    "flame": lambda r: np.maximum(np.where(r <= 0.7, r / 0.7, (1 - r) / 0.3), 0.05),
    "inverse conical": lambda r: 1 - 0.8 * r,
    "tend flame": lambda r: np.where(r <= 0.7, 0.5 + 0.5 * r / 0.7, 0.5 + 0.5 * (1 - r) / 0.3),
    "receding": lambda r: 0.4 + 0.6 * r,
}
CROWN_PROFILES = tuple(_RATIOS)
"""Names of the shapes, in the order of their numbers (Weber and Penn, SIGGRAPH 1995, section 4.3), and one more."""
BARKS = (
    "ridged", "plated", "smooth", "banded", "ringed", "fibrous", "jointed", "netted", "peeling", "scaly",
    "interlaced", "pitted", "papery",
)  # fmt: skip
"""Characters of bark that materials know."""
QUALITY_LIMITS = (0.0001, 1000.0)


_FORKS_FROM = 1e-4  # a fork is there once its stems are so long, in lengths of the full-grown branch


@dataclass(frozen=True, kw_only=True)
class Order:
    """One branch order; order 0 is the trunk. Lengths of others are also times the ``crown`` shape of the parent."""

    length: Range = limited(
        ..., 0.001, 200, "length of a branch", "m for the trunk, otherwise fraction of the parent's length"
    )
    thickness: Range = limited(
        ..., 0.001, 1, "radius at the base", "fraction of the trunk's length, or of the parent's radius"
    )
    taper: Range = limited(Range(0.3, 0), 0, 1, "radius at the tip", "fraction of the base radius")
    flare: float = limited(0.0, 0, 4, "extra thickness at the very base", "fraction of the radius")
    pipe: float = limited(
        0.0,
        0,
        4,
        "exponent of the pipe model, which divides the radius of a branch among its children (2 is Leonardo's rule; "
        "values below 1 count as 1); 0 makes the thickness of a child a fraction of the parent's radius there",
    )
    segments: int = limited(1, 1, 32, "straight segments along a branch")
    sides: int = limited(4, 3, 64, "faces around a branch")
    curvature: Range = limited(
        Range(0, 0), -360, 360, "bend along the length; positive bends toward the parent", "degrees"
    )
    curvature_tip: float = limited(
        ..., -360, 360, "bend of the outer half (default: same as curvature)", "degrees", follows="curvature"
    )
    attraction: Range = limited(
        Range(0, 0), -360, 360, "turn of a level branch toward the sky; negative turns down", "degrees"
    )
    angle: Range = limited(Range(0, 0), 0, 180, "angle between branch and parent, at the parent's base", "degrees")
    angle_tip: float = limited(
        ..., 0, 180, "the same at the parent's tip (default: same as angle)", "degrees", follows="angle"
    )
    azimuth: Range = limited(Range(137.5, 10), -360, 360, "rotation around the parent between branches", "degrees")
    spray: float = limited(0.0, 0, 1, "how strongly branches spread horizontally to both sides of their parent")
    whorl: int = limited(1, 1, 12, "branches at each node: 1 alternate, 2 opposite, 3 or more a whorl")
    branches: Range = limited(Range(0, 0), 0, 10_000, "number of branches of the next order on each branch")
    branch_start: Range = limited(Range(0.1, 0), 0, 0.99, "part at the base without branches", "fraction of the length")
    crown: str = named("cylindrical", CROWN_PROFILES, "how the length of child branches varies along the branch")
    count_by_length: float = limited(
        0.0, 0, 1, "how many fewer branches and leaves shorter branches bear: 0 not at all, 1 in proportion"
    )
    forks: Range = limited(Range(0, 0), 0, 8, "number of stems that the branch forks into; 0 disables forking")
    fork_at: float = limited(0.5, 0.05, 0.95, "position of the first fork", "fraction of the length")
    fork_angle: Range = limited(Range(25, 8), 0, 120, "angle by which each stem turns away", "degrees")
    fork_levels: int = limited(1, 1, 4, "number of successive forks, evenly spaced up to the tip")
    spurs: Range = limited(Range(0, 0), 0, 10_000, "number of short shoots on each branch, as defined by spur")
    spur_start: Range = limited(
        Range(0.1, 0), 0, 0.99, "part at the base without short shoots", "fraction of the length"
    )
    leaf_kind: str = named("leaf", LEAF_KINDS, "what grows on the branch: the leaf or the blossom of the species")
    leaves: Range = limited(Range(0, 0), 0, 100_000, "number of leaves directly on each branch of this order")
    leaf_envelope: str = named(
        "none", LEAF_ENVELOPES, "solid around the branch that leaves fill evenly, instead of sitting on its axis"
    )
    leaf_envelope_radius: float = limited(
        0.5, 0.001, 20, "radius of the solid; of a box half of its side", "fraction of the length"
    )
    leaf_inclination: str = named(
        "branch", LEAF_INCLINATIONS, "distribution of the angle between leaf normals and the axis of the branch"
    )
    leaf_whorl: int = limited(1, 1, 64, "leaves at each node: 1 alternate, 2 opposite, 3 or more a whorl")
    leaf_start: Range = limited(Range(0.1, 0), 0, 0.99, "part at the base without leaves", "fraction of the length")
    leaf_size: Range = limited(Range(0.08, 0.02), 0.0005, 20, "length of a leaf", "m")
    leaf_size_tip: float = limited(1.0, 0.05, 5, "size of leaves at the outside of the crown", "fraction of leaf_size")
    leaf_size_young: float = limited(
        1.0, 0.05, 5, "size of young leaves, those at the ends of the branches", "fraction of the size"
    )
    leaf_angle: Range = limited(Range(50, 15), 0, 180, "angle between branch and leaf", "degrees")
    leaf_azimuth: Range = limited(Range(137.5, 20), -360, 360, "rotation around the branch between leaves", "degrees")
    leaf_light: Range = limited(Range(0.5, 0), 0, 1, "how strongly leaves turn toward the sky")
    leaf_light_tip: float = limited(
        ...,
        0,
        1,
        "how strongly leaves turn toward the sky at the outside of the crown (default: same as leaf_light)",
        follows="leaf_light",
    )
    leaf_spray: float = limited(0.0, 0, 1, "how strongly leaves spread horizontally to both sides of their branch")
    leaf_droop: float = limited(0.0, 0, 1, "how strongly leaves hang down")
    branch_color: Color = described(Color((0.16, 0.11, 0.07), (0.04, 0.03, 0.02)), "color of the bark", "linear RGB")
    leaf_color: Color = described(Color((0.08, 0.19, 0.03), (0.03, 0.06, 0.01)), "color of the leaves", "linear RGB")
    leaf_color_tip: Rgb = described(
        ..., "color of leaves at the crown's outside (default: same as leaf_color)", "linear RGB", follows="leaf_color"
    )
    leaf_color_young: Rgb = described(
        ...,
        "color of young leaves, at the ends of the branches, inside the crown; those outside differ from it as other "
        "leaves do (default: same as leaf_color)",
        "linear RGB",
        follows="leaf_color",
    )
    growing: PartGrown | None = None  # How far it has grown; None where it is as long as it will be


@dataclass(frozen=True)
class Bud:
    """The buds of shoots with leaves: one at the end of each, others in the axils of its leaves."""

    length: float = limited(0.005, 0.0005, 0.1, "length", "m")
    width: float = limited(0.5, 0.05, 1.5, "width, fraction of the length")
    lateral: float = limited(1.0, 0, 1, "fraction of the leaves with a bud in their axil")
    color: Rgb = described((0.11, 0.06, 0.035), "color")


@dataclass(frozen=True)
class Dead:
    """Dead branches of a trunk below and in the lower crown: broken off or bare.

    ``orders`` are the dead branches; then, if any, the twigs on these.
    """

    number: Range = limited(Range(10, 4), 0, 1000, "number on the trunk")
    low: float = limited(0.25, 0, 0.95, "where they begin, fraction of what is bare of branches", written="from")
    high: float = limited(0.12, 0.01, 0.95, "where they end, fraction of the rest", written="into")
    on_limbs: Range = limited(Range(0, 0), 0, 1000, "number on each limb (branch of order 1), likewise")
    orders: tuple[Order, ...] = ()

    def part(self, start: float) -> tuple[float, float]:
        """From where to where they are, fractions of an axis that is bare up to a fraction of it."""
        return self.low * start, start + self.high * (1 - start)


@dataclass(frozen=True, kw_only=True)
class Species:
    """A species as read from its file."""

    #: identifier, name and description: identifier is the file's name without its ending.
    identifier: str
    name: str = limited(..., 1, 1000, "name")
    description: str = described("", "description")
    orders: tuple[Order, ...]  # from the trunk up; at most `skeletons.MAX_ORDERS`
    #: leaf and blossom: forms of the sample leaf, and of blossoms or fruit, where there are any; each leaf has one of
    #: them by chance. A string is the name of a Blender mesh object, which the bridge to Blender replaces by a model.
    leaf: tuple[LeafModel | str, ...]
    leaf_transmission: float = limited(0.4, 0, 1, "fraction of the light scattered by a leaf that goes through it")
    blossom: tuple[LeafModel | str, ...] = ()
    blossom_transmission: float = limited(0.4, 0, 1, "the same of blossoms or fruit")
    #: A short shoot; its length is in meters and its thickness a fraction of that, as for a trunk.
    spur: Order | None = None
    bud: Bud | None = None
    dead: Dead | None = None
    bark: str = named(BARKS[0], BARKS, "character of the bark")
    quality: float = limited(1.0, *QUALITY_LIMITS, "polygons of a plant, of those that the description gives")
    habit: float = limited(0.0, 0, 1, "how far trees are those of a dense stand, not free ones as described")
    stand_leaves: float = limited(1.0, 0.05, 1, "fraction of the leaves on a twig that are left in a dense stand")
    exact: bool = described(False, "whether all plants are the same: ranges have their means, and seeds do not matter")
    skeleton: Skeleton | None = None  # trunk and lower orders modeled by hand; only the orders above are grown
    #: (Species, float): of what, and at how many years, this is another age; see `ages.with_age`.
    aged: tuple[Self, float] | None = None
    crowded: bool = False  # of a dense stand: its leaves lie closer where its crown is narrower
    year: Year | None = None  # when leaves appear, turn and fall
    ages: Ages | None = None  # how it grows
    ecology: Ecology | None = None  # what it needs among others

    def forms(self, kind: str) -> tuple[LeafModel | str, ...]:
        """Forms of leaves of a kind, one of `LEAF_KINDS`; leaves where there are no blossoms."""
        return self.blossom or self.leaf if kind == "blossom" else self.leaf


def fork_cuts(order: Order) -> list[float]:
    """Ends of the parts into which forks divide the branches of an order, fractions of the length from 0 to 1."""
    cuts = whole_cuts(order)
    if order.growing is None:
        return cuts
    now = order.growing.now
    return [*(cut / now for cut in cuts[: len(cuts) - 1]), 1.0]


def whole_cuts(order: Order) -> list[float]:
    """The same as fractions of the length when it is full-grown; forks that it has not reached yet are left out."""
    if order.forks.high <= 0:
        return [0.0, 1.0]
    levels = order.fork_levels
    cuts = [0.0, *(order.fork_at + (1 - order.fork_at) * k / levels for k in range(levels)), 1.0]
    if order.growing is None:
        return cuts
    return cuts[: max(sum(cut < order.growing.now - _FORKS_FROM for cut in cuts[:-1]), 1) + 1]


def crown_ratio(shape: Integers | str, r: Floats) -> Floats:
    """Length ratio of a child, 0 to 1.

    Parameters
    ----------
    shape : (...) int or str
        Index into `CROWN_PROFILES`, or one of these for all.
    r : (...) float64
        1 at the lowest child, 0 at the parent's tip.

    Notes
    -----
    Weber and Penn 1995, table of ShapeRatio. "Receding" is their rule for the branches of branches (section 4.3):
    parent's length less 0.6 of the way to the child. Their number of leaves and of further branches, less by half
    toward the tip, is what ``count_by_length`` 5/6 makes of it. The lower end of the two flames is raised from 0 to
    0.05, so that no branch has zero length.
    """
    r = np.clip(r, 0.0, 1.0)
    if isinstance(shape, str):
        return _RATIOS[shape](r)
    used = np.bincount(np.ravel(shape), minlength=len(_RATIOS))
    return np.choose(shape, [ratio(r) if number else r for ratio, number in zip(_RATIOS.values(), used, strict=True)])
