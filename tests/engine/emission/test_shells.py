# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells keep what the shader relies on: closed, outward faces and exact thickness, wherever the cells are."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tetflora_addon.emission.shells import _shell_buffers
from tetflora_addon.light.receivers import MediumCells
from tetflora_addon.tetrahedra.geometry import signed_volume


def cells(seed: int, count: int = 20, origin: float = 0.0) -> np.ndarray:
    vertices = np.random.default_rng(seed).normal(size=(count, 4, 3)) + origin
    return np.where(signed_volume(vertices)[:, None, None] < 0.0, vertices[:, [0, 2, 1, 3]], vertices)


def build(vertices: np.ndarray, color: np.ndarray | None = None, **options):
    return _shell_buffers(medium(vertices, np.array([4.0, 1.0, 9.0, 0.0, 0.0, 0.0]), color), **options)


def medium(vertices: np.ndarray, matrices: np.ndarray, color: np.ndarray | None = None) -> MediumCells:
    count = len(vertices)
    return MediumCells(
        vertices,
        np.broadcast_to(matrices, (count, 6)),
        np.full((count, 3), 0.2) if color is None else color,
        np.full(count, 0.3),
        np.tile([0.0, 0.0, 1.0], (count, 1)),
        np.full(count, 0.5),
    )


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 5000.0]))
def test_faces_point_outwards_and_enclose_the_volume(seed, origin):
    vertices = cells(seed, origin=origin)
    buffers = build(vertices)
    local = buffers.positions.astype(np.float64).reshape(-1, 4, 3)
    corners = buffers.positions.astype(np.float64)[buffers.corner_verts].reshape(-1, 4, 3, 3)
    relative = corners - local.mean(axis=1)[:, None, None]
    signed = np.einsum("nfi,nfi->n", relative[:, :, 0], np.cross(relative[:, :, 1], relative[:, :, 2])) / 6.0
    spans = vertices[:, 1:] - vertices[:, :1]
    volume = np.abs(np.linalg.det(spans)) / 6.0
    # Doubles minus the rounding of positions to 32 bits, which at 5 km is .25 mm.
    np.testing.assert_allclose(signed, volume, atol=1e-5 + origin * 2e-6)


def test_edges_belong_to_their_corners():
    buffers = build(cells(1, 3))
    following = buffers.corner_verts.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    wanted = np.sort(np.stack([buffers.corner_verts, following], axis=1), axis=1)
    np.testing.assert_array_equal(np.sort(buffers.edge_verts[buffers.corner_edges], axis=1), wanted)
    assert len(np.unique(buffers.edge_verts, axis=0)) == 18
    assert np.bincount(buffers.corner_edges).tolist() == [2] * 18
    assert not buffers.smooth  # the shader takes their normals for those of the cell's sides


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 5000.0]))
def test_exit_distance_from_the_attributes_is_the_true_one(seed, origin):
    """From a point on a face into the cell: the least λ / −(∇λ·ω) equals the intersection with the other faces."""
    rng = np.random.default_rng(seed)
    vertices = cells(seed, 8, origin)
    buffers = build(vertices)
    gradients = np.stack([buffers.attributes[f"tf_g{k}"][1][::4] for k in (1, 2, 3)], axis=1).astype(np.float64)
    weights = rng.dirichlet([1.0, 1.0, 1.0], size=8)
    inside = rng.dirichlet([2.0, 2.0, 2.0, 2.0], size=8)
    # Enter through the face opposite vertex 0, toward an inner point.
    entry_weights = np.concatenate([np.zeros((8, 1)), weights], axis=1)
    # Without the rounding of positions: thickness must not depend on where the cell is.
    exact = vertices
    entry = np.einsum("nk,nki->ni", entry_weights, exact)
    direction = np.einsum("nk,nki->ni", inside, exact) - entry
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    coordinates = np.concatenate([1.0 - weights.sum(axis=1, keepdims=True), weights], axis=1)
    slopes = np.einsum("nki,ni->nk", gradients, direction)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    falling = slopes[:, 1:] < 0
    exits = np.where(falling, coordinates[:, 1:] / np.where(falling, -slopes[:, 1:], 1.0), np.inf).min(axis=1)
    system = np.concatenate([exact.transpose(0, 2, 1), np.ones((8, 1, 4))], axis=1)
    at_exit = np.concatenate([entry + exits[:, None] * direction, np.ones((8, 1))], axis=1)
    left = np.linalg.solve(system, at_exit[..., None])[..., 0]
    # Gradients have 32 bits, and are large where a cell is nearly flat.
    size = np.linalg.norm(vertices - vertices.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    assert (np.abs(left.min(axis=1)) < 1e-4 + 1e-6 * np.abs(gradients).max(axis=(1, 2)) * size).all()
    assert (exits > 0).all()


def test_gradients_are_those_of_barycentric_coordinates():
    vertices = cells(3, 50)
    attributes = build(vertices).attributes
    gradients = np.stack([attributes[f"tf_g{k}"][1][::4] for k in (1, 2, 3)], axis=1).astype(np.float64)
    spans = vertices[:, 1:] - vertices[:, :1]
    expected = np.tile(np.eye(3), (50, 1, 1))
    np.testing.assert_allclose(np.einsum("nki,nji->nkj", gradients, spans), expected, atol=1e-4)


def test_flat_cells_hold_nothing():
    vertices = cells(4, 2)
    vertices[1, 3] = vertices[1, :3].mean(axis=0)
    buffers = build(vertices)
    for name, (_, values) in buffers.attributes.items():
        assert np.isfinite(values).all(), name
    assert buffers.attributes["tf_kappa"][1][4:].tolist() == [0.0] * 4
    assert (buffers.attributes["tf_kappa"][1][:4] > 0).all()


def test_directional_mean():
    even = medium(cells(2, 1), np.array([4.0, 4.0, 4.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(even.mean_extinction, 2.0, rtol=1e-12)
    # Flakes of one orientation: the mean of |cos| over the sphere is one half, whatever the orientation.
    axes = np.random.default_rng(0).normal(size=(20, 3))
    x, y, z = (axes / np.linalg.norm(axes, axis=1)[:, None]).T
    alike = medium(cells(2), np.stack([x * x, y * y, z * z, x * y, x * z, y * z], axis=1))
    np.testing.assert_allclose(alike.mean_extinction, 0.5, rtol=0.02)


def test_no_cells():
    assert build(np.zeros((0, 4, 3))).polygons == 0


def test_rank_writes_cells_back_to_front():
    """Whoever blends faces in their order then sees the farthest first; all attributes go with their cells."""
    vertices = cells(5, 30)
    rank = np.random.default_rng(6).permutation(30)
    light = np.random.default_rng(7).random((30, 4, 3))
    color = np.random.default_rng(8).random((30, 3))
    plain = build(vertices, color=color, light=light)
    ranked = build(vertices, color=color, light=light, rank=rank)
    order = np.argsort(-rank)
    for name, (domain, values) in plain.attributes.items():
        moved = values.reshape(30, 4, *values.shape[1:])[order].reshape(values.shape)
        assert ranked.attributes[name][0] == domain
        np.testing.assert_array_equal(ranked.attributes[name][1], moved, err_msg=name)
    np.testing.assert_array_equal(ranked.positions, plain.positions.reshape(30, 4, 3)[order].reshape(-1, 3))
    np.testing.assert_array_equal(ranked.corner_verts, plain.corner_verts)


def test_light_stays_with_its_corner():
    """The radiance that is written is that of the position beside it."""
    vertices = cells(9, 40)
    light = vertices @ np.array([[1.0, 0.0, 2.0], [0.5, 1.0, 0.0], [0.0, 3.0, 1.0]])
    buffers = build(vertices, light=light)
    written = np.stack([buffers.attributes[f"tf_light{k}"][1][::4] for k in range(4)], axis=1)
    places = buffers.positions.reshape(40, 4, 3).astype(np.float64)
    expected = places @ np.array([[1.0, 0.0, 2.0], [0.5, 1.0, 0.0], [0.0, 3.0, 1.0]])
    np.testing.assert_allclose(written, expected, atol=1e-5)
    assert not any(name.startswith("tf_light") for name in build(vertices).attributes)


def test_the_noise_of_a_cell_is_even_and_its_own():
    vertices = cells(10, 4000, 5000.0)
    noise = build(vertices).attributes["tf_random"][1][::4]
    assert 0.0 <= noise.min() <= noise.max() < 1.0
    # Standard deviation of the mean of 4,000 even numbers: .0046.
    assert abs(noise.mean() - 0.5) < 0.02
    assert np.histogram(noise, 8, (0.0, 1.0))[0].min() > 400
    turned = np.random.default_rng(1).permuted(np.arange(4))
    np.testing.assert_array_equal(build(vertices[::-1][:, turned]).attributes["tf_random"][1][::4][::-1], noise)
