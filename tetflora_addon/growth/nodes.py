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

from ..species.growing import node_at, place_at
from .branches import Branches
from .grown_rows import BEGIN, BELOW, END, NOW, POWER, UNTIL, WHOLE
from .hashing import Draw, child_key, signed

_NEGATIVE = 1 << 28  # numbers of nodes below the first are counted back from here: none meets another sort's


def child_number(index: NDArray[np.integer], path: int) -> NDArray[np.int64]:
    """Child indices (n,), for `hashing.child_key`, of children (n,) of a sort; negative ones have some of their own."""
    return np.where(index < 0, index + _NEGATIVE, index) + path if (index < 0).any() else index + path


def within_node(key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Where in their node the children of keys (n,) sit, 0 to 1."""
    return 0.5 + 0.5 * signed(key, Draw.PLACE)


@dataclass(frozen=True)
class Grown:
    """Living nodes of branches (n,).

    Attributes
    ----------
    on : (n,) bool
        Whether they are still growing; if not, the rest has no meaning.
    first, number : (n,) int64
        Number of the lowest node, and how many there are.
    now : (n,) float64
        Length over that when full-grown.
    law : tuple of (n,) float64
        See `species.growing.node_at`.
    ends : (2, n) float64
        First and last place in nodes.
    up : (n,) float64
        Nodes above the begin over those of the law.
    """

    on: NDArray[np.bool_]
    first: NDArray[np.int64]
    number: NDArray[np.int64]
    now: NDArray[np.float64]
    law: tuple[NDArray[np.float64], ...]
    ends: NDArray[np.float64]
    up: NDArray[np.float64]

    def places(
        self, owner: NDArray[np.integer], node: NDArray[np.integer], within: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Fractions of the branch, and of its children (m,), (m,) for nodes (m,) of branches (m,)."""
        own = node + within
        own = np.where(own >= 0, own / np.maximum(self.up[owner], 1e-9), own)
        t = place_at(own, *(one[owner] for one in self.law)) / self.now[owner]
        low, high = self.ends[:, owner]
        return np.clip(t, 0, 1), np.clip((own - low) / np.maximum(high - low, 1e-9), 0, 1)


def grown_nodes(
    rows: NDArray[np.void],
    branches: Branches,
    sort: int,
    path: int,
    wanted: NDArray[np.float64],
    start: NDArray[np.float64],
    chance: NDArray[np.float64],
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
    start : (n,) float64
        Bare part of each.
    chance : (n,) float64
        Random numbers by which the nodes of the full-grown branch are rounded.
    """
    row, key = branches.row, branches.key
    own = rows["growing"][row, sort]
    on = own[:, NOW] > 0
    now = np.where(on, own[:, NOW], 1.0)
    mean = rows["start"][row, sort, 0]
    begin = own[:, BEGIN]
    begin = np.minimum(begin * np.where(mean > 0, start / np.maximum(mean, 1e-12), 1.0), np.maximum(begin, 0.999))
    power = np.where(on, own[:, POWER], 1.0)
    whole = wanted * own[:, WHOLE]
    law = begin, np.maximum(own[:, END], begin), power, whole, wanted * own[:, BELOW]
    settled = rows["settled"][row]
    rounded = (1 - settled) * whole + settled * np.floor(whole + chance)
    up = np.where(whole > 0, rounded / np.maximum(whole, 1e-12), 1.0)
    ends = np.stack([node_at(place * now, *law) for place in (start, own[:, UNTIL])])
    ends[1] = np.maximum(ends[0], ends[1])
    counted = np.where(ends > 0, ends * up, ends)
    node = np.floor(counted)
    whorl = np.maximum(rows["whorl"][rows["next"][row, sort]], 1)
    passed = [
        number + (within_node(child_key(key, child_number(number * whorl, path))) < part)
        for number, part in zip(node.astype(np.int64), counted - node, strict=True)
    ]
    return Grown(on, passed[0], np.maximum(passed[1] - passed[0], 0), now, law, ends, up)
