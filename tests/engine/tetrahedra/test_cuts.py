# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes through tetrahedra: nothing is lost or inverted, and neighbours agree about the face that they share."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tetflora_addon.tetrahedra import geometry
from tetflora_addon.tetrahedra.cuts import _CASES, TOLERANCE, _chain, cut_tetrahedra

CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
SEEDS = st.integers(0, 10**9)
#: How far planes pass from the vertices, edges and faces that they are laid through, metres.
NEAR = st.sampled_from([0.0, 1e-9, 0.5e-7, 2e-7, 1e-5, 1e-2])


def positive(rng, n):
    """Tetrahedra of a few metres, within some hundred metres, that are not all but flat."""
    vertices = rng.normal(size=(4 * n, 4, 3)) * 3
    vertices = vertices[geometry.quality(vertices) > 0.05][:n]
    turned = geometry.signed_volume(vertices) < 0
    vertices[turned] = vertices[turned][:, [1, 0, 2, 3]]
    return vertices + rng.uniform(-100, 100, 3)


def planes_through(rng, vertices, near):
    """Planes through the middle, a vertex, an edge, or a face of each tetrahedron, or nearly so."""
    weights = rng.dirichlet([1, 1, 1, 1], (len(vertices), 3))
    fixed = rng.integers(0, 4, len(vertices))
    weights = np.where(np.arange(3)[:, None] < fixed[:, None, None], np.eye(4)[:3], weights)
    planes = geometry.plane_through(weights @ vertices, vertices[:, 3])
    planes *= rng.choice([-1.0, 1.0], len(planes))[:, None]
    planes[:, 3] += near * rng.choice([-1.0, 1.0], len(planes))
    return planes


def crossed(vertices, planes):
    """Vertices on the planes, and edges that they cross."""
    distance = geometry.plane_distance(planes[:, None], vertices)
    side = np.where(np.abs(distance) <= TOLERANCE, 0, np.sign(distance))
    first, second = geometry.EDGES.T
    return (side == 0).sum(axis=1), (side[:, first] * side[:, second] < 0).sum(axis=1)


@given(SEEDS, NEAR)
@settings(deadline=None, max_examples=60)
def test_pieces_are_as_many_as_the_paper_says_positive_and_on_their_side(seed, near):
    rng = np.random.default_rng(seed)
    vertices = positive(rng, 100)
    planes = planes_through(rng, vertices, near)
    pieces = cut_tetrahedra(vertices, planes)
    on, edges = crossed(vertices, planes)
    expected = np.array([1, 2, 3, 4, 6])[edges]
    np.testing.assert_array_equal(np.bincount(pieces.owner, minlength=len(vertices)), expected)
    np.testing.assert_array_equal(on[(edges == 1) | (edges == 2)], 3 - edges[(edges == 1) | (edges == 2)])
    np.testing.assert_array_equal(pieces.divided, edges > 0)
    volumes = geometry.signed_volume(pieces.vertices)
    assert (volumes > 0).all()
    whole = geometry.signed_volume(vertices)
    np.testing.assert_allclose(np.bincount(pieces.owner, volumes), whole, rtol=1e-12)
    distance = geometry.plane_distance(planes[pieces.owner, None], pieces.vertices)
    outwards = np.where(pieces.side[:, None] == 1, distance, -distance)
    assert (outwards >= -1.01 * TOLERANCE).all()
    assert (outwards.max(axis=1) > TOLERANCE / 1.01).all()


@given(SEEDS, NEAR)
@settings(deadline=None, max_examples=40)
def test_pieces_of_a_side_are_parted_by_their_planes(seed, near):
    rng = np.random.default_rng(seed)
    vertices = positive(rng, 60)
    pieces = cut_tetrahedra(vertices, planes_through(rng, vertices, near))
    chain = 2 * pieces.owner + pieces.side
    assert (np.diff(chain) >= 0).all()
    starts = np.flatnonzero(np.diff(chain, prepend=-1))
    np.testing.assert_array_equal(
        pieces.step, np.arange(len(chain)) - np.repeat(starts, np.bincount(chain)[chain[starts]])
    )
    np.testing.assert_array_equal(pieces.last, np.append(chain[1:] != chain[:-1], True))
    assert (pieces.plane[pieces.last] == 0).all()
    for later in (1, 2):
        one = np.flatnonzero(~pieces.last)
        one = one[one + later < len(chain)]
        one = one[chain[one] == chain[one + later]]
        plane = pieces.plane[one, None]
        assert (geometry.plane_distance(plane, pieces.vertices[one]) <= 1e-10).all()
        # A thin piece has a plane through three points that nearly stand in a line, so rounding turns it.
        thick = geometry.quality(pieces.vertices[one]) > 1e-3
        assert (geometry.plane_distance(plane, pieces.vertices[one + later])[thick] >= -1e-9).all()


def triangles_on(pieces, owner, plane):
    """Triangles of the pieces of one tetrahedron that lie in a plane, as sets of exact points."""
    found = set()
    for vertices in pieces.vertices[pieces.owner == owner]:
        inside = vertices[np.abs(geometry.plane_distance(plane, vertices)) < 1e-10]
        if len(inside) == 3:
            found.add(frozenset(map(tuple, inside + 0.0)))
    return found


@given(SEEDS, NEAR, st.permutations(range(4)), st.permutations(range(4)))
@settings(deadline=None, max_examples=60)
def test_neighbours_divide_their_common_face_alike(seed, near, order, other_order):
    rng = np.random.default_rng(seed)
    one = positive(rng, 1)[0]
    two = one.copy()
    two[3] += 2 * (one[:3].mean(axis=0) - one[3]) + rng.uniform(-0.3, 0.3, 3)
    face = geometry.plane_through(one[:3], one[3])
    pair = np.array([one[list(order)], two[list(other_order)]])
    turned = geometry.signed_volume(pair) < 0
    pair[turned] = pair[turned][:, [1, 0, 2, 3]]
    plane = np.repeat(planes_through(rng, one[None], near), 2, axis=0)
    plane[1] *= rng.choice([-1.0, 1.0])
    # The very plane of the face divides neither; planes all but in it make everything lie on it.
    assume(np.abs(geometry.plane_distance(plane[0], one[:3])).max() >= 1e-4)
    pieces = cut_tetrahedra(pair, plane)
    shared = triangles_on(pieces, 0, face)
    assert shared == triangles_on(pieces, 1, face)
    area = sum(np.linalg.norm(np.cross(*(np.array(sorted(t))[1:] - sorted(t)[0]))) for t in shared)
    np.testing.assert_allclose(area, np.linalg.norm(np.cross(one[1] - one[0], one[2] - one[0])), rtol=1e-9)


@given(SEEDS)
@settings(deadline=None, max_examples=40)
def test_no_order_of_corners_makes_diagonals_turn_in_a_ring(seed):
    rng = np.random.default_rng(seed)
    for case in _CASES:
        ranks = rng.permuted(np.tile(np.arange(4 + len(case.negative)), (200, 1)), axis=1)
        pattern = np.zeros(200, int)
        for i, quad in enumerate(case.quads):
            pattern |= (np.argmin(ranks[:, quad], axis=1) % 2) << i
        assert case.possible[pattern].all()
    # Rings there are: two of the eight ways to draw three diagonals.
    assert _CASES[2].possible.sum() == 6
    quads = [(0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
    for way in (0, 1):
        assert _chain(tuple(range(6)), {frozenset(q): frozenset(q[way::2]) for q in quads}) is None


@given(SEEDS)
@settings(deadline=None, max_examples=30)
def test_points_lie_in_one_piece_on_their_side(seed):
    rng = np.random.default_rng(seed)
    vertices = positive(rng, 20)
    planes = planes_through(rng, vertices, 1e-2)
    pieces = cut_tetrahedra(vertices, planes)
    weights = rng.dirichlet([1] * 4, (len(vertices), 200))
    points = weights @ vertices
    for owner in range(len(vertices)):
        own = np.flatnonzero(pieces.owner == owner)
        inside = geometry.barycentric(pieces.vertices[own, None], points[owner]).min(axis=2)
        clear = np.abs(inside).min(axis=0) > 1e-7
        assert ((inside > 0).sum(axis=0)[clear] == 1).all()
        side = pieces.side[own[np.argmax(inside, axis=0)]]
        np.testing.assert_array_equal(side[clear], (geometry.plane_distance(planes[owner], points[owner]) >= 0)[clear])


def test_free_diagonal_is_chosen_by_shape():
    rng = np.random.default_rng(5)
    vertices = positive(rng, 2000)
    middles = (vertices[:, [0, 0, 1]] + vertices[:, [2, 3, 2]]) / 2
    planes = geometry.plane_through(middles + rng.normal(size=(len(vertices), 3, 3)) * 0.2, vertices[:, 0])
    chosen = cut_tetrahedra(vertices, planes)
    case = _CASES[3]
    assert case.free
    case.free = False
    try:
        canonical = cut_tetrahedra(vertices, planes)
    finally:
        case.free = True
    np.testing.assert_array_equal(chosen.owner, canonical.owner)
    worst = [np.full(len(vertices), np.inf), np.full(len(vertices), np.inf)]
    for least, pieces in zip(worst, (chosen, canonical), strict=True):
        np.minimum.at(least, pieces.owner, geometry.quality(pieces.vertices))
    assert (worst[0] >= worst[1]).all()
    assert (worst[0] > worst[1]).sum() > 100


def test_known_cuts():
    # Through the middles of the edges from vertex 0: a corner of an eighth, and a prism.
    pieces = cut_tetrahedra(CORNER[None], np.array([[1, 1, 1, -0.5]]) / 3**0.5)
    assert pieces.side.tolist() == [0, 1, 1, 1]
    assert np.isclose(geometry.volume(pieces.vertices[0]), 1 / 48)
    beside = cut_tetrahedra(np.stack([CORNER, CORNER]), np.array([[1.0, 0, 0, 1], [1.0, 0, 0, -1 - 1e-9]]))
    assert beside.side.tolist() == [1, 0] and not beside.divided.any()
    np.testing.assert_array_equal(beside.vertices, [CORNER, CORNER])


def test_nothing_to_cut_and_shapes_that_do_not_fit():
    nothing = cut_tetrahedra(np.zeros((0, 4, 3)), np.zeros((0, 4)))
    assert nothing.vertices.shape == (0, 4, 3) and nothing.owner.shape == (0,)
    with pytest.raises(ValueError, match="must have shapes"):
        cut_tetrahedra(CORNER[None], np.zeros((2, 4)))
