# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights of facets of clusters: a single sheet needs all of its area, a dense crown less the fewer facets it has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine.assets import trees
from tetflora_addon.assets import compiled


def test_a_single_sheet_needs_all_of_its_area() -> None:
    assert trees.compiled("card").clusters.weights[0, 0] > 0.9
    far = trees.source_of(trees.leaves(1, 40, size=0.02, radius=6.0))
    assert trees.compile_asset(far).clusters.weights[0] == pytest.approx(1.0, abs=0.1)


def test_facets_of_a_dense_crown_need_less_the_fewer_they_are() -> None:
    dense = trees.compile_asset(trees.source_of(trees.leaves(1, 1500, size=0.15, radius=0.45))).clusters.weights[0]
    assert dense[0] < 0.6
    assert dense[-1] > 0.85
    assert (np.diff(dense) > -0.05).all()
    sparse = trees.compile_asset(trees.source_of(trees.leaves(1, 1500, size=0.02, radius=1.0))).clusters.weights[0]
    assert (sparse >= dense - 0.02).all() and sparse[0] > dense[0] + 0.2


def test_holes_count_as_such() -> None:
    """Leaves of half the coverage let through half the light: as facets of half the area, they hide each other less."""
    full = trees.leaves(1, 1000, size=0.15, radius=0.4)
    thin = replace(full, coverage=np.full(full.faces, 0.25, np.float16))
    whole, some = (trees.compile_asset(trees.source_of(s)).clusters.weights[0, 0] for s in (full, thin))
    assert some > whole + 0.1


def test_leaves_that_lie_in_a_heap_take_no_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Facets as large as all of them would meet millions of rays."""
    most, met = [], compiled._View.met

    def counted(view: compiled._View, corners: np.ndarray) -> tuple:
        found = met(view, corners)
        most.append(len(found[0]) / len(corners))
        return found

    monkeypatch.setattr(compiled._View, "met", counted)
    matrices = np.tile(np.eye(4), (60, 1, 1))
    heap = trees.source_of(trees.leaves(1, 1), shown=np.zeros(60), matrices=matrices)
    weights = trees.compile_asset(heap).clusters.weights[0]
    assert max(most) <= 2 * compiled.RAYS**2
    assert weights[0] == pytest.approx(0.1)
