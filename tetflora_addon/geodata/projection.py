# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate systems: any projected one by its EPSG code, longitude and latitude, and a plane about the middle of data.

Figures of systems, ellipsoids and shifts of datums are in ``systems.json``, those of the EPSG Dataset (IOGP) as PROJ
9.8 gives them; a shift is the first without a grid in the middle of a system's area, good to some meters at worst.

Names of parameters are those of IOGP Publication 373-7-2 (2023), where the formulas stand in real numbers. Here a place
is one complex number: isometric latitude + i longitude on the ellipsoid, and north + i east on the map. What keeps
angles is an analytic function then, and its way back the inverse function. Transverse Mercator is Krüger's series to
the fourth order in the third flattening, exact to a micrometer within 3,000 km of the meridian (C. F. F. Karney,
"Transverse Mercator with an accuracy of a few nanometers", Journal of Geodesy 85, 2011, equations 7 to 36). In methods
angles are radians, and longitudes count from their own meridian.

Files tell systems in well-known text of both kinds, ArcInfo's older words and keys of GeoTIFF. What is described in
full becomes the system of the EPSG code that has the same figures, or one by itself.
"""

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from math import asin, atan2, cos, degrees, exp, inf, isclose, isfinite, log, sin, sqrt, tan, tanh
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats
from ..errors import SceneError, readable
from . import table

#: EPSG code of longitude and latitude, and what stands for a plane in meters in place of a code.
LONGITUDE_LATITUDE, PLAIN = 4326, -1
_HEIGHTS = {4937: 4258}  # systems with heights, by those without
_Pair = tuple[Floats, Floats]
_Way = Callable[[NDArray[np.complex128]], NDArray[np.complex128]]
_STEPS = 5  # of Newton's method for latitudes, which doubles the digits each time
_ROUNDS = 7  # each of which leaves a 150th of the error
_HALF_PI = np.pi / 2.0
#: Degrees from the meridian: beyond it nobody has a scene, and series come to an end.
MOST_OFF = 40.0


@dataclass(frozen=True)
class Ellipsoid:
    """Half of the longer axis in meters, and the inverse of the flattening."""

    a: float = 6378137.0
    inverse: float = 298.257223563

    @cached_property
    def e2(self) -> float:
        """Square of the eccentricity."""
        f = 1.0 / self.inverse
        return f * (2.0 - f)

    @cached_property
    def e(self) -> float:
        """Eccentricity."""
        return sqrt(self.e2)

    def isometric(self, latitude: Floats) -> Floats:
        """Isometric latitude."""
        return np.arcsinh(np.tan(latitude)) - self.e * np.arctanh(self.e * np.sin(latitude))

    def of_isometric(self, psi: Floats) -> Floats:
        """Latitude from `isometric`."""
        phi = np.zeros_like(psi)
        for _ in range(_ROUNDS):
            phi = np.arctan(np.sinh(psi + self.e * np.arctanh(self.e * np.sin(phi))))
        return phi

    def cosine(self, latitude: float) -> float:
        """Radius of a parallel, over the longer half-axis."""
        return cos(latitude) / sqrt(1.0 - self.e2 * sin(latitude) ** 2)

    def authalic(self, latitude: Floats) -> Floats:
        """Twice the area between equator and parallel, over what a radian has of it on a sphere."""
        s = np.sin(latitude)
        return (1.0 - self.e2) * (s / (1.0 - self.e2 * s * s) + np.arctanh(self.e * s) / self.e)

    def of_authalic(self, q: Floats) -> Floats:
        """Latitude from `authalic`."""
        phi = np.arcsin(np.clip(q / self.authalic(np.array(_HALF_PI)), -1.0, 1.0))
        for _ in range(_STEPS):
            slope = 2.0 * (1.0 - self.e2) * np.cos(phi) / (1.0 - self.e2 * np.sin(phi) ** 2) ** 2
            phi = phi + (q - self.authalic(phi)) / np.maximum(slope, 1e-9)
        return phi

    def at(self, longitude: Floats, latitude: Floats) -> Floats:
        """Places (n, 3) on the ellipsoid, meters from the middle of the Earth."""
        nu = self.a / np.sqrt(1.0 - self.e2 * np.sin(latitude) ** 2)
        flat = nu * np.cos(latitude)
        up = nu * (1.0 - self.e2) * np.sin(latitude)
        return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), up], axis=1)

    def of(self, places: Floats) -> _Pair:
        """Longitude and latitude of places (n, 3) near the ellipsoid."""
        x, y, z = places.T
        flat = np.hypot(x, y)
        tangent = z / (flat * (1.0 - self.e2))
        for _ in range(_STEPS):
            nu = self.a / np.sqrt(1.0 - self.e2 * tangent**2 / (1.0 + tangent**2))
            tangent = (z + self.e2 * nu * tangent / np.hypot(1.0, tangent)) / flat
        return np.arctan2(y, x), np.arctan(tangent)


WGS84 = Ellipsoid()


@dataclass(frozen=True)
class Definition:
    """A coordinate system."""

    method: str  # a key of `METHODS`, or ``geo`` for longitude and latitude
    ellipsoid: Ellipsoid = WGS84
    #: tuple of 7 floats: to WGS 84: meters, seconds of arc, and parts in a million, as of a position vector.
    shift: tuple[float, ...] = (0.0,) * 7
    meridian: float = 0.0  # of longitude 0, degrees east of Greenwich
    unit: float = 1.0  # meters
    parameters: tuple[float, ...] = ()  # degrees and meters, in the order that the method has them

    @cached_property
    def ways(self) -> tuple[Callable[..., _Pair], Callable[..., _Pair], float]:
        """From longitude and latitude, back, and the meridian that longitudes count from, degrees."""
        if self.method == "geo":
            return lambda *place: np.degrees(place), lambda *place: np.radians(place), 0.0
        (east, north), angles = self.parameters[-2:], np.radians(self.parameters[:-2])
        if self.method in _SCALED:
            angles[-1] = self.parameters[-3]
        # Web Mercator takes figures of the ellipsoid for those of a sphere.
        ell = Ellipsoid(self.ellipsoid.a, inf) if self.method == "web" else self.ellipsoid
        forward, backward = METHODS[self.method](ell, *angles.tolist())
        equal = self.method in ("aea", "laea")
        latitudes = (ell.authalic, ell.of_authalic) if equal else (ell.isometric, ell.of_isometric)

        def project(longitude: Floats, latitude: Floats) -> _Pair:
            place = forward(latitudes[0](latitude) + 1j * longitude)
            return (place.imag + east) / self.unit, (place.real + north) / self.unit

        def back(x: Floats, y: Floats) -> _Pair:
            place = backward(y * self.unit - north + 1j * (x * self.unit - east))
            return place.imag, latitudes[1](place.real)

        return project, back, self.parameters[1] + self.meridian

    @property
    def _turned(self) -> Floats:
        """Matrix (3, 3) of the turn and the scale of the shift."""
        x, y, z = np.radians(np.array(self.shift[3:6]) / 3600.0)
        return (1.0 + 1e-6 * self.shift[6]) * np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])

    def to_wgs84(self, longitude: Floats, latitude: Floats) -> _Pair:
        """Longitude and latitude on WGS 84 of those on the own datum."""
        if not any(self.shift):
            return longitude, latitude
        return WGS84.of(self.ellipsoid.at(longitude, latitude) @ self._turned.T + self.shift[:3])

    def from_wgs84(self, longitude: Floats, latitude: Floats) -> _Pair:
        """Longitude and latitude on the own datum of those on WGS 84."""
        if not any(self.shift):
            return longitude, latitude
        places = WGS84.at(longitude, latitude) - self.shift[:3]
        return self.ellipsoid.of(np.linalg.solve(self._turned, places.T).T)


def _transverse(ell: Ellipsoid, foot: float, _meridian: float, scale: float) -> tuple[_Way, _Way]:
    """Transverse Mercator."""
    n = 1.0 / (2.0 * ell.inverse - 1.0)
    radius = scale * ell.a / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0)
    alphas = (
        n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180,
        13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440,
        61 * n**3 / 240 - 103 * n**4 / 140,
        49561 * n**4 / 161280,
    )
    betas = (
        n / 2 - 2 * n**2 / 3 + 37 * n**3 / 96 - n**4 / 360,
        n**2 / 48 + n**3 / 15 - 437 * n**4 / 1440,
        17 * n**3 / 480 - 37 * n**4 / 840,
        4397 * n**4 / 161280,
    )

    def northing(q: NDArray[np.complex128]) -> NDArray[np.complex128]:
        zeta = np.arctan(np.sinh(q))
        return radius * (zeta + sum(alpha * np.sin(2 * j * zeta) for j, alpha in enumerate(alphas, 1)))

    start = float(northing(ell.isometric(np.array([foot])) + 0j)[0].real)

    def backward(p: NDArray[np.complex128]) -> NDArray[np.complex128]:
        zeta = (p + start) / radius
        return np.arcsinh(np.tan(zeta - sum(beta * np.sin(2 * j * zeta) for j, beta in enumerate(betas, 1))))

    return lambda q: np.where(np.abs(q.imag) < np.radians(MOST_OFF), northing(q) - start, np.nan), backward


def _cone(n: float, size: float, middle: float) -> tuple[_Way, _Way]:
    """A conformal cone, whose apex is so far north of y = 0."""
    # The apex itself has no logarithm.
    return lambda q: middle - size * np.exp(-n * q), lambda p: -np.log((middle - p) / size + 1e-99) / n


def _lambert(ell: Ellipsoid, foot: float, _meridian: float, *others: float) -> tuple[_Way, _Way]:
    """Lambert's conformal cone, with one parallel and a scale, or with two."""
    first, second = others if len(others) == 2 else (foot, foot)
    scale = 1.0 if len(others) == 2 else others[0]
    n, (psi, other, base) = sin(first), ell.isometric(np.array([first, second, foot])).tolist()
    if abs(first - second) > 1e-9:
        n = log(ell.cosine(first) / ell.cosine(second)) / (other - psi)
    size = scale * ell.a * ell.cosine(first) * exp(n * psi) / n
    return _cone(n, size, size * exp(-n * base))


def _albers(ell: Ellipsoid, foot: float, _meridian: float, first: float, second: float) -> tuple[_Way, _Way]:
    """Albers' cone, true to area; latitudes are authalic."""
    m1, m2 = ell.cosine(first) ** 2, ell.cosine(second) ** 2
    q1, q2, base = ell.authalic(np.array([first, second, foot])).tolist()
    n = (m1 - m2) / (q2 - q1) if abs(first - second) > 1e-9 else sin(first)
    c, size = m1 + n * q1, ell.a / n
    middle = size * sqrt(c - n * base)

    def backward(p: NDArray[np.complex128]) -> NDArray[np.complex128]:
        off = (middle - p) / size
        return (c - np.abs(off) ** 2) / n - 1j * np.angle(off) / n

    return lambda q: middle - size * np.sqrt(c - n * q.real) * np.exp(-1j * n * q.imag), backward


def _mercator(ell: Ellipsoid, latitude: float, _meridian: float, scale: float | None = None) -> tuple[_Way, _Way]:
    """Mercator, with a scale or a parallel that is true to it."""
    radius = ell.a * (ell.cosine(latitude) if scale is None else scale)
    return lambda q: radius * q, lambda p: p / radius


def _double(ell: Ellipsoid, foot: float, _meridian: float, scale: float) -> tuple[_Way, _Way]:
    """Oblique stereographic projection of a sphere, onto which the ellipsoid is projected before."""
    e2, s = ell.e2, sin(foot)
    size = 2.0 * scale * ell.a * sqrt(1.0 - e2) / (1.0 - e2 * s * s)
    n = sqrt(1.0 + e2 * cos(foot) ** 4 / (1.0 - e2))
    psi = float(ell.isometric(np.array(foot)))
    start = tanh(n * psi)
    shift = log((n + s) * (1.0 - start) / ((n - s) * (1.0 + start))) / 2.0
    opposite = exp(-n * psi - shift)
    return (
        lambda q: size * np.expm1(n * (q - psi)) / (np.exp(n * q + shift) + opposite),
        lambda p: (np.log((size + p * opposite) / (size * opposite - p)) - shift) / n,
    )


def _polar(ell: Ellipsoid, latitude: float, _meridian: float, scale: float | None = None) -> tuple[_Way, _Way]:
    """Polar stereographic projection, with a scale or a parallel that is true to it."""
    rim = sqrt((1.0 + ell.e) ** (1.0 + ell.e) * (1.0 - ell.e) ** (1.0 - ell.e))
    if scale is None:
        scale = ell.cosine(latitude) * rim * exp(abs(float(ell.isometric(np.array(latitude))))) / 2.0
    side = -1.0 if latitude < 0.0 else 1.0
    return _cone(side, side * 2.0 * ell.a * scale / rim, 0.0)


def _azimuthal(ell: Ellipsoid, foot: float, _meridian: float) -> tuple[_Way, _Way]:
    """Lambert's azimuthal projection, true to area; latitudes are authalic."""
    whole, q = ell.authalic(np.array([_HALF_PI, foot])).tolist()
    sine = q / whole
    cosine, radius = sqrt(1.0 - sine**2), ell.a * sqrt(whole / 2.0)
    d = ell.a * ell.cosine(foot) / (radius * cosine)

    def forward(q: NDArray[np.complex128]) -> NDArray[np.complex128]:
        s = q.real / whole
        flat = np.sqrt(np.maximum(1.0 - s * s, 0.0)) * np.exp(1j * q.imag)
        b = radius * np.sqrt(2.0 / (1.0 + sine * s + cosine * flat.real))
        return b / d * (cosine * s - sine * flat.real) + 1j * b * d * flat.imag

    def backward(p: NDArray[np.complex128]) -> NDArray[np.complex128]:
        p = p.real * d + 1j * p.imag / d
        off = 2.0 * np.arcsin(np.clip(np.abs(p) / (2.0 * radius), -1.0, 1.0))
        p = p * np.sin(off) / np.maximum(np.abs(p), 1e-12)
        turn = np.arctan2(p.imag, cosine * np.cos(off) - p.real * sine)
        return whole * (np.cos(off) * sine + p.real * cosine) + 1j * turn

    return forward, backward


def _oblique(
    ell: Ellipsoid, foot: float, _meridian: float, azimuth: float, skew: float, scale: float, middle: bool = False
) -> tuple[_Way, _Way]:
    """Hotine's oblique Mercator: that of a sphere, onto which the ellipsoid is projected before, turned about the point
    where the initial line crosses the equator. ``middle``: lengths count from the center (variant B), not from there.
    """
    e2, side = ell.e2, 1.0 if foot >= 0.0 else -1.0
    b = sqrt(1.0 + e2 * cos(foot) ** 4 / (1.0 - e2))
    radius = ell.a * scale * sqrt(1.0 - e2) / (1.0 - e2 * sin(foot) ** 2)
    d = max(b * sqrt(1.0 - e2) / ell.cosine(foot) / (1.0 - e2 * sin(foot) ** 2), 1.0)
    f = d + side * sqrt(d * d - 1.0)
    tilt = asin(sin(azimuth) / d)
    across = abs(azimuth - _HALF_PI) < 1e-9
    # To the meridian in which the initial line crosses the equator.
    lead = side * _HALF_PI if across else asin(max(min((f - 1.0 / f) / 2.0 * tan(tilt), 1.0), -1.0))
    start = radius * lead if across else side * radius * atan2(sqrt(d * d - 1.0), cos(azimuth))
    shift = log(f) - b * float(ell.isometric(np.array(foot))) + 1j * lead
    start, turn, skewed = start * middle, complex(sin(tilt), cos(tilt)), complex(cos(skew), sin(skew))
    return (
        lambda q: skewed * (-2j * radius * np.arctanh(turn * np.tanh((b * q + shift) / 2.0)) - start),
        lambda p: (2.0 * np.arctanh(np.tanh((p / skewed + start) * 0.5j / radius) / turn) - shift) / b,
    )


#: Functions that make the two ways of a method from its ellipsoid and angles, a factor last.
METHODS: dict[str, Callable[..., tuple[_Way, _Way]]] = {
    "tm": _transverse,
    **dict.fromkeys(("lcc1", "lcc2"), _lambert),
    "aea": _albers,
    "sterea": _double,
    **dict.fromkeys(("stereA", "stereB"), _polar),
    **dict.fromkeys(("mercA", "mercB"), _mercator),
    "web": lambda ell, *_: _mercator(ell, 0.0, 0.0),
    "laea": _azimuthal,
    "omercA": _oblique,
    "omercB": lambda *given: _oblique(*given, True),
}
#: Those whose last parameter before the lengths is a factor.
_SCALED = {"tm", "lcc1", "sterea", "stereA", "mercA", "omercA", "omercB"}
#: Those that keep angles, and lengths to some thousandths where anybody uses them.
TRUE = {"tm", "lcc1", "lcc2", "sterea", "omercA", "omercB"}


@dataclass(frozen=True)
class System:
    """A coordinate system."""

    #: EPSG; 0 for a plane in meters at no known place, -1 for one about a place, -2 for one of the file itself.
    epsg: int = 0
    #: longitude and latitude: the place, degrees.
    longitude: float = 0.0
    latitude: float = 0.0
    custom: Definition | None = field(default=None, repr=False)  # of the file
    unit: float = 1.0  # meters of plain coordinates, or of those that are taken for meters of the system

    @property
    def definition(self) -> Definition:
        """Figures of a system that lies on Earth."""
        if self.custom is not None:
            return self.custom
        if self.epsg == -1:
            return _about(self.longitude, self.latitude)
        return known_systems()[self.epsg]

    @property
    def geographic(self) -> bool:
        """Whether coordinates are longitude and latitude."""
        return self.epsg != 0 and self.definition.method == "geo"

    @property
    def metric(self) -> bool:
        """Whether coordinates are true meters, but for some parts in a thousand."""
        return self.epsg == -1 or (self.epsg > 0 and self.definition.method in TRUE and self.definition.unit == 1.0)

    @property
    def name(self) -> str:
        """For messages."""
        plain = "plain meters" if self.unit == 1.0 else f"plain units of {self.unit:g} m"
        about = f"the plane about {self.latitude:.5f}, {self.longitude:.5f}"
        names = {0: plain, -1: about, -2: "the system that the file defines"}
        return names.get(self.epsg, f"EPSG:{self.epsg}")


@cache
def _about(longitude: float, latitude: float) -> Definition:
    """Transverse Mercator about a place."""
    return Definition("tm", parameters=(latitude, longitude, 1.0, 0.0, 0.0))


@cache
def known_systems() -> dict[int, Definition]:
    """All systems that have an EPSG code here."""
    data = table("systems")
    ellipsoids, shifts = [Ellipsoid(*e) for e in data["ellipsoids"]], [tuple(s) for s in data["shifts"]]
    systems = {}
    for method, ellipsoid, shift, meridian, unit, rows in data["systems"]:
        definition = Definition(method, ellipsoids[ellipsoid], shifts[shift], meridian, data["units"][unit])
        for parameters, codes, *run in rows:
            number, step = run or (1, [0.0] * len(parameters))
            for k in range(number):
                figures = tuple(round(a + k * b, 9) for a, b in zip(parameters, step, strict=True))
                systems.update(dict.fromkeys([epsg + k for epsg in codes], replace(definition, parameters=figures)))
    return systems | {epsg: systems[flat] for epsg, flat in _HEIGHTS.items()}


def system_of(epsg: int, what: str = "") -> System:
    """The system of an EPSG code, if it is known here.

    Raises
    ------
    SceneError
        It is none of those that are known here; says what to do.
    """
    if epsg in known_systems():
        return System(epsg)
    raise SceneError(
        f"{what}EPSG:{epsg} is none of the coordinate systems that TetFlora reads. Set Coordinate System to another "
        "code, reproject the file, for example with gdalwarp or ogr2ogr and -t_srs EPSG:4326, or turn on Plain Meters"
    )


def chosen_system(epsg: int, system: System, what: str) -> System:
    """The system of what an artist chose, which is an EPSG code, `PLAIN`, or 0 for the file's own."""
    return System() if epsg == PLAIN else system_of(epsg or system.epsg, what) if epsg or system.epsg > 0 else system


def may_be_degrees(points: ArrayLike) -> bool:
    """Whether points (n, 2), of which there is one at least, can be longitude and latitude."""
    points = np.array(points, np.float64).reshape(-1, 2)
    return bool(len(points) and (np.abs(points) <= [360.0, 90.0]).all())


def code_in(text: str) -> int | None:
    """The EPSG code in a name such as ``urn:ogc:def:crs:EPSG::25832`` or an address; None where there is none."""
    if re.search(r"CRS84h?\b", text):
        return LONGITUDE_LATITUDE
    match = re.search(r"\bEPSG\b[^\w]{1,2}(?:[\d.]*[:/#])?(?:[a-z]+#)?(\d{4,6})\W*$", text.strip(), re.IGNORECASE)
    match = match or re.search(r"\bepsg\.xml#(\d{4,6})$|/epsg/(\d{4,6})/?$|\bEPSG:(\d{4,6})\b", text, re.IGNORECASE)
    return int(next(filter(None, match.groups()))) if match else None


def to_degrees(system: System, points: Floats) -> Floats:
    """Longitude and latitude on WGS 84 in degrees, (n, 2), of points (n, 2) in a system that lies on Earth."""
    points, definition = system.unit * np.asarray(points, np.float64), system.definition
    if definition.method == "geo" and not any(definition.shift):
        return points
    _, back, meridian = definition.ways
    longitude, latitude = back(*points.T)
    return np.degrees(np.stack(definition.to_wgs84(longitude + np.radians(meridian), latitude), axis=1))


def from_degrees(system: System, points: Floats) -> Floats:
    """Points (n, 2) of a system on Earth from longitude and latitude (n, 2), degrees on WGS 84; too far off nan."""
    points, definition = np.asarray(points, np.float64), system.definition
    if definition.method == "geo" and not any(definition.shift):
        return points
    longitude, latitude = definition.from_wgs84(*np.radians(points).T)
    forward, _, meridian = definition.ways
    off = longitude - np.radians(meridian)
    off = np.where(np.abs(off) <= np.pi, off, (off + np.pi) % (2.0 * np.pi) - np.pi)
    return np.stack(forward(off, latitude), axis=1) / system.unit


def between(points: Floats, source: System, target: System) -> Floats:
    """Points (n, 2) of one system in another; both lie on Earth, or both are plain."""
    if source == target or source.epsg == target.epsg == 0:
        return points * (source.unit / target.unit)
    return from_degrees(target, to_degrees(source, points))


@dataclass(frozen=True)
class MapOrigin:
    """Where on a map the world's origin is."""

    system: System
    #: east and north: coordinates of the origin in the system.
    east: float
    north: float

    def local(self, points: Floats, system: System, what: str) -> Floats:
        """Meters from the origin, (n, 2), of points (n, 2) of a system.

        Raises
        ------
        SceneError
            Nobody can tell where they lie, or they are too far away; ``what`` begins the message.
        """
        local = self.offsets(points, system, what)
        far = np.abs(local).max(initial=0.0)
        if not far < MOST_AWAY:
            away = f"{far / 1000.0:,.0f} km" if np.isfinite(far) else "too far"
            raise SceneError(
                f"{what}it reaches {away} from the middle of the scene; set Coordinate System to the EPSG code of the "
                "file, or turn on New Origin to put it in the middle by itself"
            )
        return local

    def offsets(self, points: Floats, system: System, what: str) -> Floats:
        """Meters from the origin, (n, 2), of points (n, 2) of a system, however far.

        Raises
        ------
        SceneError
            Nobody can tell where they lie; ``what`` begins the message.
        """
        if (system.epsg == 0) != (self.system.epsg == 0):
            known, other = ("the scene", "the file") if system.epsg == 0 else ("the file", "the scene")
            raise SceneError(
                f"{what}{known} lies on Earth, and the coordinate system of {other} is not known; set Coordinate "
                "System to its EPSG code, or turn on New Origin"
            )
        return between(points, system, self.system) - [self.east, self.north]


#: Meters from the origin within which all of a scene must lie.
MOST_AWAY = 250_000.0


def place_about(system: System, low: Floats, high: Floats, what: str = "") -> MapOrigin:
    """The place for a scene whose first data lie between two corners, (2,) each; in whole meters.

    Raises
    ------
    SceneError
        They are no places on Earth.
    """
    middle = (np.asarray(low, np.float64) + high) / 2.0
    if system.metric or system.epsg == 0:
        east, north = np.round(system.unit * middle).tolist()
        place = MapOrigin(system if system.epsg else System(), east, north)
    else:
        longitude, latitude = np.round(to_degrees(system, middle[None])[0], 6).tolist()
        if not (abs(longitude) <= 360.0 and abs(latitude) < 89.0):
            told = f"{what}{longitude:g}, {latitude:g}"
            raise SceneError(readable(f"{told} is no longitude and latitude with room about it"))
        place = MapOrigin(System(-1, longitude, latitude), 0.0, 0.0)
    ends = np.array([[low[0], middle[1]], [high[0], middle[1]], [middle[0], low[1]], [middle[0], high[1]]])
    sides = between(ends, system, place.system)
    width, depth = np.linalg.norm(sides[1::2] - sides[::2], axis=1) / 1000.0
    if not max(width, depth) < 2.0 * MOST_AWAY / 1000.0:
        raise SceneError(
            f"{what}it is {width:,.0f} by {depth:,.0f} km large; choose a Crop, or crop it to "
            f"{MOST_AWAY / 500.0:,.0f} km or less"
        )
    return place


_FIGURES = table("systems")
#: Geographic systems by what names of datums begin with, and methods by what theirs do; letters and digits only.
_DATUMS: dict[str, int] = _FIGURES["datums"]
_METHODS: dict[str, str] = _FIGURES["methods"]
#: What parameters mean by a part of their names, of which the first that fits counts; and those of methods in order.
_PARAMETERS: dict[str, str] = _FIGURES["parameters"]
_ORDER: dict[str, list[str]] = _FIGURES["order"]
_FOOT, _SURVEY_FOOT = 0.3048, 1200.0 / 3937.0
_Node = tuple[str, list[Any]]


def system_in(text: str) -> System:
    """The system that a text describes; plain in the unit that it names if it is none that lies on Earth."""
    with suppress(ValueError, IndexError, TypeError, OverflowError, RecursionError, ZeroDivisionError):
        if re.search(r"^\s*projection\s", text, re.IGNORECASE):
            return _old(text)
        match = re.search(r"[A-Z]\w*\s*[\[(]", text, re.IGNORECASE)
        if match and "," in text:
            root = _nodes(text[match.start() :])
            if root is not None:
                return _well_known(root)
    code = code_in(text)
    return System(code) if code in known_systems() else System()


def _nodes(text: str) -> _Node | None:
    """Well-known text as a tree of names and values."""
    top: list[Any] = []
    stack = [top]
    for word, string, number, mark in re.findall(
        r'([A-Za-z_]\w*)|"((?:[^"]|"")*)"|([-+]?[\d.]+(?:[eE][-+]?\d+)?)|([\[\](),])', text[:20_000]
    ):
        if mark and mark in "[(":
            node = (str(stack[-1].pop()).upper(), [])
            stack[-1].append(node)
            stack.append(node[1])
        elif mark and mark in "])":
            stack.pop()
            if len(stack) < 2:
                break
        elif not mark:
            stack[-1].append(float(number) if number else word or string)
    return top[0] if top and isinstance(top[0], tuple) else None


def _child(node: _Node, *names: str) -> _Node | None:
    """The first part of a node with one of some names."""
    return next((part for part in node[1] if isinstance(part, tuple) and part[0] in names), None)


def _well_known(node: _Node) -> System:
    """The system of a node of well-known text."""
    projected = ("PROJCS", "PROJCRS", "PROJECTEDCRS")
    flat = ("GEOGCS", "GEOGCRS", "GEODCRS", "GEOGRAPHICCRS", "GEODETICCRS")
    while node[0] not in projected + flat:
        inner = _child(node, "SOURCECRS", "COMPD_CS", "COMPOUNDCRS", *projected, *flat)
        if inner is None:
            return System()
        node = inner
    code = _code(node)
    if code in known_systems():
        return System(code)
    base = node if node[0] in flat else _child(node, *flat, "BASEGEOGCRS", "BASEGEODCRS")
    if base is None:
        return System()
    unit = _child(node, "UNIT", "LENGTHUNIT")
    axis = _child(node, "AXIS")
    unit = unit or (axis and _child(axis, "LENGTHUNIT")) or ("", ["metre", 1.0])
    meters = 1.0 if node is base else unit[1][1]
    datum = _datum(base)
    angle = _child(base, "UNIT", "ANGLEUNIT")
    angle = degrees(angle[1][1]) if angle else 1.0
    if node is base:
        named = _code_of_datum((_child(base, "DATUM", "ENSEMBLE") or ("", [""]))[1][0])
        return System(named) if named and known_systems()[named] == datum else _system(datum)
    conversion = _child(node, "CONVERSION") or node
    method = _child(conversion, "PROJECTION", "METHOD")
    given = {}
    for name, *rest in (part[1] for part in conversion[1] if isinstance(part, tuple) and part[0] == "PARAMETER"):
        key = next((key for part, key in _PARAMETERS.items() if re.search(part, _plain(name))), "")
        factor = next((part[1][1] for part in rest[1:] if isinstance(part, tuple) and part[0].endswith("UNIT")), None)
        if key in ("east", "north"):
            given[key] = rest[0] * (meters if factor is None else factor)
        else:
            scale = 1.0 if key == "scale" else angle if factor is None else degrees(factor)
            given[key] = rest[0] * (1.0 if isclose(scale, 1.0, rel_tol=1e-6) else scale)
    name = "web" if "pseudo" in _plain(node[1][0]) else method[1][0] if method else ""
    zone = re.search(r"utmzone(\d{1,2})([ns])", _plain(node[1][0]))
    if zone and not given:  # a name that says all
        name, given = "transverse", utm_zone(int(zone[1]), zone[2] == "s")
    return described(name, given, replace(datum, unit=meters))


def _code(node: _Node) -> int:
    """The EPSG code that a node names; 0 for none."""
    authority = _child(node, "AUTHORITY", "ID")
    return int(authority[1][1]) if authority and str(authority[1][0]).upper() == "EPSG" else 0


def _plain(name: Any) -> str:
    """Small letters and digits of a name."""
    return re.sub("[^a-z0-9]", "", str(name).lower())


def _datum(base: _Node) -> Definition:
    """Ellipsoid, shift and prime meridian of a geographic system."""
    code, node = _code(base), _child(base, "DATUM", "ENSEMBLE")
    if code in known_systems() and known_systems()[code].method == "geo":
        return known_systems()[code]
    meridian = _child(base, "PRIMEM")
    east = float(meridian[1][1]) if meridian else 0.0
    if node is None:
        return known_systems().get(_code_of_datum(base[1][0])) or Definition("geo", meridian=east)
    shape, shift = _child(node, "SPHEROID", "ELLIPSOID"), _child(node, "TOWGS84")
    ellipsoid = Ellipsoid(shape[1][1], shape[1][2] or 1e9) if shape else WGS84
    if not (6.2e6 < ellipsoid.a < 6.5e6 and ellipsoid.inverse > 100.0):
        ellipsoid = WGS84
    known = known_systems().get(_code_of_datum(node[1][0]))
    if shift and len(shift[1]) in (3, 7):
        return Definition("geo", ellipsoid, (*shift[1], *([0.0] * (7 - len(shift[1])))), east)
    if known is None or abs(known.ellipsoid.a - ellipsoid.a) > 1.0:
        return Definition("geo", ellipsoid, meridian=east)
    return replace(known, meridian=east)


def _code_of_datum(name: Any) -> int:
    """EPSG code of the geographic system of a datum; 0 for unknown ones."""
    name = _plain(name).removeprefix("gcs")
    fitting = [part for part in _DATUMS if name.removeprefix("d").startswith(part) or name.startswith(part)]
    return _DATUMS[max(fitting, key=len)] if fitting else 0


def described(method: str, given: Mapping[str, float], datum: Definition) -> System:
    """The system of a method by its name, with parameters in degrees and meters, on a datum."""
    plain = re.sub("[0-9]sp", "", _plain(method))
    kind = _METHODS.get(max((m for m in _METHODS if plain.startswith(m)), key=len, default=""), "")
    given = {"scale": 1.0, "east": 0.0, "north": 0.0, **given}
    if kind == "web":
        given = {"latitude": 0.0, "longitude": 0.0} | given
    if kind == "lcc":
        kind = "lcc2" if "second" in given else "lcc1"
    if kind == "merc":
        kind = "mercB" if given.get("first") else "mercA"
    if kind in ("lcc1", "mercA"):
        given["latitude"] = given.get("latitude", given.get("first", 0.0))
    if kind == "stere":  # the parallel of true scale has several names
        given["first"] = given.get("first", given.get("latitude", 90.0))
        kind = "stereB" if abs(given["first"]) < 90.0 - 1e-9 else "stereA"
        given["latitude"] = given["first"]
    if "swiss" in plain or kind == "omercB":
        given = {"azimuth": 90.0} | given
    given["skew"] = given.get("skew", given.get("azimuth", 0.0))
    order = (*_ORDER.get(kind, _ORDER[""]), "east", "north")
    if kind not in METHODS or not all(isfinite(given.get(key, float("nan"))) for key in order):
        return System(unit=datum.unit)
    definition = replace(datum, method=kind, parameters=tuple(float(given[key]) for key in order))
    definition.ways[0](*_SOMEWHERE)  # figures that no map can have are an error, and no system
    return _system(definition)


_SOMEWHERE = (np.array([0.1]), np.array([0.1]))


def _system(definition: Definition) -> System:
    """The system with the same figures that has a code, or one by itself."""
    return System(code) if (code := _codes().get(_figures(definition))) else System(-2, custom=definition)


@cache
def _codes() -> dict[Any, int]:
    """Lowest codes of systems by their figures."""
    usual = {code for first, last in _FIGURES["usual"] for code in range(first, last + 1)}
    codes = sorted(known_systems(), key=lambda code: (code not in usual, code))
    return {_figures(known_systems()[code]): code for code in reversed(codes)}


def _figures(definition: Definition) -> tuple:
    """Figures of a system, rounded so that the same ones are equal."""
    shape = round(definition.ellipsoid.a, 1), round(definition.ellipsoid.inverse, 6)
    if definition.method == "geo":
        return definition.method, *shape, tuple(round(v, 2) for v in definition.shift), round(definition.meridian, 6)
    # Datums follow from ellipsoids here: whoever writes the figures of a national map means that map.
    angles, lengths = definition.parameters[:-2], definition.parameters[-2:]
    if definition.method in ("lcc2", "aea"):  # of two parallels either may come first
        angles = *angles[:2], *sorted(angles[2:])
    numbers = (*(round(v, 6) for v in angles), *(round(v, 2) for v in lengths))
    return definition.method, *shape, round(definition.meridian, 6), round(definition.unit, 7), numbers


def utm_zone(zone: int, south: bool) -> dict[str, float]:
    """Parameters of a zone of UTM."""
    return {"latitude": 0.0, "longitude": 6.0 * zone - 183.0, "scale": 0.9996, "east": 5e5, "north": 1e7 * south}


def _old(text: str) -> System:
    """Words of ArcInfo: a name and a value on each line, and parameters with comments below."""
    head, _, tail = text.partition("Parameters")
    words = {line.split()[0].lower(): " ".join(line.split()[1:]).upper() for line in head.splitlines() if line.split()}
    name, units = words.get("projection", ""), words.get("units", "METERS")
    meters = _FOOT if "INT" in units and "F" in units else _SURVEY_FOOT if units.startswith("F") else 1.0
    datum = known_systems().get(_code_of_datum(words.get("datum", ""))) or Definition("geo")
    if name.startswith("GEO"):
        return System(_code_of_datum(words.get("datum", "")) or LONGITUDE_LATITUDE)
    datum = replace(datum, unit=meters)
    if name == "UTM":
        zone = int(float(words["zone"]))
        south = zone < 0 or float(words.get("yshift", "0")) < 0
        return described("transverse", utm_zone(abs(zone), south), datum)
    keys = ("scale",) if name.startswith("TRANS") else ("first", "second")
    numbers = []
    for line in tail.splitlines():
        parts = [float(word) for word in re.sub(r"/\*.*", "", line).split()]
        if parts:
            sign = -1.0 if line.strip().startswith("-") else 1.0
            numbers.append(sign * sum(abs(part) / 60.0**power for power, part in enumerate(parts)))
    return described(name, dict(zip((*keys, "longitude", "latitude", "east", "north"), numbers, strict=False)), datum)
