# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate systems: to millimetres and back, true to shape, and as published."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.errors import SceneError
from tetflora_addon.places.projection import (
    MapOrigin,
    System,
    between,
    from_degrees,
    place_about,
    system_of,
    to_degrees,
)

_A, _F = 6378137.0, 1.0 / 298.257223563
_E2 = _F * (2.0 - _F)


@given(st.floats(-177.0, 177.0), st.floats(-79.0, 83.0), st.floats(-3.0, 3.0))
def test_there_and_back_again(meridian, latitude, off):
    place = np.array([[meridian + off, latitude]])
    zone = int((meridian + 180.0) // 6.0) + 1
    for system in (
        System((32600 if latitude >= 0.0 else 32700) + zone),
        System(3857),
        System(4326),
        System(-1, meridian, latitude),
    ):
        points = from_degrees(system, place)
        assert np.abs(to_degrees(system, points) - place).max() < 1e-9  # a tenth of a millimetre


@given(st.floats(-80.0, 80.0), st.floats(-3.0, 3.0))
def test_transverse_mercator_keeps_angles_and_the_length_of_its_meridian(latitude, off):
    """A small step to the north and one to the east, by the radii of curvature, which are not used there."""
    system, step, phi = System(-1, 0.0, 0.0), 1e-6, np.radians(latitude)
    meridian = _A * (1.0 - _E2) / (1.0 - _E2 * np.sin(phi) ** 2) ** 1.5
    across = _A / np.sqrt(1.0 - _E2 * np.sin(phi) ** 2) * np.cos(phi)
    base = np.array([off, latitude])
    ends = from_degrees(system, base + [[0.0, -step], [0.0, step], [-step, 0.0], [step, 0.0]])
    north = (ends[1] - ends[0]) / (2.0 * np.radians(step) * meridian)
    east = (ends[3] - ends[2]) / (2.0 * np.radians(step) * across)
    assert east == pytest.approx([north[1], -north[0]], abs=1e-6)
    if abs(off) < 1e-3:
        assert np.linalg.norm(north) == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize(
    ("code", "longitude", "latitude", "east", "north"),
    [
        # The CN Tower, as the article on UTM of Wikipedia gives it to the metre.
        (32617, -(79 + 23 / 60 + 13.7 / 3600), 43 + 38 / 60 + 33.24 / 3600, 630_084.0, 4_833_438.0),
        # A quarter of the meridian is 10,001,965.729 m (WGS 84), times .9996.
        (32631, 3.0, 90.0, 500_000.0, 0.9996 * 10_001_965.729),
        (3857, 180.0, 0.0, 20_037_508.343, 0.0),
    ],
)
def test_points_that_others_published(code, longitude, latitude, east, north):
    assert from_degrees(System(code), np.array([[longitude, latitude]]))[0] == pytest.approx([east, north], abs=0.6)


def test_layers_of_different_systems_align():
    """The same places as longitude and latitude and in two zones of UTM, in a scene that began with any of them."""
    places = np.array([[11.99, 48.0], [12.0, 48.01], [12.01, 47.99]])
    layers = [(system, from_degrees(system, places)) for system in (System(4326), System(25832), System(32633))]
    for system, own in layers:
        place = place_about(system, own.min(axis=0), own.max(axis=0))
        found = [place.local(points, other, "x: ") for other, points in layers]
        assert np.abs(found[0] - found[1:]).max() < 1e-3
        assert np.abs(found).max() < 2000.0


def test_what_is_refused_says_what_to_do():
    with pytest.raises(SceneError, match=r"EPSG:31468 is none.*-t_srs"):
        system_of(31468)
    plane, utm = MapOrigin(System(), 0.0, 0.0), MapOrigin(System(32632), 500_000.0, 5_300_000.0)
    for place, system in ((plane, System(4326)), (utm, System())):
        with pytest.raises(SceneError, match="not known; set Coordinate System"):
            place.local(np.zeros((1, 2)), system, "a.csv: ")
    with pytest.raises(SceneError, match=r"a.csv: lies .* km from"):
        utm.local(np.array([[9.0, 20.0]]), System(4326), "a.csv: ")
    with pytest.raises(SceneError, match="no longitude and latitude"):
        place_about(System(4326), np.array([0.0, 90.0]), np.array([0.0, 90.0]))
    assert between(np.ones((1, 2)), System(), System()).tolist() == [[1.0, 1.0]]
