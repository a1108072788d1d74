# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of terminal nodes while a tree is divided: taken out, handed on, put back."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

from tests.engine.refinement.test_polygons import SEEDS, divided, placed, thicket
from tetflora_addon.refinement.contents import InCells, PolygonsByCell
from tetflora_addon.refinement.polygons import Polygons


@given(SEEDS)
@settings(deadline=None, max_examples=10)
def test_holdings_give_and_take(seed: int) -> None:
    """Whatever is taken out and put back, in whatever order, everything is there once, with its own totals."""
    tree, held = divided(Polygons.everything(placed(thicket(1), 1)), 1, 0.0)
    rng = np.random.default_rng(seed)
    cell_polygons = PolygonsByCell(held)
    for _ in range(5):
        chosen = rng.random(len(tree)) < rng.choice([0.05, 0.5, 0.95])
        out = cell_polygons.take_within(chosen)
        assert len(out) + len(cell_polygons) == len(held)
        assert chosen[out.cell].all()
        for totals, cell in cell_polygons.totals(np.ones(len(tree), bool)):
            assert len(totals) == len(cell)
            assert not chosen[cell].any()
        assert not chosen[cell_polygons.polygons.cell].any()
        cell_polygons.append(out)

    def rows(some: InCells) -> np.ndarray:
        columns = (some.items.instance, some.items.face, some.cell, some.totals.area, some.totals.width)
        table = np.stack(columns, axis=1)
        return table[np.lexsort(table.T)]

    np.testing.assert_array_equal(rows(cell_polygons.polygons), rows(held))


def test_holdings_of_nothing() -> None:
    cell_polygons = PolygonsByCell(InCells.none(Polygons))
    assert len(cell_polygons) == 0
    assert len(cell_polygons.take_within(np.ones(3, bool))) == 0
    assert len(cell_polygons.polygons) == 0
