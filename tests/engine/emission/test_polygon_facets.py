# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets in place of explicit polygons: their own matter, whatever else is held, and of the same area on average."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine.refinement.test_polygons import SEEDS, grove, placed, thicket
from tetflora_addon.emission.polygons import chosen_facets
from tetflora_addon.refinement.polygons import Polygons


@given(SEEDS, st.sampled_from([0.1, 0.3, 1.0]))
@settings(deadline=None, max_examples=12)
def test_facets_do_not_depend_on_what_else_is_held(seed: int, side: float) -> None:
    """Without one of many polygons, in any order, all others have the facets that they had; all lie on their faces."""
    polygons = Polygons.everything(placed(thicket(seed, 30), seed))
    rng = np.random.default_rng(seed)
    optical, sides = polygons.areas(), np.full(len(polygons), side)

    def facets_of(some: np.ndarray) -> set[tuple]:
        made = chosen_facets(polygons.take(some), optical[some], sides[some])
        return set(map(tuple, np.concatenate([made.center, made.along], axis=1).round(9)))

    every, gone = rng.permutation(len(polygons)), rng.integers(len(polygons))
    whole, rest, alone = facets_of(every), facets_of(np.delete(np.arange(len(polygons)), gone)), facets_of([gone])
    assert rest | alone == whole
    number = optical.sum() / side**2
    assert len(whole) == pytest.approx(number, abs=1 + 5 * np.sqrt(number))


def test_facets_have_the_area_of_their_polygons_on_average() -> None:
    """In any one instance to within chance, which is less than if every triangle drew lots by itself."""
    meshes, _ = grove(200)
    polygons = Polygons.everything(meshes)
    area, side = polygons.areas(), 0.3
    wanted = np.bincount(polygons.instance, area) / side**2

    def number(instance: int) -> int:
        own = polygons.instance == instance
        return len(chosen_facets(polygons.take(own), area[own], np.full(own.sum(), side)).side)

    error = np.array([number(i) for i in range(len(wanted))]) - wanted
    assert abs(error.mean()) < 4 * error.std() / np.sqrt(len(error))
    assert error.std() < 0.8 * np.sqrt(wanted.mean())
