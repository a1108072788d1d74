# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Totals of sub-plants, branches and polygons, their sums by tetrahedron, and the box around all that there is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.refinement.contents import (
    PlantParts,
    Totals,
    as_pieces,
    bounding_box,
    piece_leaves,
    piece_totals,
    subplant_totals,
    sums,
)
from tetflora_addon.subplants.pieces import expand, wood_areas


def test_totals_of_a_piece_add_up_to_its_branch() -> None:
    flora = support.small_flora()
    trunk, pieces = support.grown(flora, support.plants([1]))
    own = piece_totals(flora, pieces)
    branches = pieces.t0 == 0
    size, spread = flora.rows["leaf_size"][pieces.branches.row].T
    leaves = flora.rows["leaves"][pieces.branches.row, 0]
    expected = leaves * (size**2 + spread**2 / 3) * flora.leaf.area[0] * pieces.branches.scale**2
    assert own.leaf_area.sum() == pytest.approx(expected[branches].sum())
    assert own.wood_area.sum() == pytest.approx(wood_areas(flora, pieces).sum())
    assert (own.wood_area > 0).all()
    assert subplant_totals(flora, trunk).leaf_area[0] == pytest.approx(flora.area_nodes[0, 0])


def test_totals_of_a_branch_alone_are_those_of_its_pieces() -> None:
    """Of everything a branch may be: flared, drawn with pipes, with leaves that are larger outside."""
    flora = support.compiled(support.RICH)
    trunk, pieces = support.grown(flora, support.plants([1, 2]))
    whole = [some.branches for some in expand(flora, trunk)]
    alone = [PlantParts.of_branches(flora, branches).totals for branches in whole]
    for name in ("leaf_area", "wood_area"):
        one, other = sum(getattr(t, name).sum() for t in alone), getattr(piece_totals(flora, pieces), name).sum()
        assert one == pytest.approx(other, rel=1e-9)
    pieces = as_pieces(Branches.concatenate(whole))
    row, number = pieces.branches.row, piece_leaves(flora, pieces)[0]
    expected = number * flora.leaf.polygons[row] + flora.rows["sides"][row]
    assert piece_totals(flora, pieces).polygons == pytest.approx(expected)
    assert (number * (flora.leaf.polygons[row] - 1.0) > 1.0).any()
    ends = as_pieces(whole[0])
    np.testing.assert_allclose(np.linalg.norm(ends.end - ends.start, axis=1), whole[0].length)


@given(st.lists(st.tuples(st.integers(0, 3), st.floats(0, 9), st.floats(0, 9), st.floats(0.01, 5)), max_size=30))
def test_sums_by_tetrahedron(things: list[tuple]) -> None:
    """Sums, and means of widths by area; where only things of infinite width are, the width is infinite."""
    cells, leaf, wood, width = (np.array([t[i] for t in things], float) for i in range(4))
    endless = width > 4
    totals = Totals(leaf, wood, np.ones(len(things)), np.where(endless, np.inf, width))
    found = sums(totals, cells.astype(int), 4)
    for cell in range(4):
        own = cells == cell
        assert found.leaf_area[cell] == pytest.approx(leaf[own].sum())
        assert found.wood_area[cell] == pytest.approx(wood[own].sum())
        assert found.polygons[cell] == own.sum()
        fine = own & ~endless & (totals.area > 0)
        if fine.any() and totals.area[fine].sum() > 1e-9:
            assert found.width[cell] == pytest.approx(np.average(width[fine], weights=totals.area[fine]))
        elif not (own & ~endless).any():
            assert found.width[cell] == (np.inf if own.any() else 0)


def test_bounding_box_holds_all_bounds() -> None:
    flora = support.lean()
    seeds = support.plants(np.arange(6), np.arange(6) % len(support.SPECIES), np.arange(18.0).reshape(6, 3))
    trunk, pieces = support.grown(flora, seeds)
    low, high = bounding_box(flora, trunk)
    for tubes_and_leaves in support.meshes(flora, pieces):
        for mesh in tubes_and_leaves:
            assert (mesh.positions >= low - 1e-5).all()
            assert (mesh.positions <= high + 1e-5).all()
