# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured on tetrahedra, and their bisection."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.engine.support import contains, face_planes
from tetflora_addon.tetrahedra import geometry
from tetflora_addon.tetrahedra.tree import _bisect, _longest_edge

REGULAR = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])

COORDINATE = st.floats(-100, 100, allow_nan=False, width=32)


@st.composite
def positive(draw):
    """A tetrahedron of positive orientation that is not all but flat."""
    vertices = draw(arrays(np.float64, (4, 3), elements=COORDINATE))
    assume(geometry.quality(vertices) > 1e-3)
    return vertices if geometry.signed_volume(vertices) > 0 else vertices[[1, 0, 2, 3]]


def test_known_tetrahedra():
    assert np.isclose(geometry.signed_volume(CORNER), 1 / 6)
    assert np.isclose(geometry.volume(CORNER[[1, 0, 2, 3]]), 1 / 6)
    assert np.isclose(geometry.quality(REGULAR), 1.0)
    assert geometry.quality(np.zeros((4, 3))) == 0.0
    assert np.isclose(geometry.projected_area(CORNER, np.array([0.0, 0, 1])), 0.5)
    # The regular tetrahedron inscribed in a cube fills one whole face of it, seen along an edge of the cube.
    assert np.isclose(geometry.projected_area(REGULAR, np.array([1.0, 0, 0])), 4.0)


@given(positive())
@settings(deadline=None)
def test_faces_close_and_point_outwards(vertices):
    areas = geometry.face_area_vectors(vertices)
    scale = np.abs(areas).max()
    np.testing.assert_allclose(areas.sum(axis=0), 0, atol=1e-12 * scale)
    planes = face_planes(vertices)
    np.testing.assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1)
    distance = geometry.plane_distance(planes[:, None], vertices[None])
    size = np.abs(vertices).max()
    # Each vertex is on the three faces that meet in it, and behind the one opposite.
    np.testing.assert_allclose(distance[~np.eye(4, dtype=bool)], 0, atol=1e-10 * size)
    assert (np.diag(distance) < 0).all()
    # V = area · height / 3, whichever face is the base.
    heights = -np.diag(distance)
    np.testing.assert_allclose(np.linalg.norm(areas, axis=1) * heights / 3, geometry.volume(vertices), rtol=1e-6)


@given(positive(), arrays(np.float64, 3, elements=COORDINATE))
@settings(deadline=None)
def test_barycentric_coordinates_give_the_point_back(vertices, point):
    weights = geometry.barycentric(vertices, point)
    assert np.isclose(weights.sum(), 1)
    tolerance = 1e-9 * (1 + np.abs(weights).max()) * np.abs(vertices).max()
    np.testing.assert_allclose(weights @ vertices, point, atol=tolerance)
    inside = geometry.plane_distance(face_planes(vertices), point)
    if np.abs(inside).min() > 1e-6:
        assert contains(vertices, point) == (inside < 0).all()


@given(positive())
@settings(deadline=None)
def test_bisection_halves_the_volume(vertices):
    planes, children = _bisect(vertices[None])
    volumes = geometry.signed_volume(children[0])
    np.testing.assert_allclose(volumes, geometry.signed_volume(vertices) / 2, rtol=1e-9)
    distance = geometry.plane_distance(planes[0], children[0])
    size = np.abs(vertices).max()
    assert (distance[0] <= 1e-10 * size).all()
    assert (distance[1] >= -1e-10 * size).all()


@given(positive(), st.permutations(range(4)))
@settings(deadline=None)
def test_bisection_cuts_the_longest_edge_only(vertices, order):
    shuffled = vertices[list(order)]
    squared = geometry.squared_edges(shuffled)
    assert squared[_longest_edge(shuffled[None])[0]] >= squared.max() * (1 - 1e-8)
    _, children = _bisect(shuffled[None])
    kept = [(child[:, None] == shuffled).all(-1).any(1).sum() for child in children[0]]
    assert kept == [3, 3]
    middle = [child[~(child[:, None] == shuffled).all(-1).any(1)][0] for child in children[0]]
    np.testing.assert_array_equal(middle[0], middle[1])


def test_equal_edges_are_told_apart_the_same_way_after_rounding():
    shaken = REGULAR + np.random.default_rng(0).uniform(-1e-13, 1e-13, (200, 4, 3))
    assert (_longest_edge(shaken) == _longest_edge(REGULAR[None])).all()


def test_no_tetrahedra():
    nothing = np.zeros((0, 4, 3))
    planes, children = _bisect(nothing)
    assert planes.shape == (0, 4)
    assert children.shape == (0, 2, 4, 3)
    assert geometry.quality(nothing).shape == (0,)
