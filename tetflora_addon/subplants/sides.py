# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which side of a plane sub-plants lie on, to the last leaf (paper, section 6.5).

The compiled bound settles most of them and costs next to nothing. What straddles by it is looked at as it grows: its
axis, those of its leaves that may reach the plane, and those of its children that may, whose bounds are asked in turn.
The first part found beyond the plane settles the matter, so that little is grown of what has to be opened anyway.
Nothing of what is grown is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread
from ..compiled.bounds import own_leaf_reaches, ring_stretch
from ..compiled.flora import Flora
from ..growth.axes import Axes, axes
from ..growth.branches import Branches
from ..growth.foliage import in_wind, leaf_keys, leaf_places, leaf_start, place_leaves, settled
from ..growth.growth import branch_counts, chosen_children, leaf_counts, radius_at, sorts_of
from ..growth.hashing import Draw
from ..growth.rows import FORK, LATERAL, SPUR, varied

_START = {LATERAL: Draw.BRANCH_START, SPUR: Draw.SPUR_START}
#: Sub-plants that are looked at as they grow at a time; bounds the memory that this takes to some ten megabytes.
_AT_ONCE = 20_000


def bounding_bodies(flora: Flora, subplants: Branches) -> NDArray[np.float64]:
    """Bodies that hold all vertices of sub-plants, from the compiled bounds alone.

    Returns
    -------
    (9, n) float64
        A cylinder, and how far whatever is not within it reaches beyond: centre (3), axis (3), radius, half of the
        height, and that pad. Metres, world space.
    """
    bound = (flora.bound[subplants.row] * subplants.length[:, None]).T
    out = np.empty((9, len(subplants)))
    out[3:6] = subplants.frame[:, :, 2].T
    out[:3] = subplants.position.T + (bound[1] + bound[2]) / 2 * out[3:6]
    out[6], out[7] = bound[0], (bound[2] - bound[1]) / 2
    out[8] = subplants.radius * flora.widest[subplants.row] + flora.leaf_reach[subplants.row] * subplants.scale
    return out


def body_distances(bodies: NDArray[np.float64], planes: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Signed distance of the centres of `bounding_bodies` from planes (n, 4), and how far they reach to its sides."""
    along = _distance(planes, *bodies[3:6], 0.0)
    reach = bodies[7] * np.abs(along) + bodies[6] * np.sqrt(np.maximum(1 - along**2, 0)) + bodies[8]
    return _distance(planes, *bodies[:3]), reach


def sampled_bodies(flora: Flora, subplants: Branches) -> NDArray[np.float64]:
    """Bodies (9, n) as `bounding_bodies`, that hold what has been sampled of such sub-plants: nearly all, not all."""
    bound = (flora.sampled_bound[subplants.row] * subplants.length[:, None]).T
    out = np.zeros((9, len(subplants)))
    out[3:6] = subplants.frame[:, :, 2].T
    out[:3] = subplants.position.T + (bound[1] + bound[2]) / 2 * out[3:6]
    out[6], out[7] = bound[0], (bound[2] - bound[1]) / 2
    out[8] = flora.leaf_reach[subplants.row] * subplants.scale  # samples are where leaves begin
    return out


def crossing(
    flora: Flora, subplants: Branches, planes: NDArray[np.float64], slack: NDArray[np.float64] | float = 0.0
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Look at sub-plants as they grow: which have vertices on both sides of a plane each.

    Parameters
    ----------
    flora : Flora
    subplants : Branches of n
        Those that straddle by their bodies; others only take time.
    planes : (n, 4) float64
    slack : (n,) float64, optional
        How far one may reach beyond its plane, metres.

    Returns
    -------
    crossing : (n,) bool
        False: no vertex of the sub-plant lies beyond the plane by more. True: some do, or lie closer to it than the
        box of a leaf or the sphere around a tube's ring tell apart; or it is a plant drawn by hand, always opened.
    side : (n,) int64
        Side of the base, which is that of the whole where it does not cross.
    """
    base = _distance(planes, *subplants.position.T)
    facing = planes * np.where(base < 0, -1.0, 1.0)[:, None]  # all bases on the positive side
    facing[:, 3] += slack
    crosses = flora.rows["phantom"][subplants.row]
    subplants = replace(subplants, later=None)  # how they move does not matter here
    for start in range(0, len(subplants), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        _look(flora, subplants.take(part), facing[part], crosses[part])
    return crosses, (base >= 0).astype(np.int64)


def _look(flora: Flora, subplants: Branches, planes: NDArray[np.float64], crosses: NDArray[np.bool_]) -> None:
    """Mark in ``crosses`` which sub-plants reach beyond their planes, to whose positive side their bases lie."""
    rows = flora.rows
    branches, whole = subplants, np.arange(len(subplants))  # what is looked at, and which sub-plant it belongs to
    while len(branches):
        parts, owners = [Branches.empty()], [np.zeros(0, np.int64)]
        for row in np.unique(branches.row):
            chosen = np.flatnonzero((branches.row == row) & ~crosses[whole])
            if len(chosen) == 0:
                continue
            if chosen[-1] - chosen[0] + 1 == len(chosen):
                chosen = slice(int(chosen[0]), int(chosen[-1]) + 1)  # nothing is copied then
            own, of = branches.take(chosen), whole[chosen]
            plane = planes[of]
            lines = axes(rows, own)
            distance = _distance(plane[:, :, None], *np.moveaxis(lines.knots, 2, 0)).T
            beyond = _wood_crosses(rows, own, distance)
            beyond |= _leaves_cross(flora, own, lines, distance, plane, ~beyond)
            crosses[of[beyond]] = True
            for sort in sorts_of(rows, own.take(np.s_[:1])):
                grown, owner = _near_children(flora, own, lines, distance, ~crosses[of], sort)
                below = of[owner]
                middle, reach = body_distances(bounding_bodies(flora, grown), planes[below])
                near = np.flatnonzero(middle < reach)
                parts.append(grown.take(near))
                owners.append(below[near])
        branches, whole = Branches.concatenate(parts), np.concatenate(owners)


def _distance(planes: NDArray, x: NDArray, y: NDArray, z: NDArray, offset: float | None = None) -> NDArray[np.float64]:
    out = planes[:, 0] * x
    out += planes[:, 1] * y
    out += planes[:, 2] * z
    return out + (planes[:, 3] if offset is None else offset)


def _wood_crosses(rows: NDArray[np.void], branches: Branches, distance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the tubes of branches (n,) of one row reach beyond; ``distance`` (S + 1, n) is that of their knots."""
    row = branches.row[:1]
    stretch = ring_stretch(rows[row])
    lowest = distance.min(axis=0)
    out = lowest < 0
    near = np.flatnonzero(~out & (lowest < branches.radius * (rows["flare"][row] + stretch)))
    if len(near):
        some, places = branches.take(near), np.linspace(0, 1, len(distance))
        radius = np.stack([radius_at(rows, some, np.full(len(near), t)) for t in places])
        if rows["flare"][row] > 0:
            radius[1] = radius[0]  # rings between them may be as wide as that
        out[near] = (distance[:, near] < stretch * radius).any(axis=0)
    return out


def _leaves_cross(
    flora: Flora,
    branches: Branches,
    lines: Axes,
    distance: NDArray[np.float64],
    planes: NDArray[np.float64],
    asked: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Whether leaves of the axes of branches (n,) of one row reach beyond; False where it is not asked."""
    rows, row = flora.rows, branches.row[0]
    out = np.zeros(len(branches), bool)
    if rows["leaves"][row].sum() <= 0:
        return out
    reach = own_leaf_reaches(rows[row : row + 1], flora.leaf.reach[row]) * branches.scale
    counts = leaf_counts(rows, branches)
    start, whorl = leaf_start(rows, branches), rows["leaf_whorl"][row]
    wanted = np.where(asked, counts, 0)
    owner, index = _near(distance, branches.length, wanted, whorl, start, reach)
    if len(owner) == 0:
        return out
    key = leaf_keys(branches, owner, index)
    t = leaf_places(rows, branches, owner, index, counts, key)
    base = _along(distance, owner, t)
    # The leaf of each branch that sits closest to the plane decides most; the others follow where it does not.
    run = np.flatnonzero(np.diff(owner, prepend=-1))
    first = base == np.repeat(np.minimum.reduceat(base, run), np.diff(run, append=len(owner)))
    near = base < np.take(reach, owner)
    middle, half = flora.leaf_box[row].astype(np.float32)
    normals = planes[:, :3].T.astype(np.float32)
    for chosen in (first, ~first):
        some = np.flatnonzero(chosen & near & ~np.take(out, owner))
        of = np.take(owner, some)
        leaves = place_leaves(rows, branches, lines, of, index[some], key[some], t[some])
        frame = in_wind(rows, branches, leaves, settled(rows, branches.row[:1], leaves.frame, leaves.light, leaves.sky))
        normal = np.take(normals, of, axis=1)
        low = np.zeros(len(some), np.float32)
        for axis in range(3):
            cosine = frame[:, 0, axis] * normal[0]
            cosine += frame[:, 1, axis] * normal[1]
            cosine += frame[:, 2, axis] * normal[2]
            low += middle[axis] * cosine - half[axis] * np.abs(cosine)
        out[of[base[some] + leaves.size * low < 0]] = True
    return out


def _near_children(
    flora: Flora,
    parents: Branches,
    lines: Axes,
    distance: NDArray[np.float64],
    asked: NDArray[np.bool_],
    sort: int,
) -> tuple[Branches, NDArray[np.int64]]:
    """Those children of one sort of branches (n,) of one row that may reach beyond, and the index of each parent."""
    rows, row = flora.rows, parents.row[0]
    child = rows["next"][row, sort]
    counts = branch_counts(rows, parents, sort)
    radius, low, high = flora.bound[child]
    longest = {LATERAL: parents.length * rows["nominal"][row], FORK: parents.length, SPUR: parents.scale}[sort]
    reach = np.hypot(radius, max(high, -low)) * rows["length"][child].sum() * longest
    reach += parents.radius * flora.widest[row] + parents.scale * flora.leaf_reach[row]
    wanted = np.where(asked, counts, 0)
    if sort == FORK:
        owner, index = spread(np.where(distance[-1] < reach, wanted, 0))
    else:
        start = varied(rows["start"][parents.row, sort], parents.key, _START[sort])
        owner, index = _near(distance, parents.length, wanted, max(rows["whorl"][child], 1), start, reach)
    return chosen_children(rows, parents, lines, owner, index, counts, sort), owner


def _near(
    distance: NDArray[np.float64],
    length: NDArray[np.float64],
    counts: NDArray[np.int64],
    whorl: int,
    start: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Owner and number of the leaves or children along axes (n,) that may come closer to their plane than a reach.

    Each keeps to its own part of the axis, and along it no distance changes faster than the way. Random numbers are
    not needed for that.
    """
    owner, index = spread(np.where(distance.min(axis=0) < reach, counts, 0))
    step = (1 - start) / np.maximum(counts // whorl, 1)
    node = index // whorl if whorl > 1 else index
    t = np.take(start + step / 2, owner) + node * np.take(step, owner)
    near = np.flatnonzero(_along(distance, owner, t) < np.take(reach + step / 2 * length, owner))
    return np.take(owner, near), np.take(index, near)


def _along(distance: NDArray[np.float64], owner: NDArray[np.int64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (m,) at fractions t (m,) of the axes of branches (m,), from those of knots (S + 1, n)."""
    segments, branches = len(distance) - 1, distance.shape[1]
    along = t * segments
    segment = np.minimum(along.astype(np.int64), segments - 1)
    flat, at = distance.reshape(-1), segment * branches + owner
    low = np.take(flat, at)
    return low + (along - segment) * (np.take(flat, at + branches) - low)
