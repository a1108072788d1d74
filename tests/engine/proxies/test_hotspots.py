# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets are balanced against leaves by light and view, and send back as much in all directions together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.growth.growth import trunks
from tetflora_addon.proxies.hotspots import LightRatios, _balance, balanced_colors, light_ratios, mean_overlap, overlap
from tetflora_addon.refinement.lights import Light

EXTINCTION = st.floats(0.01, 20.0)
SIZE = st.floats(0.005, 1.0)


def test_light_and_eye_share_all_gaps_where_they_are_one_and_none_where_leaves_are_small() -> None:
    assert overlap(np.array([1e4])) == pytest.approx([2.0], abs=1e-3)
    assert overlap(np.array([1e-3])) == pytest.approx([1.0], abs=2e-3)
    a = np.geomspace(1e-3, 1e3, 50)
    assert (np.diff(overlap(a)) > 0).all()


@given(st.floats(0.02, 50.0))
def test_overlap_is_the_integral_of_the_bidirectional_gap_probability(a: float) -> None:
    x = np.linspace(0.0, 30.0, 60_001)
    gap = 2.0 * np.exp(-2.0 * x + a * (1.0 - np.exp(-x / a)))
    assert overlap(np.array([a]))[0] == pytest.approx(np.trapezoid(gap, x), rel=2e-3)


@given(EXTINCTION, SIZE, st.floats(1.0, 30.0))
def test_light_in_all_directions_stays(extinction: float, leaf: float, times: float) -> None:
    psi = (np.arange(4000) + 0.5) / 4000 * np.pi / 2
    chord, one = 2.0 * np.sin(psi / 2), np.ones(len(psi))
    ratio = _balance(chord, extinction * one, leaf * one, times * leaf * one)
    # Facets send by their own overlap; balanced, the mean is theirs.
    own = overlap(0.6 * extinction * times * leaf / np.maximum(chord, 1e-3))
    weight = np.sin(psi) * np.cos(psi)  # through a surface that faces the lamp
    assert (weight * own * ratio).sum() == pytest.approx((weight * own).sum(), rel=0.01)


@given(EXTINCTION, SIZE)
def test_facets_as_large_as_leaves_stay_as_they_are(extinction: float, leaf: float) -> None:
    chord = np.linspace(0.0, 2.0, 20)
    same = np.full(20, leaf)
    assert _balance(chord, np.full(20, extinction), same, same) == pytest.approx(np.ones(20))


def test_near_the_shadow_of_the_eye_large_facets_are_dimmed_and_far_from_it_lightened() -> None:
    chord = 2.0 * np.sin(np.radians([10.0, 80.0]) / 2)
    near, far = _balance(chord, np.full(2, 0.2), np.full(2, 0.18), np.full(2, 0.8))
    assert near < 0.97
    assert far > 1.0


@given(st.floats(0.01, 1.0), st.floats(0.8, 1.2))
def test_colors_stay_colors_and_white_is_changed_least(color: float, hotspot_factor: float) -> None:
    given_, white = np.array([[color] * 3]), np.ones((1, 3))
    out = balanced_colors(given_, np.array([hotspot_factor]))
    assert ((out >= 0.0) & (out <= 1.0)).all()
    if hotspot_factor < 1.0:
        assert (out / given_ <= balanced_colors(white, np.array([hotspot_factor])) + 1e-12).all()
    assert balanced_colors(given_, np.ones(1)) == pytest.approx(given_)


def test_colors_beyond_white_are_changed_as_white_is() -> None:
    hotspot_factor = np.array([0.3])
    assert balanced_colors(np.full((1, 3), 1.2), hotspot_factor) == pytest.approx(
        1.2 * balanced_colors(np.ones((1, 3)), hotspot_factor)
    )


def test_mean_overlap_lies_between() -> None:
    a = np.geomspace(1e-2, 1e2, 30)
    assert (mean_overlap(a) >= overlap(a / np.sqrt(2.0)) - 1e-6).all()
    assert (mean_overlap(a) <= 2.0).all()


def test_the_eye_counts_and_not_where_a_camera_of_several_stands() -> None:
    """A camera that is set back for a view cell sees hotspots as the one in the middle of the cell does."""
    flora = support.small_flora()
    plants = trunks(flora.rows, support.plants([1, 2], position=[(0, 0, 0), (3, 1, 0)]))
    eye = support.camera((0, -8, 2), (0, 0, 2), pixels=64)
    back = replace(eye, position=eye.position + 3.0 * eye.frame[:, 2], setback=3.0, cell_radius=0.1)
    assert back.eye == pytest.approx(eye.eye)
    sun = Light("SUN", np.zeros(3), np.array([0.1, 1.0, -0.2]) / np.linalg.norm([0.1, 1.0, -0.2]))
    ratios = [light_ratios(flora, plants, np.full(2, 0.3), view, (sun,)).hotspot for view in (eye, back)]
    assert ratios[1] == pytest.approx(ratios[0], rel=1e-9)
    assert (ratios[0] != 1.0).all()


def test_a_lamp_lights_each_plant_as_a_sun_from_its_side() -> None:
    flora, place = support.small_flora(), np.array([(0.0, 0.0, 0.0), (3.0, 1.0, 0.0)])
    plants = trunks(flora.rows, support.plants([1, 2], position=place))
    eye, facet, lamp = support.camera((0, -8, 2), (0, 0, 2), pixels=64), np.full(2, 0.3), np.array([4.0, -5.0, 9.0])
    found = light_ratios(flora, plants, facet, eye, (Light("POINT", lamp, np.array([0.0, 0.0, -1.0])),))
    for number, toward in enumerate(found.toward):
        middle = plants.position[number] + 0.5 * plants.length[number] * plants.frame[number, :, 2]
        assert toward == pytest.approx((lamp - middle) / np.linalg.norm(lamp - middle))
        sun = light_ratios(flora, plants, facet, eye, (Light("SUN", np.zeros(3), -toward),))
        assert found.hotspot[number] == pytest.approx(sun.hotspot[number])


@given(st.floats(1.0, 100.0), st.floats(0.0, 1.0))
def test_facets_are_evened_and_send_as_much_light(leaves: float, part: float) -> None:
    cosine = (np.arange(4000) + 0.5) / 4000
    normal = np.stack([np.sqrt(1.0 - cosine**2), 0.0 * cosine, cosine], axis=1)
    lit = LightRatios(np.ones(1), np.array([[0.0, 0.0, 1.0]]), np.array([part]))
    number, color = np.full(len(cosine), leaves), np.full((len(cosine), 3), 0.3)
    ratio = lit.colors(color, np.zeros(len(cosine), np.int64), normal, number)[:, 1] / 0.3
    alone, together = 0.6 + cosine, (0.6 + cosine) * ratio
    assert together.mean() == pytest.approx(alone.mean(), rel=1e-3)
    assert together.std() <= alone.std() * (1.0 - 0.5 * part * (1.0 - 1.0 / leaves)) + 1e-9
    assert (np.diff(together) > 0.0).all()  # what faces the lamp stays the brightest


@given(st.floats(0.3, 1.0), st.floats(1.0, 100.0))
def test_bright_facets_send_as_much_light(bright: float, leaves: float) -> None:
    """None can be brighter than white, so that the brightest leaves are evened less; the mean stays."""
    cosine = (np.arange(4000) + 0.5) / 4000
    normal = np.stack([np.sqrt(1.0 - cosine**2), 0.0 * cosine, cosine], axis=1)
    lit = LightRatios(np.ones(1), np.array([[0.0, 0.0, 1.0]]), np.ones(1))
    color = np.tile([bright, 0.2, 0.1], (len(cosine), 1))
    found = lit.colors(color, np.zeros(len(cosine), np.int64), normal, np.full(len(cosine), leaves))
    light = (0.6 + cosine)[:, None]
    assert (light * found).mean(axis=0) == pytest.approx((light * color).mean(axis=0), rel=2e-3)


def test_leaves_and_facets_without_a_lamp_are_not_evened() -> None:
    normal, number = np.eye(3), np.array([1.0, 50.0, 50.0])
    none = LightRatios(np.ones(2), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), np.array([1.0, 0.0]))
    color = np.full((3, 3), 0.3)
    assert none.colors(color, np.array([0, 1, 1]), normal, number) == pytest.approx(color)
