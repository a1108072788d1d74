# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate systems: to millimeters and back, true to shape, and as published."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.errors import SceneError
from tetflora_addon.geodata.projection import (
    MapOrigin,
    System,
    between,
    from_degrees,
    place_about,
    system_in,
    system_of,
    to_degrees,
)

#: By code: longitude and latitude on WGS 84, and coordinates there, by PROJ 9.8.1 without grids.
_TABLE = json.loads((Path(__file__).parents[2] / "data/geodata/projections.json").read_text())
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
        assert np.abs(to_degrees(system, points) - place).max() < 1e-9  # a tenth of a millimeter


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
    ("epsg", "longitude", "latitude", "east", "north"),
    [
        # The CN Tower, as the article on UTM of Wikipedia gives it to the meter.
        (32617, -(79 + 23 / 60 + 13.7 / 3600), 43 + 38 / 60 + 33.24 / 3600, 630_084.0, 4_833_438.0),
        # A quarter of the meridian is 10,001,965.729 m (WGS 84), times .9996.
        (32631, 3.0, 90.0, 500_000.0, 0.9996 * 10_001_965.729),
        (3857, 180.0, 0.0, 20_037_508.343, 0.0),
    ],
)
def test_points_that_others_published(epsg, longitude, latitude, east, north):
    assert from_degrees(System(epsg), np.array([[longitude, latitude]]))[0] == pytest.approx([east, north], abs=0.6)


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
    with pytest.raises(SceneError, match=r"EPSG:31499 is none.*-t_srs.*Plain Meters"):
        system_of(31499)
    plane, utm = MapOrigin(System(), 0.0, 0.0), MapOrigin(System(32632), 500_000.0, 5_300_000.0)
    for place, system in ((plane, System(4326)), (utm, System())):
        with pytest.raises(SceneError, match="not known; set Coordinate System"):
            place.local(np.zeros((1, 2)), system, "a.csv: ")
    with pytest.raises(SceneError, match=r"a.csv: it reaches .* km from"):
        utm.local(np.array([[9.0, 20.0]]), System(4326), "a.csv: ")
    with pytest.raises(SceneError, match="no longitude and latitude"):
        place_about(System(4326), np.array([0.0, 90.0]), np.array([0.0, 90.0]))
    assert between(np.ones((1, 2)), System(), System()).tolist() == [[1.0, 1.0]]


@pytest.mark.parametrize("epsg", _TABLE)
def test_systems_agree_with_a_projection_library(epsg):
    system, rows = System(int(epsg)), np.array(_TABLE[epsg])
    scale = 111_000.0 if system.geographic else system.definition.unit
    found = from_degrees(system, rows[:, :2])
    assert np.abs(found - rows[:, 2:]).max() * scale < 0.1
    assert np.abs(to_degrees(system, found) - rows[:, :2]).max() * 111_000.0 < 0.1


_NAD83 = (
    'GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],'
    'PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]'
)
_TRANSVERSE = (
    'PARAMETER["False_Easting",{}],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",{}],'
    'PARAMETER["Scale_Factor",{}],PARAMETER["Latitude_Of_Origin",{}],UNIT[{}]]'
)


@pytest.mark.parametrize(
    ("text", "epsg"),
    [
        (_NAD83, 4269),
        (
            f'PROJCS["x",{_NAD83},PROJECTION["Transverse_Mercator"],'
            + _TRANSVERSE.format(5e5, -81, 0.9996, 0, '"m",1'),
            26917,
        ),
        (
            'PROJCS["x",GEOGCS["GCS_Deutsches_Hauptdreiecksnetz",DATUM["D_Deutsches_Hauptdreiecksnetz",'
            'SPHEROID["Bessel_1841",6377397.155,299.1528128]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],'
            'PROJECTION["Gauss_Kruger"],' + _TRANSVERSE.format(3.5e6, 9, 1, 0, '"Meter",1.0'),
            31467,
        ),
        ('COMPD_CS["x + height",PROJCS["x",' + _NAD83 + ',AUTHORITY["EPSG","25832"]],VERT_CS["h"]]', 25832),
        ('PROJCRS["x",BASEGEOGCRS["y",DATUM["z",ELLIPSOID["GRS 1980",6378137,298.257222101]]],ID["EPSG",2154]]', 2154),
        ("Projection UTM\nZone 32\nDatum WGS84\nUnits METERS\nParameters\n", 32632),
        ("Projection GEOGRAPHIC\nDatum NAD83\nUnits DD\nParameters\n", 4269),
        (
            "Projection ALBERS\nDatum NAD83\nUnits METERS\nParameters\n 29 30 0.0 /* 1st standard parallel\n"
            " 45 30 0.0 /* 2nd standard parallel\n-96 0 0.0 /* central meridian\n 23 0 0.0 /* latitude of origin\n"
            "0.0 /* false easting\n0.0 /* false northing\n",
            5070,
        ),
        (
            f'PROJCS["x",{_NAD83},PROJECTION["Lambert_Conformal_Conic"],PARAMETER["False_Easting",6561666.666666666],'
            'PARAMETER["False_Northing",1640416.666666667],PARAMETER["Central_Meridian",-120.5],'
            'PARAMETER["Standard_Parallel_1",37.06666666666667],PARAMETER["Standard_Parallel_2",38.43333333333333],'
            'PARAMETER["Latitude_Of_Origin",36.5],UNIT["Foot_US",0.3048006096012192]]',
            2227,
        ),
        ("urn:ogc:def:crs:EPSG::25832", 25832),
        ("http://www.opengis.net/def/crs/EPSG/0/25832", 25832),
        ("http://www.opengis.net/gml/srs/epsg.xml#31467", 31467),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", 4326),
        ("nonsense", 0),
        ("PROJCS[[[[", 0),
    ],
)
def test_systems_by_their_texts(text, epsg):
    assert system_in(text).epsg == epsg


def test_a_system_without_a_code_is_used_by_its_figures():
    """A strip about a meridian of its own, in US feet, as survey offices define them."""
    text = f'PROJCS["own",{_NAD83},PROJECTION["Transverse_Mercator"],' + _TRANSVERSE.format(
        1000.0, -81.3, 1.00002, 40, '"Foot_US",0.3048006096012192'
    )
    system = system_in(text)
    place = np.array([[-81.31, 40.02]])
    own = from_degrees(system, place)
    near = from_degrees(System(-1, -81.3, 40.0), place) * 1.00002 / 0.3048006096012192 + [1000.0, 0.0]
    np.testing.assert_allclose(own, near, atol=1e-3)
    assert not system.metric
    # What lacks figures is no system, but has a unit.
    assert system_in(text.replace('PARAMETER["Central_Meridian",-81.3],', "")) == System(unit=0.3048006096012192)


def test_what_is_too_large_says_how_large_it_is():
    with pytest.raises(SceneError, match=r"a.asc: it is \d+ by 5\d\d km large; choose a Crop, or crop it"):
        place_about(System(4326), np.array([5.0, 45.0]), np.array([15.0, 50.0]), "a.asc: ")
