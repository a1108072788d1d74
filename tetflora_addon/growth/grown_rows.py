# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of axes that are not full-grown: where their children are, part by part between forks; and how long these are.

``growing`` of a row holds for each sort of children: the present length of the row over the full-grown one; the
`Nodes` of the row, begin, end, until (of the present length), power, whole and below, where those that live for a while
are (of the present length), and how many there are for each of the others; variation of the begin over its
mean; and the fraction of the order's children at which those begin that live for a while.

Which children a branch has that is not full-grown: those whose place it has reached and that are not dead yet. Each has
its number and place for life. Which numbers those are depends on the places alone, so that nothing appears but at the
very top and nothing goes but at the very base; how many there are is exact on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Integers, Keys, Mask, Table
from ..species.growing import NodeLaw, Nodes, faded, shortened, some_nodes
from ..species.species import crown_ratio
from .hashing import Draw, child_key, signed
from .seeds import Branches

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

    ``bare`` is where the lowest are at least, by a crown shape; or of dead ones ``dead`` where the topmost are.
    """
    own, number, (mean, variation) = row["growing"][sort], row["count"][sort, 0], row["start"][sort]
    begins = varied_begin(own[BEGIN], own[VARIES], _GAUSS)
    law = NodeLaw(begins, np.maximum(own[END], begins), own[POWER], own[WHOLE] * number, own[BELOW] * number)
    starts = np.maximum(mean + (0.0 if dead is not None else variation) * _GAUSS, bare)
    until = max(own[UNTIL], dead or 0.0) if own[UNTIL] > mean else own[UNTIL]
    return _alive(law, (starts, own[FRESH], until), own[NOW], own[EXTRA])


def varied_begin(begin: ArrayLike, varies: ArrayLike, draw: Floats) -> Floats:
    """Where nodes of branches (n,) begin, by random numbers (n,) between -1 and 1."""
    return np.minimum(begin * (1 + varies * draw), np.maximum(begin, 0.999))


def spread_children(
    row: np.void, sort: int, bare: float = 0.0, dead: float = 0.0, among: Floats | None = None
) -> tuple[Floats, ...]:
    """Children of one sort of a mean branch of a row that is not full-grown, as many as stand for all.

    ``bare`` and ``dead`` are as in `living`; ``among`` (2,) is where the row's children begin and end among those of
    the order's branch, by a crown shape.

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


def lengths(rows: Table, row: Integers, fraction: Floats) -> Floats:
    """Length ratios (n,) of laterals at fractions (n,) of those of their parents, which are of rows (n,)."""
    out = crown_ratio(rows["crown"][row], 1 - fraction)
    ramps = rows["ramps"][row]
    if ramps.any() or rows["conical"][row].any():
        out = out * shortened(fraction, rows["conical"][row], *ramps.T)
    return out


def fullness_of(rows: Table, row: Integers, vigor: Floats, own: Floats | None = None) -> Floats:
    """Factor (n,) on the numbers of branches and leaves on branches of rows (n,) and vigors (n,).

    ``own`` (n,) are their vigors without the crown shapes of their plants.
    """
    weight = rows["count_by_length"][row]
    full = 1 - weight + weight * vigor
    least = rows["least"][row]
    if least.any():  # what has just begun to grow bears nothing yet
        own = vigor if own is None else own
        full = full * np.where(least > 0, np.clip(own / np.maximum(least, 1e-9), 0, 1), 1.0)
    return full


#: Where numbers of nodes that live for a while begin, and those below the first are counted back from: no child
#: index of one is that of another, nor of another sort.
_EXTRA, _NEGATIVE = 1 << 27, 1 << 28


def child_number(index: Integers, path: int) -> Integers:
    """Child indices (n,), for `hashing.child_key`, of children (n,) of a sort; negative ones have some of their own."""
    return np.where(index < 0, index + _NEGATIVE, index) + path if (index < 0).any() else index + path


def _within(key: Keys) -> Floats:
    """Where in their node the children of keys (n,) sit, 0 to 1."""
    return 0.5 + 0.5 * signed(key, Draw.PLACE)


@dataclass(frozen=True)
class Grown:
    """Living nodes of branches (n,)."""

    on: Mask  # (n,): whether they are still growing; if not, the rest has no meaning
    #: first and number, (2, n): number of the lowest node, and how many there are: of those that stay, and those that
    #: live for a while.
    first: Integers
    number: Integers
    now: Floats  # (n,): length over that when full-grown
    law: NodeLaw  # of (n,) float64
    ends: Floats  # (3, n): where nodes begin, where those begin that live for a while, and where all end, in nodes
    density: Floats  # (2, n): nodes above the begin, and nodes that live for a while, over those of the law
    described: Floats  # (n,): where nodes would begin without the crown shapes of plants

    def chosen(self, owner: Integers, index: Integers, whorl: Integers) -> tuple[Integers, Integers, Mask]:
        """Index that is theirs for life, where child numbers begin, and which live for a while (m,), of children (m,).

        These are given by branch and index among the living; a node bears as many as a whorl has.
        """
        node, within = index // whorl, index % whorl
        on, stay = self.on[owner], self.number[0][owner]
        extra = on & (node >= stay)
        node = node + np.where(on, np.where(extra, self.first[1][owner] - stay, self.first[0][owner]), 0)
        return node * whorl + within, np.where(extra, _EXTRA, 0), extra

    def places(self, owner: Integers, node: Integers, within: Floats, extra: Mask) -> tuple[Floats, Floats, Floats]:
        """Fractions (m,) for nodes (m,) of branches (m,): of the branch, of its children, and of those as described."""
        own = node + within
        dense = np.where(extra, self.density[1][owner], np.where(own >= 0, self.density[0][owner], 1.0))
        own = own / np.maximum(dense, 1e-9)
        t = NodeLaw(*(one[owner] for one in self.law)).place_of(own) / self.now[owner]
        high = self.ends[2][owner]
        parts = [(own - low) / np.maximum(high - low, 1e-9) for low in (self.ends[0][owner], self.described[owner])]
        return np.clip(t, 0, 1), np.clip(parts[0], 0, 1), np.clip(parts[1], 0, 1)


def grown_nodes(
    rows: Table,
    branches: Branches,
    sort: int,
    path: int,
    wanted: Floats,
    start: Floats,
    draw: Floats,
    chance: Floats,
    shaped: tuple[Floats, Floats] | None = None,
) -> Grown:
    """Living nodes of branches for children of one sort.

    Parameters
    ----------
    rows : parameter table
    branches : Branches of n
    sort, path : int
        Of children, and where their child indices begin.
    wanted : (n,) float64
        How many nodes there are to be.
    start, draw : (n,) float64
        Bare part of each, and the random numbers between -1 and 1 that it follows.
    chance : (n,) float64
        Random numbers by which the nodes of the full-grown branch are rounded.
    shaped : pair of (n,) float64, optional
        Where the lowest and the topmost are at least, because of crown shapes.
    """
    row, key = branches.row, branches.key
    own = rows["growing"][row, sort]
    on = own[:, NOW] > 0
    now = np.where(on, own[:, NOW], 1.0)
    begin = varied_begin(own[:, BEGIN], own[:, VARIES], draw)
    power = np.where(on, own[:, POWER], 1.0)
    whole = wanted * own[:, WHOLE]
    law = NodeLaw(begin, np.maximum(own[:, END], begin), power, whole, wanted * own[:, BELOW])
    settled = rows["settled"][row]
    rounded = (1 - settled) * whole + settled * np.floor(whole + chance)
    density = np.stack([np.where(whole > 0, rounded / np.maximum(whole, 1e-12), 1.0), own[:, EXTRA]])
    last, described = own[:, UNTIL], law.number_at(start * now)
    if shaped is not None:
        last = np.where(last > start, np.maximum(last, shaped[1]), last)
        start = np.maximum(start, shaped[0])
    ends = np.stack([law.number_at(place * now) for place in (start, own[:, FRESH], last)])
    ends = np.maximum(ends, ends[0])
    whorl = np.maximum(rows["whorl"][rows["next"][row, sort]], 1)

    def passed(place: Floats, begin: int) -> Integers:
        node = np.floor(place)
        first = child_key(key, child_number((node * whorl).astype(np.int64), path + begin))
        return node.astype(np.int64) + (_within(first) < place - node)

    stay = [passed(np.where(place > 0, place * density[0], place), 0) for place in (ends[0], ends[2])]
    first, last = np.stack([stay, [passed(place * density[1], _EXTRA) for place in ends[1:]]], axis=1)
    return Grown(on, first, np.maximum(last - first, 0), now, law, ends, density, described)
