# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The visibility step against rays cast one by one, whose order comes from their distances and not from the tree."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.engine.support import face_planes
from tetflora_addon.camera.camera import Camera, silhouette_pixels
from tetflora_addon.refinement.rasterize import buffer_size, occluder_depth, pixel_rays
from tetflora_addon.refinement.visibility import COARSEST, AlphaBuffer, Buffers, pixels_of_buffer
from tetflora_addon.tetrahedra.roots import view_root

# Looks along +y, z up, from 5 m before the origin.
FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
EYE = np.array([0.0, -5.0, 1.0])
BOUNDS = np.array([[-6.0, 0.0, -4.0], [6.0, 30.0, 8.0]])


def camera_of(kind, position=EYE, frame=FRAME):
    window = (-0.5, 0.5, -0.3, 0.3) if kind == "PERSP" else (-5.0, 5.0, -3.0, 3.0)
    return Camera(kind, position, frame, window, 0.1, 100.0, 320, 192)


def alpha(buffer):
    """Opacity (height, width) of all tetrahedra together, as far as no occluder hides them; row 0 is lowest."""
    total = np.bincount(buffer._pixel, buffer._depth, buffer.width * buffer.height)
    return -np.expm1(-total).reshape(buffer.height, buffer.width)


def visibility(vertices, extinction, rank, camera, resolution, occluders=None):
    """All that the buffer says of tetrahedra that are drawn at once."""
    buffer = AlphaBuffer(camera, resolution, occluders)
    outline = buffer.add(np.arange(len(vertices)), vertices, extinction)
    seen = buffer.transmittance(np.asarray(rank) - np.min(rank, initial=0))
    return SimpleNamespace(transmittance=seen, alpha=alpha(buffer), **vars(outline))


def split_view(camera, cells, seed=0):
    """Cells of the view, split at random with large ones first, and their ranks."""
    rng = np.random.default_rng(seed)
    tree = view_root(camera, BOUNDS)
    while True:
        nodes = tree.terminals()
        nodes = nodes[tree.inside[nodes]]
        if len(nodes) >= cells:
            break
        pixels, whole = silhouette_pixels(tree.vertices(nodes), camera)
        pixels = np.where(whole, pixels, 1e9) * rng.uniform(0.3, 1.0, len(nodes))
        tree.split(nodes[pixels >= np.median(pixels)])
    ranks = tree.order(camera.position if camera.kind == "PERSP" else None, -camera.frame[:, 2])
    return tree.vertices(nodes), ranks[nodes]


def cast(vertices, extinction, camera, width, height, occluders=None):
    """Pixels of the final image, transmittance and alpha by rays that meet all cells, sorted by distance."""
    origins, directions = pixel_rays(camera, width, height)
    planes = face_planes(vertices)
    count, seen, alpha = np.zeros(len(vertices)), np.zeros(len(vertices)), np.zeros(width * height)
    ahead = -camera.frame[:, 2]
    for part in np.array_split(np.arange(width * height), 32):
        slope = np.einsum("cfi,ri->rcf", planes[..., :3], directions[part])
        height_above = np.einsum("cfi,ri->rcf", planes[..., :3], origins[part]) + planes[..., 3]
        parallel = slope == 0
        distance = -height_above / np.where(parallel, 1.0, slope)
        start = np.where(slope < 0, distance, -np.inf).max(-1)
        end = np.where(slope > 0, distance, np.inf).min(-1)
        end = np.where((parallel & (height_above > 0)).any(-1), -np.inf, end)
        start = np.maximum(start, (camera.near / (directions[part] @ ahead))[:, None])
        length = np.maximum(end - start, 0.0)
        hit = length > 0
        fraction = np.ones_like(length)
        if occluders is not None:
            fraction = np.clip((occluders[part, None] - start) / np.where(hit, length, 1.0), 0.0, 1.0)
        order = np.argsort(np.where(hit, start, np.inf), axis=1)
        depth = np.take_along_axis(length * extinction * fraction, order, axis=1)
        before = np.zeros_like(depth)
        np.put_along_axis(before, order, np.cumsum(depth, axis=1) - depth, axis=1)
        count += hit.sum(0)
        seen += (np.exp(-before) * fraction * hit).sum(0)
        alpha[part] = 1 - np.exp(-depth.sum(1))
    return count * camera.width * camera.height / (width * height), seen / np.maximum(count, 1), alpha


def compare(vertices, extinction, rank, camera, resolution, fine=112, triangles=None):
    """Measured visibility, and rays at the final image's resolution or coarser."""
    occluders, hidden = None, None
    size = buffer_size(camera, fine)
    if triangles is not None:
        occluders = occluder_depth(triangles, camera, *buffer_size(camera, resolution))
        hidden = occluder_depth(triangles, camera, *size)
    return (
        visibility(vertices, extinction, rank, camera, resolution, occluders),
        cast(vertices, extinction, camera, *size, hidden),
    )


@pytest.mark.parametrize(("width", "height"), [(320, 192), (192, 320), (640, 640)])
def test_pixels_of_the_buffer_are_squares_of_the_images_pixels(width, height):
    camera = replace(camera_of("PERSP"), width=width, height=height)
    assert pixels_of_buffer(camera, 64) == pytest.approx(max(width, height) / 64, rel=0.02)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("cells", [40, 250])
def test_random_scene_agrees_with_rays(kind, cells):
    camera = camera_of(kind)
    vertices, rank = split_view(camera, cells)
    rng = np.random.default_rng(cells)
    extinction = np.where(rng.random(len(vertices)) < 0.5, rng.uniform(0.0, 0.6, len(vertices)), 0.0)
    found, (pixels, seen, alpha) = compare(vertices, extinction, rank, camera, 64)
    large = pixels > 200.0
    assert large.any()
    np.testing.assert_allclose(found.pixels[large], pixels[large], rtol=0.1)
    known = pixels > 0
    off = np.abs(found.transmittance - seen)[known]
    assert np.quantile(off, 0.95) < 0.05, np.quantile(off, [0.5, 0.95, 1.0])
    assert abs(found.alpha.mean() - alpha.mean()) < 0.01


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_cells_smaller_than_the_buffers_pixels(kind):
    camera = camera_of(kind)
    vertices, rank = split_view(camera, 1500)
    rng = np.random.default_rng(7)
    extinction = np.where(rng.random(len(vertices)) < 0.5, rng.uniform(0.0, 0.6, len(vertices)), 0.0)
    found, (pixels, seen, alpha) = compare(vertices, extinction, rank, camera, 8, fine=80)
    # A ray of the comparison stands for 16 pixels; a pixel of the buffer for 1536.
    large = (pixels > 300.0) & (pixels < 1536.0)
    assert large.sum() > 50
    assert abs(found.pixels[large].sum() / pixels[large].sum() - 1) < 0.05
    off = (found.transmittance - seen)[large]
    assert abs(off.mean()) < 0.02, off.mean()
    assert np.median(np.abs(off)) < 0.03
    assert abs(found.alpha.mean() - alpha.mean()) < 0.01


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_occluders_hide_what_is_behind_them(kind):
    camera = camera_of(kind)
    vertices, rank = split_view(camera, 300)
    extinction = np.full(len(vertices), 0.02)
    # A tilted wall over the left half of the image and far beyond it.
    corners = np.array([[-80.0, 6, -50], [-0.7, 9, -50], [-0.7, 9, 50], [-80, 6, 50]])
    triangles = corners[[[0, 1, 2], [0, 2, 3]]]
    found, (_, seen, alpha) = compare(vertices, extinction, rank, camera, 128, triangles=triangles)
    assert np.quantile(np.abs(found.transmittance - seen), 0.95) < 0.05
    assert abs(found.alpha.mean() - alpha.mean()) < 0.01
    behind = (vertices[..., 1] > 9).all(axis=1) & (camera.to_camera_space(vertices)[..., 0] < -0.7).all(axis=1)
    assert behind.any()
    assert (found.transmittance[behind] < 0.02).all()
    assert (visibility(vertices, extinction, rank, camera, 128).transmittance[behind] > 0.1).any()


def test_nothing_and_nothing_in_view():
    camera = camera_of("PERSP")
    none = visibility(np.zeros((0, 4, 3)), np.zeros(0), np.zeros(0, int), camera, 32)
    assert len(none.pixels) == len(none.transmittance) == 0
    assert none.alpha.shape == (19, 32)
    assert (none.alpha == 0).all()
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    places = np.array([[0.0, -50, 0], [300, 10, 0], [0, 500, 0], [0.01, -5.5, 1]])
    found = visibility(corner + places[:, None], np.full(4, 1.0), np.arange(4), camera, 32)
    # Behind the eye, beside the window, beyond the far plane; the last one holds the eye.
    np.testing.assert_array_equal(found.pixels[:3], 0)
    np.testing.assert_array_equal(found.transmittance[:3], 0)


def test_opaque_cells_leave_nothing_behind_them_and_numbers_finite():
    camera = camera_of("PERSP")
    vertices, rank = split_view(camera, 60)
    extinction = np.where(rank == rank.min(), np.inf, 0.0)
    found = visibility(vertices, extinction, rank, camera, 64)
    for values in (found.pixels, found.transmittance, found.opacity, found.alpha):
        assert np.isfinite(values).all()
    first = np.argmin(rank)
    assert found.transmittance[first] == pytest.approx(1.0, abs=1e-12)
    assert np.isclose(found.opacity[first], 1.0)
    assert found.transmittance.min() < 0.5


def test_ranks_decide_what_hides_what():
    camera = camera_of("PERSP")
    vertices, rank = split_view(camera, 60)
    extinction = np.full(len(vertices), 0.05)
    forward = visibility(vertices, extinction, rank, camera, 64)
    backward = visibility(vertices, extinction, -rank, camera, 64)
    np.testing.assert_allclose(forward.alpha, backward.alpha, atol=1e-12)
    near, far = np.argmin(rank), np.argmax(rank)
    assert forward.transmittance[near] > forward.transmittance[far]
    assert backward.transmittance[near] < backward.transmittance[far]


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_tetrahedra_that_come_and_go_leave_the_others_as_they_are(kind):
    """Drawn one after the other, with some taken away in between, they are seen as if drawn at once."""
    camera = camera_of(kind)
    vertices, rank = split_view(camera, 120)
    rng = np.random.default_rng(3)
    extinction = rng.uniform(0.0, 0.3, len(vertices))
    once = visibility(vertices, extinction, rank, camera, 64)
    buffer = AlphaBuffer(camera, 64)
    parts = np.array_split(rng.permutation(len(vertices)), 5)
    pixels = np.zeros(len(vertices))
    for part in parts[:3]:
        buffer.add(part, vertices[part], extinction[part])
    away = np.zeros(len(vertices), bool)
    away[parts[1]] = True
    buffer.remove(away)
    for part in (parts[1], *parts[3:]):
        pixels[part] = buffer.add(part, vertices[part], extinction[part]).pixels
    np.testing.assert_allclose(buffer.transmittance(rank), once.transmittance, atol=1e-9)
    np.testing.assert_allclose(alpha(buffer), once.alpha, atol=1e-12)
    for part in (parts[1], *parts[3:]):
        np.testing.assert_array_equal(pixels[part], once.pixels[part])


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_buffers_grow_with_what_is_drawn(kind):
    """A coarse buffer for a few tetrahedra says what a fine one says; occluders are known to both."""
    camera = camera_of(kind)
    wall = np.array([[[-80.0, 9, -50], [-0.7, 9, -50], [-0.7, 9, 50]], [[-80.0, 9, -50], [-0.7, 9, 50], [-80, 9, 50]]])
    buffers = Buffers(camera, 200, wall)
    sizes, buffer = [], None
    for cells in (1, 40, 300, 2000):
        vertices, rank = split_view(camera, max(cells, 2))
        finer = buffers.fit(buffer, cells)
        sizes.append(finer.width)
        buffer = finer
        if cells in (40, 300):
            seen = []
            for one in (buffers.fit(None, cells), buffers.fit(None, 100_000)):
                one.add(np.arange(len(vertices)), vertices, np.full(len(vertices), 0.05))
                seen.append(one.transmittance(rank))
            assert np.quantile(np.abs(seen[0] - seen[1]), 0.9) < 0.1
            assert abs(seen[0].mean() - seen[1].mean()) < 0.02
    assert sizes[0] == COARSEST
    assert sizes[-1] == 200
    assert sizes == sorted(sizes)
    assert buffers.fit(buffer, 10) is buffer
