# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a plant grows: sizes by age, and where branches leave a parent that is not as long as it will be.

Sizes follow the function of Chapman and Richards (F. J. Richards, "A flexible growth function for empirical use", 1959;
D. G. Chapman, 1961). Branches keep their place in meters while their parent grows beyond them. They are *nodes* on the
full-grown axis, numbered from where its crown begins; those of younger years, below, have negative numbers and stand
closer, because shoots were shorter then.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Mask
from ..parameters import described, limited

_SHARP = 4.0
#: Limits of rates, 1/year, and powers of curves.
_CURVE = (0.0001, 0.2), (10, 5)


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
    #: whole and below, (...): number of nodes from ``begin`` to ``end`` (and on, as densely), and from the foot to
    #: ``begin``.
    whole: ArrayLike
    below: ArrayLike

    def number_at(self, place: ArrayLike) -> Floats:
        """Number (...) of nodes up to places (...), fractions of the full-grown length."""
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
    conical: float = 0.0  # by how much the topmost children are shorter than the crown's shape would have them
    #: Fractions of the children, from the lowest up and from the topmost down, that are about to die or just grow.
    ramps: tuple[float, float] = (0.0, 0.0)


#: Lowest part of the children that live for a while in which they are the shorter the sooner they go.
_FADING = 0.9
#: Middles of equal parts of a whole, over which expectations are means.
EVEN = (np.arange(256) + 0.5) / 256


def some_nodes(ends: ArrayLike, extra: float) -> tuple[Floats, Floats, Mask]:
    """Places of children in nodes, as many as stand for all.

    Parameters
    ----------
    ends : (3,) float64
        Where nodes begin, where those begin that live for a while, and where all end.
    extra : float
        As of `Nodes`.

    Returns
    -------
    node : (512,) float64
    weight : (512,) float64
        How many children each stands for, 1 on the mean.
    extra : (512,) bool
        Whether they live for a while.
    """
    base, some, tip = ends
    weight = np.array([tip - base, extra * (tip - some)])
    node = np.concatenate([base + (tip - base) * EVEN, some + (tip - some) * EVEN])
    weight = np.repeat(weight / max(weight.mean(), 1e-12), len(EVEN))
    return node, weight, np.repeat([False, True], len(EVEN))


def faded(fraction: Floats, first: ArrayLike, extra: Mask) -> Floats:
    """Factor (n,) on the lengths of laterals at fractions (n,) of them: those that live for a while begin at one."""
    part = np.clip((fraction - first) / np.maximum(_FADING * (1 - np.asarray(first)), 1e-9), 0, 1)
    return np.where(extra, part, 1.0)


def shortened(fraction: Floats, conical: ArrayLike, low: ArrayLike, high: ArrayLike) -> Floats:
    """Factor (...) on lengths of laterals at fractions (...) of them, by ``conical`` and ``ramps`` of `PartGrown`."""
    new = np.clip((1 - fraction) / np.maximum(high, 1e-9), 0, 1)
    return (1 - conical * fraction) * np.clip(fraction / np.maximum(low, 1e-9), 0, 1) * new
