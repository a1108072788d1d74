# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as single triangles: over many copies, as much is seen of them from everywhere as of the models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.leaves.models import LEAF_MODELS, LeafModel, leaf_model
from tetflora_addon.leaves.triangles import LeafTriangles, leaf_triangles

#: Faces of a cube, all outward.
_CUBE = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def area_vectors(triangles: LeafTriangles) -> np.ndarray:
    """Normals times areas (k, 3)."""
    a, b, c = triangles.positions.transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def seen(vectors: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Projected area (200,) of faces with area vectors (f, 3) and weights (f,) for random directions."""
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.abs(directions @ vectors.T) @ weight


def check(model: LeafModel, spread: float) -> None:
    triangles = leaf_triangles(model)
    vectors, share = area_vectors(triangles), np.diff(triangles.share, prepend=0.0)
    assert triangles.share[-1] == 1.0
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), model.area, rtol=1e-6)
    whole, ours = seen(model.face_vectors, np.ones(model.polygons)), seen(vectors, share)
    np.testing.assert_allclose(ours.mean(), whole.mean(), rtol=0.02)
    assert np.abs(ours - whole).max() <= spread * whole.mean()
    # Bounds of plants leave room for leaves about their bases.
    assert np.linalg.norm(triangles.positions, axis=2).max() <= (1.0 + 1e-3) * model.reach
    assert (triangles.uv >= model.uv.min(axis=0)).all()
    assert (triangles.uv <= model.uv.max(axis=0)).all()


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_triangles_show_what_the_model_shows(name: str) -> None:
    check(LEAF_MODELS[name], 0.05)


@given(st.floats(0.05, 0.6), st.floats(-0.5, 0.5), st.floats(-0.4, 0.4))
def test_of_any_folded_leaf(half: float, fold: float, droop: float) -> None:
    """Two planes, in proportion to their areas: exact from everywhere, but where they are nearly one."""
    points = [[0, 0, 0], [0, 1, -droop], [half, 0.4, fold], [-0.7 * half, 0.5, fold]]
    check(leaf_model(points, [[0, 2, 1], [0, 1, 3]]), 0.06)


def test_half_of_a_fruit_is_seen() -> None:
    cube = leaf_model([[x, y, z] for x in (-0.5, 0.5) for y in (0.0, 1.0) for z in (-0.5, 0.5)], _CUBE)
    assert cube.closed
    assert not LEAF_MODELS["ovate"].closed
    np.testing.assert_allclose(np.linalg.norm(area_vectors(leaf_triangles(cube)), axis=1), cube.area / 2)


def test_materials_are_taken_by_area() -> None:
    model = replace(LEAF_MODELS["ovate"], material_index=np.array([3, 1], np.int32))
    triangles = leaf_triangles(model)
    assert sorted(triangles.material_index.tolist()) == [1, 3]
    assert leaf_triangles(LEAF_MODELS["ovate"]).material_index is None


def test_numbers_choose_by_share() -> None:
    triangles = replace(leaf_triangles(LEAF_MODELS["ovate"]), share=np.array([0.25, 1.0]))
    assert triangles.chosen(np.array([0.0, 0.2, 0.25, 0.9, 1.0])).tolist() == [0, 0, 1, 1, 1]
