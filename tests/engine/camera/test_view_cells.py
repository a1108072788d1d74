# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""View cells: alike for all cameras in them, and enough for each of these."""

from __future__ import annotations

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tetflora_addon.camera.camera import MOST, Camera, blur_margins, expected_pixels
from tetflora_addon.camera.view_cells import CLEAR, Around, ViewCells, cell_camera
from tetflora_addon.refinement.visibility import AlphaBuffer, Buffers

CELLS = ViewCells(4.0, np.radians(3.0))
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # looks along +y
RANDOM = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def turn(rng: np.random.Generator, angle: float) -> np.ndarray:
    """Rotation (3, 3) by an angle about an axis drawn at random."""
    axis = rng.normal(size=3)
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def drawn(rng: np.random.Generator, kind: str = "PERSP") -> Camera:
    """A camera anywhere, with a lens of any common length and shift."""
    half = np.array([0.36, 0.36 * rng.uniform(0.4, 1.2)]) * rng.uniform(0.5, 2.5)
    half *= 1.0 if kind == "PERSP" else 10.0
    shift = rng.uniform(-0.5, 0.5, 2) * half
    window = (shift[0] - half[0], shift[0] + half[0], shift[1] - half[1], shift[1] + half[1])
    place, frame = rng.normal(size=3) * 30.0, turn(rng, rng.uniform(0.0, np.pi))
    height = round(640 * half[1] / half[0])
    return Camera(kind, place, frame, tuple(window), 0.1, 200.0, 640, height)


def points_in_image(rng: np.random.Generator, camera: Camera, count: int = 400) -> np.ndarray:
    """Points (n, 3) that a camera sees, near ones as often as far ones."""
    left, right, bottom, top = camera.window
    x, y = rng.uniform(left, right, count), rng.uniform(bottom, top, count)
    depth = np.exp(rng.uniform(np.log(camera.near), np.log(camera.far), count))
    scale = depth if camera.kind == "PERSP" else 1.0
    return np.stack([x * scale, y * scale, -depth], axis=1) @ camera.frame.T + camera.position


def far_points(rng: np.random.Generator, camera: Camera, cell: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) that a camera sees far from the eyes of its cell, and their distances (n,)."""
    points = points_in_image(rng, camera)
    away = np.linalg.norm(points - camera.position, axis=1)
    return points[away > 8.0 * cell.cell_radius], away[away > 8.0 * cell.cell_radius]


def same(a: Camera, b: Camera) -> bool:
    """Equal to the last bit."""
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(Camera))


def neighbor(rng: np.random.Generator, camera: Camera, step: float = 0.3) -> Camera:
    """A camera near another one."""
    return replace(
        camera,
        position=camera.position + rng.normal(size=3) * step,
        frame=turn(rng, rng.normal() * 0.01) @ camera.frame,
        window=tuple(np.array(camera.window) * np.exp(rng.normal() * 0.01)),
    )


@given(RANDOM, st.sampled_from(["PERSP", "ORTHO"]))
def test_the_cells_camera_sees_all_that_any_of_its_cameras_sees(rng, kind):
    camera = drawn(rng, kind)
    cell = cell_camera(camera, CELLS)
    if cell is None:
        assert max(np.abs(camera.window)) > 1.0  # wider than 90 degrees
        return
    points = points_in_image(rng, camera)
    assert (cell.distance_to_view(points) <= 1e-9).all()
    depth = cell.to_camera_space(points)[:, 2]
    assert (depth >= cell.near - 1e-9).all()
    assert (depth <= cell.far + 1e-9).all()


@given(RANDOM)
def test_it_sees_what_the_other_eye_sees_through_a_shifted_window(rng):
    camera = drawn(rng)
    shift = rng.uniform(-0.2, 0.2)
    eye = camera.position + 0.065 * camera.frame[:, 0]
    left, right, bottom, top = camera.window
    other = replace(camera, position=eye, window=(left + shift, right + shift, bottom, top))
    cell = cell_camera(replace(camera, shutter=(other,)), CELLS)
    if cell is None:
        assert max(np.abs((*camera.window, *other.window))) > 1.0
        return
    assert (cell.distance_to_view(points_in_image(rng, camera)) <= 1e-9).all()
    assert (cell.distance_to_view(points_in_image(rng, other)) <= 0.01).all()  # a 64th of a pixel at most


@given(RANDOM)
def test_blur_reaches_as_far_into_its_picture_as_into_that_of_any_of_its_cameras(rng):
    camera = drawn(rng)
    center, reach = points_in_image(rng, camera, 1), np.full(1, 0.01)
    away = np.linalg.norm(center - camera.position)
    # Nearer than a third of the way to what is sharp: nearly sharp, it is a matter of how wide cells of focus are.
    camera = replace(camera, lens_radius=rng.uniform(0.005, 0.05), focus=rng.uniform(3.0, 30.0) * away)
    cell = cell_camera(camera, CELLS)
    assume(cell is not None)
    assume(away > 1.5 * cell.cell_radius)
    margins = [
        np.array(blur_margins(viewer, center, reach))
        * (viewer.window[1] - viewer.window[0], viewer.window[3] - viewer.window[2])
        for viewer in (camera, cell)
    ]
    assert (margins[1] >= 0.9 * margins[0]).all() or max(blur_margins(cell, center, reach)) == MOST


@given(RANDOM)
def test_it_takes_nothing_to_be_farther_away_than_any_of_its_cameras(rng):
    camera = drawn(rng)
    cell = cell_camera(camera, CELLS)
    assume(cell is not None)
    points = points_in_image(rng, camera)
    points = points[np.linalg.norm(points - camera.position, axis=1) > 4.0 * cell.cell_radius]
    # Toward the border of a wide image depth changes with the direction as well.
    border = 1.0 + np.tan(CELLS.turn) * 2.0 * np.abs(camera.window).max()
    assert (cell.extent_around(points) <= camera.extent_around(points) * border).all()
    assert (cell.pixel_extent(points) <= camera.pixel_extent(points) * border).all()


@given(RANDOM)
def test_nor_much_nearer_than_it_is(rng):
    camera = drawn(rng)
    cell = cell_camera(camera, CELLS)
    assume(cell is not None)
    points, away = far_points(rng, camera, cell)
    least = (1.0 - 2.5 * cell.cell_radius / away) * 2.0 ** (-1.0 / 16.0) * 0.9
    assert (cell.extent_around(points) >= camera.extent_around(points) * least).all()


@given(RANDOM)
def test_pixels_are_those_that_the_nearest_camera_sees(rng):
    camera = drawn(rng)
    cell = cell_camera(camera, CELLS)
    assume(cell is not None)
    points, away = far_points(rng, camera, cell)
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0]])
    small = points[:, None] + 0.002 * away[:, None, None] * corners
    seen, whole = expected_pixels(small, camera)
    shared, _ = expected_pixels(small, cell)
    assert (shared[whole] >= 0.8 * seen[whole]).all()  # silhouettes differ with the direction
    assert np.median(shared[whole] / seen[whole]) < 3.0 if whole.any() else True


@given(RANDOM)
def test_all_cameras_of_a_cell_get_the_same_one_to_the_last_bit(rng):
    camera = drawn(rng)
    others = [neighbor(rng, camera) for _ in range(8)]
    cells = [cell_camera(c, CELLS) for c in (camera, *others)]
    known = [c for c in cells if c is not None]
    distinct = [c for n, c in enumerate(known) if not any(same(c, d) for d in known[:n])]
    for n, one in enumerate(distinct):
        for other in distinct[:n]:  # what differs at all is another cell: by a whole step in place, turn or zoom
            far = np.linalg.norm(one.eye - other.eye) > 0.1
            turned = np.abs(one.frame - other.frame).max() > 1e-3
            zoomed = abs(np.log2(one.pixel_size / other.pixel_size)) > 0.05
            assert far or turned or zoomed


@pytest.mark.parametrize("angles", [(0, 0), (90, 0), (90, 45), (90, 90), (60, 180), (180, 0), (0, 90), (45, 30)])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.0, -20.0, 2.0), (10.0, 10.0, 1.7)])
def test_what_artists_type_in_lies_on_no_border(angles, place):
    tilt, yaw = np.radians(angles)
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    window = (-0.36, 0.36, -0.2025, 0.2025)
    camera = Camera("PERSP", np.array(place), about_z @ about_x, window, 0.1, 100.0, 1920, 1080)
    rng = np.random.default_rng(1)
    cell = cell_camera(camera, CELLS)
    for _ in range(20):  # as much as single precision may lose
        moved = replace(
            camera,
            position=camera.position + rng.normal(size=3) * 1e-5,
            frame=turn(rng, rng.normal() * 1e-6) @ camera.frame,
            window=tuple(np.array(window) * (1.0 + rng.normal(size=4) * 1e-7)),
        )
        assert same(cell_camera(moved, CELLS), cell)


def test_a_walk_goes_through_few_cells():
    camera = Camera("PERSP", np.zeros(3), LEVEL, (-0.36, 0.36, -0.2025, 0.2025), 0.1, 100.0, 1920, 1080)
    length = 100.0
    walk = [replace(camera, position=np.array([0.3, y, 1.7])) for y in np.arange(0.0, length, 0.15)]
    cells = [cell_camera(c, CELLS) for c in walk]
    changes = sum(not same(a, b) for a, b in itertools.pairwise(cells))
    # Along the way, and where it is not quite the lattice's direction now and then across it.
    assert length / CELLS.length - 1 <= changes <= 1.5 * length / CELLS.length


def changes(cameras: list[Camera], around: Around | None) -> int:
    """How often an animation comes to another cell."""
    cells = [cell_camera(c, CELLS, around) for c in cameras]
    return sum(not same(a, b) for a, b in itertools.pairwise(cells))


def test_far_from_all_things_a_flight_goes_through_fewer_cells():
    camera = Camera("PERSP", np.zeros(3), LEVEL, (-0.36, 0.36, -0.2025, 0.2025), 0.1, 1000.0, 1920, 1080)
    flight = [replace(camera, position=np.array([0.3, y, 60.0])) for y in np.arange(0.0, 400.0, 1.5)]
    ground = np.stack(np.meshgrid(np.arange(-100.0, 100.0, 10.0), np.arange(-100.0, 500.0, 10.0), 0.0), -1)
    low, high = (Around(ground.reshape(-1, 3), np.full(ground.size // 3, height)) for height in (10.0, 55.0))
    assert changes(flight, low) <= changes(flight, None) / 2
    assert changes(flight, high) == changes(flight, None)


@given(RANDOM, st.sampled_from(["PERSP", "PANO"]))
def test_all_cameras_of_a_larger_cell_get_the_same_one_and_things_stay_clear_of_it(rng, kind):
    camera = drawn(rng)
    if kind == "PANO":
        camera = replace(camera, kind=kind, window=(-np.pi, np.pi, -np.pi / 2, np.pi / 2))
    centers, radii = rng.normal(size=(20, 3)) * 300.0, rng.uniform(0.0, 10.0, 20)
    around = Around(centers, radii)
    cell = cell_camera(camera, CELLS, around)
    assume(cell is not None)
    small = cell_camera(camera, CELLS)
    if cell.cell_radius > small.cell_radius:
        away = np.linalg.norm(centers - cell.eye, axis=1) - radii
        assert (away >= CLEAR * cell.cell_radius * (1.0 - 1e-9)).all()
    assert np.linalg.norm(camera.position - cell.eye) <= cell.cell_radius * (1.0 + 1e-9)
    assert float(np.log2(cell.cell_radius / small.cell_radius)).is_integer()
    for _ in range(8):
        other = replace(camera, position=cell.eye + rng.uniform(-1.0, 1.0, 3) * cell.cell_radius)
        shared = cell_camera(other, CELLS, around)
        inside = np.linalg.norm(cell.eye - shared.eye) < 1e-9 * np.linalg.norm(cell.eye)
        assert same(shared, cell) or not inside


def test_what_leaves_the_cell_while_the_shutter_is_open_shares_nothing():
    camera = Camera("PERSP", np.zeros(3), LEVEL, (-0.36, 0.36, -0.2025, 0.2025), 0.1, 100.0, 1920, 1080)
    slow = replace(camera, shutter=(replace(camera, position=np.array([0.05, 0.0, 0.0])),))
    fast = replace(camera, shutter=(replace(camera, position=np.array([9.0, 0.0, 0.0])),))
    spun = replace(camera, shutter=(replace(camera, frame=LEVEL @ turn(np.random.default_rng(0), 0.3)),))
    assert same(cell_camera(slow, CELLS), cell_camera(camera, CELLS))
    assert cell_camera(fast, CELLS) is None
    assert cell_camera(spun, CELLS) is None


def test_wide_windows_and_parts_of_panoramas_share_nothing_whole_panoramas_do():
    wide = Camera("PERSP", np.zeros(3), LEVEL, (-12.0, 12.0, -8.0, 8.0), 0.1, 100.0, 1920, 1080)
    assert cell_camera(wide, CELLS) is None
    sphere = (-np.pi, np.pi, -np.pi / 2, np.pi / 2)
    panorama = Camera("PANO", np.array([0.1, 0.2, 0.3]), LEVEL, sphere, 0.1, 100.0, 512, 256)
    cell = cell_camera(panorama, CELLS)
    assert same(cell, cell_camera(replace(panorama, position=np.array([0.15, 0.2, 0.3])), CELLS))
    points = np.random.default_rng(2).normal(size=(100, 3)) * 50.0
    points = points[np.linalg.norm(points, axis=1) > 12.0]
    assert (cell.extent_around(points) <= panorama.extent_around(points) * 1.05).all()
    assert cell_camera(replace(panorama, window=(-1.0, 1.0, -0.5, 0.5)), CELLS) is None


@pytest.mark.parametrize("opaque", ["tetrahedron", "polygon"])
def test_only_what_is_far_enough_hides_others_from_all_cameras_of_a_cell(opaque):
    camera = Camera("PERSP", np.zeros(3), LEVEL, (-0.36, 0.36, -0.2025, 0.2025), 0.1, 200.0, 640, 360)
    cell = cell_camera(camera, CELLS)
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0]])
    ahead = np.array([0.0, 1.0, 0.0])
    far = 100.0 * ahead + 2.0 * corners

    def seen(distance: float, viewer: Camera) -> float:
        """Transmittance of what is far behind a screen at a distance, both in the middle of the image."""
        screen = distance * (ahead + np.array([[-1.5, 0.0, -1.5], [1.5, 0.0, -1.5], [0.0, 0.0, 2.0]]))
        solid = np.concatenate([screen, (screen.mean(axis=0) + 0.2 * distance * ahead)[None]])
        if opaque == "polygon":
            buffer = Buffers(viewer, 64, screen[None]).fit(None, 1000)
            buffer.add(np.array([0]), far[None], [1.0])
            return float(buffer.transmittance(np.array([0]))[0])
        buffer = AlphaBuffer(viewer, 64)
        buffer.add(np.array([0, 1]), np.array([far, solid[[0, 2, 1, 3]]]), [1.0, np.inf])
        return float(buffer.transmittance(np.array([1, 0]))[0])

    near, beyond = cell.cell_radius, 4.0 * cell.cell_radius + 2.0
    assert seen(near, camera) == pytest.approx(0.0, abs=1e-20)
    assert seen(beyond, camera) == pytest.approx(0.0, abs=1e-20)
    assert seen(near, cell) == pytest.approx(1.0)
    assert seen(beyond, cell) == pytest.approx(0.0, abs=1e-20)
