# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as single kites: over many copies, as much is seen of them from everywhere as of the models."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.leaves.levels import LeafKites, leaf_kites, leaf_planes
from tetflora_addon.leaves.models import LEAF_MODELS, LeafModel, fans, leaf_model, mean_silhouette
from tetflora_addon.species.catalog import load_species

#: Faces of a cube, all outward.
_CUBE = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def area_vectors(kites: LeafKites) -> np.ndarray:
    """Normals times areas (k, 2, 3) of the halves of kites on both sides of their fold."""
    a, b, c, d = kites.positions.transpose(1, 0, 2)
    return np.stack([np.cross(b - a, c - a), np.cross(c - a, d - a)], axis=1) / 2


def seen(vectors: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Projected area (200,) of faces with area vectors (f, 3) and weights (f,) for random directions."""
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.abs(directions @ vectors.T) @ weight


def centroid(model: LeafModel) -> np.ndarray:
    """Of the area of all faces, (3,)."""
    face, corners = fans(model)
    vectors = np.cross(corners[1] - corners[0], corners[2] - corners[0]) / 2
    area = np.einsum(
        "ci,ci->c", vectors, model.face_vectors[face] / np.linalg.norm(model.face_vectors[face], axis=1)[:, None]
    )
    return area @ corners.mean(axis=0) / area.sum()


def check(model: LeafModel, spread: float) -> None:
    kites = leaf_kites(model)
    vectors, share = area_vectors(kites), np.diff(kites.share, prepend=0.0)
    assert kites.share[-1] == 1.0
    drawn = np.linalg.norm(vectors, axis=2).sum(axis=1)
    np.testing.assert_allclose(drawn, model.area, rtol=0.03 if model.polygons == 1 else 5e-3)  # not flat
    faces = model.face_vectors if model.polygons > 1 else area_vectors(LeafKites(model.positions[None], None, None))[0]
    whole = seen(faces, np.ones(len(faces)))
    ours = seen(vectors.reshape(-1, 3), np.repeat(share, 2))
    np.testing.assert_allclose(ours.mean(), whole.mean(), rtol=0.02)
    assert np.abs(ours - whole).max() <= spread * whole.mean()
    # Bounds of plants leave room for leaves about their bases.
    assert np.linalg.norm(kites.positions, axis=2).max() <= (1.0 + 1e-3) * model.reach
    assert (kites.uv >= model.uv.min(axis=0)).all()
    assert (kites.uv <= model.uv.max(axis=0)).all()


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_kites_show_what_the_model_shows(name: str) -> None:
    check(LEAF_MODELS[name], 0.05)


@pytest.mark.parametrize("name", ["spruce", "silver_fir", "larch", "scots_pine"])
def test_planes_of_shoots_show_what_these_show_where_they_are(name: str) -> None:
    """Each copy as much as its model, from everywhere: in two triangles a plane, where models have up to 25 a face."""
    model = load_species(name).forms("leaf")[0]
    planes = leaf_planes(model)
    assert planes.triangles == 2 * planes.polygons <= 10
    assert planes.area == pytest.approx(model.shown_area, rel=5e-3)
    ours, whole = (seen(one.face_vectors, np.ones(one.polygons)) for one in (planes, model))
    assert np.abs(ours - whole).max() <= 0.05 * whole.mean()
    ours, whole = (centroid(one) for one in (planes, model))
    assert np.linalg.norm(ours - whole) < 0.05 * model.reach
    assert planes.reach <= (1.0 + 1e-3) * model.reach


@given(st.floats(0.05, 0.6), st.floats(-0.5, 0.5), st.floats(-0.4, 0.4))
def test_of_any_folded_leaf(half: float, fold: float, droop: float) -> None:
    """Two planes: folded once if they are about alike, or each in proportion to its area."""
    points = [[0, 0, 0], [0, 1, -droop], [half, 0.4, fold], [-0.7 * half, 0.5, fold]]
    check(leaf_model(points, [[0, 2, 1], [0, 1, 3]]), 0.2)


def test_half_of_a_fruit_is_seen() -> None:
    """A closed convex body shows a quarter of its surface on average, a sheet half of its area (Cauchy, 1841)."""
    cube = leaf_model([[x, y, z] for x in (-0.5, 0.5) for y in (0.0, 1.0) for z in (-0.5, 0.5)], _CUBE)
    assert mean_silhouette(cube) == pytest.approx(cube.area / 4, rel=0.03)
    areas = np.linalg.norm(area_vectors(leaf_kites(cube)), axis=2).sum(axis=1)
    np.testing.assert_allclose(areas, cube.shown_area)
    assert LEAF_MODELS["ovate"].shown_area == LEAF_MODELS["ovate"].area


def test_scales_of_a_cone_hide_each_other() -> None:
    """Kites of cones, a few pixels long, cover what the cones cover: three times as much with all faces counted."""
    (cone,) = support.compiled(support.shipped("spruce")).forms[0][1]
    assert mean_silhouette(cone) < 0.2 * cone.area
    areas = np.linalg.norm(area_vectors(leaf_kites(cone)), axis=2).sum(axis=1)
    np.testing.assert_allclose(areas, 2.0 * mean_silhouette(cone))


def test_materials_are_taken_by_area() -> None:
    model = replace(LEAF_MODELS["ovate"], material_index=np.array([3, 1], np.int32))
    kites = leaf_kites(model)
    assert sorted(kites.material_index.tolist()) == [1, 3]
    assert leaf_kites(LEAF_MODELS["ovate"]).material_index is None


def test_numbers_choose_by_share() -> None:
    kites = replace(leaf_kites(LEAF_MODELS["ovate"]), share=np.array([0.25, 1.0]))
    assert kites.chosen(np.array([0.0, 0.2, 0.25, 0.9, 1.0])).tolist() == [0, 0, 1, 1, 1]


@given(st.floats(0.1, 0.9), st.floats(0.05, 0.3))
def test_a_kite_stays_what_it_is(widest: float, half: float) -> None:
    kite = leaf_model([[0, 0, 0], [half, widest, 0], [0, 1, 0], [-half, widest, 0]], [[0, 1, 2, 3]])
    made = leaf_kites(kite).positions[0]
    off = np.linalg.norm(made[:, None] - kite.positions[None], axis=2).min(axis=0)
    np.testing.assert_allclose(off, 0.0, atol=0.01)


@pytest.mark.parametrize("name", ["kite", "ovate", "maple", "lanceolate"])
def test_of_flat_leaves_the_centroid_is_kept(name: str) -> None:
    model = LEAF_MODELS[name]
    kites = leaf_kites(model)
    points = model.positions[model.corner_verts]
    center, area = np.zeros(3), 0.0
    for face in range(model.polygons):
        a, *rest = points[model.face_offsets[face] : model.face_offsets[face + 1]]
        for b, c in pairwise(rest):
            part = np.linalg.norm(np.cross(b - a, c - a)) / 2
            center, area = center + part * (a + b + c) / 3, area + part
    share = np.diff(kites.share, prepend=0.0)
    mean = sum(weight * kite_center(corners) for weight, corners in zip(share, kites.positions, strict=True))
    np.testing.assert_allclose(mean, center / area, atol=0.03 * model.reach)


def kite_center(corners: np.ndarray) -> np.ndarray:
    a, b, c, d = corners
    return ((a + b + c) + (a + c + d)) / 6  # halves are equal
