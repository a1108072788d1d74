# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of axes that are not full-grown: where their children are, part by part between forks; and how long these are.

``growing`` of a row holds for each sort of children: the present length of the row over the full-grown one; the
`Nodes` of the row, begin, end, until (of the present length), power, whole and below, where those that live for a while
are (of the present length), and how many there are for each of the others; variation of the begin over its
mean; and the fraction of the order's children at which those begin that live for a while.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..species.growing import NodeLaw, Nodes, faded, shortened, some_nodes
from ..species.species import crown_ratio

NOW, BEGIN, END, UNTIL, POWER, WHOLE, BELOW, FRESH, EXTRA, VARIES, FADES = range(11)
"""Columns of ``growing``."""
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5) / np.array([[1], [2]])


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
    law = nodes.law(number)
    low, full = cuts[p], cuts[p + 1] - cuts[p]
    high = now if p + 2 == len(cuts) else min(cuts[p + 1], now)
    here = high - low
    first, top = (float(law.number_at(place * now)) for place in (start[0], nodes.until))
    last = first + nodes.kept * (top - first)
    fraction = (np.clip(law.number_at([low, high]), first, last) - first) / max(top - first, 1e-9)
    begin = float(np.clip((nodes.begin - low) / full, 0, 1))
    end = float(np.clip((nodes.end - low) / full, begin, 1))
    whole = law.whole * (full * (end - begin) / (nodes.end - nodes.begin))
    below = float(np.diff(law.number_at([low, min(nodes.begin, cuts[p + 1])]))[0]) if low < nodes.begin else 0.0
    power = nodes.power if p == 0 else 1.0
    inside = low < start[0] * now < high
    mean = float(np.clip((start[0] * now - low) / here, 0, 0.999))
    ends = law.place_of([last - nodes.fresh * (last - first), last])
    fresh, until = np.clip((ends - low) / here, mean, 1)
    variation = min(start[1] * now / here, mean, 0.999 - mean) if inside else 0.0
    starts = mean + variation * _GAUSS  # numbers are not linear in the start, so that their mean is not that of it
    varies = start[1] / start[0] if start[0] > 0 else 0.0
    begins = varied_begin(begin, varies, _GAUSS)
    own = NodeLaw(begins, np.maximum(end, begins), power, whole, below)
    there = _alive(own, (starts, fresh, until), here / full, nodes.extra)
    row["fraction"][sort] = fraction
    row["count"][sort] *= there / number
    row["start"][sort] = mean, variation
    if there > 0:
        row["growing"][sort] = (
            *(here / full, begin, end, until, power, whole / there, below / there),
            *(fresh, nodes.extra, varies, nodes.kept * (1 - nodes.fresh)),
        )


def _alive(law: NodeLaw, places: tuple, now: float, extra: float) -> float:
    """Mean number of living nodes, by where they begin, where those that live for a while do, and where they end."""
    base, some, tip = (law.number_at(place * now) for place in places)
    return float(_WEIGHTS @ (np.maximum(tip - base, 0) + extra * np.maximum(tip - np.maximum(some, base), 0)))


def living(row: np.void, sort: int, bare: float = 0.0, dead: float | None = None) -> float:
    """Mean number of children of one sort of branches of a row that is not full-grown.

    ``bare`` is where the lowest are at least, by a crown form; or if they are dead ones ``dead`` where the topmost are.
    """
    own, number, (mean, variation) = row["growing"][sort], row["count"][sort, 0], row["start"][sort]
    begins = varied_begin(own[BEGIN], own[VARIES], _GAUSS)
    law = NodeLaw(begins, np.maximum(own[END], begins), own[POWER], own[WHOLE] * number, own[BELOW] * number)
    starts = np.maximum(mean + (0.0 if dead is not None else variation) * _GAUSS, bare)
    until = max(own[UNTIL], dead or 0.0) if own[UNTIL] > mean else own[UNTIL]
    return _alive(law, (starts, own[FRESH], until), own[NOW], own[EXTRA])


def varied_begin(begin: ArrayLike, varies: ArrayLike, draw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where nodes of branches (n,) begin, by random numbers (n,) between -1 and 1."""
    return np.minimum(begin * (1 + varies * draw), np.maximum(begin, 0.999))


def spread_children(
    row: np.void, sort: int, bare: float = 0.0, dead: float = 0.0, among: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], ...]:
    """Children of one sort of a mean branch of a row that is not full-grown, as many as stand for all.

    ``bare`` and ``dead`` are as in `living`; ``among`` (2,) is where the row's children begin and end among those of
    the order's branch, by a crown form.

    Returns
    -------
    t, fraction : (512,) float64
        Where they are on the branch, and among those of the order's branch.
    weight : (512,) float64
        How many each stands for; 1 on the mean.
    fading : (512,) float64
        Factor on their lengths.
    """
    own, number = row["growing"][sort], row["count"][sort, 0]
    law = NodeLaw(own[BEGIN], own[END], own[POWER], own[WHOLE] * number, own[BELOW] * number)
    start = row["start"][sort, 0]
    until = max(own[UNTIL], dead) if own[UNTIL] > start else own[UNTIL]
    base, lowest, some, tip = law.number_at(np.array([start, max(start, bare), own[FRESH], until]) * own[NOW])
    node, weight, extra = some_nodes((lowest, max(some, lowest), tip), own[EXTRA])
    (low, high), described = row["fraction"][sort] if among is None else among, row["fraction"][sort]
    fraction = low + (high - low) * (node - lowest) / max(tip - lowest, 1e-9)
    own_fraction = described[0] + (described[1] - described[0]) * (node - base) / max(tip - base, 1e-9)
    return np.clip(law.place_of(node) / own[NOW], 0, 1), fraction, weight, faded(own_fraction, own[FADES], extra)


def lengths(rows: NDArray[np.void], row: NDArray[np.integer], fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length ratios (n,) of laterals at fractions (n,) of those of their parents, which are of rows (n,)."""
    out = crown_ratio(rows["crown"][row], 1 - fraction)
    ramps = rows["ramps"][row]
    if ramps.any() or rows["conical"][row].any():
        out = out * shortened(fraction, rows["conical"][row], *ramps.T)
    return out


def fullness_of(
    rows: NDArray[np.void],
    row: NDArray[np.integer],
    vigour: NDArray[np.float64],
    own: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Factor (n,) on the numbers of branches and leaves on branches of rows (n,) and vigours (n,).

    ``own`` (n,) are their vigours without the crown forms of their plants.
    """
    weight = rows["count_by_length"][row]
    full = 1 - weight + weight * vigour
    least = rows["least"][row]
    if least.any():  # what has just begun to grow bears nothing yet
        own = vigour if own is None else own
        full = full * np.where(least > 0, np.clip(own / np.maximum(least, 1e-9), 0, 1), 1.0)
    return full
