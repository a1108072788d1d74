# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons that an artist draws: edges with radii in, branches of several orders out.

A skeleton is a forest of points, each of which knows the one before it. At every fork one child, as a rule the
thickest, continues the branch, and the others are branches of the next order: the main axis first, as Gravelius (1914)
counts streams. What is not drawn grows from the species.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Integers, Integers32, connected, top
from ..errors import SpeciesError
from .curves import breadth_first, coinciding, levels, longest_way, summed_from_root

#: Orders of branches that a plant has at most.
MAX_ORDERS = 6
MAX_POINTS = 200_000
MERGED_WITHIN = 1e-6  # of the size; points of splines and edges that an exporter split differ by rounding only
_AT_ORIGIN = 0.01  # of the size; an artist snaps the foot to the origin, and a file rounds it
_ROOT_RADIUS = 1 / 40  # of the longest way to a tip: between a slender spruce and a stout oak
_TIP = 0.01  # of that way; wood that every tip counts for, so that twigs do not end in nothing
_SAME = 1e-6  # of the largest; radii and lengths that differ by less are equal


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Points of a plant's drawn branches; equal where the numbers are.

    Raises
    ------
    ValueError
        Arrays that do not fit each other, or a parent that does not stand before its child.
    """

    points: Floats  # (p, 3): meters in the plant's space: z up, the origin at its foot
    radius: Floats  # (p,): meters
    parent: Integers32  # (p,): the point before, toward the root; -1 for roots. Parents stand before their children.
    #: (p,): which stroke of the artist's led to the point from the one before; all 0 where nobody knows.
    line: Integers32 | None = None

    def __post_init__(self) -> None:
        if self.line is None:
            object.__setattr__(self, "line", np.zeros(len(self.parent), np.int32))
        for name, dtype in (("points", np.float64), ("radius", np.float64), ("parent", np.int32), ("line", np.int32)):
            array = np.array(getattr(self, name), dtype=dtype, order="C")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        n = len(self.points)
        if self.points.shape != (n, 3) or {self.radius.shape, self.parent.shape, self.line.shape} != {(n,)}:
            raise ValueError("a skeleton must have (p, 3) points, (p,) radii, (p,) parents and (p,) lines")
        if not ((self.parent >= -1) & (self.parent < np.arange(n))).all():
            raise ValueError("the parents of a skeleton must precede their children; use -1 for no parent")

    @cached_property
    def content(self) -> bytes:
        """Bytes that are equal for equal skeletons; what caches are keyed by."""
        return b"".join(a.tobytes() for a in (self.points, self.radius, self.parent, self.line))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Skeleton) and self.content == other.content

    def __hash__(self) -> int:
        return hash(self.content)


@dataclass(frozen=True)
class DrawnBranches:
    """Branches of a skeleton, sorted by order; parents come before their children, the largest trunk first."""

    first: Integers  # (b + 1,): first knot of each branch, and the number of knots
    #: (k, 3): meters, branch after branch from base to tip. A branch starts at the point of its parent where it leaves.
    knots: Floats
    radius: Floats  # (k,): meters
    order: Integers32  # (b,): 0 for trunks; at most ``MAX_ORDERS - 1``
    parent: Integers32  # (b,): branch that it grows on; -1 for trunks
    at: Floats  # (b,): where on the parent it leaves, fraction of the parent's length; 0 for trunks
    length: Floats  # (b,): along the knots, meters
    #: (b,): from order 2 on, the fraction of the limb's length (its ancestor of order 1) at which that line of branches
    #: leaves it; 0 for trunks and limbs.
    outward: Floats

    def __len__(self) -> int:
        return len(self.order)

    @cached_property
    def owner(self) -> Integers:
        """(k,) int64: branch of each knot."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    @cached_property
    def arc(self) -> Floats:
        """(k,) float64: way along the branch from its base to each knot, meters."""
        return _arc(self.knots, self.first)


def skeleton_from_edges(
    points: ArrayLike, radius: ArrayLike | None, edges: ArrayLike, source: str, line: ArrayLike | None = None
) -> Skeleton:
    """A graph of edges made a forest.

    Parameters
    ----------
    points : (n, 3) float
        Meters in the plant's space.
    radius : (n,) float, optional
        Meters. Where it is missing or zero everywhere, radii follow the pipe rule, see Notes.
    edges : (e, 2) int
        Ends of each edge, in any order and direction.
    source : str
        Name of the thing that they are from, for messages.
    line : (e,) int, optional
        Which stroke of the artist's, such as a spline, each edge belongs to; branches go on along it.

    Returns
    -------
    Skeleton
        Breadth first from the roots, without lone points; points closer than `MERGED_WITHIN` of the size are one.

    Raises
    ------
    SpeciesError
        No edge of any length, numbers that are not finite, a negative radius, an edge to a point that is not there, or
        more than `MAX_POINTS` points.

    Notes
    -----
    The root of each connected part is an end or a fork at the origin; where there is none, the lowest end; in a part
    without ends, the lowest point. Loops are cut where two ways from the root meet that have equally many edges.

    The pipe rule (Shinozaki and others 1964; Leonardo da Vinci before them) lets cross-sections add up at forks. Here
    drawn wood bears twigs along all of its length, so the cross-section is proportional to the wood beyond, and a
    single stem tapers too. The largest root has 1/40 of the longest way to a tip as its radius.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    edges = np.asarray(edges, dtype=np.int64).reshape(-1, 2)
    given = np.zeros(len(points)) if radius is None else np.asarray(radius, dtype=np.float64).reshape(-1)
    refused = f'"{source}" cannot be the skeleton of a plant: '
    if not len(edges):
        raise SpeciesError(refused + "it has no edges; use a curve, or a mesh whose edges are the branches")
    if edges.min() < 0 or edges.max() >= len(points) or len(given) != len(points):
        raise SpeciesError(refused + "its edges or radii do not match its points; export or convert it again")
    used, edges = np.unique(edges, return_inverse=True)
    edges, points, given = edges.reshape(-1, 2), points[used], given[used]
    if not (np.isfinite(points).all() and (given >= 0).all() and np.isfinite(given).all()):
        raise SpeciesError(refused + "it has a point with an invalid position or radius; correct or delete the point")
    if len(points) > MAX_POINTS:
        raise SpeciesError(
            f"{refused}it has {len(points):,} points, more than {MAX_POINTS:,}; lower the curve's resolution, or "
            "simplify the mesh to the centerlines of the branches"
        )
    size = float(np.ptp(points, axis=0).max())
    merged = coinciding(points, size * MERGED_WITHIN)
    pairs = np.sort(merged[edges], axis=1)
    stays = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
    pairs, first = np.unique(pairs[stays], axis=0, return_index=True)
    if not len(pairs):
        raise SpeciesError(refused + "its edges have no length; use a curve, or a mesh whose edges are the branches")
    thickest = np.zeros(len(points))
    np.maximum.at(thickest, merged, given)
    order, parent = breadth_first(pairs, _roots(points, pairs, size))
    points, thickest = points[order], thickest[order]
    if not thickest.any():
        thickest = _pipe_radii(points, parent)
    strokes = np.zeros(len(points), np.int32)
    if line is not None:
        ends = np.sort(np.stack([order, np.where(parent < 0, order, order[parent])], axis=1), axis=1)
        found = np.searchsorted(pairs @ (len(merged), 1), ends @ (len(merged), 1))[parent >= 0]
        strokes[parent >= 0] = np.asarray(line)[stays[first[found]]]
    return Skeleton(points, thickest, parent, strokes)


def drawn_branches(skeleton: Skeleton) -> DrawnBranches:
    """Split a skeleton into branches.

    At each fork the child on the same line goes on; of equals, the one with the largest radius; of these, the one with
    the longest way to a tip. A side branch takes its radius at the fork from its own points, as far as these
    determine it, not from its parent.
    """
    points, radius, parent = skeleton.points, skeleton.radius, skeleton.parent.astype(np.int64)
    n = len(points)
    index, rooted = np.arange(n), parent < 0
    before = np.where(rooted, index, parent)
    step = np.linalg.norm(points - points[before], axis=1)
    far = longest_way(parent, step) + step
    thick, far = (np.rint(v / max(_SAME * float(v.max(initial=0.0)), 1e-300)) for v in (radius, far))
    leaves_line = skeleton.line != skeleton.line[before]
    children = np.lexsort((index, -far, -thick, leaves_line, parent))[int(rooted.sum()) :]
    leads = np.zeros(n, dtype=bool)
    leads[children[np.diff(parent[children], prepend=-1) != 0]] = True  # the first child of each point continues it
    bears = np.bincount(parent[~rooted], minlength=n) > 0
    heads = np.flatnonzero(~leads & (bears | ~rooted))
    generation = summed_from_root(parent, ~leads & ~rooted)
    large = np.where(rooted[heads], -far[heads], 0)
    heads = heads[np.lexsort((heads, large, generation[heads]))]
    number = np.full(n, -1)
    number[heads] = np.arange(len(heads))
    branch = number[top(np.where(leads, parent, index))]

    side = heads[~rooted[heads]]
    own = np.flatnonzero(branch >= 0)
    entry = np.concatenate([own, parent[side]])
    at_branch = np.concatenate([branch[own], number[side]])
    sequence = np.lexsort((entry, at_branch))
    entry = entry[sequence]
    first = np.concatenate([[0], np.cumsum(np.bincount(at_branch, minlength=len(heads)))])
    knots, along = points[entry], radius[entry]
    base = first[number[side]]
    along[base] = _base_radius(knots, along, base, first[number[side] + 1] - base)

    arc = _arc(knots, first)
    length = arc[first[1:] - 1]
    place = np.zeros(n)
    is_own = sequence < len(own)
    place[entry[is_own]] = arc[is_own]
    grown_on = np.where(rooted[heads], -1, branch[before[heads]])
    at = np.where(grown_on >= 0, np.minimum(place[before[heads]] / np.maximum(length[grown_on], 1e-300), 1.0), 0.0)
    level = generation[heads]
    order = np.minimum(level, MAX_ORDERS - 1).astype(np.int32)
    outward = _outward(level, grown_on, at)
    return DrawnBranches(first, knots, along, order, grown_on.astype(np.int32), at, length, outward)


def _roots(points: Floats, pairs: Integers, size: float) -> Integers:
    """One point of each connected part, see `skeleton_from_edges`."""
    n = len(points)
    degree = np.bincount(pairs.reshape(-1), minlength=n)
    away = np.linalg.norm(points, axis=1)
    there = (degree != 2) & (away <= _AT_ORIGIN * size)
    order = np.lexsort((points[:, 2], degree != 1, np.where(there, away, np.inf)))
    order = order[degree[order] > 0]
    part = connected(n, *pairs.T)
    return order[np.unique(part[order], return_index=True)[1]]


def _pipe_radii(points: Floats, parent: Integers) -> Floats:
    """Radii (p,) by the pipe rule, see `skeleton_from_edges`."""
    before = np.where(parent < 0, np.arange(len(parent)), parent)
    step = np.linalg.norm(points - points[before], axis=1)
    longest = float(longest_way(parent, step).max())
    tips = np.bincount(parent[parent >= 0], minlength=len(points)) == 0
    wood = np.where(tips, _TIP * longest, 0.0)
    for now in levels(parent):
        np.add.at(wood, parent[now], wood[now] + step[now])
    return _ROOT_RADIUS * longest * np.sqrt(wood / wood.max())


def _base_radius(knots: Floats, radius: Floats, base: Integers, count: Integers) -> Floats:
    """Radii (s,) at the first knots ``base`` (s,) of side branches of ``count`` knots (s,); those given are the forks'.

    The taper between its own first two points, continued to the fork; half of the fork's radius for a branch that has
    only a tip of radius 0.
    """
    fork, here, beyond = radius[base], radius[base + 1], np.where(count > 2, base + 2, base + 1)
    run = np.linalg.norm(knots[base + 1] - knots[base], axis=1)
    rise = np.linalg.norm(knots[beyond] - knots[base + 1], axis=1)
    steeper = np.maximum(here - radius[beyond], 0.0) * run / np.where(rise > 0, rise, np.inf)
    start = np.where(here + steeper > 0, here + steeper, 0.5 * fork)
    return np.minimum(start, np.maximum(fork, here))


def _arc(knots: Floats, first: Integers) -> Floats:
    """Way (k,) along each branch to its knots."""
    step = np.zeros(len(knots))
    step[1:] = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    step[first[:-1]] = 0.0
    total = np.cumsum(step)
    return total - np.repeat(total[first[:-1]], np.diff(first))


def _outward(level: Integers, parent: Integers, at: Floats) -> Floats:
    """See `DrawnBranches`, from the number of forks (b,) below each branch."""
    outward = np.where(level == 2, at, 0.0)
    for g in range(3, int(level.max(initial=0)) + 1):
        outward[level == g] = outward[parent[level == g]]
    return outward
