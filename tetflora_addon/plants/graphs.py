# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs and forests as arrays: points that coincide, connected parts, trees from the root outwards, sums along it.

A forest is an array ``parent`` of indices, -1 for roots. Loops run over the depth of a forest or its logarithm.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def connected(n: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) smallest index in the part of each of n things, of which a (e,) and b (e,) are connected."""
    label = np.arange(n)
    while (label[a] != label[b]).any():
        np.minimum.at(label, np.maximum(label[a], label[b]), np.minimum(label[a], label[b]))
        label = top(label)
    return label


def top(up: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where each thing (n,) comes to by following ``up`` until it stays; the steps double each time."""
    while (up[up] != up).any():
        up = up[up]
    return up


def breadth_first(pairs: NDArray[np.int64], roots: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
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


def summed_from_root(parent: NDArray[np.int64], values: NDArray) -> NDArray[np.int64]:
    """Sums (n,) of integers along the way from the root to each point, it included; the steps double each time."""
    total, up = values.astype(np.int64), parent.copy()
    while (go := np.flatnonzero(up >= 0)).size:
        total[go], up[go] = total[go] + total[up[go]], up[up[go]]
    return total


def levels(parent: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Points that have a parent, by their number of steps from the root, the farthest first."""
    depth = summed_from_root(parent, parent >= 0)
    order = np.argsort(depth, kind="stable")
    cuts = np.searchsorted(depth[order], np.arange(1, depth.max(initial=0) + 2))
    return [order[a:b] for a, b in pairwise(cuts)][::-1]


def longest_way(parent: NDArray[np.int64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Longest way (n,) from each point to a tip, where ``step`` (n,) is the way to its parent."""
    longest = np.zeros(len(parent))
    for now in levels(parent):
        np.maximum.at(longest, parent[now], longest[now] + step[now])
    return longest


def coinciding(points: NDArray[np.float64], within: float) -> NDArray[np.int64]:
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
