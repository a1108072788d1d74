# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers as a pure function of (seed, path of child indices, attribute).

Any part of a plant can therefore be made alone, in any order, and comes out the same. Only unsigned 64-bit integer
arithmetic is used, which numpy defines exactly, so no version of numpy or Blender changes a plant. Some choices are
spread more evenly than by chance, so that few of them give good means: stratified and systematic sampling (Cochran,
"Sampling Techniques", 1977).
"""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Integers, Keys

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
# Odd, and not the constant of seeds: else child i of seed s would be child s of seed i, and child s of seed s always 0.
_CHILD = np.uint64(0xD1342543DE82EF95)
_TO_UNIT = 2.0**-53


class Draw(IntEnum):
    """What a random number is drawn for; a number for each attribute of a branch or leaf, which is never another's."""

    LENGTH, THICKNESS, ANGLE, AZIMUTH, ROLL, PLACE = range(1, 7)
    BRANCHES, BRANCHES_ROUND, LEAVES, LEAVES_ROUND = range(7, 11)
    BRANCH_COLOR, LEAF_COLOR, LEAF_SIZE, TAPER, BRANCH_START, LEAF_START, LEAF_LIGHT, ATTRACTION = range(11, 19)
    FORKS, FORKS_ROUND, SPURS, SPURS_ROUND, SPUR_START = range(19, 24)
    LEAF_FORM, TRANSITION, SWAY_ALONG, SWAY_ACROSS, SWAY_UP, LEAF_KITE, LEAF_PLANE, TWIG_TURN = range(24, 32)
    BEND = 32  # one for each segment and axis from here on
    LEAF_LEVEL, LEAF_VARIANT = 226, 227  # beyond those of all segments
    DEAD, DEAD_ROUND, BUD, BROKEN = range(228, 232)
    LEAF_INCLINATION, LEAF_BEARING, LEAF_SIDE, LEAF_TWIST, ENVELOPE_ACROSS, ENVELOPE_AROUND = range(232, 238)
    LEAF_YEAR, SPRING, AUTUMN, AUTUMN_HUE = range(238, 242)


def mix(z: Keys) -> Keys:
    """64-bit integers (...) scrambled (the finaliser of SplitMix64; Steele, Lea and Flood, OOPSLA 2014)."""
    z = np.asarray(z, dtype=np.uint64)
    if z.ndim == 0:  # only scalars warn; wrapping is what is wanted
        return mix(z[None])[0]
    shifted = z >> np.uint64(30)
    z = z ^ shifted  # a new array, in which all that follows is worked out
    z *= _MIX_1
    z ^= np.right_shift(z, np.uint64(27), out=shifted)
    z *= _MIX_2
    z ^= np.right_shift(z, np.uint64(31), out=shifted)
    return z


def place_keys(place: Floats) -> Keys:
    """Keys (n,) of things by their places (n, 3), to a tenth of a millimeter: those of one seed differ by them."""
    key = np.zeros(len(place), np.uint64)
    for axis in range(3):
        key = mix(key ^ np.rint(place[:, axis] * 1e4).astype(np.int64).view(np.uint64))
    return key


def key_of_seed(seed: ArrayLike) -> Keys:
    """Key of a whole plant from its integer seed ((...) any integer type, negative ones too)."""
    seed = np.asarray(seed).astype(np.int64).view(np.uint64)
    with np.errstate(over="ignore"):
        return mix(seed * _GOLDEN + _GOLDEN)


def child_key(key: Keys, index: ArrayLike) -> Keys:
    """Key of the child with a given index of the branches with given keys (both broadcast)."""
    index = np.asarray(index).astype(np.uint64)
    with np.errstate(over="ignore"):
        return mix(np.asarray(key, dtype=np.uint64) ^ mix((index + np.uint64(1)) * _CHILD))


def mix_draw(key: Keys, draw: int) -> Keys:
    """Random bits, 64 for each key (...); different draws of a key are independent, see `Draw`."""
    with np.errstate(over="ignore"):
        return mix(np.asarray(key, dtype=np.uint64) + np.uint64(draw) * _GOLDEN)


def uniform(key: Keys, draw: int) -> Floats:
    """Numbers (...) in [0, 1), one for each key (...); different draws of a key are independent, see `Draw`."""
    z = mix_draw(key, draw)
    z >>= np.uint64(11)
    out = z.astype(np.float64)
    out *= _TO_UNIT
    return out


def stepped(key: Keys, index: Integers) -> Floats:
    """Numbers in [0, 1) that are spread evenly along consecutive indices (n,), beginning where each key (n,) says.

    Steps by the golden section (H. Weyl, "Über die Gleichverteilung von Zahlen mod. Eins", 1916): of any run of them,
    the fraction inside an interval is its length, to within one or two.
    """
    return ((key + np.asarray(index).astype(np.uint64) * _GOLDEN) >> np.uint64(11)).astype(np.float64) * _TO_UNIT


def signed(key: Keys, draw: int) -> Floats:
    """Numbers (n,) in [-1, 1), one for each key (n,)."""
    out = uniform(key, draw)
    out *= 2.0
    out -= 1.0
    return out


#: Multiples of it, less the whole part, are spread evenly, any run of them: the golden section.
GOLDEN = (np.sqrt(5) - 1) / 2
_THIN = 201  # a draw of this module, beyond those of growth and samples


def evenly(key: Keys, draw: int) -> Floats:
    """Numbers in [0, 1) as from `uniform`, but for all keys (n,) together one in each n-th of the interval."""
    out = np.empty(len(key))
    out[np.argsort(uniform(key, draw), kind="stable")] = (np.arange(len(key)) + 0.5) / len(key)
    return out


def thinned(number: int, places: int) -> Integers:
    """Indices (places,) of some of a number of things in order, or all and some again; one of each run.

    Which one of the run is random: a fixed step could fall in with a pattern of the things.
    """
    each = np.arange(places)
    return ((each + uniform(key_of_seed(each), _THIN)) * (number / places)).astype(np.int64)


def systematic(weights: Floats, group: Integers, sort: Floats, numbers: Integers) -> Integers:
    """Draw things by their weights from each of several groups (systematic resampling).

    Parameters
    ----------
    weights : (n,) float64
    group : (n,) int64
    sort : (n,) float64
        Between −1 and 1. Draws are spread evenly over these values within a group.
    numbers : (groups,) int64
        How many to draw from each group; from a group without members they are of all others.

    Returns
    -------
    (sum of numbers,) int64 : indices, group after group, each in an order in which any run is spread over all of it
    """
    order = np.argsort(3 * group + sort, kind="stable")
    edges = np.concatenate([[0.0], np.cumsum(weights[order])])
    bounds = np.concatenate([[0], np.cumsum(np.bincount(group, minlength=len(numbers)))])
    low, high = edges[bounds[:-1]], edges[bounds[1:]]
    low, high = np.where(high > low, [low, high], [[0.0], [edges[-1]]])
    of = np.repeat(np.arange(len(numbers)), numbers)
    place = {number: np.argsort(np.argsort(np.arange(number) * GOLDEN % 1.0)) for number in set(numbers.tolist())}
    fraction = (np.concatenate([place[number] for number in numbers.tolist()]) + 0.5) / numbers[of]
    marks = low[of] + (high - low)[of] * fraction
    return order[np.minimum(np.searchsorted(edges[1:], marks, side="right"), len(order) - 1)]
