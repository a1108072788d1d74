# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The canonical eight: equal volumes, seven planes that part them, and shapes that stay as good as they were."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tetflora_addon.camera.camera import Camera
from tetflora_addon.tetrahedra import geometry
from tetflora_addon.tetrahedra.roots import view_root
from tetflora_addon.tetrahedra.tree import _best_diagonal, _bisect, _bisect_thrice, _divide_by_shape, _divide_in_eight

SEEDS = st.integers(0, 10**9)


def positive(rng, n):
    """Tetrahedra of a few meters that are not all but flat."""
    vertices = rng.normal(size=(4 * n, 4, 3)) * 3
    vertices = vertices[geometry.quality(vertices) > 0.02][:n]
    turned = geometry.signed_volume(vertices) < 0
    vertices[turned] = vertices[turned][:, [1, 0, 2, 3]]
    return vertices + rng.uniform(-50, 50, 3)


def halves(window):
    """The two halves of a view pyramid."""
    left, right, bottom, top = window
    far = [(left, bottom, 1), (right, bottom, 1), (right, top, 1), (left, top, 1)]
    pair = np.array([[(0, 0, 0), far[0], far[1], far[2]], [(0, 0, 0), far[0], far[2], far[3]]]) * 30.0
    return pair if geometry.signed_volume(pair[0]) > 0 else pair[:, [1, 0, 2, 3]]


def shapes(vertices, root):
    """One tetrahedron of each shape and root; those alike differ by no more than a turn and a move."""
    alike = np.round(np.log(geometry.squared_edges(vertices)) * 1e6)
    kept = np.unique(np.column_stack([alike, root]), axis=0, return_index=True)[1]
    return vertices[kept], root[kept]


def divided_best(vertices):
    """Planes and children of the eight along the best diagonals."""
    return _divide_in_eight(vertices, _best_diagonal(vertices))


def squared_diagonals(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths ``(n, 3)`` of the three diagonals of the inner octahedron of tetrahedra ``(n, 4, 3)``, m².

    Diagonal ``k`` joins the middles of edges ``k`` and ``5 - k`` of `geometry.EDGES`: four times its square is the sum
    of the other four edges' squares less the sum of these two.
    """
    squared = geometry.squared_edges(vertices)
    return (np.sum(squared, axis=1, keepdims=True) - 2.0 * (squared[:, :3] + squared[:, :2:-1])) / 4.0


def worst_over_levels(vertices, divide, levels, most=3000):
    """Worst quality (levels + 1, n) of all descendants, which are kept at the size of their ancestors."""
    rng = np.random.default_rng(0)
    root = np.arange(len(vertices))
    worst = [geometry.quality(vertices)]
    for _ in range(levels):
        children = divide(vertices)
        root = np.repeat(root, children.shape[1])
        vertices = children.reshape(-1, 4, 3) * np.cbrt(children.shape[1])
        assert (geometry.signed_volume(vertices) > 0).all()
        worst.append(np.full(len(worst[0]), np.inf))
        np.minimum.at(worst[-1], root, geometry.quality(vertices))
        vertices, root = shapes(vertices, root)
        some = rng.permutation(len(vertices))[:most]
        vertices, root = vertices[some], root[some]
    return np.array(worst)


@given(SEEDS)
@settings(deadline=None, max_examples=40)
def test_eight_of_equal_volume_each_on_its_side(seed):
    rng = np.random.default_rng(seed)
    vertices = positive(rng, 50)
    which = rng.integers(0, 3, len(vertices))
    for planes, children in (
        divided_best(vertices),
        _divide_in_eight(vertices, which),
        _bisect_thrice(vertices),
        _divide_by_shape(vertices),
    ):
        eighth = np.repeat(geometry.signed_volume(vertices)[:, None] / 8, 8, axis=1)
        np.testing.assert_allclose(geometry.signed_volume(children), eighth, rtol=1e-11)
        np.testing.assert_allclose(geometry.signed_volume(children).sum(axis=1), 8 * eighth[:, 0], rtol=1e-12)
        for child in range(8):
            plane = 0
            for level in (2, 1, 0):
                side = (child >> level) & 1
                distance = geometry.plane_distance(planes[:, plane, None], children[:, child])
                assert (distance <= 1e-9).all() if side == 0 else (distance >= -1e-9).all()
                plane = 2 * plane + 1 + side


@given(SEEDS)
@settings(deadline=None, max_examples=20)
def test_corners_are_the_whole_at_half_size_and_the_rest_shares_the_diagonal(seed):
    rng = np.random.default_rng(seed)
    vertices = positive(rng, 30)
    which = rng.integers(0, 3, len(vertices))
    _, children = _divide_in_eight(vertices, which)
    quality = geometry.quality(vertices)[:, None]
    np.testing.assert_allclose(geometry.quality(children[:, ::2]), np.repeat(quality, 4, axis=1), rtol=1e-9)
    squared = squared_diagonals(vertices)[np.arange(len(vertices)), which]
    inner = np.sort(geometry.squared_edges(children[:, 1::2]), axis=-1)
    assert np.isclose(inner, squared[:, None, None], rtol=1e-9).any(axis=-1).all()


@given(SEEDS, st.permutations(range(4)), st.permutations(range(4)))
@settings(deadline=None, max_examples=30)
def test_neighbors_divide_their_common_face_alike(seed, order, other_order):
    rng = np.random.default_rng(seed)
    one = positive(rng, 1)[0]
    two = one.copy()
    two[3] = 2 * one[:3].mean(axis=0) - one[3]
    face = geometry.plane_through(one[:3], one[3])
    found = []
    for vertices, turn in ((one, order), (two, other_order)):
        vertices = vertices[list(turn)]
        if geometry.signed_volume(vertices) < 0:
            vertices = vertices[[1, 0, 2, 3]]
        children = divided_best(vertices[None])[1][0]
        on = np.abs(geometry.plane_distance(face, children)) < 1e-9
        found.append({frozenset(map(tuple, c[o])) for c, o in zip(children, on, strict=True) if o.sum() == 3})
    assert found[0] == found[1]
    assert len(found[0]) == 4


@given(SEEDS)
@settings(deadline=None, max_examples=30)
def test_best_diagonal_is_the_best_and_keeps_three_quarters(seed):
    vertices = positive(np.random.default_rng(seed), 200)
    best = geometry.quality(divided_best(vertices)[1]).min(axis=1)
    for other in range(3):
        worst = geometry.quality(_divide_in_eight(vertices, np.full(200, other))[1]).min(axis=1)
        assert (best >= worst * (1 - 1e-8)).all()
    assert (best > 0.75 * geometry.quality(vertices)).all()
    assert (_best_diagonal(vertices) < 3).all()


@given(st.floats(0.1, 1.5), st.floats(0.4, 1.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
@settings(deadline=None, max_examples=6)
def test_eight_levels_of_a_view_pyramid_keep_their_shape(half_width, aspect, across, up):
    half_height = half_width * aspect
    window = (across - half_width, across + half_width, up - half_height, up + half_height)
    worst = worst_over_levels(halves(window), lambda v: _divide_by_shape(v)[1], 8)
    # Long lenses have slender pyramids, which keep a little less.
    assert (worst >= (0.8 if half_width >= 0.3 else 0.7) * worst[0]).all(), (worst.min(axis=0) / worst[0]).min()
    if 0.4 < half_width < 0.7 and max(abs(across), abs(up)) < 0.1:
        worst = worst_over_levels(halves(window), lambda v: divided_best(v)[1], 8)
        assert (worst >= 0.8 * worst[0]).all(), (worst.min(axis=0) / worst[0]).min()


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_eight_levels_around_a_view_keep_their_shape(kind):
    sides = np.array((-0.5, 0.5, -0.28, 0.28)) * (1.0 if kind == "PERSP" else 20.0)
    camera = Camera(
        kind, np.array([3.0, -40.0, 6.0]), np.eye(3)[:, [0, 2, 1]] * (1, 1, -1), tuple(sides), 0.1, 60.0, 640, 360
    )
    tree = view_root(camera, np.array([[-40.0, -30.0, 0.0], [30.0, 50.0, 20.0]]))
    vertices = tree.vertices(tree.terminals())
    worst = worst_over_levels(vertices, lambda v: _divide_by_shape(v)[1], 8)
    assert (worst >= 0.8 * worst[0]).all(), (worst.min(axis=0) / worst[0]).min()
    # The eight alone keep less of what is long and thin.
    worst = worst_over_levels(vertices, lambda v: divided_best(v)[1], 8)
    assert (worst > 0.74 * worst[0]).all()


def test_longest_diagonal_makes_slivers():
    pair = halves((-0.5, 0.5, -0.28, 0.28))
    longest = worst_over_levels(pair, lambda v: _divide_in_eight(v, np.argmax(squared_diagonals(v), axis=1))[1], 8)
    assert longest.min() < 0.05


def test_bisection_over_thirty_generations_makes_no_slivers():
    worst = worst_over_levels(halves((-0.5, 0.5, -0.28, 0.28)), lambda v: _bisect(v)[1], 30)
    assert worst.min() > 0.337


def test_division_follows_shape():
    regular = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    needle = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.5, 0.3, 20]])
    both = np.stack([regular, needle])
    if geometry.signed_volume(regular) < 0:
        both[0] = both[0, [1, 0, 2, 3]]
    planes, children = _divide_by_shape(both)
    for one, expected in enumerate((divided_best(both), _bisect_thrice(both))):
        np.testing.assert_array_equal(planes[one], expected[0][one])
        np.testing.assert_array_equal(children[one], expected[1][one])


def test_no_tetrahedra():
    nothing = np.zeros((0, 4, 3))
    for planes, children in (divided_best(nothing), _bisect_thrice(nothing), _divide_by_shape(nothing)):
        assert planes.shape == (0, 7, 4) and children.shape == (0, 8, 4, 3)
