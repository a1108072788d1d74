# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rings of vertices around branches, from which tubes are made: at joints, or finer along a curve."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread, unit
from ..compiled.averages import tube_perimeter
from ..compiled.flora import Flora
from ..growth.axes import Axes
from ..growth.branches import Branches
from ..growth.growth import WholeBranches, radius_at
from .feet import (
    PLACES,
    below_base,
    below_forks,
    beyond,
    beyond_tip,
    collars,
    depths,
    has_foot,
    root_number,
    roots,
    swelling,
    widening,
)
from .wood_detail import Curve, Fineness, Pixels, curve, parts, unit_of

_SHORTEST = 1e-9  # metres of a branch that has just begun to grow
_AT_JOINT = 1e-6  # fractions of a segment closer to a joint than this are at it


@dataclass(frozen=True)
class Rings:
    """Places on branches (k) around which there are rings of vertices.

    Attributes
    ----------
    branches : Branches of k
    branch : (r,) int64
        Rings of a branch follow one another.
    t : (r,) float64
        Fractions of the axes, for textures; below the base negative.
    centre : (r, 3) float64
    reach : (2, 3, r) float32
        From the centre to the ring, along both axes across the branch.
    goes_on : (r,) bool
        Whether a tube leads from a ring to the next.
    later : tuple of (r, 3) float64 and (2, 3, r) float32, or None
        Centre and reach a moment later, where it is asked how plants move.
    swelling : (sides, r) float32 or None
        What multiplies the reach at each vertex.
    colour : (k, 3) float64 or None
        Of what has not that of its branch.
    """

    branches: Branches
    branch: NDArray[np.int64]
    t: NDArray[np.float64]
    centre: NDArray[np.float64]
    reach: NDArray[np.float32]
    goes_on: NDArray[np.bool_]
    later: tuple[NDArray, NDArray] | None = None
    swelling: NDArray[np.float32] | None = None
    colour: NDArray[np.float64] | None = None


def ring_counts(flora: Flora, branches: Branches, segments: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number (n,) of the rings of coarse tubes."""
    return segments + flora.rows["rings"][branches.row] + 1


def rings_of(flora: Flora, whole: WholeBranches) -> Rings:
    """Rings at the joints of branches, and some where a base is flared."""
    rows, branches = flora.rows, whole.branches
    owner, t, centre = whole.knots(rows)
    radius = radius_at(rows, without_places(branches, owner), t).astype(np.float32)
    later = None
    if whole.lines.later is not None:
        moved = WholeBranches(branches, whole.lines.later).knots(rows)[2]
        later = moved, radius * _ring_axes(whole.lines.later, owner, t)
    reach = radius * _ring_axes(whole.lines, owner, t)
    return Rings(branches, owner, t, centre, reach, _goes_on(owner), later)


def fine_numbers(
    flora: Flora, whole: WholeBranches, counts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rings of each branch (n,), and of its roots, of which each has `PLACES`."""
    footed = has_foot(flora.rows, whole.branches)
    rings = counts.sum(axis=1) + 1 + below_base(flora.rows, whole.branches) + beyond_tip(flora.rows, whole.branches)
    return rings, np.where(footed, PLACES * root_number(whole.branches.key), 0)


def fine_counts(flora: Flora, whole: WholeBranches, fine: Fineness, pixels: Pixels) -> NDArray[np.int64]:
    """Parts (n, S) of the segments of branches; a branch has a ring more than parts."""
    rows, branches, lines = flora.rows, whole.branches, whole.lines
    n, most = len(branches), lines.frames.shape[1]
    there = np.arange(most) < lines.segments[:, None]
    bent = _curve(flora, whole, fine.weight)
    pixel = pixels.extent(lines.knots.reshape(-1, 3)).reshape(n, -1)
    pixel = np.minimum(pixel[:, :-1], pixel[:, 1:])
    out = parts(bent.deviation(), pixel)
    # A flare is e^-s over s: lines between n points of it, as `_stretched` places them, are 1 / (2 n²) off.
    growth = np.maximum(rows["flare"][branches.row], collars(rows, branches)[0])
    out[:, 0] = np.maximum(out[:, 0], parts(growth * branches.radius, 2.0 * pixel[:, 0]))
    out[:, 0] = np.maximum(out[:, 0], rows["rings"][branches.row] + 1)
    return np.where(there, out, 0)


def fine_rings(flora: Flora, whole: WholeBranches, fine: Fineness, counts: NDArray[np.int64]) -> Rings:
    """Rings along the curves of branches of one number of sides, so many (n, S) to each segment."""
    rows, branches, segments = flora.rows, whole.branches, whole.lines.segments
    n, most = counts.shape
    own = counts.copy()
    own[np.arange(n), segments - 1] += 1 + beyond_tip(rows, branches)
    sunk = below_base(rows, branches)
    own[:, 0] += sunk
    flat, index = spread(own.ravel())
    owner, segment = flat // most, flat % most
    index = np.where(segment == 0, index - sunk[owner], index)
    below, above = index < 0, np.flatnonzero(index > counts[owner, segment])
    x = np.clip(index, 0, counts[owner, segment]) / counts[owner, segment]
    ahead = segment == 0
    x[ahead] = _stretched(x[ahead], _falls(rows, branches, segments)[owner[ahead]])
    t = (segment + x) / segments[owner]
    some = without_places(branches, owner)
    sides = int(fine.sides[0])
    # As round as it is, the tube has the surface that its species' coarse one has.
    sparse = tube_perimeter(rows["sides"][branches.row]) / tube_perimeter(np.array([sides]))
    radius = radius_at(rows, some, t) * sparse[owner]
    wider = 1.0 + fine.weight * (below_forks(rows, branches) - 1.0)
    radius *= widening(wider[owner], t)
    more, length = collars(rows, branches)
    radius += (fine.weight * more * branches.radius)[owner] * np.exp(
        -((t * branches.length[owner] / length[owner]) ** 2)
    )
    allowed = np.maximum(flora.widest[branches.row][owner] * branches.radius[owner] - radius, 0.0)
    light = radius.astype(np.float32)
    swollen = swelling(rows, branches, fine.weight, owner, t, radius, sides)
    base, footed = owner[below], has_foot(rows, branches)
    deep, narrow = depths(footed[base], -index[below])
    deep *= fine.weight[base] * np.where(footed[base], branches.radius[base], radius[below])
    t[below] = -deep / np.maximum(branches.length[base], _SHORTEST)
    light[below] *= narrow.astype(np.float32)
    down = (below * t * branches.length[owner])[:, None] * branches.frame[owner, :, 2]
    last = owner[above]
    high, narrow, slant = beyond(rows, branches, last, index[above] - counts[last, segment[above]])
    high *= fine.weight[last] * radius[above]
    slant *= fine.weight[last] * radius[above] * narrow
    t[above] += high / np.maximum(branches.length[last], _SHORTEST)
    light[above] *= narrow.astype(np.float32)

    def placed(lines: Axes) -> tuple[NDArray, NDArray]:
        bent = _curve(flora, replace(whole, lines=lines), fine.weight)
        centre, across = bent.at(owner, segment, x, allowed)
        centre += down
        tip = lines.frames[last, segments[last] - 1, :, 2]
        centre[above] += high[:, None] * tip
        reach = light * across.astype(np.float32)
        reach[0][:, above] += (slant[:, None] * tip).T.astype(np.float32)
        return centre, reach

    centre, reach = placed(whole.lines)
    later = None if whole.lines.later is None else placed(whole.lines.later)
    return Rings(branches, owner, t, centre, reach, _goes_on(owner), later, swollen)


def foot_rings(flora: Flora, whole: WholeBranches, fine: Fineness) -> tuple[Rings, NDArray[np.int64]] | None:
    """Rings of the roots of trunks, and the branch of each root; None without any."""
    rows, branches = flora.rows, whole.branches
    own = np.flatnonzero(has_foot(rows, branches) & (fine.weight > 0))
    if not len(own):
        return None
    trunks, weight = branches.take(own), fine.weight[own]
    path, width, which = roots(rows, trunks, weight)
    many, places = path.shape[:2]
    length = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(axis=1)
    wood = replace(trunks.take(which), radius=width[:, 0], length=np.maximum(length, 1e-9), later=None)
    along = unit_of(np.gradient(path, axis=1)).reshape(-1, 3)
    aside = unit(np.cross(along, [0.0, 0.0, 1.0]) + [1e-9, 0.0, 0.0])
    axes = np.stack([aside, np.cross(along, aside)])
    turn = np.repeat(trunks.frame[which], places, axis=0)
    centre = np.einsum("nij,nj->ni", turn, path.reshape(-1, 3)) + np.repeat(wood.position, places, axis=0)
    axes = np.einsum("nij,anj->ain", turn, axes)
    owner = np.repeat(np.arange(many), places)
    t = -np.tile(np.linspace(0.0, 1.0, places), many)  # as deep as the foot, for materials: below the base
    reach = (width.ravel() * axes).astype(np.float32)
    still = None if whole.lines.later is None else (centre, reach)
    return Rings(wood, owner, t, centre, reach, _goes_on(owner), still), own[which]


def _curve(flora: Flora, whole: WholeBranches, weight: NDArray[np.float64]) -> Curve:
    """The curves of branches, which stay within their own thickness."""
    n, joints = whole.lines.knots.shape[:2]
    t = np.minimum(np.arange(joints) / whole.lines.segments[:, None], 1.0)
    owner = np.repeat(np.arange(n), joints)
    radius = radius_at(flora.rows, without_places(whole.branches, owner), t.ravel()).reshape(n, joints)
    return curve(whole.lines, radius, weight)


def _falls(rows: NDArray[np.void], branches: Branches, segments: NDArray[np.int64]) -> NDArray[np.float64]:
    """Over how many of its own lengths the base of a branch falls to its usual thickness in the first segment (n,)."""
    step = branches.length / segments
    more, length = collars(rows, branches)
    flared = rows["flare"][branches.row] > 0
    return np.where(flared, 8 * np.log(100.0) / segments, np.where(more > 0, 2.0 * step / length, 0.0))


def _stretched(x: NDArray[np.float64], fall: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fractions (n,) moved so that straight lines between them are equally far off e^(-fall x)."""
    fall = np.clip(fall, 1e-6, 40.0)
    return -2.0 * np.log1p(-x * -np.expm1(-fall / 2.0)) / fall


def _goes_on(owner: NDArray[np.int64]) -> NDArray[np.bool_]:
    out = np.zeros(len(owner), bool)
    out[:-1] = owner[1:] == owner[:-1]
    return out


def without_places(branches: Branches, index: NDArray[np.int64]) -> Branches:
    """Selection of all that numbers and radii depend on; places and frames, which are most of the memory, are zero."""
    n = len(index)
    names = ("row", "plant", "key", "length", "radius", "scale", "vigour", "outward")
    rest = {name: np.take(getattr(branches, name), index) for name in names}
    return Branches(position=np.broadcast_to(0.0, (n, 3)), frame=np.broadcast_to(0.0, (n, 3, 3)), **rest)


def _ring_axes(lines: Axes, branch: NDArray[np.int64], t: NDArray[np.float64]) -> NDArray[np.float64]:
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
