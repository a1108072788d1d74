# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as the engine sees it: what is in view, how far beside it, and a wider one that sees the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.proxies.microsurfaces import Facets, pushed_outside_view

KINDS = ("PERSP", "ORTHO")


def _camera(kind):
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return Camera(kind, np.array([3.0, -2.0, 1.0]), turn, (-0.4, 0.6, -0.3, 0.2), 0.1, 100.0, 200, 100)


def _world(camera, x, y, depth):
    return camera.position + np.stack([x, y, -depth], axis=-1) @ camera.frame.T


@pytest.mark.parametrize("kind", KINDS)
def test_clearance_is_the_distance_from_the_view(kind):
    camera = _camera(kind)
    random = np.random.default_rng(1)
    depth = random.uniform(0.5, 20, 500)
    scale = depth if kind == "PERSP" else np.ones(500)
    x, y = random.uniform(-0.4, 0.6, 500) * scale, random.uniform(-0.3, 0.2, 500) * scale
    assert (camera.distance_to_view(_world(camera, x, y, depth)) <= 1e-9).all()
    # Points beside one wall, at a distance along that wall's normal.
    away = random.uniform(0.1, 3, 500)
    slope = 0.6 if kind == "PERSP" else 0.0
    normal = np.array([1.0, -slope]) / np.hypot(1.0, slope)
    beside = _world(camera, 0.6 * scale + away * normal[0], np.zeros(500), depth + away * normal[1])
    assert camera.distance_to_view(beside) == pytest.approx(away)


def test_what_is_behind_the_eye_is_out_of_view():
    camera = _camera("PERSP")
    behind = _world(camera, np.zeros(5), np.zeros(5), -np.arange(1.0, 6.0))
    assert (camera.distance_to_view(behind) > 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_widened_camera_keeps_its_pixels(kind):
    camera = _camera(kind)
    wide = camera.widened(0.05)
    assert (wide.width, wide.height) == (220, 110)
    assert wide.pixel_size == pytest.approx(camera.pixel_size)
    assert wide.window == pytest.approx((-0.45, 0.65, -0.325, 0.225))
    same = camera.widened(0.0)
    assert (same.window, same.width, same.height) == (camera.window, camera.width, camera.height)


@pytest.mark.parametrize("stretch", [None, 3.0])
def test_facets_beside_the_view_do_not_reach_into_it(stretch):
    camera = _camera("PERSP")
    random = np.random.default_rng(2)
    n = 300
    depth = random.uniform(1, 20, n)
    # The middles of some are in the view, however they got there.
    center = _world(camera, (0.6 + random.uniform(-0.3, 0.5, n)) * depth, np.zeros(n), depth)
    a, b = np.linalg.qr(random.normal(size=(n, 3, 2)))[0].transpose(2, 0, 1)
    facets = Facets(center, a, b, random.uniform(0.5, 4, n), np.zeros((n, 3)), np.zeros(n))
    facets = replace(facets, stretch=None if stretch is None else np.full(n, stretch))
    shrunk = support.facet_mesh(pushed_outside_view(facets, camera.distance_to_view))
    assert camera.distance_to_view(support.facet_mesh(facets).positions.astype(float)).min() < -0.1  # they did reach in
    assert camera.distance_to_view(shrunk.positions.astype(float)).min() > -1e-4
    same = pushed_outside_view(facets, lambda points: np.full(len(points), np.inf))
    assert (same.side == facets.side).all()


@given(st.integers(1, 5000), st.integers(1, 5000), st.integers(1, 2000))
def test_a_smaller_camera_sees_the_same(width, height, most):
    camera = replace(_camera("PERSP"), width=width, height=height)
    smaller = replace(camera, shutter=(camera,)).smaller(most)
    assert max(smaller.width, smaller.height) <= max(most, 1)
    assert smaller.window == camera.window
    assert (smaller.width, smaller.height) == (smaller.shutter[0].width, smaller.shutter[0].height)
    if max(width, height) <= most:
        assert (smaller.width, smaller.height) == (width, height)
