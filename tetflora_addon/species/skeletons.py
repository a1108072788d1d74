# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons that an artist draws: edges with radii in, branches of several orders out.

A skeleton is a forest of points, each of which knows the one before it. At every fork one child, as a rule the
thickest, continues the branch, and the others are branches of the next order: the main axis first, as Gravelius (1914)
counts streams. What is not drawn grows from the species.

*Chains* are splines evaluated as points with radii (p, 4): Bezier, Catmull-Rom and NURBS, with side branches joined.
Graphs and forests are arrays: points that coincide, connected parts, trees from the root outwards, sums along it. A
forest is an array ``parent`` of indices, -1 for roots; loops run over its depth or the logarithm of that.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Integers, Integers32, Mask, connected, spread, top
from ..errors import SpeciesError

_JOINED_WITHIN = 0.01  # of the size: a start that is drawn by eye, not snapped


@dataclass(frozen=True)
class Chains:
    """Points of several splines, one after the other."""

    points: Floats  # (p, 4): x, y, z and radius
    first: Integers  # (s + 1,): first point of each spline, and the number of points
    cyclic: Mask  # (s,): whether the last point leads back to the first

    @classmethod
    def concatenate(cls, parts: list[Self]) -> Self:
        """All splines of several in one."""
        counts = np.concatenate([np.zeros(1, np.int64), *(np.diff(p.first) for p in parts)])
        points = np.concatenate([np.zeros((0, 4)), *(p.points for p in parts)])
        return cls(points, np.cumsum(counts), np.concatenate([np.zeros(0, bool), *(p.cyclic for p in parts)]))

    def without(self, splines: Integers) -> Self:
        """The chains without some splines, given by number (k,)."""
        counts = np.diff(self.first)
        stays = np.ones(len(counts), dtype=bool)
        stays[splines] = False
        first = np.concatenate([[0], np.cumsum(counts[stays])])
        return Chains(self.points[np.repeat(stays, counts)], first, self.cyclic[stays])

    def edges(self) -> Integers:
        """Ends (e, 2) int64 of the edges along all splines."""
        index = np.arange(len(self.points) - 1)
        index = np.delete(index, self.first[1:-1] - 1)
        last, first = self.first[1:] - 1, self.first[:-1]
        closing = np.stack([last, first], axis=1)[self.cyclic & (last > first)]
        return np.concatenate([np.stack([index, index + 1], axis=1), closing])


def bezier_chains(control: Chains, left: Floats, right: Floats, steps: Integers) -> Chains:
    """Cubic Bezier splines; radii run evenly from one control point to the next.

    Parameters
    ----------
    control : Chains
        Control points.
    left, right : (p, 3) float64
        Handles before and after each control point.
    steps : (s,) int
        Pieces between two control points of each spline, 1 or more; 1 gives straight lines.
    """
    counts = np.diff(control.first)
    owner = np.repeat(np.arange(len(counts)), counts)
    last = np.zeros(len(owner), dtype=bool)
    last[control.first[1:] - 1] = True
    following = np.where(last, control.first[owner], np.arange(len(owner)) + 1)
    # An open spline ends with its last control point; all others begin a piece.
    pieces = np.where(last & ~control.cyclic[owner], 1, np.maximum(steps, 1)[owner])
    a, within = spread(pieces)
    t = (within / pieces[a])[:, None]
    b, s = following[a], 1 - t
    points = np.zeros((len(a), 4))
    ends = control.points
    points[:, :3] = s**3 * ends[a, :3] + 3 * s * t * (s * right[a] + t * left[b]) + t**3 * ends[b, :3]
    points[:, 3:] = s * ends[a, 3:] + t * ends[b, 3:]
    first = np.concatenate([[0], np.cumsum(np.bincount(owner[a], minlength=len(counts)))])
    return Chains(points, first, control.cyclic)


def smooth_handles(control: Chains) -> tuple[Floats, Floats]:
    """Handles (p, 3) before and (p, 3) after each control point that make Catmull-Rom splines of Bezier splines."""
    counts = np.diff(control.first)
    owner = np.repeat(np.arange(len(counts)), counts)
    index, first, last = np.arange(len(owner)), control.first[owner], control.first[owner + 1] - 1
    round_ = control.cyclic[owner]
    before = np.where(index > first, index - 1, np.where(round_, last, first))
    after = np.where(index < last, index + 1, np.where(round_, first, last))
    places = control.points[:, :3]
    third = (places[after] - places[before]) / 6
    return places - third, places + third


def nurbs_chain(
    control: Floats, weights: Floats, order: int, steps: int, *, cyclic: bool, endpoint: bool, bezier: bool
) -> Chains:
    """One NURBS spline, by the recursion of Cox and de Boor (de Boor 1972).

    Parameters
    ----------
    control : (n, 4) float64
        Control points.
    weights : (n,) float64
        Their weights.
    order : int
        Degree and 1; at most n is used.
    steps : int
        Pieces of each span between two knots.
    cyclic, endpoint, bezier : bool
        As Blender places its knots: around, with the ends at the outer control points, in pieces of Bezier splines.
        A spline that goes around has evenly spaced knots whatever else is asked for.

    Returns
    -------
    Chains
        The control points themselves where they are too few for the knots.
    """
    polygon = Chains(control, np.array([0, len(control)]), np.array([cyclic]))
    order = min(order, len(control))
    if order < 2:
        return polygon
    if cyclic:
        around = np.arange(len(control) + order - 1) % len(control)
        control, weights = control[around], weights[around]
    n = len(control)
    index = np.arange(n + order)
    repeated = order - 1 if bezier and not cyclic else 1
    head = order if endpoint and not cyclic else min(2, repeated)
    knots = np.maximum((index - head) // repeated + 1, 0)
    if endpoint and not cyclic:
        knots = np.minimum(knots, knots[n])
    spans = np.unique(knots[order - 1 : n + 1]).astype(np.float64)
    if len(spans) < 2:
        return polygon
    marks = np.append((spans[:-1, None] + np.diff(spans)[:, None] * np.arange(steps) / steps).ravel(), spans[-1])
    # The spline's end belongs to its last span.
    span = np.clip(np.searchsorted(knots, marks, side="right") - 1, order - 1, np.searchsorted(knots, spans[-1]) - 1)
    basis = (np.arange(n + order - 1) == span[:, None]).astype(np.float64)
    u = marks[:, None]
    for k in range(2, order + 1):
        m = n + order - k
        rise, fall = knots[k - 1 : k - 1 + m] - knots[:m], knots[k : k + m] - knots[1 : m + 1]
        rising = (u - knots[:m]) / np.maximum(rise, 1) * (rise > 0) * basis[:, :m]
        basis = rising + (knots[k : k + m] - u) / np.maximum(fall, 1) * (fall > 0) * basis[:, 1 : m + 1]
    basis = basis * weights
    total = basis.sum(axis=1, keepdims=True)
    points = basis @ control / np.where(total > 0, total, 1.0)
    if cyclic:
        points = points[:-1]
    return Chains(points, np.array([0, len(points)]), np.array([cyclic]))


def joined_edges(chains: Chains) -> tuple[Floats, Integers, Integers]:
    """One graph of chains; those that begin on another are moved onto its line and joined to it there.

    A chain begins on another where its first point, or else its last, is within its radius, or 1 % of the size of all.

    Returns
    -------
    points : (p, 4) float64
    edges : (e, 2) int64
    line : (e,) int64
        Chain of each edge.
    """
    points, edges = chains.points.copy(), chains.edges()
    line = np.repeat(np.arange(len(chains.cyclic)), np.diff(chains.first))[edges[:, 0]]
    if not len(edges):
        return points, edges, line
    near = _JOINED_WITHIN * float(np.ptp(points[:, :3], axis=0).max())
    margin = np.maximum(points[edges, 3].max(axis=1), near)[:, None]
    low = points[edges, :3].min(axis=1) - margin
    high = points[edges, :3].max(axis=1) + margin
    places: list[tuple[int, float, Floats]] = []  # edge, fraction along it, and the joint there
    for chain in np.flatnonzero(~chains.cyclic):
        for end in (chains.first[chain], chains.first[chain + 1] - 1):
            here = points[end, :3]
            close = np.flatnonzero(((low <= here) & (here <= high)).all(axis=1) & (line != chain))
            a, b = points[edges[close, 0]], points[edges[close, 1]]
            along = b[:, :3] - a[:, :3]
            fraction = ((here - a[:, :3]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300)
            fraction = np.clip(fraction, 0, 1)[:, None]
            on_line = a + fraction * (b - a)
            gap = np.linalg.norm(here - on_line[:, :3], axis=1) / np.maximum(on_line[:, 3], near)
            if len(gap) and gap.min() <= 1:
                best = int(gap.argmin())
                points[end, :3] = on_line[best, :3]
                places.append((int(close[best]), float(fraction[best, 0]), on_line[best]))
                break
    if not places:
        return points, edges, line
    # Each edge that bears joints becomes a chain through them.
    bearer, fraction, joints = (np.array(of) for of in zip(*places, strict=True))
    order = np.lexsort((fraction, bearer))
    bearer, new = bearer[order], len(points) + np.arange(len(places))
    points = np.concatenate([points, joints[order]])
    first = np.diff(bearer, prepend=-1) != 0
    final = np.diff(bearer, append=-1) != 0
    before = np.where(first, edges[bearer, 0], new - 1)
    split = [np.stack([before, new], axis=1), np.stack([new[final], edges[bearer[final], 1]], axis=1)]
    lines = [np.delete(line, bearer), line[bearer], line[bearer[final]]]
    return points, np.concatenate([np.delete(edges, bearer, axis=0), *split]), np.concatenate(lines)


def breadth_first(pairs: Integers, roots: Integers) -> tuple[Integers, Integers]:
    """Points (p,) in the order in which they are reached from the roots, and the place (p,) of each one's parent."""
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    ends = ends[np.lexsort((ends[:, 1], ends[:, 0]))]
    n = int(pairs.max()) + 1
    start = np.searchsorted(ends[:, 0], np.arange(n + 1))
    place = np.full(n, -1)  # in the result
    place[roots] = np.arange(len(roots))
    reached, parents, now, number = [roots], [np.full(len(roots), -1)], roots, len(roots)
    while len(now):
        counts = start[now + 1] - start[now]
        last = np.cumsum(counts)
        near = ends[np.repeat(start[now] - last + counts, counts) + np.arange(last[-1]), 1]
        parent = np.repeat(place[now], counts)
        new = np.flatnonzero(place[near] < 0)
        new = new[np.sort(np.unique(near[new], return_index=True)[1])]
        now = near[new]
        place[now] = number + np.arange(len(now))
        number += len(now)
        reached.append(now)
        parents.append(parent[new])
    return np.concatenate(reached), np.concatenate(parents)


def summed_from_root(parent: Integers, values: NDArray) -> Integers:
    """Sums (n,) of integers along the way from the root to each point, it included; the steps double each time."""
    total, up = values.astype(np.int64), parent.copy()
    while (go := np.flatnonzero(up >= 0)).size:
        total[go], up[go] = total[go] + total[up[go]], up[up[go]]
    return total


def levels(parent: Integers) -> list[Integers]:
    """Points that have a parent, grouped by steps from the root, farthest first; ``parent`` is (n,), -1 at roots."""
    depth = summed_from_root(parent, parent >= 0)
    order = np.argsort(depth, kind="stable")
    cuts = np.searchsorted(depth[order], np.arange(1, depth.max(initial=0) + 2))
    return [order[a:b] for a, b in pairwise(cuts)][::-1]


def longest_way(parent: Integers, step: Floats) -> Floats:
    """Longest way (n,) from each point to a tip, where ``step`` (n,) is the way to its parent."""
    longest = np.zeros(len(parent))
    for now in levels(parent):
        np.maximum.at(longest, parent[now], longest[now] + step[now])
    return longest


def coinciding(points: Floats, within: float) -> Integers:
    """(n,) the first of the points that lie together, directly or by way of others, of each point.

    Two points closer than ``within`` share a cell of twice that side in one of eight grids, shifted by half a cell.
    """
    n = len(points)
    if within == 0:
        return np.zeros(n, np.int64)
    steps = (points - points.min(axis=0)) / (2 * within)
    ends = [np.zeros((2, 0), np.int64)]
    for shift in np.ndindex(2, 2, 2):
        cell = np.floor(steps + 0.5 * np.array(shift)).astype(np.int64)
        cell = cell @ (1, 1 << 21, 1 << 42)  # a side has half a million cells
        order = np.argsort(cell, kind="stable")
        same = np.diff(cell[order]) == 0
        ends.append(np.stack([order[:-1][same], order[1:][same]]))
    return connected(n, *np.concatenate(ends, axis=1))


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
    insertion: Floats  # (b,): where on the parent it leaves, fraction of the parent's length; 0 for trunks
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
        No edge of any length, numbers that are not finite, a negative radius, an edge to nowhere, or over `MAX_POINTS`.

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
        matches = np.searchsorted(pairs @ (len(merged), 1), ends @ (len(merged), 1))[parent >= 0]
        strokes[parent >= 0] = np.asarray(line)[stays[first[matches]]]
    return Skeleton(points, thickest, parent, strokes)


def drawn_branches(skeleton: Skeleton) -> DrawnBranches:
    """Split a skeleton into branches.

    At each fork the child on the same line goes on; of equals, the one with the largest radius; of these, the one with
    the longest way to a tip. A side branch takes its radius at the fork from its own points where these have one.
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
    heads = heads[np.lexsort((heads, np.where(rooted[heads], -far[heads], 0), generation[heads]))]
    number = np.full(n, -1)
    number[heads] = np.arange(len(heads))
    branch = number[top(np.where(leads, parent, index))]

    side = heads[~rooted[heads]]
    members = np.flatnonzero(branch >= 0)
    entry = np.concatenate([members, parent[side]])
    at_branch = np.concatenate([branch[members], number[side]])
    sequence = np.lexsort((entry, at_branch))
    entry = entry[sequence]
    first = np.concatenate([[0], np.cumsum(np.bincount(at_branch, minlength=len(heads)))])
    knots, along = points[entry], radius[entry]
    base = first[number[side]]
    along[base] = _base_radius(knots, along, base, first[number[side] + 1] - base)

    arc = _arc(knots, first)
    length = arc[first[1:] - 1]
    place = np.zeros(n)
    is_own = sequence < len(members)
    place[entry[is_own]] = arc[is_own]
    grown_on = np.where(rooted[heads], -1, branch[before[heads]])
    joint = np.where(grown_on >= 0, np.minimum(place[before[heads]] / np.maximum(length[grown_on], 1e-300), 1.0), 0.0)
    level = generation[heads]
    order = np.minimum(level, MAX_ORDERS - 1).astype(np.int32)
    # See `DrawnBranches`, from the number of forks (b,) below each branch.
    outward = np.where(level == 2, joint, 0.0)
    for g in range(3, int(level.max(initial=0)) + 1):
        outward[level == g] = outward[grown_on[level == g]]
    return DrawnBranches(first, knots, along, order, grown_on.astype(np.int32), joint, length, outward)


def _roots(points: Floats, pairs: Integers, size: float) -> Integers:
    """One point of each connected part, see `skeleton_from_edges`."""
    n = len(points)
    degree = np.bincount(pairs.reshape(-1), minlength=n)
    away = np.linalg.norm(points, axis=1)
    at_origin = (degree != 2) & (away <= _AT_ORIGIN * size)
    order = np.lexsort((points[:, 2], degree != 1, np.where(at_origin, away, np.inf)))
    order = order[degree[order] > 0]
    return order[np.unique(connected(n, *pairs.T)[order], return_index=True)[1]]


def _pipe_radii(points: Floats, parent: Integers) -> Floats:
    """Radii (p,) by the pipe rule, see `skeleton_from_edges`."""
    step = np.linalg.norm(points - points[np.where(parent < 0, np.arange(len(parent)), parent)], axis=1)
    longest = float(longest_way(parent, step).max())
    tips = np.bincount(parent[parent >= 0], minlength=len(points)) == 0
    wood = np.where(tips, _TIP * longest, 0.0)
    for now in levels(parent):
        np.add.at(wood, parent[now], wood[now] + step[now])
    return _ROOT_RADIUS * longest * np.sqrt(wood / wood.max())


def _base_radius(knots: Floats, radius: Floats, base: Integers, count: Integers) -> Floats:
    """Radii (s,) at the first knots ``base`` (s,) of side branches of ``count`` knots (s,); those given are the forks'.

    The taper between its own first two points, continued to the fork; half of the fork's radius for a lone tip of 0.
    """
    fork, here, beyond = radius[base], radius[base + 1], np.where(count > 2, base + 2, base + 1)
    run = np.linalg.norm(knots[base + 1] - knots[base], axis=1)
    rise = np.linalg.norm(knots[beyond] - knots[base + 1], axis=1)
    steeper = np.maximum(here - radius[beyond], 0.0) * run / np.where(rise > 0, rise, np.inf)
    return np.minimum(np.where(here + steeper > 0, here + steeper, 0.5 * fork), np.maximum(fork, here))


def _arc(knots: Floats, first: Integers) -> Floats:
    """Way (k,) along each branch to its knots."""
    step = np.zeros(len(knots))
    step[1:] = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    step[first[:-1]] = 0.0
    total = np.cumsum(step)
    return total - np.repeat(total[first[:-1]], np.diff(first))
