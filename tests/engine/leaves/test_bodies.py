# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Berries become round and keep their area; stalks, points and what the artist made stay as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tetflora_addon.leaves.levels import coarse_error, leaf_levels, level_errors
from tetflora_addon.leaves.models import LeafModel, closed_parts, leaf_model, rounded
from tetflora_addon.species import catalog

CORNERS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
SIDES = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]


def berries() -> LeafModel:
    """Two octahedra, one of which hangs at a triangle."""
    points = np.concatenate(
        [0.1 * CORNERS + [0.0, 0.8, 0.0], 0.05 * CORNERS + [0.3, 0.5, 0.0], [[0, 0, 0], [0, 0, 0.02]]]
    )
    return leaf_model(points, [*SIDES, *(np.array(SIDES) + 6).tolist(), [12, 13, 3]])


def test_parts_are_closed_where_each_edge_has_two_faces() -> None:
    part = closed_parts(berries())
    assert (part[:8] == 0).all() and (part[8:16] == 8).all() and part[16] == -1


@pytest.mark.parametrize("times", [1, 2, 4])
def test_berries_become_balls_of_the_same_area(times: int) -> None:
    model = berries()
    made, error = rounded(model, times)
    assert made.polygons == 16 * 4**times + 1
    areas, before = (np.linalg.norm(m.face_vectors, axis=1) for m in (made, model))
    half = 8 * 4**times
    own = closed_parts(made)
    for part, expected in ((0, before[:8].sum()), (own[own > 0].min(), before[8:16].sum())):
        assert areas[own == part].sum() == pytest.approx(expected, rel=1e-9)
    ball = np.unique(made.corner_verts[: 3 * 2 * half].reshape(-1, 3)[own[: 2 * half] == 0])
    radii = np.linalg.norm(made.positions[ball] - [0.0, 0.8, 0.0], axis=1)
    assert np.ptp(radii) < 0.08 * radii.mean()
    assert error < 0.1 * 0.3**times
    # The triangle hangs on.
    np.testing.assert_array_equal(made.positions[made.corner_verts[-3:-1]], model.positions[12:14])


def test_points_stay() -> None:
    """The tip of a spine is as sharp as before; what is blunt is round."""
    spine = leaf_model(CORNERS * [0.05, 1.0, 0.05] + [0.0, 1.0, 0.0], SIDES)
    made, _ = rounded(spine, 3)
    assert made.positions[:, 1].max() == pytest.approx(2.0, rel=1e-3)
    assert made.positions[:, 0].max() < 0.06


def test_levels_of_fruit_are_finer_and_finer() -> None:
    fruit = catalog.load_species("rowan").blossom[0]
    assert (np.diff(level_errors(fruit)) < 0).all() and len(leaf_levels(fruit)) >= 2
    for level in leaf_levels(fruit):
        assert level.model.area == pytest.approx(fruit.area, rel=0.01)
        assert np.linalg.norm(level.shapes, axis=2).max() <= fruit.reach * (1 + 1e-6)
        assert np.bincount(level.model.edges[1]).max() <= 2


def test_what_is_open_or_the_artists_own_stays() -> None:
    flat = leaf_model([[0, 0, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2]])
    for model in (flat, replace(berries(), textured=True)):
        assert leaf_levels(model) == () and coarse_error(model) == 0.0
