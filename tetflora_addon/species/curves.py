# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Splines and graphs from which skeletons are made.

*Chains* are splines evaluated as points with radii (p, 4): Bezier, Catmull-Rom and NURBS, with side branches joined.
Graphs and forests are arrays: points that coincide, connected parts, trees from the root outwards, sums along it. A
forest is an array ``parent`` of indices, -1 for roots; loops run over its depth or the logarithm of that.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, connected

_JOINED_WITHIN = 0.01  # of the size: a start that is drawn by eye, not snapped


@dataclass(frozen=True)
class Chains:
    """Points of several splines, one after the other."""

    points: Floats  # (p, 4): x, y, z and radius
    first: Integers  # (s + 1,): first point of each spline, and the number of points
    cyclic: Mask  # (s,): whether the last point leads back to the first

    @classmethod
    def concatenate(cls, parts: list[Chains]) -> Chains:
        """All splines of several in one."""
        counts = np.concatenate([np.zeros(1, np.int64), *(np.diff(p.first) for p in parts)])
        points = np.concatenate([np.zeros((0, 4)), *(p.points for p in parts)])
        return cls(points, np.cumsum(counts), np.concatenate([np.zeros(0, bool), *(p.cyclic for p in parts)]))

    def without(self, splines: Integers) -> Chains:
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
    a = np.repeat(np.arange(len(owner)), pieces)
    t = ((np.arange(len(a)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[a])[:, None]
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
    control: Floats,
    weights: Floats,
    order: int,
    steps: int,
    *,
    cyclic: bool = False,
    endpoint: bool = False,
    bezier: bool = False,
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
    order = max(min(order, len(control)), 1)
    if cyclic:
        around = np.arange(len(control) + order - 1) % len(control)
        control, weights = control[around], weights[around]
    n = len(control)
    index = np.arange(n + order)
    repeated = order - 1 if bezier and not cyclic and order > 1 else 1
    head = order if endpoint and not cyclic else min(2, repeated)
    knots = np.maximum((index - head) // repeated + 1, 0)
    if endpoint and not cyclic:
        knots = np.minimum(knots, knots[n])
    spans = np.unique(knots[order - 1 : n + 1]).astype(np.float64)
    if len(spans) < 2:
        return polygon
    at = np.append((spans[:-1, None] + np.diff(spans)[:, None] * np.arange(steps) / steps).ravel(), spans[-1])
    # The spline's end belongs to its last span.
    span = np.clip(np.searchsorted(knots, at, side="right") - 1, order - 1, np.searchsorted(knots, spans[-1]) - 1)
    basis = (np.arange(n + order - 1) == span[:, None]).astype(np.float64)
    u = at[:, None]
    for k in range(2, order + 1):
        m = n + order - k
        rise, fall = knots[k - 1 : k - 1 + m] - knots[:m], knots[k : k + m] - knots[1 : m + 1]
        basis = (u - knots[:m]) / np.maximum(rise, 1) * (rise > 0) * basis[:, :m] + (knots[k : k + m] - u) / np.maximum(
            fall, 1
        ) * (fall > 0) * basis[:, 1 : m + 1]
    basis = basis * weights
    total = basis.sum(axis=1, keepdims=True)
    points = basis @ control / np.where(total > 0, total, 1.0)
    if cyclic:
        points = points[:-1]
    return Chains(points, np.array([0, len(points)]), np.array([cyclic]))


def joined_edges(chains: Chains) -> tuple[Floats, Integers, Integers]:
    """One graph of chains; those that begin on another are moved onto its line and joined to it there.

    A chain begins on another where its first point, or else its last, is nearer to the other's line than its radius
    there, or than 1 % of the size of all.

    Returns
    -------
    points : (p, 4) float64
    edges : (e, 2) int64
    line : (e,) int64
        Chain of each edge.
    """
    points, edges = chains.points.copy(), chains.edges()
    owner = np.repeat(np.arange(len(chains.cyclic)), np.diff(chains.first))
    line = owner[edges[:, 0]]
    if not len(edges):
        return points, edges, line
    near = _JOINED_WITHIN * float(np.ptp(points[:, :3], axis=0).max())
    margin = np.maximum(points[edges, 3].max(axis=1), near)[:, None]
    low = points[edges, :3].min(axis=1) - margin
    high = points[edges, :3].max(axis=1) + margin
    found: list[tuple[int, float]] = []  # edge, fraction along it
    joints: list[Floats] = []
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
                found.append((int(close[best]), float(fraction[best, 0])))
                joints.append(on_line[best])
                break
    if not found:
        return points, edges, line
    # Each edge that bears joints becomes a chain through them.
    bearer, fraction = np.array([e for e, _ in found]), np.array([s for _, s in found])
    order = np.lexsort((fraction, bearer))
    bearer, new = bearer[order], len(points) + np.arange(len(found))
    points = np.concatenate([points, np.array(joints)[order]])
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
