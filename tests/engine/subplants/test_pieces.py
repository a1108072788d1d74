# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of branches, from base to tip, and runs of things of about one size."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.growth.test_drawn import flora as drawn_flora
from tetflora_addon.arrays import chunks
from tetflora_addon.growth.growth import open_branches, trunks
from tetflora_addon.subplants.pieces import leaf_fraction, open_subplants, whole_pieces


@pytest.mark.parametrize("kind", ["rich", "drawn"])
def test_pieces_are_all_of_their_branches(kind: str) -> None:
    """From base to tip, end to end, each with its fraction of the leaves; nothing of a branch is on another."""
    flora = support.compiled(support.RICH) if kind == "rich" else drawn_flora()
    whole, body, grown, parent = open_branches(flora.rows, trunks(flora.rows, support.plants([1, 1, 2])))
    pieces, owner = whole_pieces(flora.rows, whole)
    assert (np.diff(owner) >= 0).all()
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    last = np.append(first[1:], len(owner)) - 1
    assert len(first) == len(whole.branches)
    assert (pieces.t0[first] == 0).all()
    assert (pieces.t1[last] == 1).all()
    inner = np.flatnonzero(owner[1:] == owner[:-1])
    np.testing.assert_array_equal(pieces.t1[inner], pieces.t0[inner + 1])
    np.testing.assert_array_equal(pieces.end[inner], pieces.start[inner + 1])
    assert (pieces.t1 > pieces.t0).all()
    np.testing.assert_array_equal(pieces.branches.key, whole.branches.key[owner])
    np.testing.assert_allclose(np.bincount(owner, leaf_fraction(flora, pieces)), 1.0)
    assert set(body) == {0, 1, 2}
    if len(grown):
        assert (grown.plant == whole.branches.plant[parent]).all()


def test_what_sub_plants_are_opened_into_knows_where_it_comes_from() -> None:
    flora = support.compiled(support.RICH)
    limbs, of_trunk, pieces, of_plant = open_subplants(flora, trunks(flora.rows, support.plants([3, 4])))
    assert (limbs.plant == of_trunk).all()
    assert (pieces.branches.plant == of_plant).all()
    assert set(of_trunk) == set(of_plant) == {0, 1}


@given(st.lists(st.floats(0, 50), max_size=40), st.floats(1, 100))
def test_runs_of_about_one_size(sizes: list[float], limit: float) -> None:
    """One after the other, all of them; none holds more than the limit beside its largest."""
    weights = np.array(sizes)
    runs = list(chunks(weights, limit))
    assert [i for run in runs for i in range(run.start, run.stop)] == list(range(len(sizes)))
    for run in runs:
        assert weights[run].sum() <= (limit + weights[run].max()) * (1 + 1e-9)
