# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A hierarchy of clusters over the patches of an asset, as a species has orders of branches.

Patches are divided in space, each time in two where a cluster is longest and half of the triangles are on either side
(a k-d tree; Bentley 1975). Three divisions at once make eight children.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Integers, Integers32

#: Triangles up to which a cluster has no children.
SMALL = 256
#: Divisions between a cluster and its children.
GENERATIONS = 3


@dataclass(frozen=True)
class Hierarchy:
    """Clusters (c), parents before children and children of one parent together; the first is all of the asset."""

    order: Integers  # (p,): patches, those of each cluster together
    #: first and last, (c,): which of them are of each: from the first on, before the last.
    first: Integers
    last: Integers
    parent: Integers32  # (c,): −1 for the first
    #: child and children, (c,): first child, and how many there are; 0 where there are none.
    child: Integers32
    children: Integers32


def hierarchy_of(center: NDArray[np.floating], triangles: Integers, kind: Integers) -> Hierarchy:
    """Clusters of patches with middles (p, 3) and so many triangles (p,) each, at least one patch.

    Kinds (p,) are divided before anything else: a trunk among leaves would be as small as these for all that asks.
    """
    order = np.argsort(kind, kind="stable")
    first, last, parent = [np.zeros(1, np.int64)], [np.array([len(center)])], [np.array([-1])]
    start, stop, number, known = first[0], last[0], np.zeros(1, np.int64), 1
    begin = np.flatnonzero(np.diff(kind[order], prepend=-1))
    if len(begin) > 1:
        start, stop = begin.astype(np.int64), np.append(begin[1:], len(center))
        first.append(start)
        last.append(stop)
        parent.append(np.zeros(len(begin), np.int64))
        number, known = np.arange(1, 1 + len(begin)), 1 + len(begin)
    # The first cluster has fewer children, so that the last divisions, too, come as many at once.
    depth = max(int(np.ceil(np.log2(max(float(triangles.sum()), 1.0) / SMALL))), 0)
    generations = depth % GENERATIONS or GENERATIONS
    while len(number):
        inner, low, high = number, start, stop
        for _ in range(generations):
            order, low, high, inner = _divided(order, low, high, inner, center, triangles)
        # A cluster that is not divided any more has itself as its only child.
        real = np.bincount(inner, minlength=known)[inner] > 1
        start, stop, of = low[real], high[real], inner[real]
        first.append(start)
        last.append(stop)
        parent.append(of)
        number, known, generations = np.arange(known, known + len(of)), known + len(of), GENERATIONS
    parents = np.concatenate(parent).astype(np.int32)
    children = np.bincount(parents[1:], minlength=known).astype(np.int32)
    child = np.where(children > 0, np.searchsorted(parents[1:], np.arange(known)) + 1, 0)
    return Hierarchy(order, np.concatenate(first), np.concatenate(last), parents, child.astype(np.int32), children)


def _divided(
    order: Integers, low: Integers, high: Integers, number: Integers, center: NDArray[np.floating], triangles: Integers
) -> tuple[Integers, Integers, Integers, Integers]:
    """Divide runs (r,) of the order in two where they are large; new order, runs, and where each comes from."""
    size = high - low
    owner = np.repeat(np.arange(len(low)), size)
    at = np.arange(len(owner)) - (np.cumsum(size) - size - low)[owner]
    patch = order[at]
    weight = triangles[patch].astype(np.float64)
    begin = np.cumsum(size) - size
    load = np.add.reduceat(weight, begin)
    dividing = (load > SMALL) & (size > 1)
    if not dividing.any():
        return order, low, high, number
    points = center[patch]
    least, most = np.minimum.reduceat(points, begin, axis=0), np.maximum.reduceat(points, begin, axis=0)
    axis = (most - least).argmax(axis=1)
    along = np.take_along_axis(points, axis[owner][:, None], axis=1)[:, 0].astype(np.float64)
    span = np.maximum((most - least)[np.arange(len(low)), axis], 1e-30)
    # What is not divided keeps its order. Equal places keep theirs, too, whatever sorts them.
    place = np.where(dividing[owner], (along - least[owner, axis[owner]]) / span[owner], 0.0)
    sorted_ = np.argsort(2 * owner + np.clip(place, 0.0, 1.0), kind="stable")
    order = order.copy()
    order[at] = patch[sorted_]
    done = np.cumsum(weight[sorted_])
    before = done - weight[sorted_] - (np.cumsum(load) - load)[owner]
    half = np.bincount(owner, before < load[owner] / 2, len(low)).astype(np.int64)
    half = np.clip(half, 1, np.maximum(size - 1, 1))
    middle = low + half
    times = 1 + dividing
    runs = np.repeat(np.arange(len(low)), times)
    second = np.diff(runs, prepend=-1) == 0
    new_low = np.where(second, middle[runs], low[runs])
    new_high = np.where(~second & dividing[runs], middle[runs], high[runs])
    return order, new_low, new_high, number[runs]
