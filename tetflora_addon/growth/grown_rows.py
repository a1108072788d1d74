# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of axes that are not full-grown: where their children are, part by part between forks; and how long these are.

``growing`` of a row holds for each sort of children: the present length of the row over the full-grown one; the
`Nodes` of the row, begin, end, until (of the present length), power, whole and below.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..species.growing import Nodes, node_at, place_at
from ..species.species import crown_ratio

NOW, BEGIN, END, UNTIL, POWER, WHOLE, BELOW = range(7)
"""Columns of ``growing``."""


def grow_children(
    row: np.void, sort: int, nodes: Nodes, start: tuple[float, float], now: float, cuts: Sequence[float], p: int
) -> None:
    """Set what a row knows of its children of one sort: numbers, ends, ``growing``.

    Parameters
    ----------
    row : record of `rows.ROW_DTYPE`
        Its count is that of the whole axis, of which it is one part.
    sort : int
    nodes : Nodes
        Of the whole axis.
    start : pair of float
        Part of the present axis without children, mean and variation.
    now : float
        Length of the axis over the full-grown one.
    cuts : sequence of float
        Ends of its parts, as fractions of the full-grown length.
    p : int
        Number of the part.
    """
    number = float(row["count"][sort, 0])
    if number <= 0:
        return
    whole, below = nodes.whole * number, nodes.below * number
    law = nodes.begin, nodes.end, nodes.power, whole, below
    low, full = cuts[p], cuts[p + 1] - cuts[p]
    high = now if p + 2 == len(cuts) else min(cuts[p + 1], now)
    here = high - low
    first, top = (float(node_at(place * now, *law)) for place in (start[0], nodes.until))
    last = first + nodes.kept * (top - first)
    fraction = (np.clip(node_at([low, high], *law), first, last) - first) / max(top - first, 1e-9)
    begin = float(np.clip((nodes.begin - low) / full, 0, 1))
    end = float(np.clip((nodes.end - low) / full, begin, 1))
    whole *= full * (end - begin) / (nodes.end - nodes.begin)
    below = float(node_at(min(nodes.begin, cuts[p + 1]), *law) - node_at(low, *law)) if low < nodes.begin else 0.0
    power = nodes.power if p == 0 else 1.0
    inside = low < start[0] * now < high
    mean = float(np.clip((start[0] * now - low) / here, 0, 0.999))
    until = float(np.clip((float(place_at(last, *law)) - low) / here, mean, 1))
    own = begin, end, power, whole, below
    there = float(np.diff(node_at(np.array([mean, until]) * here / full, *own))[0])
    row["fraction"][sort] = fraction
    row["count"][sort] *= there / number
    variation = min(start[1] * now / here, mean, 0.999 - mean) if inside else 0.0
    row["start"][sort] = mean, variation
    if there > 0:
        row["growing"][sort] = here / full, begin, end, until, power, whole / there, below / there


def places(row: np.void, sort: int, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where on a row its children at fractions (n,) of them are, from the lowest to the topmost; for mean ranges."""
    start = row["start"][sort, 0]
    own = row["growing"][sort]
    if own[NOW] <= 0:
        return start + (1.0 - start) * fraction
    number = row["count"][sort, 0]
    law = own[BEGIN], own[END], own[POWER], own[WHOLE] * number, own[BELOW] * number
    first, last = node_at(np.array([start, own[UNTIL]]) * own[NOW], *law)
    return np.clip(place_at(first + (last - first) * fraction, *law) / own[NOW], 0, 1)


def lengths(rows: NDArray[np.void], row: NDArray[np.integer], fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length ratios (n,) of laterals at fractions (n,) of those of their parents, which are of rows (n,)."""
    out = crown_ratio(rows["crown"][row], 1 - fraction)
    ramps = rows["ramps"][row]
    if ramps.any() or rows["conical"][row].any():
        out = out * (1 - rows["conical"][row] * fraction)
        low, high = np.maximum(ramps, 1e-9).T
        out *= np.clip(fraction / low, 0, 1) * np.clip((1 - fraction) / high, 0, 1)
    return out


def least_length(crown: int, conical: float) -> float:
    """Shortest length ratio of laterals that are neither new nor about to die."""
    fraction = np.linspace(0, 1, 65)
    return float((crown_ratio(np.full(65, crown), 1 - fraction) * (1 - conical * fraction)).min())


def fullness_of(rows: NDArray[np.void], row: NDArray[np.integer], vigour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factor (n,) on the numbers of branches and leaves on branches of rows (n,) and vigours (n,)."""
    weight = rows["count_by_length"][row]
    full = 1 - weight + weight * vigour
    least = rows["least"][row]
    if least.any():  # what has just begun to grow bears nothing yet
        full = full * np.where(least > 0, np.clip(vigour / np.maximum(least, 1e-9), 0, 1), 1.0)
    return full
