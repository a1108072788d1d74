# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rings of vertices around branches, from which tubes are made: at joints, or finer along a curve.

Where wood begins it has collars, the joints of forks, buttresses of trunks, and roots from these into the ground. All
of it is for near wood only, and grows with its size in the image. Buttresses take as much at some angles as they give
at others, so that a trunk is as thick on average as from afar.

Buds of shoots with leaves are one over the end of each, others in the axils of leaves, always at the same places. They
belong to near wood and grow with its size in the image from nothing. Averages leave them out: of the surface of a twig
they are some hundredths, and of a crown with leaves less than a hundredth.

A branch of which a pixel shows that it has sides gets twice as many, or four times, and so on; its joints become a
curve, as far as its own thickness allows, since what grows on it stands on the straight segments. What the coarse tube
has not at all (the curve, buttresses, collars) grows with the size in the image from nothing: nothing appears at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Keys, Mask, Table, cross, dot, smoothstep, spread, unit
from ..compiled.averages import tube_perimeter
from ..compiled.flora import Flora, bounds
from ..growth.axes import Axes
from ..growth.foliage import leaf_keys, leaf_places, place_leaves
from ..growth.growth import WholeBranches, branch_counts, leaf_counts, radius_at
from ..growth.hashing import Draw, child_key, uniform
from ..growth.rows import FLARE_FALL, FORK, SPUR_ORDER, ranged
from ..growth.seeds import Branches

#: Pixels by which a tube may be off the round and bent branch that it stands for.
DEVIATION = 0.5
#: Sides of a tube at most, unless its species has more; rings of a segment at most.
MOST_SIDES, MOST_RINGS = 512, 48
#: Width over the one from which on branches are finer, at which they have all that near wood has.
_BAND = 2.5
_BENT = 8.0  # radius in pixels up to which joints pass for curves
_ASIDE = 0.5  # the curve leaves the straight segment by no more than this part of the radius
_SAGITTA = 0.05  # how bent segments are, about
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
    return sides << np.minimum(power, np.floor(np.log2(np.maximum(MOST_SIDES / sides, 1.0)))).astype(np.int64)


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
        chord, start, end = (vectors[branch, segment] for vectors in (self.chord, self.start, self.end))
        aside = x * (x - 1.0) ** 2 * start + x * x * (x - 1.0) * end
        aside *= np.minimum(1.0, most / np.maximum(_norm(aside), 1e-300))[:, None]
        center = self.lines.knot(branch, segment) + x * chord + aside
        along = chord + (3.0 * x * x - 4.0 * x + 1.0) * start + (3.0 * x * x - 2.0 * x) * end
        along = unit(along)
        first = (1.0 - x) * self.across[branch, segment] + x * self.across[branch, segment + 1]
        first = unit(first - dot(first, along) * along)
        return center, np.stack([first.T, cross(along, first).T])


def _curve(flora: Flora, branches: Branches, lines: Axes, weight: Floats) -> Curve:
    """The curves of branches (n), which stay within a part of their own thickness: straight for a weight (n,) of 0."""
    n, most = len(lines.segments), lines.frames.shape[1]
    t = np.minimum(np.arange(most + 1) / lines.segments[:, None], 1.0)
    owner = np.repeat(np.arange(n), most + 1)
    radius = radius_at(flora.rows, _without_places(branches, owner), t.ravel()).reshape(n, most + 1)
    present = np.arange(most) < lines.segments[:, None]
    chord = np.diff(lines.knots, axis=1)
    length = _norm(chord)[..., None]
    ahead = np.where(present[..., None], lines.frames[..., 2], 0.0)
    # Beyond the tip both are zero, so that the last joint has the direction of its segment.
    none = np.zeros((n, 1, 3))
    tangent = _unit_of(np.concatenate([none, ahead], axis=1) + np.concatenate([ahead, none], axis=1))
    first = np.where(present[..., None], lines.frames[..., 0], 0.0)
    across = _unit_of(np.concatenate([none, first], axis=1) + np.concatenate([first, none], axis=1))
    start, end = tangent[:, :-1] * length - chord, tangent[:, 1:] * length - chord
    allowed = _ASIDE * np.minimum(radius[:, :-1], radius[:, 1:])
    share = allowed / np.maximum(2.0 * _HERMITE * np.maximum(_norm(start), _norm(end)), 1e-300)
    share = np.where(present, np.minimum(share, 1.0), 1.0)
    one = np.ones((n, 1))
    joint = np.minimum(np.concatenate([one, share], axis=1), np.concatenate([share, one], axis=1)) * weight[:, None]
    start, end = start * joint[:, :-1, None], end * joint[:, 1:, None]
    return Curve(lines, chord, np.where(present[..., None], start, 0.0), np.where(present[..., None], end, 0.0), across)


def parts(deviation: Floats, pixel: Floats) -> Integers:
    """Straight parts (...) of segments whose curve is so far off them, where a pixel spans so much."""
    number = np.ceil(np.sqrt(deviation / (DEVIATION * np.maximum(pixel, 1e-300))))
    return np.clip(number, 1, MOST_RINGS).astype(np.int64)


def _unit_of(vectors: Floats) -> Floats:
    """Vectors (..., 3) scaled to length 1."""
    return vectors / np.maximum(_norm(vectors), 1e-300)[..., None]


def _norm(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


_SHORTEST = 1e-9  # meters of a branch that has just begun to grow
_AT_JOINT = 1e-6  # fractions of a segment closer to a joint than this are at it


@dataclass(frozen=True)
class Rings:
    """Places on branches (k) around which there are rings of vertices."""

    branches: Branches  # of k
    branch: Integers  # (r,): rings of a branch follow one another
    t: Floats  # (r,): fractions of the axes, for textures; below the base negative
    center: Floats  # (r, 3)
    reach: Floats32  # (2, 3, r): from the center to the ring, along both axes across the branch
    goes_on: Mask  # (r,): whether a tube leads from a ring to the next
    #: tuple of (r, 3) and (2, 3, r): center and reach a moment later, where it is asked how plants move.
    later: tuple[NDArray, NDArray] | None = None
    swelling: Floats32 | None = None  # (sides, r): what multiplies the reach at each vertex
    color: Floats | None = None  # (k, 3): of what has not that of its branch


def rings_of(flora: Flora, whole: WholeBranches) -> Rings:
    """Rings at the joints of branches, and some where a base is flared."""
    rows, branches = flora.rows, whole.branches
    owner, t, center = whole.knots(rows)
    radius = radius_at(rows, _without_places(branches, owner), t).astype(np.float32)
    later = None
    if whole.lines.later is not None:
        moved = WholeBranches(branches, whole.lines.later).knots(rows)[2]
        later = moved, radius * _ring_axes(whole.lines.later, owner, t)
    return Rings(branches, owner, t, center, radius * _ring_axes(whole.lines, owner, t), _goes_on(owner), later)


def ring_sums(flora: Flora, whole: WholeBranches, counts: Integers) -> tuple[Integers, tuple[Integers, Integers]]:
    """Rings of each branch (n,), and of what `BESIDES` makes of it (n,), (n,)."""
    rows, branches = flora.rows, whole.branches
    rings = counts.sum(axis=1) + 1 + below_base(rows, branches) + beyond_tip(rows, branches)
    roots = np.where(has_foot(rows, branches), PLACES * root_number(branches.key), 0)
    return rings, (roots, bud_numbers(flora, whole))


def fine_counts(flora: Flora, whole: WholeBranches, fine: Fineness, pixels: Pixels) -> Integers:
    """Parts (n, S) of the segments of branches; a branch has a ring more than parts."""
    rows, branches, lines = flora.rows, whole.branches, whole.lines
    n, most = len(branches), lines.frames.shape[1]
    present = np.arange(most) < lines.segments[:, None]
    bent = _curve(flora, branches, lines, fine.weight)
    reach = np.repeat(branches.radius * flora.widest[branches.row], most + 1)
    pixel = pixels.extent(lines.knots.reshape(-1, 3), reach).reshape(n, -1)
    pixel = np.minimum(pixel[:, :-1], pixel[:, 1:])
    out = parts(bent.deviation(), pixel)
    # A flare is e^-s over s: lines between n points of it, as `_stretched` places them, are 1 / (2 n²) off.
    growth = np.maximum(rows["flare"][branches.row], collars(rows, branches)[0])
    out[:, 0] = np.maximum(out[:, 0], parts(growth * branches.radius, 2.0 * pixel[:, 0]))
    out[:, 0] = np.maximum(out[:, 0], rows["rings"][branches.row] + 1)
    return np.where(present, out, 0)


def fine_rings(flora: Flora, whole: WholeBranches, fine: Fineness, counts: Integers) -> Rings:
    """Rings along the curves of branches of one number of sides, so many (n, S) to each segment."""
    rows, branches, segments = flora.rows, whole.branches, whole.lines.segments
    n, most = counts.shape
    ring_counts = counts.copy()
    ring_counts[np.arange(n), segments - 1] += 1 + beyond_tip(rows, branches)
    sunk = below_base(rows, branches)
    ring_counts[:, 0] += sunk
    flat, index = spread(ring_counts.ravel())
    owner, segment = flat // most, flat % most
    index = np.where(segment == 0, index - sunk[owner], index)
    below, above = index < 0, np.flatnonzero(index > counts[owner, segment])
    x = np.clip(index, 0, counts[owner, segment]) / counts[owner, segment]
    ahead = segment == 0
    x[ahead] = _stretched(x[ahead], _falls(rows, branches, segments)[owner[ahead]])
    t = (segment + x) / segments[owner]
    owners = _without_places(branches, owner)
    sides = int(fine.sides[0])
    # As round as it is, the tube has the surface that its species' coarse one has.
    sparse = tube_perimeter(rows["sides"][branches.row]) / tube_perimeter(np.array([sides]))
    radius = radius_at(rows, owners, t) * sparse[owner]
    wider = 1.0 + fine.weight * (_below_forks(rows, branches) - 1.0)
    end = np.clip((t - _WIDENS) / (1.0 - _WIDENS), 0.0, 1.0)
    radius *= 1.0 + (wider[owner] - 1.0) * end * end * (3.0 - 2.0 * end)
    more, length = collars(rows, branches)
    fall = np.exp(-((t * branches.length[owner] / length[owner]) ** 2))
    radius += (fine.weight * more * branches.radius)[owner] * fall
    allowed = np.maximum(flora.widest[branches.row][owner] * branches.radius[owner] - radius, 0.0)
    light = radius.astype(np.float32)
    swollen = swelling(rows, branches, fine.weight, owner, t, radius, sides)
    base, footed = owner[below], has_foot(rows, branches)
    deep, narrow = depths(footed[base], -index[below])
    deep *= fine.weight[base] * np.where(footed[base], branches.radius[base], radius[below])
    t[below] = -deep / np.maximum(branches.length[base], _SHORTEST)
    # As much narrower as deep: where there is little of a ball, a flat end would turn normals of the wood before it.
    light[below] *= (1.0 + fine.weight[base] * (narrow - 1.0)).astype(np.float32)
    down = (below * t * branches.length[owner])[:, None] * branches.frame[owner, :, 2]
    last = owner[above]
    high, narrow, slant = beyond(rows, branches, last, index[above] - counts[last, segment[above]])
    high *= fine.weight[last] * radius[above]
    narrow = 1.0 + fine.weight[last] * (narrow - 1.0)
    slant *= fine.weight[last] * radius[above] * narrow
    t[above] += high / np.maximum(branches.length[last], _SHORTEST)
    light[above] *= narrow.astype(np.float32)

    def placed(lines: Axes) -> tuple[NDArray, NDArray]:
        center, across = _curve(flora, branches, lines, fine.weight).at(owner, segment, x, allowed)
        center += down
        tip = lines.frames[last, segments[last] - 1, :, 2]
        center[above] += high[:, None] * tip
        reach = light * across.astype(np.float32)
        reach[0][:, above] += (slant[:, None] * tip).T.astype(np.float32)
        return center, reach

    center, reach = placed(whole.lines)
    later = None if whole.lines.later is None else placed(whole.lines.later)
    return Rings(branches, owner, t, center, reach, _goes_on(owner), later, swollen)


def foot_rings(flora: Flora, whole: WholeBranches, fine: Fineness) -> tuple[Rings, Integers] | None:
    """Rings of the roots of trunks, and the branch of each root; None without any."""
    rows, branches = flora.rows, whole.branches
    footed = np.flatnonzero(has_foot(rows, branches) & (fine.weight > 0))
    if not len(footed):
        return None
    trunks, weight = branches.take(footed), fine.weight[footed]
    path, width, which = _roots(rows, trunks, weight)
    many, places = path.shape[:2]
    length = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(axis=1)
    wood = replace(trunks.take(which), radius=width[:, 0], length=np.maximum(length, 1e-9), later=None)
    along = _unit_of(np.gradient(path, axis=1)).reshape(-1, 3)
    aside = unit(np.cross(along, [0.0, 0.0, 1.0]) + [1e-9, 0.0, 0.0])
    axes = np.stack([aside, np.cross(along, aside)])
    turn = np.repeat(trunks.frame[which], places, axis=0)
    center = np.einsum("nij,nj->ni", turn, path.reshape(-1, 3)) + np.repeat(wood.position, places, axis=0)
    axes = np.einsum("nij,anj->ain", turn, axes)
    owner = np.repeat(np.arange(many), places)
    t = -np.tile(np.linspace(0.0, 1.0, places), many)  # as deep as the foot, for materials: below the base
    reach = (width.ravel() * axes).astype(np.float32)
    still = None if whole.lines.later is None else (center, reach)
    return Rings(wood, owner, t, center, reach, _goes_on(owner), still), footed[which]


def _falls(rows: Table, branches: Branches, segments: Integers) -> Floats:
    """Over how many of its own lengths the base of a branch falls to its usual thickness in the first segment (n,)."""
    more, length = collars(rows, branches)
    grown = np.where(more > 0, 2.0 * branches.length / length, 0.0)
    return np.where(rows["flare"][branches.row] > 0, rows["fall"][branches.row], grown) / segments


def _stretched(x: Floats, fall: Floats) -> Floats:
    """Fractions (n,) moved so that straight lines between them are equally far off e^(-fall x)."""
    fall = np.clip(fall, 1e-6, 40.0)
    return -2.0 * np.log1p(-x * -np.expm1(-fall / 2.0)) / fall


def _goes_on(owner: Integers) -> Mask:
    out = np.zeros(len(owner), bool)
    out[:-1] = owner[1:] == owner[:-1]
    return out


def _without_places(branches: Branches, index: Integers) -> Branches:
    """Selection of all that numbers and radii depend on; places and frames, which are most of the memory, are zero."""
    n = len(index)
    names = ("row", "plant", "key", "length", "radius", "scale", "vigor", "outward")
    rest = {name: np.take(getattr(branches, name), index) for name in names}
    return Branches(position=np.broadcast_to(0.0, (n, 3)), frame=np.broadcast_to(0.0, (n, 3, 3)), **rest)


def _ring_axes(lines: Axes, branch: Integers, t: Floats) -> Floats:
    """Both axes (2, 3, n) across a branch at rings; at a joint, half way between those of the two segments."""
    frames = lines.frames[:, :, :, :2].astype(np.float32)
    number = np.take(lines.segments, branch)
    along = t * number
    joint = np.rint(along).astype(np.int64)
    at_joint = np.flatnonzero((np.abs(along - joint) < _AT_JOINT) & (joint > 0) & (joint < number))
    segment = np.minimum(along.astype(np.int64), number - 1)
    segment[at_joint] = joint[at_joint]
    light = Axes(lines.knots, frames, lines.segments)
    out = light.frame(branch, segment).transpose(2, 1, 0)
    if len(at_joint):
        before = light.frame(branch[at_joint], joint[at_joint] - 1)
        for axis in range(2):
            out[axis][:, at_joint] = unit(before[:, :, axis] + out[axis][:, at_joint].T).T
    return out


#: Buttresses of a trunk, at least and at most.
LEAST, MOST = 4, 7
#: A collar over the radius of its branch, and the longest in radii of the branch.
_COLLAR, _LONGEST = 0.55, 4.0
#: Radius of a parent over that of its child by the pipe model, about: it is not known which parent a branch has.
_PIPED = 2.0
#: Narrowness of a buttress, its height over that of the flare, its size over that of the flare.
_NARROW, _HIGH, _STRONG = 13.0, 2.4, 1.1
_LEAST_RADIUS = 0.55  # a buttress takes no more of the radius than this leaves
_ROOTS = 1 << 28  # child index below which random numbers of roots are drawn
_WIDENS = 0.65  # fraction of a branch from which on it widens toward a fork
#: Places along a root, and how deep the stump of a trunk is in the ground, in its radii.
PLACES, SUNK = 14, 0.6
#: Rings of the ball in which a stem begins beyond a fork, and the angle of the last one below its equator.
_BALL, _ROUND = 4, np.radians(72.0)
#: Rings that close an end, and how oblique a break is at most, in radii to a radius.
_CAP, _SPLINTERS = 3, 1.6


def collars(rows: Table, branches: Branches) -> tuple[Floats, Floats]:
    """How much thicker branches (n,) are at their base, over their radius, and over which length that falls, meters.

    The base lies on the axis of the parent: what is seen begins a radius of the parent further out.
    """
    row = branches.row
    thickness = np.maximum(ranged(rows, "thickness", row, branches.key, Draw.THICKNESS), 0.1)
    parent = branches.radius * np.where(rows["pipe"][row] > 0, _PIPED, 1.0) / thickness
    length = np.minimum(np.minimum(1.2 * parent, _LONGEST * branches.radius), branches.length / 3.0)
    order, continues = rows["order"][row], rows["continues"][row] | rows["drawn"][row]
    grown = (order > 0) & (order < SPUR_ORDER) & ~continues & (rows["flare"][row] <= 0)
    return np.where(grown, _COLLAR, 0.0), np.maximum(length, 1e-9)


def has_foot(rows: Table, branches: Branches) -> Mask:
    """Branches (n,) with buttresses and roots: flared trunks."""
    row = branches.row
    return (rows["order"][row] == 0) & (rows["flare"][row] > 0) & ~rows["continues"][row] & ~rows["phantom"][row]


def below_base(rows: Table, branches: Branches) -> Integers:
    """Rings (n,) below the base of near branches: of trunks in the ground, of stems beyond a fork within their parent.

    The end of what forks and the base of such a stem are circles around one place, as wide as each other. At an angle
    they leave a wedge open. A ball around both fills it, of which either has a half.
    """
    row = branches.row
    ball = rows["continues"][row] & ~rows["phantom"][row] & ~rows["drawn"][row]
    return np.where(has_foot(rows, branches), 1, np.where(ball, _BALL, 0))


def beyond_tip(rows: Table, branches: Branches) -> Integers:
    """Rings (n,) beyond the end of near branches: the half of a ball where they fork, a cap where they end."""
    return np.where(rows["next"][branches.row, FORK] >= 0, _BALL, _CAP)


def beyond(rows: Table, branches: Branches, branch: Integers, number: Integers) -> tuple[Floats, Floats, Floats]:
    """How far rings (m,) of branches, numbered from 1, lie beyond the end, how wide and how oblique they are.

    All in radii there. Ends are round; dead ones are broken off, with a hollow in the oblique break.
    """
    row = branches.row[branch]
    ball, dead = rows["next"][row, FORK] >= 0, rows["dead"][row]
    deep, narrow = depths(np.zeros(len(row), bool), number)
    angle = np.pi / 2 * number / _CAP
    deep, narrow = np.where(ball, deep, np.sin(angle)), np.where(ball, narrow, np.maximum(np.cos(angle), 0.0))
    slant = np.where(dead, _SPLINTERS * (0.25 + 0.75 * uniform(branches.key[branch], Draw.BROKEN)), 0.0)
    ring = np.minimum(number, _CAP) - 1
    deep = np.where(dead, slant * np.array([1.0, 0.85, 0.5])[ring], deep)
    return deep, np.where(dead, np.array([0.96, 0.6, 0.0])[ring], narrow), slant


def depths(footed: Mask, number: Integers) -> tuple[Floats, Floats]:
    """How far rings (n,), numbered from 1, lie beyond an end, and how wide they are, in radii there.

    Those of the ``footed`` are in the ground, others on a ball.
    """
    angle = _ROUND * number / _BALL
    return np.where(footed, SUNK, np.sin(angle)), np.where(footed, 1.0, np.cos(angle))


def _below_forks(rows: Table, branches: Branches) -> Floats:
    """How much wider branches (n,) are where they fork, over their radius there: as wide as the stems beyond begin.

    Stems share the cross-section of what forks, and flare at their base by what the expected number of them takes.
    Where there are fewer, they would begin wider than what they come from.
    """
    beyond = rows["next"][branches.row, FORK]
    number = np.maximum(branch_counts(rows, branches, FORK), 1)
    wider = (1.0 + rows["flare"][beyond]) * number ** (-1.0 / np.maximum(rows["fork_power"][branches.row], 1e-9))
    return np.where(beyond >= 0, wider, 1.0)


def root_number(key: Keys) -> Integers:
    """Number (n,) of the buttresses of trunks, each with a root."""
    return LEAST + np.floor((MOST - LEAST + 1) * uniform(child_key(key, _ROOTS), 0)).astype(np.int64)


def buttresses(key: Keys) -> tuple[Floats, Floats]:
    """Angles and sizes (n, MOST) of the buttresses of trunks; those that a trunk has not are 0 large."""
    number = root_number(key)[:, None]
    each = np.arange(MOST)
    keys = child_key(key[:, None], _ROOTS + 1 + each)
    angle = 2 * np.pi * (each + 0.75 * (uniform(keys, 0) - 0.5)) / number
    return angle, np.where(each < number, 0.45 + 0.55 * uniform(keys, 1), 0.0)


def root_sides(sides: int) -> int:
    """Sides of the roots of a trunk of so many."""
    return max(sides // 4, 6)


def keep_inside(flora: Flora, branches: Branches, owner: Integers, points: Floats32) -> None:
    """Move points (m, 3), in place, that lie outside the bounds of their branches (n,) to the border of these.

    Hardly any: bounds are those of whole sub-plants, and wider than what a foot or a collar adds to wood.
    """
    bound, pad = bounds(flora, branches)
    radius, low, high = bound.T
    offset = points - branches.position[owner]
    along = np.einsum("ni,ni->n", offset, branches.frame[owner, :, 2])
    aside = offset - along[:, None] * branches.frame[owner, :, 2]
    across = np.sqrt(np.einsum("ni,ni->n", aside, aside))
    most, least, highest = radius[owner], low[owner], high[owner]
    beside, above = np.maximum(across - most, 0.0), along - np.clip(along, least, highest)
    beyond = np.hypot(beside, above)
    out = np.flatnonzero(beyond > pad[owner])
    if len(out):
        back = (1.0 - pad[owner[out]] / beyond[out])[:, None]
        aside, across = aside[out], np.maximum(across[out], 1e-12)[:, None]
        move = beside[out, None] * aside / across + above[out, None] * branches.frame[owner[out], :, 2]
        points[out] -= (back * move).astype(np.float32)


def swelling(
    rows: Table, branches: Branches, weight: Floats, owner: Integers, t: Floats, radius: Floats, sides: int
) -> Floats32 | None:
    """Factors (sides, r) of the radius (r,) of rings at fractions t (r,) of branches (n,); None where all are 1."""
    footed = has_foot(rows, branches)
    if not footed.any():
        return None
    flare = rows["flare"][branches.row] * branches.radius * weight * footed * _STRONG
    size = flare[owner] * np.exp(-FLARE_FALL / _HIGH * t) / np.maximum(radius, 1e-12)
    angle, sizes = buttresses(branches.key)
    around = 2 * np.pi * np.arange(sides) / sides
    bump = np.exp(_NARROW * (np.cos(around[:, None, None] - angle) - 1.0)) - np.i0(_NARROW) * np.exp(-_NARROW)
    shape = (bump * sizes).sum(axis=2)  # (sides, n)
    return np.maximum(1.0 + size * shape[:, owner], _LEAST_RADIUS).astype(np.float32)


def _roots(rows: Table, trunks: Branches, weight: Floats) -> tuple[Floats, Floats, Integers]:
    """Surface roots of trunks (n,): they leave the buttresses, wind along the ground and lead into it.

    Places (m, `PLACES`, 3) in the frames of the trunks' bases, radii (m, `PLACES`), meters, and trunks (m,).
    """
    angle, size = buttresses(trunks.key)
    trunk, which = spread(root_number(trunks.key))
    keys = child_key(trunks.key[trunk], _ROOTS + 64 + which)
    angle, size = angle[trunk, which], size[trunk, which]
    base = trunks.radius[trunk]
    flare = rows["flare"][trunks.row][trunk]
    x = np.linspace(0.0, 1.0, PLACES)
    away = base[:, None] * (0.5 + 0.4 * flare[:, None] + (1.4 + 1.8 * uniform(keys, 0))[:, None] * x)
    begin = uniform(keys, 1)[:, None]
    wave = 0.35 * np.sin(2 * np.pi * (begin + 1.1 * x)) - 0.35 * np.sin(2 * np.pi * begin)
    turn = angle[:, None] + wave * x
    width = (base * (0.14 + 0.16 * size) * np.minimum(flare + 0.4, 1.2))[:, None] * (1.0 - 0.72 * x)
    # Nearly level at first, with what is over the ground less and less; sunk as a whole where seen from afar.
    steep = 0.7 + 0.5 * uniform(keys, 2)[:, None]
    bumps = 0.05 * np.sin(9 * x + 6 * angle[:, None]) * x
    high = base[:, None] * (0.3 * size[:, None] * (1 - x) ** 1.5 - steep * x**3 + bumps)
    high = high - (1.0 - weight[trunk])[:, None] * (width + 0.2 * base[:, None])
    return np.stack([away * np.cos(turn), away * np.sin(turn), high], axis=2), width, trunk


#: Rings of a bud, and where they are: fractions of its length, and radii over the largest.
BUD_RINGS = 7
_ALONG = np.array([-0.08, 0.06, 0.2, 0.42, 0.68, 0.9, 1.0])
_WIDTH = np.array([0.5, 0.76, 0.96, 1.0, 0.7, 0.27, 0.0])
_LAST = (1 << 28) + 7  # child index of the bud at the end, of which random numbers are drawn
_AT_END, _VARIED = 1.3, 0.25  # length of the bud at the end over that of others; variation of lengths
#: How far a bud in an axil leans away from its shoot, and how deep its base is in the wood, in radii of that.
_LEAN, _SUNK = 0.62, 0.75


def bud_numbers(flora: Flora, whole: WholeBranches) -> Integers:
    """Rings (n,) of the buds of near branches."""
    return BUD_RINGS * np.bincount(_places(flora, whole)[0], minlength=len(whole))


def bud_sides(sides: int | Integers) -> Integers:
    """Sides of the buds on twigs of so many."""
    return np.clip(2 * sides, 6, 24)


def bud_rings(flora: Flora, whole: WholeBranches, fine: Fineness) -> tuple[Rings, Integers] | None:
    """Rings of the buds of near branches (n), and the branch of each bud; None without any."""
    owner, index, key = _places(flora, whole)
    if not len(owner):
        return None
    rows, branches = flora.rows, whole.branches
    number = leaf_counts(rows, branches)
    at_end = index < 0
    t = np.ones(len(owner))
    side = np.flatnonzero(~at_end)
    # Leaves are placed branch row by branch row: the same for all where there is one.
    t[side] = leaf_places(rows, branches, owner[side], index[side], number, key[side])
    owners = _without_places(branches, owner)
    radius = radius_at(rows, owners, t)
    sort = [species.bud for species in flora.species]
    table = np.array([(0.0, 0.0) if bud is None else (bud.length, bud.width) for bud in sort])
    color = np.array([(0.0, 0.0, 0.0) if bud is None else bud.color for bud in sort])
    species = rows["species"][owners.row]
    varied = 1.0 + _VARIED * (2.0 * uniform(key, Draw.LENGTH) - 1.0)
    length = table[species, 0] * owners.scale * varied * np.where(at_end, _AT_END, 1.0) * fine.weight[owner]
    thick = 0.5 * table[species, 1] * length

    def placed(lines: Arrays, bearers: Branches) -> tuple[NDArray, NDArray]:
        base, frame = lines.at(owner, t)
        x, along = frame[:, :, 0], frame[:, :, 2].copy()
        if len(side):
            leaves = place_leaves(rows, bearers, lines, owner[side], index[side], key[side], t[side])
            leaf = leaves.frame[:, :, 1].astype(np.float64)
            out = unit(leaf - dot(leaf, along[side]) * along[side] + 1e-6 * x[side])
            base = base.copy()
            base[side] += _SUNK * radius[side, None] * out
            along[side] = unit(along[side] + _LEAN * out)
        x = unit(x - dot(x, along) * along)
        center = base[:, None] + (length[:, None] * _ALONG)[..., None] * along[:, None]
        reach = np.stack([x, cross(along, x)])[:, :, None] * (thick[:, None] * _WIDTH)[None, :, :, None]
        return center.reshape(-1, 3), reach.reshape(2, -1, 3).transpose(0, 2, 1).astype(np.float32)

    center, reach = placed(whole.lines, branches)
    later = None if whole.lines.later is None else placed(whole.lines.later, branches.moved())
    wood = replace(branches.take(owner), radius=np.maximum(thick, 1e-9), length=np.maximum(length, 1e-9), later=None)
    bud = np.repeat(np.arange(len(owner)), BUD_RINGS)
    goes_on = np.tile(np.arange(BUD_RINGS) < BUD_RINGS - 1, len(owner))
    return Rings(wood, bud, np.tile(_ALONG, len(owner)), center, reach, goes_on, later, None, color[species]), owner


#: What there is beside the tubes of near branches: how it is made, sides by those of a tube, and rings of each one.
BESIDES = ((foot_rings, root_sides, PLACES), (bud_rings, bud_sides, BUD_RINGS))


def _places(flora: Flora, whole: WholeBranches) -> tuple[Integers, Integers, Keys]:
    """Branch (m,), leaf in whose axil it is, or -1 for the one at the end, and key of each bud of branches (n)."""
    rows, branches = flora.rows, whole.branches
    lateral = np.array([-1.0 if one.bud is None else one.bud.lateral for one in flora.species])
    # Leaves that fill a solid stand in no axils.
    lateral = np.where(rows["envelope"][branches.row] > 0, -1.0, lateral[rows["species"][branches.row]])
    number = leaf_counts(rows, branches)
    bears = (lateral >= 0.0) & (number > 0)
    ends = np.flatnonzero(bears & (rows["next"][branches.row, FORK] < 0))
    owner, index = spread(np.where(bears & (lateral > 0.0), number, 0))
    key = leaf_keys(branches, owner, index)
    kept = np.flatnonzero(uniform(key, Draw.BUD) < lateral[owner])
    owner = np.concatenate([ends, owner[kept]])
    index = np.concatenate([np.full(len(ends), -1), index[kept]])
    return owner, index, np.concatenate([child_key(branches.key[ends], _LAST), key[kept]])
