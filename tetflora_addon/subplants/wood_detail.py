# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How finely near wood is drawn: sides of tubes and the curve along which their rings lie.

A branch of which a pixel shows that it has sides gets twice as many, or four times, and so on; its joints become a
curve, as far as its own thickness allows, since what grows on it stands on the straight segments. What the coarse tube
has not at all (the curve, buttresses, collars) grows with the size in the image from nothing: nothing appears at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Arrays, Floats, Integers, cross, dot, smoothstep, spread, unit
from ..compiled.flora import Flora
from ..growth.axes import Axes
from ..growth.growth import WholeBranches, radius_at

#: Pixels by which a tube may be off the round and bent branch that it stands for.
DEVIATION = 0.5
#: Sides of a tube at most, unless its species has more; rings of a segment at most.
MOST_SIDES, MOST_RINGS = 512, 48
#: Width over the one from which on branches are finer, at which they have all that near wood has.
_BAND = 2.5
#: Radius in pixels up to which joints pass for curves.
_BENT = 8.0
#: The curve leaves the straight segment by no more than this part of the radius.
_ASIDE = 0.5
#: How bent segments are, about.
_SAGITTA = 0.05
# Largest value of both Hermite polynomials of tangents.
_HERMITE = 4.0 / 27.0
# Places on a segment at which it is asked how near it comes.
_PLACES = np.array([0.25, 0.5, 0.75])


@dataclass(frozen=True)
class Pixels:
    """How large pixels are."""

    #: Meters (n,) that a pixel spans at what reaches so far, (n,) or a number, around points (n, 3).
    extent: Callable[[Floats, Floats | float], Floats]
    slope: float = 0.0  # by how much that falls at most with each meter that one comes nearer


@dataclass(frozen=True)
class Fineness(Arrays):
    """How finely branches (n,) are drawn."""

    sides: Integers  # (n,)
    #: (n,): from 0 to 1: how much there is of what near wood has besides; 0 for the coarse tube, unchanged.
    weight: Floats
    pixels: Floats  # (n,): radius in the image where that is largest


def round_up_to(sides: Integers) -> Floats:
    """Radius in pixels (n,) up to which polygons of so many sides (n,) pass for circles, and joints for curves."""
    return np.minimum(DEVIATION / (1.0 - np.cos(np.pi / sides)), _BENT)


def fine_sides(sides: Integers, pixels: Floats) -> Integers:
    """Sides (n,) of branches of a radius in pixels (n,) whose species has so many (n,): twice that, four times, ..."""
    enough = np.pi / np.arccos(np.clip(1.0 - DEVIATION / np.maximum(pixels, DEVIATION), -1.0, 1.0 - 1e-9))
    power = np.ceil(np.log2(np.maximum(enough / sides, 1.0)) - 1e-9)
    most = np.floor(np.log2(np.maximum(MOST_SIDES / sides, 1.0)))
    return sides << np.minimum(power, most).astype(np.int64)


def fineness(flora: Flora, whole: WholeBranches, pixels: Pixels) -> Fineness:
    """How finely branches are drawn where pixels are so large, from nothing but the branch itself."""
    branches, sides = whole.branches, flora.rows["sides"][whole.branches.row]
    limit = round_up_to(sides)
    # The base tells of most branches that they are too far away.
    nearest = pixels.extent(branches.position, np.inf) - pixels.slope * branches.length
    size = branches.radius * flora.widest[branches.row] / np.maximum(nearest, 1e-9)
    near = np.flatnonzero(size > limit)
    size = np.minimum(size, limit)
    if len(near):
        size[near] = _largest(flora, whole.take(near), pixels)
    weight = smoothstep(np.log(np.maximum(size, 1e-300) / limit) / np.log(_BAND))
    return Fineness(fine_sides(sides, size), weight, size)


def _largest(flora: Flora, whole: WholeBranches, pixels: Pixels) -> Floats:
    """Largest radius in pixels (n,) of branches at knots and between them."""
    owner, index = spread(whole.lines.segments * (len(_PLACES) + 1) + 1)
    segment, place = index // (len(_PLACES) + 1), np.concatenate([[0.0], _PLACES])[index % (len(_PLACES) + 1)]
    t = np.minimum((segment + place) / whole.lines.segments[owner], 1.0)
    radius = radius_at(flora.rows, whole.branches.take(owner), t)
    size = radius / np.maximum(pixels.extent(whole.lines.at(owner, t)[0], radius), 1e-300)
    return np.maximum.reduceat(size, np.searchsorted(owner, np.arange(len(whole))))


def finer(sides: Integers, pixels: Floats) -> tuple[Integers, Floats]:
    """Sides (n,) of branches of a radius in pixels (n,) whose species has so many (n,), and rings over those it has."""
    # Along, sagittas fall with the square of the parts.
    return fine_sides(sides, pixels), np.where(pixels > round_up_to(sides), 1.0 + np.sqrt(_SAGITTA * pixels), 1.0)


@dataclass(frozen=True)
class Curve:
    """The curves through the joints of branches (n,) of up to S segments: cubic, with given tangents at joints."""

    lines: Axes  # of n
    chord: Floats  # (n, S, 3): of each segment
    #: start and end, (n, S, 3): what the tangents at both ends of a segment add to its chord.
    start: Floats
    end: Floats
    across: Floats  # (n, S + 1, 3): first axis of the frames at joints

    def deviation(self) -> Floats:
        """How far the curve may be off each segment (n, S), meters."""
        return _HERMITE * (_norm(self.start) + _norm(self.end))

    def at(self, branch: Integers, segment: Integers, x: Floats, most: Floats) -> tuple[Floats, Floats]:
        """Places (m, 3) at fractions x (m,) of segments, at most so far (m,) off these, and axes (2, 3, m) across."""
        x = x[:, None]
        chord, start, end = (some[branch, segment] for some in (self.chord, self.start, self.end))
        aside = x * (x - 1.0) ** 2 * start + x * x * (x - 1.0) * end
        aside *= np.minimum(1.0, most / np.maximum(_norm(aside), 1e-300))[:, None]
        center = self.lines.knot(branch, segment) + x * chord + aside
        along = chord + (3.0 * x * x - 4.0 * x + 1.0) * start + (3.0 * x * x - 2.0 * x) * end
        along = unit(along)
        first = (1.0 - x) * self.across[branch, segment] + x * self.across[branch, segment + 1]
        first = unit(first - dot(first, along) * along)
        return center, np.stack([first.T, cross(along, first).T])


def curve(lines: Axes, radius: Floats, weight: Floats) -> Curve:
    """The curves of branches.

    Parameters
    ----------
    lines : Axes of n
    radius : (n, S + 1) float64
        At joints; curves stay within a part of it.
    weight : (n,) float64
        0 for straight segments, 1 for the whole curve.
    """
    n, most = len(lines.segments), lines.frames.shape[1]
    segment = np.arange(most)
    there = segment < lines.segments[:, None]
    chord = np.diff(lines.knots, axis=1)
    length = _norm(chord)[..., None]
    ahead = np.where(there[..., None], lines.frames[..., 2], 0.0)
    # Beyond the tip both are zero, so that the last joint has the direction of its segment.
    none = np.zeros((n, 1, 3))
    tangent = unit_of(np.concatenate([none, ahead], axis=1) + np.concatenate([ahead, none], axis=1))
    first = np.where(there[..., None], lines.frames[..., 0], 0.0)
    across = unit_of(np.concatenate([none, first], axis=1) + np.concatenate([first, none], axis=1))
    start, end = tangent[:, :-1] * length - chord, tangent[:, 1:] * length - chord
    allowed = _ASIDE * np.minimum(radius[:, :-1], radius[:, 1:])
    share = allowed / np.maximum(2.0 * _HERMITE * np.maximum(_norm(start), _norm(end)), 1e-300)
    share = np.where(there, np.minimum(share, 1.0), 1.0)
    one = np.ones((n, 1))
    joint = np.minimum(np.concatenate([one, share], axis=1), np.concatenate([share, one], axis=1)) * weight[:, None]
    start, end = start * joint[:, :-1, None], end * joint[:, 1:, None]
    return Curve(lines, chord, np.where(there[..., None], start, 0.0), np.where(there[..., None], end, 0.0), across)


def parts(deviation: Floats, pixel: Floats) -> Integers:
    """Straight parts (...) of segments whose curve is so far off them, where a pixel spans so much."""
    number = np.ceil(np.sqrt(deviation / (DEVIATION * np.maximum(pixel, 1e-300))))
    return np.clip(number, 1, MOST_RINGS).astype(np.int64)


def unit_of(vectors: Floats) -> Floats:
    """Vectors (..., 3) scaled to length 1."""
    return vectors / np.maximum(_norm(vectors), 1e-300)[..., None]


def _norm(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
