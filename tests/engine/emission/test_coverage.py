# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage: what is called hidden lies behind full pixels, and nothing in front of them is ever called so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.emission.coverage import MARGIN, Coverage

FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # looks along +y


def camera(kind: str = "PERSP", **options: object) -> Camera:
    window = (-12.0, 12.0, -8.0, 8.0) if kind == "ORTHO" else (-0.6, 0.6, -0.4, 0.4)
    return Camera(kind, np.zeros(3), FRAME, window, 0.1, 500.0, 96, 64, **options)


def wall(depth: float, half: float = 40.0) -> np.ndarray:
    """Two triangles across the view at a depth, far beyond the image on all sides."""
    a, b, c, d = ([x, depth, z] for x, z in ((-half, -half), (half, -half), (half, half), (-half, half)))
    return np.array([[a, b, c], [a, c, d]], np.float64)


def filled(view: Camera, triangles: np.ndarray) -> Coverage:
    made = Coverage(view)
    made.draw(*made.of_corners(triangles)[1:])
    return made


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_behind_a_wall_all_is_hidden_and_before_it_nothing(kind: str) -> None:
    made = filled(camera(kind), wall(20.0))
    assert np.isfinite(made.depth).all()
    random = np.random.default_rng(1)
    depth = random.uniform(1.0, 60.0, 500)
    spread = 0.3 * (depth if kind == "PERSP" else 15.0)
    center = np.stack([random.uniform(-1, 1, 500) * spread, depth, random.uniform(-1, 1, 500) * spread], axis=1)
    radius = random.uniform(0.01, 0.6, 500)
    hidden = made.hidden(made.of_spheres(center, radius))
    assert (hidden == (depth - radius > 20.0)).all()


@settings(max_examples=40)
@given(st.integers(0, 2**31))
def test_what_is_hidden_is_hidden_from_every_pixel(seed: int) -> None:
    """Rays through centers of pixels meet what covers them before they come to a sphere that is called hidden."""
    random = np.random.default_rng(seed)
    view = camera()
    corners = random.uniform(-4, 4, (60, 1, 3)) * [1, 0, 1] + [0, 12, 0] + random.normal(0, 1.5, (60, 3, 3))
    made = filled(view, corners)
    center = random.uniform(-6, 6, (300, 3)) * [1, 0.5, 1] + [0, 18, 0]
    radius = random.uniform(0.05, 0.8, 300)
    prints = made.of_spheres(center, radius)
    hidden = np.flatnonzero(made.hidden(prints) & ~made.outside(prints))
    column, row, depth = made.project(center)
    rows, columns = np.mgrid[: made.height, : made.width] + 0.5
    for one in hidden:
        reach = radius[one] / (depth[one] - radius[one]) * made.width / (view.window[1] - view.window[0])
        inside = np.hypot(columns - column[one], rows - row[one]) <= 0.8 * reach
        assert (made.depth[inside] < depth[one] - 0.8 * radius[one]).all()


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
def test_spheres_touch_no_pixel_beyond_their_rectangle(kind: str) -> None:
    view = camera(kind)
    made, random = Coverage(view), np.random.default_rng(2)
    center = random.uniform(-5, 5, (200, 3)) + [0, 12, 0]
    radius = random.uniform(0.1, 1.5, 200)
    prints = made.of_spheres(center, radius)
    way = random.normal(size=(200, 64, 3))
    points = center[:, None] + radius[:, None, None] * way / np.linalg.norm(way, axis=2, keepdims=True)
    column, row, depth = (v.reshape(200, 64) for v in made.project(points.reshape(-1, 3)))
    slack = 1e-3
    assert (column >= prints.low[:, :1] - slack).all()
    assert (column <= prints.high[:, :1] + slack).all()
    assert (row >= prints.low[:, 1:] - slack).all()
    assert (row <= prints.high[:, 1:] + slack).all()
    assert (depth >= prints.near[:, None] - slack).all()


def test_what_surrounds_the_eye_is_never_hidden_and_what_is_beside_is_outside() -> None:
    made = filled(camera(), wall(1.0))
    center, radius = np.array([[0.0, 0.2, 0.0], [0.0, -9.0, 0.0], [80.0, 5.0, 0.0]]), np.array([1.0, 1.0, 1.0])
    prints = made.of_spheres(center, radius)
    assert made.outside(prints).tolist() == [False, True, True]
    assert made.hidden(prints).tolist() == [False, True, True]


def test_pixels_are_full_where_their_centers_are_covered() -> None:
    """As many as the triangles' area has, on average over many."""
    view, random = camera("ORTHO"), np.random.default_rng(3)
    corners = np.concatenate([random.uniform(-9, 9, (400, 1, 3)) * [1, 0, 0.7]] * 3, axis=1)
    corners += random.normal(0, 0.35, (400, 3, 3)) + [0, 20, 0]
    pixels, area = 0, 0.0
    for one in corners:
        pixels += np.isfinite(filled(view, one[None]).depth).sum()
        (ax, az), (bx, bz) = (one[1:] - one[0])[:, [0, 2]]
        area += abs(ax * bz - az * bx) / 2
    assert pixels == pytest.approx(area / 0.25**2, rel=0.05)


def test_a_tile_hides_nothing_beyond_what_it_knows() -> None:
    view = camera()
    tile = Coverage(view, (0, 40))
    tile.draw(*tile.of_corners(wall(10.0))[1:])
    assert tile.depth.shape == (64 + 2 * MARGIN, 40)
    whole = filled(view, wall(10.0))
    center = np.stack([np.linspace(-11, 11, 60), np.full(60, 20.0), np.zeros(60)], axis=1)
    prints = whole.of_spheres(center, np.full(60, 0.4))
    inside = (prints.high[:, 0] <= 40) & ~whole.outside(prints)
    assert whole.hidden(prints).all()
    assert (tile.hidden(prints) == (inside | whole.outside(prints))).all()


def test_other_eyes_see_behind() -> None:
    """What only one eye, one moment or a point of the lens does not see is not hidden."""
    narrow = np.array(
        [[[-1.0, 10, -40], [1.0, 10, -40], [1.0, 10, 40]], [[-1.0, 10, -40], [1.0, 10, 40], [-1.0, 10, 40]]]
    )
    center, radius = np.array([[0.0, 20.0, 0.0]]), np.array([0.8])
    assert filled(camera(), narrow).hidden(Coverage(camera()).of_spheres(center, radius)).all()
    other = replace(camera(), position=np.array([3.0, 0.0, 0.0]))
    for view in (camera(shutter=(other,)), camera(lens_radius=2.5, focus=10.0), camera(cell_radius=3.0)):
        made = filled(view, narrow)
        assert not made.hidden(made.of_spheres(center, radius)).any()


def test_panoramas_are_known_across_their_seam() -> None:
    view = replace(camera("PANO"), window=(-np.pi, np.pi, -np.pi / 2, np.pi / 2), width=128)
    made = Coverage(view)
    behind = np.array([[0.0, -10.0, 0.0], [0.0, 10.0, 0.0]])
    prints = made.of_spheres(behind, np.array([1.0, 1.0]))
    assert not made.hidden(prints).any()
    assert not made.outside(prints).any()


def test_blocks_of_faces_keep_what_they_need() -> None:
    """Some faces of a mesh are those faces, with their attributes, and a valid mesh."""
    from tests.engine.subplants.test_leaf_meshes import check_topology
    from tetflora_addon.buffers import kept_faces
    from tetflora_addon.emission.plants import expanded_blocks

    for block in expanded_blocks(support.small_flora(), support.plants([1, 2])):
        mesh, kept = block.buffers, np.random.default_rng(4).random(block.buffers.polygons) < 0.4
        some = kept_faces(mesh, kept)
        check_topology(some)
        assert support.face_areas(some) == pytest.approx(support.face_areas(mesh)[kept])
        for name, (domain, values) in some.attributes.items():
            if domain == "FACE":
                assert (values == mesh.attributes[name][1][kept]).all()
