# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramas against rays cast all around the eye, one for each pixel of the equirectangular image."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.engine import support
from tests.engine.refinement.test_loop import check, run
from tetflora_addon.camera.camera import Camera, expected_pixels
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.rasterize import pixel_rays
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.refinement.visibility import _PanoramaBuffer, face_cameras, pixels_per_solid_angle
from tetflora_addon.tetrahedra.roots import world_root

SPHERE = (-np.pi, np.pi, -np.pi / 2, np.pi / 2)
PART = (-1.3, 0.4, -0.3, 0.8)
EYE = np.array([0.31, 0.17, 1.23])


def panorama(window: tuple[float, ...] = SPHERE, width: int = 256, height: int = 128) -> Camera:
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return Camera("PANO", EYE, turn, window, 0.01, 1000.0, width, height)


def rays(camera: Camera) -> NDArray[np.float64]:
    """Directions through the pixels of the image, as Cycles has them: columns are longitudes, rows latitudes."""
    left, right, bottom, top = camera.window
    longitude = left + (np.arange(camera.width) + 0.5) * (right - left) / camera.width
    latitude = bottom + (np.arange(camera.height) + 0.5) * (top - bottom) / camera.height
    latitude, longitude = (a.ravel() for a in np.meshgrid(latitude, longitude, indexing="ij"))
    local = [np.cos(latitude) * np.sin(longitude), np.sin(latitude), -np.cos(latitude) * np.cos(longitude)]
    return np.stack(local, axis=1) @ camera.frame.T


def cells_around(number: int, seed: int = 0) -> tuple[NDArray, NDArray]:
    """Tetrahedra around the eye, some of which hold it, and their ranks."""
    rng = np.random.default_rng(seed)
    tree = world_root([[-3, -3, -1], [3, 3, 4]])
    while len(tree.terminals()) < number:
        nodes = tree.terminals()
        tree.split(nodes[rng.uniform(size=len(nodes)) < 0.5])
    nodes = tree.terminals()
    return tree.vertices(nodes), tree.order(EYE)[nodes]


def cast(vertices: NDArray, extinction: NDArray, camera: Camera) -> tuple[NDArray, NDArray]:
    """Pixels and transmittance by rays that meet all cells, sorted by distance."""
    directions, planes = rays(camera), support.face_planes(vertices)
    count, seen = np.zeros((2, len(vertices)))
    above = planes[..., :3] @ camera.position + planes[..., 3]
    for part in np.array_split(directions, 64):
        slope = np.einsum("cfi,ri->rcf", planes[..., :3], part)
        distance = -above / np.where(slope == 0, 1.0, slope)
        start = np.maximum(np.where(slope < 0, distance, -np.inf).max(-1), camera.near)
        end = np.where(slope > 0, distance, np.inf).min(-1)
        length = np.maximum(end - start, 0.0)
        order = np.argsort(np.where(length > 0, start, np.inf), axis=1)
        depth = np.take_along_axis(length * extinction, order, axis=1)
        before = np.zeros_like(depth)
        np.put_along_axis(before, order, np.cumsum(depth, axis=1) - depth, axis=1)
        count += (length > 0).sum(0)
        seen += (np.exp(-before) * (length > 0)).sum(0)
    return count, seen / np.maximum(count, 1)


@pytest.mark.parametrize("window", [SPHERE, PART])
def test_a_random_scene_agrees_with_rays(window: tuple[float, ...]) -> None:
    camera = panorama(window)
    vertices, rank = cells_around(120)
    extinction = np.random.default_rng(2).choice([0.0, 0.3, 1.5], len(vertices))
    buffer = _PanoramaBuffer(camera, 128)
    outline = buffer.add(np.arange(len(vertices)), vertices, extinction)
    seen = buffer.transmittance(rank)
    pixels, wanted = cast(vertices, extinction, camera)
    large = pixels > 0.002 * pixels.sum()
    assert large.sum() > 20
    # Beyond 84 degrees of latitude pixels are not counted as they crowd.
    upright = np.abs(camera.longitude_latitude(camera.to_camera_space(vertices.mean(axis=1)))[1]) < 1.0
    assert outline.pixels[large & upright] == pytest.approx(pixels[large & upright], rel=0.25)
    assert np.average(np.abs(seen - wanted), weights=pixels) < 0.02
    assert (outline.pixels[pixels == 0] < 0.002 * pixels.sum()).all()


@pytest.mark.parametrize("window", [SPHERE, PART])
def test_pixels_are_those_of_the_image(window: tuple[float, ...]) -> None:
    """Six faces fill the sphere once, and what their pixels are worth is all of the image."""
    camera = panorama(window)
    side = 200
    solid, pixel_weight = 0.0, 0.0
    for face in face_cameras(camera, side):
        directions = pixel_rays(face, side, side)[1]
        angle = (2 / side) ** 2 * (directions @ -face.frame[:, 2]) ** 3
        solid += angle.sum()
        pixel_weight += (angle * pixels_per_solid_angle(camera, directions)).sum()
        assert np.linalg.det(face.frame) == pytest.approx(1.0)
    assert solid == pytest.approx(4 * np.pi, rel=1e-3)
    assert pixel_weight == pytest.approx(camera.width * camera.height, rel=0.04)


def test_clearance_is_positive_beside_the_image_only() -> None:
    camera = panorama(PART)
    points = EYE + np.random.default_rng(3).normal(size=(2000, 3)) * 5
    longitude, latitude = camera.longitude_latitude(camera.to_camera_space(points))
    inside = (longitude > -1.3) & (longitude < 0.4) & (latitude > -0.3) & (latitude < 0.8)
    assert np.array_equal(camera.distance_to_view(points) < 0, inside)
    # Never more than the distance from a point in the image.
    shown = EYE + rays(camera)[::37] * 6
    beside = points[~inside]
    distance = np.linalg.norm(beside[:, None] - shown, axis=-1).min(axis=1)
    assert (camera.distance_to_view(beside) <= distance + 1e-9).all()
    assert (panorama().distance_to_view(points) < 0).all()


def test_widened_panoramas_end_at_the_poles() -> None:
    whole = panorama().widened(0.1)
    assert (whole.window, whole.width, whole.height) == (pytest.approx(SPHERE), 256, 128)
    part = panorama(PART, 200, 100)
    wide = part.widened(0.1)
    assert (wide.width, wide.height) == (240, 120)
    assert wide.window == pytest.approx((-1.47, 0.57, -0.41, 0.91))
    assert wide.pixel_size == pytest.approx(part.pixel_size)
    high = panorama((-1.0, 1.0, 0.0, 1.5), 200, 150).widened(0.2)
    assert high.window[3] <= np.pi / 2


def test_expected_pixels_are_about_those_of_rays() -> None:
    camera = panorama()
    vertices, _ = cells_around(300)
    pixels, whole = expected_pixels(vertices, camera)
    counted, _ = cast(vertices, np.zeros(len(vertices)), camera)
    assert whole.all()
    away = np.linalg.norm(vertices.mean(axis=1) - EYE, axis=1) > 2.0
    some = away & (counted > 20)
    assert some.sum() > 50
    assert np.median(np.abs(np.log(pixels[some] / counted[some]))) < 0.2


@pytest.mark.parametrize("window", [SPHERE, PART])
def test_a_grove_all_around(window: tuple[float, ...]) -> None:
    """Nothing is lost; with the whole sphere, nothing that stands free is hidden, wherever it is."""
    flora = support.small_flora()
    angle = np.arange(10) * 2 * np.pi / 10
    place = np.stack([8 * np.cos(angle), 8 * np.sin(angle), 0 * angle], axis=1)
    seeds = support.plants(np.arange(10), position=place)
    camera = panorama(window, 1024, 512)
    _, result = run(flora, seeds, camera)
    check(flora, seeds, result)
    middle = result.tree.vertices(result.nodes).mean(axis=1)
    explicit = result.decision == Decision.EXPLICIT
    sectors = np.unique(((np.arctan2(middle[:, 1], middle[:, 0]) + np.pi / 10) // (np.pi / 5))[explicit])
    assert (len(sectors) >= 10) == (window == SPHERE)
    assert explicit.any()
    if window == PART:
        many = result.totals.polygons > RefinementSettings().few_polygons
        assert (result.decision[many & (camera.distance_to_view(middle) > 3.0)] == Decision.HIDDEN).all()
