# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Margins for depth of field and motion blur: what an open lens or a moving camera sees is within them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.camera.camera import MOST, blur_margins, circle_of_confusion
from tetflora_addon.refinement.polygons import Polygons
from tetflora_addon.refinement.shared_parts import AssetParts
from tetflora_addon.refinement.visibility import widened_for

CAMERA = support.camera((0, 0, 0), (0, 10, 0), pixels=1000, view=1.0, near=0.05)
SPHERES = np.array([[0.0, 4.0, 0.0], [0.0, 40.0, 3.0], [1.0, 200.0, 0.0]]), np.array([1.0, 5.0, 20.0])


def test_a_sharp_still_picture_has_no_margins() -> None:
    assert blur_margins(CAMERA, *SPHERES) == (0.0, 0.0)
    assert blur_margins(replace(CAMERA, lens_radius=0.1, focus=5.0), np.zeros((0, 3)), np.zeros(0)) == (0.0, 0.0)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@given(st.floats(0.5, 50), st.floats(0.5, 300), st.floats(0.001, 0.1), st.integers(0, 2**31))
@settings(deadline=None, max_examples=30)
def test_circles_are_those_of_rays_through_the_lens(
    kind: str, focus: float, depth: float, radius: float, seed: int
) -> None:
    """A ray from a point through the rim of the lens is where the sharp point of the window is that far away."""
    camera = replace(CAMERA, kind=kind, lens_radius=radius, focus=focus)
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    rim = radius * np.array([np.cos(angle), np.sin(angle)])
    # The middle of the image's ray starts at the rim and crosses the axis at the depth that is sharp.
    at_depth = rim * (1 - depth / focus)
    shift = np.linalg.norm(at_depth) / (1.0 if kind == "ORTHO" else depth)
    assert circle_of_confusion(camera, np.array([depth]))[0] == pytest.approx(shift, rel=1e-9, abs=1e-12)


@given(st.integers(0, 2**31), st.floats(1, 60))
@settings(deadline=None, max_examples=40)
def test_what_the_open_lens_sees_is_in_the_wider_view(seed: int, focus: float) -> None:
    rng = np.random.default_rng(seed)
    camera = replace(CAMERA, lens_radius=0.03, focus=focus)
    center = rng.uniform([-20, 2, -20], [20, 60, 20], (30, 3))
    reach = rng.uniform(0.1, 2.0, 30)
    wide = camera.widened(*blur_margins(camera, center, reach))
    points = center + reach[:, None] * rng.normal(size=(30, 3)) / 4
    # A point is blurred over a disc of the window; where that meets the image, the point must be in the wider one.
    x, y, depth = camera.to_camera_space(points).T
    left, right, bottom, top = camera.window
    disc = circle_of_confusion(camera, depth)
    into = (depth > camera.near) & (x / depth > left - disc) & (x / depth < right + disc)
    into &= (y / depth > bottom - disc) & (y / depth < top + disc)
    into &= np.linalg.norm(points - center, axis=1) <= reach
    pixel = 0.51 * camera.pixel_size * depth  # margins are whole pixels
    assert (wide.distance_to_view(points)[into] <= pixel[into]).all()


@given(st.integers(0, 2**31))
@settings(deadline=None, max_examples=40)
def test_what_a_moving_camera_sees_is_in_the_wider_view(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = np.deg2rad(rng.uniform(-4, 4))
    turned = CAMERA.frame @ np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    other = replace(CAMERA, position=rng.uniform(-0.3, 0.3, 3), frame=turned)
    camera = replace(CAMERA, shutter=(other,))
    center, reach = rng.uniform([-3, 8, -3], [3, 60, 3], (30, 3)), rng.uniform(0.1, 2.0, 30)
    margins = blur_margins(camera, center, reach)
    assert 0 <= max(margins) < MOST  # 0 where the camera moves ahead, and sees less and less
    wide = camera.widened(*margins)
    inside = other.distance_to_view(center) < 0
    pixel = 0.51 * camera.pixel_size * np.linalg.norm(center, axis=1)
    # Only what the camera itself sees sets the range of depths.
    depth = camera.to_camera_space(center)[:, 2]
    seen = camera.distance_to_view(center) < reach
    inside &= (depth >= (depth - reach)[seen].min()) & (depth <= (depth + reach)[seen].max()) if seen.any() else False
    assert (wide.distance_to_view(center)[inside] <= pixel[inside]).all()


def test_a_camera_that_turns_fast_gets_no_more_than_the_most() -> None:
    back = replace(CAMERA, frame=CAMERA.frame @ np.diag([-1.0, 1.0, -1.0]))
    assert blur_margins(replace(CAMERA, shutter=(back,)), *SPHERES) == (MOST, MOST)
    close = replace(CAMERA, lens_radius=1.0, focus=100.0)
    assert max(blur_margins(close, np.array([[0.0, 0.3, 0.0]]), np.array([0.2]))) == MOST


def test_the_view_is_widened_by_the_lens() -> None:
    flora, seeds = support.small_flora(), support.grove(9, 2.0)
    camera = support.camera((0, -14, 3), (0, 0, 1.5), pixels=256)
    plants = support.trunks(flora.rows, seeds)
    others = Polygons.empty(), AssetParts.empty()
    sharp = widened_for(camera, 0.04, flora, plants, *others)
    assert sharp.window == camera.widened(0.04).window
    blurred = widened_for(replace(camera, lens_radius=0.2, focus=4.0), 0.04, flora, plants, *others)
    assert blurred.width > sharp.width
    assert blurred.pixel_size == pytest.approx(sharp.pixel_size)
