# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fragments and occluders against what geometry says without pixels."""

import numpy as np
import pytest

from tetflora_addon.camera.camera import Camera, silhouette_pixels
from tetflora_addon.refinement import rasterize
from tetflora_addon.refinement.rasterize import buffer_size, occluder_depth, pixel_rays, tetrahedron_fragments
from tetflora_addon.tetrahedra.geometry import signed_volume, volume
from tetflora_addon.tetrahedra.roots import view_root

WIDTH, HEIGHT = 48, 28


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q


def make(kind, seed=0, window=(-0.3, 0.6, -0.2, 0.3)):
    rng = np.random.default_rng(seed)
    sides = tuple(np.array(window) * (1.0 if kind == "PERSP" else 30.0))
    return Camera(kind, rng.uniform(-9, 9, 3), rotation(rng), sides, 0.05, 200.0, 480, 280), rng


def in_front(camera, rng, count, size, depth=(2.0, 60.0)):
    """Positive tetrahedra of about ``size`` meters, within the window or near it."""
    left, right, bottom, top = camera.window
    z = rng.uniform(*depth, count)
    x, y = rng.uniform(left, right, count), rng.uniform(bottom, top, count)
    scale = z if camera.kind == "PERSP" else 1.0
    center = np.stack([x * scale, y * scale, -z], axis=1) @ camera.frame.T + camera.position
    vertices = center[:, None] + rng.normal(size=(count, 4, 3)) * size
    wrong = signed_volume(vertices) < 0
    vertices[wrong] = vertices[wrong][:, [1, 0, 2, 3]]
    return vertices


def triangle_distances(triangles, origins, directions):
    """Nearest hit of each ray by solving o + t d = a + u (b − a) + v (c − a) for each pair."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    shape = (len(origins), len(triangles), 3)
    columns = [
        np.broadcast_to(-directions[:, None], shape),
        np.broadcast_to(b - a, shape),
        np.broadcast_to(c - a, shape),
    ]
    solution = np.linalg.solve(np.stack(columns, axis=-1), (origins[:, None] - a)[..., None])[..., 0]
    t, u, v = np.moveaxis(solution, -1, 0)
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1), t, np.nan)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_entry_and_exit_lie_on_the_surface(kind):
    camera, rng = make(kind)
    vertices = in_front(camera, rng, 30, 4.0)
    found = tetrahedron_fragments(vertices, camera, WIDTH, HEIGHT)
    origins, directions = pixel_rays(camera, WIDTH, HEIGHT)
    exact = found.coverage == 1.0
    assert exact.sum() > 1000
    local = camera.to_camera_space(vertices)
    for end in (found.entry, found.entry + found.thickness):
        points = origins[found.pixel] + end[:, None] * directions[found.pixel]
        edges = vertices[found.cell][:, 1:] - vertices[found.cell][:, :1]
        rest = np.linalg.solve(np.swapaxes(edges, 1, 2), (points - vertices[found.cell][:, 0])[..., None])[..., 0]
        least = np.minimum(rest.min(axis=1), 1 - rest.sum(axis=1))
        depth = camera.to_camera_space(points)[:, 2]
        clipped = np.isclose(depth, camera.near) | np.isclose(depth, camera.far)
        assert (np.abs(least[exact & ~clipped]) < 1e-6).all()
        assert (least[exact] > -1e-6).all()
    assert np.isfinite(local).all()


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("size", [0.01, 0.3, 3.0])
def test_the_image_holds_each_volume(kind, size):
    """Σ coverage · thickness · (area of a pixel across the ray) is the volume, also between the pixels' centers."""
    camera, rng = make(kind)
    vertices = in_front(camera, rng, 400, size, (30.0, 60.0))
    whole = silhouette_pixels(vertices, camera)[1]
    vertices = vertices[whole]
    found = tetrahedron_fragments(vertices, camera, WIDTH, HEIGHT)
    assert set(found.cell) == set(range(len(vertices)))
    left, right, bottom, top = camera.window
    pixel = (right - left) * (top - bottom) / (WIDTH * HEIGHT)
    if kind == "PERSP":
        directions = pixel_rays(camera, WIDTH, HEIGHT)[1]
        cosine = -(directions @ camera.frame[:, 2])[found.pixel]
        # ∫ r² dr dΩ over the chord, with dΩ = pixel · cos³ at depth 1.
        ends = found.entry, found.entry + found.thickness
        measure = (ends[1] ** 3 - ends[0] ** 3) / 3 * pixel * cosine**3
    else:
        measure = found.thickness * pixel
    total = np.bincount(found.cell, measure * found.coverage, len(vertices))
    assert np.isclose(total.sum(), volume(vertices).sum(), rtol=0.03)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_cells_of_the_view_fill_every_ray(kind):
    camera, rng = make(kind)
    tree = view_root(camera, np.array([[-20.0, -20, -20], [20, 20, 20]]))
    for _ in range(4):
        nodes = tree.terminals()
        tree.split(nodes[rng.random(len(nodes)) < 0.5])
    nodes = tree.terminals()[tree.inside[tree.terminals()]]
    found = tetrahedron_fragments(tree.vertices(nodes), camera, WIDTH, HEIGHT)
    reach = camera.to_camera_space(tree.vertices(nodes))[..., 2].max()
    cosine = -(pixel_rays(camera, WIDTH, HEIGHT)[1] @ camera.frame[:, 2])
    big = np.flatnonzero(np.bincount(found.cell, found.coverage == 1.0, len(nodes)) == np.bincount(found.cell))
    assert len(big) == len(nodes)
    length = np.bincount(found.pixel, found.thickness, WIDTH * HEIGHT)
    np.testing.assert_allclose(length, (reach - camera.near) / cosine, rtol=1e-9)


def test_small_memory_gives_the_same_image(monkeypatch):
    camera, rng = make("PERSP")
    vertices = in_front(camera, rng, 50, 4.0, (0.0, 40.0))
    triangles = in_front(camera, rng, 50, 4.0, (0.0, 40.0))[:, :3]
    one = tetrahedron_fragments(vertices, camera, WIDTH, HEIGHT)
    depth = occluder_depth(triangles, camera, WIDTH, HEIGHT)
    monkeypatch.setattr(rasterize, "PAIR_BATCH", 100)
    monkeypatch.setattr(rasterize, "PRIMITIVE_BATCH", 7)
    two = tetrahedron_fragments(vertices, camera, WIDTH, HEIGHT)
    np.testing.assert_array_equal(depth, occluder_depth(triangles, camera, WIDTH, HEIGHT))
    first, second = np.lexsort((one.pixel, one.cell)), np.lexsort((two.pixel, two.cell))
    for name in ("cell", "pixel", "entry", "thickness", "coverage"):
        np.testing.assert_array_equal(getattr(one, name)[first], getattr(two, name)[second])


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_occluders_agree_with_solved_equations(kind):
    camera, rng = make(kind)
    # Around the eye, so that many cross its plane.
    triangles = camera.position + rng.normal(size=(60, 3, 3)) * 20
    origins, directions = pixel_rays(camera, WIDTH, HEIGHT)
    wanted = triangle_distances(triangles, origins, directions)
    depth = wanted * -(directions @ camera.frame[:, 2])[:, None]
    wanted = np.where((depth >= camera.near) & (depth <= camera.far), wanted, np.inf).min(axis=1)
    found = occluder_depth(triangles, camera, WIDTH, HEIGHT)
    assert np.isfinite(found).mean() > 0.1
    np.testing.assert_allclose(found, wanted, rtol=1e-7)


def test_broken_triangles_are_ignored():
    camera, rng = make("PERSP")
    good = in_front(camera, rng, 5, 4.0)[:, :3]
    broken = good.copy()
    broken[0, 1, 2] = np.nan
    broken[1, 0, 0] = np.inf
    broken[2, 1] = broken[2, 0]
    broken[3] = broken[3, 0]
    broken[4] = camera.position
    np.testing.assert_array_equal(
        occluder_depth(np.concatenate([broken, good]), camera, WIDTH, HEIGHT),
        occluder_depth(good, camera, WIDTH, HEIGHT),
    )
    assert np.isinf(occluder_depth(np.zeros((0, 3, 3)), camera, WIDTH, HEIGHT)).all()


def test_a_mesh_has_no_holes_between_its_triangles():
    camera, rng = make("PERSP")
    steps = np.linspace(-1, 1, 60)
    x, y = np.meshgrid(steps, steps)
    sheet = np.stack([x * 40, y * 40, -10 - rng.uniform(0, 2, x.shape)], axis=-1) @ camera.frame.T + camera.position
    quads = np.stack([sheet[:-1, :-1], sheet[:-1, 1:], sheet[1:, 1:], sheet[1:, :-1]], axis=2).reshape(-1, 4, 3)
    found = occluder_depth(np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]), camera, 200, 120)
    assert np.isfinite(found).all()


def test_buffer_has_the_shape_of_the_image():
    camera, _ = make("PERSP")
    assert buffer_size(camera, 256) == (256, 149)
    assert buffer_size(camera, 1) == (1, 1)
