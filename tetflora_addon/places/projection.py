# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate systems: longitude and latitude, UTM, Web Mercator, and a plane about the middle of some data.

Transverse Mercator is Krüger's series to the fourth order in the third flattening, exact to a micrometre within
3,000 km of the meridian (C. F. F. Karney, "Transverse Mercator with an accuracy of a few nanometers", Journal of
Geodesy 85, 2011, equations 7 to 36). The ellipsoid is WGS 84; those of ETRS89 and NAD83 differ from it
by a tenth of a millimetre.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, readable

#: EPSG code of longitude and latitude, and of Web Mercator.
LONGITUDE_LATITUDE, WEB_MERCATOR = 4326, 3857
_GEOGRAPHIC = {4326, 4258, 4269, 4979}
_MERCATOR = {3857, 900913, 3785}
#: First code, number of zones and first zone of UTM: WGS 84 north and south, ETRS89, NAD83.
_UTM = ((32601, 60, 1, True), (32701, 60, 1, False), (25828, 11, 28, True), (26901, 23, 1, True))

_A, _F = 6378137.0, 1.0 / 298.257223563
_E2 = _F * (2.0 - _F)
_N = _F / (2.0 - _F)
_RADIUS = _A / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_ALPHA = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16 + 41 * _N**4 / 180,
    13 * _N**2 / 48 - 3 * _N**3 / 5 + 557 * _N**4 / 1440,
    61 * _N**3 / 240 - 103 * _N**4 / 140,
    49561 * _N**4 / 161280,
)
_BETA = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440,
    17 * _N**3 / 480 - 37 * _N**4 / 840,
    4397 * _N**4 / 161280,
)
_STEPS = 5  # of Newton's method for the latitude, which doubles the digits each time
_UTM_SCALE, _FALSE_EAST, _FALSE_NORTH = 0.9996, 500_000.0, 10_000_000.0
_MOST_OFF = 40.0  # degrees from the meridian: beyond it nobody has a scene, and series come to an end


@dataclass(frozen=True)
class System:
    """A coordinate system.

    Attributes
    ----------
    code : int
        EPSG; 0 for a plane in metres of which nobody knows where on Earth it lies, -1 for one about a place.
    longitude, latitude : float
        The place, degrees.
    """

    code: int = 0
    longitude: float = 0.0
    latitude: float = 0.0

    @property
    def geographic(self) -> bool:
        """Whether coordinates are longitude and latitude."""
        return self.code in _GEOGRAPHIC

    @property
    def metric(self) -> bool:
        """Whether coordinates are true meters, but for four parts in ten thousand."""
        return not self.geographic and self.code not in _MERCATOR

    @property
    def name(self) -> str:
        """For messages."""
        if self.code > 0:
            return f"EPSG:{self.code}"
        return f"the plane about {self.latitude:.5f}, {self.longitude:.5f}" if self.code else "an unknown system"


def system_of(code: int, what: str = "") -> System:
    """The system of an EPSG code.

    Parameters
    ----------
    what : str
        Begins the message, such as the name of a file.

    Raises
    ------
    SceneError
        It is none of those that are known here; says what to do.
    """
    if code in _GEOGRAPHIC | _MERCATOR or _utm(code):
        return System(code)
    raise SceneError(
        f"{what}EPSG:{code} is none of the coordinate systems that TetFlora reads: longitude and latitude (4326), UTM "
        "(326xx, 327xx, 258xx, 269xx) and Web Mercator (3857). Reproject it, for example with gdalwarp or ogr2ogr and "
        "-t_srs EPSG:326xx, where xx is the UTM zone"
    )


def code_in(text: str) -> int | None:
    """The EPSG code in a name such as ``urn:ogc:def:crs:EPSG::25832``; None where there is none."""
    if re.search(r"CRS84\b", text):
        return LONGITUDE_LATITUDE
    found = re.search(r"EPSG:(?:[\d.]*:)?(\d{4,6})$", text.strip(), re.IGNORECASE)
    return int(found[1]) if found else None


def to_degrees(system: System, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Longitude and latitude in degrees, (n, 2), of points (n, 2) in a system that lies on Earth."""
    points = np.asarray(points, np.float64)
    if system.geographic:
        return points
    if system.code in _MERCATOR:
        x, y = (points / _A).T
        return np.degrees(np.stack([x, np.arctan(np.sinh(y))], axis=1))
    if system.code == -1:
        foot = _forward(np.zeros(1), np.radians([system.latitude]))[1]
        longitude, latitude = _backward(points[:, 0], points[:, 1] + foot)
        return np.degrees(np.stack([longitude, latitude], axis=1)) + [system.longitude, 0.0]
    meridian, north = _utm(system.code)
    x, y = points[:, 0] - _FALSE_EAST, points[:, 1] - (0.0 if north else _FALSE_NORTH)
    longitude, latitude = _backward(x / _UTM_SCALE, y / _UTM_SCALE)
    return np.degrees(np.stack([longitude, latitude], axis=1)) + [meridian, 0.0]


def from_degrees(system: System, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) of a system that lies on Earth, from longitude and latitude in degrees, (n, 2).

    What is too far from the system's meridian is nan.
    """
    points = np.asarray(points, np.float64)
    if system.geographic:
        return points
    longitude, latitude = np.radians(points).T
    if system.code in _MERCATOR:
        return _A * np.stack([longitude, np.arcsinh(np.tan(latitude))], axis=1)
    meridian, north = (system.longitude, True) if system.code == -1 else _utm(system.code)
    off = (points[:, 0] - meridian + 180.0) % 360.0 - 180.0
    x, y = _forward(np.radians(np.where(np.abs(off) < _MOST_OFF, off, np.nan)), latitude)
    if system.code == -1:
        return np.stack([x, y - _forward(np.zeros(1), np.radians([system.latitude]))[1]], axis=1)
    north_of = 0.0 if north else _FALSE_NORTH
    return np.stack([_UTM_SCALE * x + _FALSE_EAST, _UTM_SCALE * y + north_of], axis=1)


def between(points: NDArray[np.float64], source: System, target: System) -> NDArray[np.float64]:
    """Points (n, 2) of one system in another; both lie on Earth, or are the same."""
    return points if source == target else from_degrees(target, to_degrees(source, points))


def _utm(code: int) -> tuple[float, bool] | None:
    """Central meridian in degrees, and whether it is a northern zone; None for other codes."""
    for first, number, zone, north in _UTM:
        if first <= code < first + number:
            return 6.0 * (zone + code - first) - 183.0, north
    return None


def _forward(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Metres east of the meridian and north of the equator; radians."""
    conformal = _conformal(np.tan(latitude))
    cosine = np.cos(longitude)
    xi = np.arctan2(conformal, cosine)
    eta = np.arcsinh(np.sin(longitude) / np.hypot(conformal, cosine))
    along, across = xi, eta
    for j, alpha in enumerate(_ALPHA, 1):
        along = along + alpha * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        across = across + alpha * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    return _RADIUS * across, _RADIUS * along


def _backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Longitude from the meridian and latitude in radians, of metres east and north."""
    along, across = y / _RADIUS, x / _RADIUS
    xi, eta = along, across
    for j, beta in enumerate(_BETA, 1):
        xi = xi - beta * np.sin(2 * j * along) * np.cosh(2 * j * across)
        eta = eta - beta * np.cos(2 * j * along) * np.sinh(2 * j * across)
    wanted = np.sin(xi) / np.hypot(np.sinh(eta), np.cos(xi))
    tangent = wanted / (1.0 - _E2)
    for _ in range(_STEPS):
        found = _conformal(tangent)
        slope = (1.0 + (1.0 - _E2) * tangent**2) / ((1.0 - _E2) * np.hypot(1.0, found) * np.hypot(1.0, tangent))
        tangent = tangent + (wanted - found) * slope
    return np.arctan2(np.sinh(eta), np.cos(xi)), np.arctan(tangent)


def _conformal(tangent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tangent of the conformal latitude, from that of the geographic one (Karney, equations 7 to 9)."""
    e = np.sqrt(_E2)
    sigma = np.sinh(e * np.arctanh(e * tangent / np.hypot(1.0, tangent)))
    return tangent * np.hypot(1.0, sigma) - sigma * np.hypot(1.0, tangent)


@dataclass(frozen=True)
class MapOrigin:
    """Where on a map the world's origin is.

    Attributes
    ----------
    system : System
    east, north : float
        Coordinates of the origin in the system.
    """

    system: System
    east: float
    north: float

    def local(self, points: NDArray[np.float64], system: System, what: str) -> NDArray[np.float64]:
        """Metres from the origin, (n, 2), of points (n, 2) of a system.

        Raises
        ------
        SceneError
            Nobody can tell where they lie, or they are too far away; ``what`` begins the message.
        """
        if system != self.system and 0 in (system.code, self.system.code):
            known, other = ("the scene", "the file") if system.code == 0 else ("the file", "the scene")
            raise SceneError(
                f"{what}{known} lies on Earth, and the coordinate system of {other} is not known; set Coordinate "
                "System to its EPSG code, or turn on New Origin"
            )
        local = between(points, system, self.system) - [self.east, self.north]
        far = np.abs(local).max(initial=0.0)
        if not far < MOST_AWAY:
            raise SceneError(
                f"{what}lies {far / 1000.0:,.0f} km from what was imported before; set Coordinate System to the EPSG "
                "code of the file, or turn on New Origin"
                if np.isfinite(far)
                else f"{what}lies too far from what was imported before; turn on New Origin"
            )
        return local


#: Metres from the origin within which all of a scene must lie.
MOST_AWAY = 250_000.0


def place_about(system: System, low: NDArray[np.float64], high: NDArray[np.float64], what: str = "") -> MapOrigin:
    """The place for a scene whose first data lie between two corners, (2,) each; in whole metres.

    Raises
    ------
    SceneError
        They are no places on Earth.
    """
    middle = (np.asarray(low, np.float64) + high) / 2.0
    if system.metric:
        east, north = np.round(middle).tolist()
        return MapOrigin(system, east, north)
    longitude, latitude = np.round(to_degrees(system, middle[None])[0], 6).tolist()
    if not (abs(longitude) <= 360.0 and abs(latitude) < 89.0):
        raise SceneError(readable(f"{what}{longitude:g}, {latitude:g} is no longitude and latitude with room about it"))
    return MapOrigin(System(-1, longitude, latitude), 0.0, 0.0)
