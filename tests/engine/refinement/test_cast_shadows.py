# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What throws shadows into the view, and from how far; facets of that are finer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.refinement.lights import Light, ShadowReach

#: Looks north from the origin at eye height; a meter beside its axis is out of view near it only.
CAMERA = support.camera([0.0, 0.0, 1.7], [0.0, 10.0, 1.7])


def sun(*direction: float) -> Light:
    vector = np.array(direction, float)
    return Light("SUN", np.zeros(3), vector / np.linalg.norm(vector), 0.01)


def distances(points: list, *lights: Light, floor: float = 0.0) -> np.ndarray:
    places = np.array(points, float)
    return ShadowReach(CAMERA, lights, floor).distance(places, CAMERA.distance_to_view(places))


def test_a_sun_from_behind_throws_shadows_forward_and_no_others() -> None:
    """A tree behind the camera shades the ground ahead with the sun behind it, and never with the sun ahead."""
    crown = [[0.0, -5.0, 8.0]]
    assert distances(crown, sun(0, 1, -0.6))[0] == pytest.approx(9.0, rel=0.5)
    assert np.isinf(distances(crown, sun(0, -1, -0.6))).all()
    assert np.isinf(distances(crown, sun(1, 0, -0.6))).all()


def test_shadows_end_on_the_ground() -> None:
    """With the sun high, what lies beside the view darkens what is below it, not the view's depth underground."""
    outside = [[300.0, 100.0, 6.0]]
    assert np.isinf(distances(outside, sun(-1, 0, -1))).all()
    assert np.isfinite(distances(outside, sun(-1, 0, -0.02))).all()


def test_lamps_throw_shadows_away_from_them() -> None:
    lamp = Light("POINT", np.array([-40.0, 20.0, 3.0]), np.zeros(3))
    assert np.isfinite(distances([[-30.0, 20.0, 2.8]], lamp)).all()
    assert np.isinf(distances([[-50.0, 20.0, 2.8]], lamp)).all()
    assert np.isinf(distances([[-30.0, 20.0, 2.8]], replace(lamp, shadow=False), sun(0, -1, -1))).all()


@given(st.integers(0, 2**31), st.booleans())
@examples(deadline=None, max_examples=20)
def test_no_shadow_falls_less_far_than_the_view_is_away(seed: int, lit: bool) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-60.0, 60.0, (50, 3))
    lights = [sun(*rng.normal(size=3)) for _ in range(2)] if lit else []
    distance_to_view = CAMERA.distance_to_view(points)
    found = ShadowReach(CAMERA, lights, -1.0).distance(points, distance_to_view)
    assert (found >= np.maximum(distance_to_view, 0.0)).all()
    assert (found[distance_to_view <= 0.0] == 0.0).all()


def test_more_lights_never_make_a_shadow_longer() -> None:
    points = np.random.default_rng(1).uniform(-60.0, 60.0, (200, 3))
    one, two = sun(0, 1, -0.3), sun(1, 0.2, -0.2)
    both = distances(list(points), one, two)
    assert (both == np.minimum(distances(list(points), one), distances(list(points), two))).all()
