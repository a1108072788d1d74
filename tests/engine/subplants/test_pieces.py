# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces in order along their branches, and the leaves that belong to each part of a branch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.arrays import spread
from tetflora_addon.growth.foliage import leaf_keys, leaf_places, leaf_range
from tetflora_addon.growth.growth import leaf_counts
from tetflora_addon.subplants.pieces import Pieces, along_branches


def names(pieces: Pieces) -> np.ndarray:
    """What tells a piece from all others."""
    branches = pieces.branches
    return np.stack([branches.plant.astype(np.uint64), branches.key, pieces.t0.view(np.uint64)], axis=1)


def test_whole_branches_are_in_order_already() -> None:
    flora = support.small_flora()
    _, pieces = support.grown(flora, support.plants([1, 1, 2]))
    assert along_branches(pieces) is pieces
    first, last = pieces.runs()
    assert (pieces.t0[first] == 0).all()
    assert (pieces.t1[last] == 1).all()
    assert (last - first + 1 == flora.rows["segments"][pieces.branches.row[first]]).all()
    assert pieces.take(np.ones(len(pieces), bool)) is pieces
    assert [len(ends) for ends in Pieces.empty().runs()] == [0, 0]


@given(st.integers(0, 2**31), st.floats(0, 1))
@settings(deadline=None, max_examples=25)
def test_pieces_of_a_branch_come_together_from_base_to_tip(seed: int, share: float) -> None:
    """Whatever is left of them, and wherever they were; none is lost and none is doubled."""
    rng = np.random.default_rng(seed)
    _, pieces = support.grown(support.small_flora(), support.plants([seed, seed]))
    some = pieces.take(rng.random(len(pieces)) < share)
    some = some.take(rng.permutation(len(some))) if seed % 2 else some
    ordered = along_branches(some)
    assert (np.unique(names(ordered), axis=0) == np.unique(names(some), axis=0)).all()
    assert len(ordered) == len(some)
    key, plant = ordered.branches.key, ordered.branches.plant
    same = (key[1:] == key[:-1]) & (plant[1:] == plant[:-1])
    assert (~same).sum() + min(len(some), 1) == len({(int(p), int(k)) for p, k, _ in names(some)})
    assert (ordered.t0[1:] > ordered.t0[:-1])[same].all()


@given(st.integers(0, 2**31), st.lists(st.floats(0, 1), max_size=4))
@settings(deadline=None, max_examples=50)
def test_parts_of_a_branch_share_its_leaves_out(seed: int, cuts: list[float]) -> None:
    """Each part has exactly the leaves whose place is in it, even where a cut goes through the base of a leaf."""
    flora = support.flora()
    which = seed % len(support.SPECIES)
    _, pieces = support.grown(flora, support.plants([seed], which))
    bearing = flora.rows["leaves"][pieces.branches.row].sum(axis=1) > 0
    branches = pieces.take(bearing & (pieces.t0 == 0)).branches.take(np.s_[:200])
    counts = leaf_counts(flora.rows, branches)
    owner, index = spread(counts)
    t = leaf_places(flora.rows, branches, owner, index, counts, leaf_keys(branches, owner, index))
    edges = np.sort([0.0, 1.0, *cuts, *t[:: max(len(t) // 3, 1)]])
    filled = np.zeros(len(branches), np.int64)
    for low_t, high_t in pairwise(edges):
        ends = (np.full(len(branches), e) for e in (low_t, high_t))
        low, high = leaf_range(flora.rows, branches, counts, *ends)
        assert (low == filled).all()
        inside = (t >= low_t) & ((t < high_t) | (high_t == 1))
        assert (np.bincount(owner[inside], minlength=len(branches)) == high - low).all()
        filled = high
    assert (filled == counts).all()
