# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which children a branch has that is not full-grown: those whose place it has reached and that are not dead yet.

Each has its number and place for life. Which numbers those are depends on the places alone, so that nothing appears
but at the very top and nothing goes but at the very base; how many there are is exact on average.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..species.growing import NodeLaw
from .branches import Branches
from .grown_rows import BEGIN, BELOW, END, EXTRA, FRESH, NOW, POWER, UNTIL, VARIES, WHOLE, varied_begin
from .hashing import Draw, child_key, signed

#: Where numbers of nodes that live for a while begin, and those below the first are counted back from: no child
#: index of one is that of another, nor of another sort.
_EXTRA, _NEGATIVE = 1 << 27, 1 << 28


def child_number(index: NDArray[np.integer], path: int) -> NDArray[np.int64]:
    """Child indices (n,), for `hashing.child_key`, of children (n,) of a sort; negative ones have some of their own."""
    return np.where(index < 0, index + _NEGATIVE, index) + path if (index < 0).any() else index + path


def _within(key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Where in their node the children of keys (n,) sit, 0 to 1."""
    return 0.5 + 0.5 * signed(key, Draw.PLACE)


@dataclass(frozen=True)
class Grown:
    """Living nodes of branches (n,).

    Attributes
    ----------
    on : (n,) bool
        Whether they are still growing; if not, the rest has no meaning.
    first, number : (2, n) int64
        Number of the lowest node, and how many there are: of those that stay, and those that live for a while.
    now : (n,) float64
        Length over that when full-grown.
    law : NodeLaw of (n,) float64
    ends : (3, n) float64
        Where nodes begin, where those begin that live for a while, and where all end, in nodes.
    density : (2, n) float64
        Nodes above the begin, and nodes that live for a while, over those of the law.
    described : (n,) float64
        Where nodes would begin without the crown forms of plants.
    """

    on: NDArray[np.bool_]
    first: NDArray[np.int64]
    number: NDArray[np.int64]
    now: NDArray[np.float64]
    law: NodeLaw
    ends: NDArray[np.float64]
    density: NDArray[np.float64]
    described: NDArray[np.float64]

    def chosen(
        self, owner: NDArray[np.integer], index: NDArray[np.integer], whorl: NDArray[np.integer]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Index that is theirs for life, where child numbers begin, and which live for a while (m,), of children (m,).

        These are given by branch and index among the living; a node bears as many as a whorl has.
        """
        node, within = index // whorl, index % whorl
        on, stay = self.on[owner], self.number[0][owner]
        extra = on & (node >= stay)
        node = node + np.where(on, np.where(extra, self.first[1][owner] - stay, self.first[0][owner]), 0)
        return node * whorl + within, np.where(extra, _EXTRA, 0), extra

    def places(
        self,
        owner: NDArray[np.integer],
        node: NDArray[np.integer],
        within: NDArray[np.float64],
        extra: NDArray[np.bool_],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Fractions (m,) for nodes (m,) of branches (m,): of the branch, of its children, and of those as described."""
        own = node + within
        dense = np.where(extra, self.density[1][owner], np.where(own >= 0, self.density[0][owner], 1.0))
        own = own / np.maximum(dense, 1e-9)
        t = NodeLaw(*(one[owner] for one in self.law)).place_of(own) / self.now[owner]
        high = self.ends[2][owner]
        parts = [(own - low) / np.maximum(high - low, 1e-9) for low in (self.ends[0][owner], self.described[owner])]
        return np.clip(t, 0, 1), np.clip(parts[0], 0, 1), np.clip(parts[1], 0, 1)


def grown_nodes(
    rows: NDArray[np.void],
    branches: Branches,
    sort: int,
    path: int,
    wanted: NDArray[np.float64],
    start: NDArray[np.float64],
    draw: NDArray[np.float64],
    chance: NDArray[np.float64],
    formed: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
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
    formed : pair of (n,) float64, optional
        Where the lowest and the topmost are at least, because of crown forms.
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
    if formed is not None:
        last = np.where(last > start, np.maximum(last, formed[1]), last)
        start = np.maximum(start, formed[0])
    ends = np.stack([law.number_at(place * now) for place in (start, own[:, FRESH], last)])
    ends = np.maximum(ends, ends[0])
    whorl = np.maximum(rows["whorl"][rows["next"][row, sort]], 1)

    def passed(place: NDArray[np.float64], begin: int) -> NDArray[np.int64]:
        node = np.floor(place)
        first = child_key(key, child_number((node * whorl).astype(np.int64), path + begin))
        return node.astype(np.int64) + (_within(first) < place - node)

    stay = [passed(np.where(place > 0, place * density[0], place), 0) for place in (ends[0], ends[2])]
    first, last = np.stack([stay, [passed(place * density[1], _EXTRA) for place in ends[1:]]], axis=1)
    return Grown(on, first, np.maximum(last - first, 0), now, law, ends, density, described)
