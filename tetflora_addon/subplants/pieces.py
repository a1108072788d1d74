# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of branches, and opening sub-plants into their branches, one order at a time or all the way (paper, 6.5).

Pieces are straight parts of an axis with the leaves on them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Arrays, Floats, Integers, Keys, Table, column, gathered, nested
from ..compiled.averages import own_leaf_integrals, tube_perimeter
from ..compiled.flora import Flora
from ..growth import axes, foliage, growth, seeds

#: What of leaves or facets is worth making, before it is made. Given keys (m,), middles (m, 3) and radii (m,), meters:
#: which (k,) are made, and how many times as large the area (k,) of each is.
Thin = Callable[[Keys, Floats, Floats], tuple[Integers, Floats]]


@dataclass(frozen=True)
class Pieces(Arrays):
    """Parts of branches, each within one straight segment."""

    #: of n: the whole branch that each piece is part of; enough to make its wood and leaves.
    branches: seeds.Branches = nested(seeds.Branches)
    #: t0 and t1, (n,): the part's ends as fractions of the branch's axis.
    t0: Floats
    t1: Floats
    #: start and end, (n, 3): the same ends in space, meters.
    start: Floats = column(3)
    end: Floats = column(3)


def whole_pieces(rows: Table, whole: growth.WholeBranches) -> tuple[Pieces, Integers]:
    """All segments (m,) of whole branches as pieces, and the branch (m,) of each."""
    owner, t, position = whole.knots(rows)
    low = np.flatnonzero(owner[1:] == owner[:-1])
    ends = gathered(position, low), gathered(position, low + 1)
    owner = np.take(owner, low)
    return Pieces(whole.branches.take(owner), t[low], t[low + 1], *ends), owner


def leaf_fraction(flora: Flora, pieces: Pieces) -> Floats:
    """Expected fraction (n,) of a branch's own leaves that sit on each piece."""
    start = foliage.leaf_start(flora.rows, pieces.branches)
    return np.clip(np.maximum(pieces.t1, start) - np.maximum(pieces.t0, start), 0, None) / (1 - start)


def outward_ends(flora: Flora, pieces: Pieces) -> tuple[Floats, Floats]:
    """Places between inside and outside of the crown of the first and the last leaf that each piece (n,) may bear."""
    rows, branches = flora.rows, pieces.branches
    start = foliage.leaf_start(rows, branches)
    every = np.arange(len(pieces))
    return tuple(foliage.outwardness(rows, branches, every, np.maximum(t, start)) for t in (pieces.t0, pieces.t1))


def piece_leaf_integrals(flora: Flora, pieces: Pieces) -> tuple[Floats, Floats, Floats]:
    """`own_leaf_integrals` (n,) of the leaves that branches themselves bear on pieces."""
    rows, row = flora.rows, pieces.branches.row
    along = None
    if flora.has_young:
        start, (first, last) = foliage.leaf_start(rows, pieces.branches), rows["part"][row].T
        along = tuple(first + (last - first) * np.maximum(t, start) for t in (pieces.t0, pieces.t1))
    sizes = rows["leaf_size_tip"][row], rows["leaf_size_young"][row]
    return own_leaf_integrals(*sizes, outward_ends(flora, pieces), along)


def piece_leaf_colors(flora: Flora, pieces: Pieces) -> Floats:
    """Mean linear RGB (n, 3) of the leaves that branches themselves bear on pieces, weighted by area."""
    row, rows = pieces.branches.row, flora.rows
    inside = color = rows["leaf_color"][row, 0]
    if rows["gradient"].any():
        area, area_outward, area_young = piece_leaf_integrals(flora, pieces)
        older = inside + (rows["leaf_color_tip"][row] - inside) * (area_outward / area)[:, None]
        color = older + (rows["leaf_color_young"][row] - inside) * (area_young / area)[:, None]
    return color if flora.day is None else flora.day.own_colors(pieces.branches, rows["leaf_kind"][row], color)


def wood_areas(flora: Flora, pieces: Pieces) -> Floats:
    """Surface (n,) of the wood of each piece, m²: perimeter × length at the mean radius."""
    branches = pieces.branches
    low, high = (axes.profile(flora.rows, branches.row, branches.key, t, summed=True) for t in (pieces.t0, pieces.t1))
    return tube_perimeter(flora.rows["sides"][branches.row]) * branches.radius * branches.length * (high - low)


def open_subplants(flora: Flora, subplants: seeds.Branches) -> tuple[seeds.Branches, Integers, Pieces, Integers]:
    """Open sub-plants into the sub-plants of the next order and the pieces of their own branch.

    Returns
    -------
    Branches, (m,) int64, Pieces, (k,) int64
        Children with the index of the sub-plant that each comes from, and pieces with theirs.
    """
    whole, body, grown, owner = growth.open_branches(flora.rows, subplants)
    pieces, piece_owner = whole_pieces(flora.rows, whole)
    return grown, body[owner], pieces, body[piece_owner]


def expand(flora: Flora, subplants: seeds.Branches) -> Iterator[growth.WholeBranches]:
    """All branches of sub-plants, to the last twig, order by order.

    Notes
    -----
    Memory grows with the number of branches; split the sub-plants with `chunks` where there are many.
    """
    while len(subplants):
        whole, _, subplants, _ = growth.open_branches(flora.rows, subplants)
        yield whole
