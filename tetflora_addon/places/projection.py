# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate systems: any projected one by its EPSG code, longitude and latitude, and a plane about the middle of data.

Figures of systems, ellipsoids and shifts of datums are in ``systems.json``, those of the EPSG Dataset (IOGP) as PROJ
9.8 gives them; a shift is the first without a grid in the middle of a system's area, good to some metres at worst.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, readable
from . import table
from .methods import TRUE, Definition, Ellipsoid

#: EPSG code of longitude and latitude, and of Web Mercator.
LONGITUDE_LATITUDE, WEB_MERCATOR = 4326, 3857
#: What stands for a plane in metres in place of a code.
PLAIN = -1
_HEIGHTS = {4937: 4258}  # systems with heights, by those without


@dataclass(frozen=True)
class System:
    """A coordinate system.

    Attributes
    ----------
    code : int
        EPSG; 0 for a plane in metres of which nobody knows where on Earth it lies, -1 for one about a place, -2 for one
        that a file defines by itself.
    longitude, latitude : float
        The place, degrees.
    own : Definition, optional
        Of the file.
    unit : float
        Metres of plain coordinates, or of those that are taken for meters of the system.
    """

    code: int = 0
    longitude: float = 0.0
    latitude: float = 0.0
    own: Definition | None = field(default=None, repr=False)
    unit: float = 1.0

    @property
    def definition(self) -> Definition:
        """Figures of a system that lies on Earth."""
        if self.own is not None:
            return self.own
        if self.code == -1:
            return _about(self.longitude, self.latitude)
        return known_systems()[self.code]

    @property
    def geographic(self) -> bool:
        """Whether coordinates are longitude and latitude."""
        return self.code != 0 and self.definition.method == "geo"

    @property
    def metric(self) -> bool:
        """Whether coordinates are true meters, but for some parts in a thousand."""
        return self.code == -1 or (self.code > 0 and self.definition.method in TRUE and self.definition.unit == 1.0)

    @property
    def name(self) -> str:
        """For messages."""
        if self.code > 0:
            return f"EPSG:{self.code}"
        return {
            0: "plain meters" if self.unit == 1.0 else f"plain units of {self.unit:g} m",
            -2: "the system that the file defines",
        }.get(self.code, f"the plane about {self.latitude:.5f}, {self.longitude:.5f}")


@cache
def _about(longitude: float, latitude: float) -> Definition:
    """Transverse Mercator about a place."""
    return Definition("tm", parameters=(latitude, longitude, 1.0, 0.0, 0.0))


@cache
def known_systems() -> dict[int, Definition]:
    """All systems that have an EPSG code here."""
    data = table("systems")
    ellipsoids, shifts = [Ellipsoid(*e) for e in data["ellipsoids"]], [tuple(s) for s in data["shifts"]]
    found = {}
    for method, ellipsoid, shift, meridian, unit, rows in data["systems"]:
        own = Definition(method, ellipsoids[ellipsoid], shifts[shift], meridian, data["units"][unit])
        for parameters, codes, *run in rows:
            number, step = run or (1, [0.0] * len(parameters))
            for k in range(number):
                figures = tuple(round(a + k * b, 9) for a, b in zip(parameters, step, strict=True))
                found.update(dict.fromkeys([code + k for code in codes], replace(own, parameters=figures)))
    return found | {code: found[flat] for code, flat in _HEIGHTS.items()}


def system_of(code: int, what: str = "") -> System:
    """The system of an EPSG code, if it is known here."""
    if code in known_systems():
        return System(code)
    raise SceneError(
        f"{what}EPSG:{code} is none of the coordinate systems that TetFlora reads. Set Coordinate System to another "
        "code, reproject the file, for example with gdalwarp or ogr2ogr and -t_srs EPSG:4326, or turn on Plain Meters"
    )


def chosen_system(code: int, own: System, what: str) -> System:
    """The system of what an artist chose, which is an EPSG code, `PLAIN`, or 0 for the file's own."""
    return System() if code == PLAIN else system_of(code or own.code, what) if code or own.code > 0 else own


def may_be_degrees(points: ArrayLike) -> bool:
    """Whether points (n, 2), of which there is one at least, can be longitude and latitude."""
    points = np.array(points, np.float64).reshape(-1, 2)
    return bool(len(points) and (np.abs(points) <= [360.0, 90.0]).all())


def code_in(text: str) -> int | None:
    """The EPSG code in a name such as ``urn:ogc:def:crs:EPSG::25832`` or an address; None where there is none."""
    if re.search(r"CRS84h?\b", text):
        return LONGITUDE_LATITUDE
    found = re.search(r"\bEPSG\b[^\w]{1,2}(?:[\d.]*[:/#])?(?:[a-z]+#)?(\d{4,6})\W*$", text.strip(), re.IGNORECASE)
    found = found or re.search(r"\bepsg\.xml#(\d{4,6})$|/epsg/(\d{4,6})/?$|\bEPSG:(\d{4,6})\b", text, re.IGNORECASE)
    return int(next(filter(None, found.groups()))) if found else None


def to_degrees(system: System, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Longitude and latitude on WGS 84 in degrees, (n, 2), of points (n, 2) in a system that lies on Earth."""
    points, own = system.unit * np.asarray(points, np.float64), system.definition
    if own.method == "geo" and not any(own.shift):
        return points
    _, back, meridian = own.ways
    longitude, latitude = back(*points.T)
    return np.degrees(np.stack(own.to_wgs84(longitude + np.radians(meridian), latitude), axis=1))


def from_degrees(system: System, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) of a system that lies on Earth, from longitude and latitude in degrees on WGS 84, (n, 2).

    What is too far from the system's meridian is nan.
    """
    points, own = np.asarray(points, np.float64), system.definition
    if own.method == "geo" and not any(own.shift):
        return points
    longitude, latitude = own.from_wgs84(*np.radians(points).T)
    there, _, meridian = own.ways
    off = longitude - np.radians(meridian)
    off = np.where(np.abs(off) <= np.pi, off, (off + np.pi) % (2.0 * np.pi) - np.pi)
    return np.stack(there(off, latitude), axis=1) / system.unit


def between(points: NDArray[np.float64], source: System, target: System) -> NDArray[np.float64]:
    """Points (n, 2) of one system in another; both lie on Earth, or both are plain."""
    if source == target or source.code == target.code == 0:
        return points * (source.unit / target.unit)
    return from_degrees(target, to_degrees(source, points))


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
        """Metres from the origin, (n, 2), of points (n, 2) of a system."""
        local = self.offsets(points, system, what)
        far = np.abs(local).max(initial=0.0)
        if not far < MOST_AWAY:
            away = f"{far / 1000.0:,.0f} km" if np.isfinite(far) else "too far"
            raise SceneError(
                f"{what}it reaches {away} from the middle of the scene; set Coordinate System to the EPSG code of the "
                "file, or turn on New Origin to put it in the middle by itself"
            )
        return local

    def offsets(self, points: NDArray[np.float64], system: System, what: str) -> NDArray[np.float64]:
        """Metres from the origin, (n, 2), of points (n, 2) of a system, however far."""
        if (system.code == 0) != (self.system.code == 0):
            known, other = ("the scene", "the file") if system.code == 0 else ("the file", "the scene")
            raise SceneError(
                f"{what}{known} lies on Earth, and the coordinate system of {other} is not known; set Coordinate "
                "System to its EPSG code, or turn on New Origin"
            )
        return between(points, system, self.system) - [self.east, self.north]


#: Metres from the origin within which all of a scene must lie.
MOST_AWAY = 250_000.0


def place_about(system: System, low: NDArray[np.float64], high: NDArray[np.float64], what: str = "") -> MapOrigin:
    """The place for a scene whose first data lie between two corners, (2,) each; in whole metres."""
    middle = (np.asarray(low, np.float64) + high) / 2.0
    if system.metric or system.code == 0:
        east, north = np.round(system.unit * middle).tolist()
        place = MapOrigin(system if system.code else System(), east, north)
    else:
        longitude, latitude = np.round(to_degrees(system, middle[None])[0], 6).tolist()
        if not (abs(longitude) <= 360.0 and abs(latitude) < 89.0):
            raise SceneError(
                readable(f"{what}{longitude:g}, {latitude:g} is no longitude and latitude with room about it")
            )
        place = MapOrigin(System(-1, longitude, latitude), 0.0, 0.0)
    sides = between(
        np.array([[low[0], middle[1]], [high[0], middle[1]], [middle[0], low[1]], [middle[0], high[1]]]),
        system,
        place.system,
    )
    width, depth = np.linalg.norm(sides[1::2] - sides[::2], axis=1) / 1000.0
    if not max(width, depth) < 2.0 * MOST_AWAY / 1000.0:
        raise SceneError(
            f"{what}it is {width:,.0f} by {depth:,.0f} km large; choose a Crop, or crop it to "
            f"{MOST_AWAY / 500.0:,.0f} km or less"
        )
    return place
