# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Map projections on any ellipsoid, and shifts between datums.

Formulas and names of their parameters are those of IOGP Publication 373-7-2 (2023). Transverse Mercator is Krüger's
series to the fourth order in the third flattening, exact to a micrometre within 3,000 km of the meridian (C. F. F.
Karney, "Transverse Mercator with an accuracy of a few nanometers", Journal of Geodesy 85, 2011, equations 7 to 36).
All coordinates are arrays of one length; angles are radians, and longitudes count from the method's own meridian.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import asin, atan2, cos, exp, inf, log, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

_Pair = tuple[NDArray[np.float64], NDArray[np.float64]]
_Way = Callable[[NDArray[np.float64], NDArray[np.float64]], _Pair]
_STEPS = 5  # of Newton's method for the latitude, which doubles the digits each time
_HALF_PI = np.pi / 2.0
#: Degrees from the meridian: beyond it nobody has a scene, and series come to an end.
MOST_OFF = 40.0


@dataclass(frozen=True)
class Ellipsoid:
    """Half of the longer axis in metres, and the inverse of the flattening."""

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

    def conformal(self, tangent: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tangent of the conformal latitude, from that of the geographic one (Karney, equations 7 to 9)."""
        sigma = np.sinh(self.e * np.arctanh(self.e * tangent / np.hypot(1.0, tangent)))
        return tangent * np.hypot(1.0, sigma) - sigma * np.hypot(1.0, tangent)

    def latitude(self, conformal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Latitude from the tangent of the conformal one."""
        tangent = conformal / (1.0 - self.e2)
        for _ in range(_STEPS):
            found = self.conformal(tangent)
            slope = 1.0 + (1.0 - self.e2) * tangent**2
            slope = slope / ((1.0 - self.e2) * np.hypot(1.0, found) * np.hypot(1.0, tangent))
            tangent = tangent + (conformal - found) * slope
        return np.arctan(tangent)

    def isometric(self, latitude: NDArray[np.float64]) -> NDArray[np.float64]:
        """Isometric latitude."""
        return np.arcsinh(self.conformal(np.tan(latitude)))

    def cosine(self, latitude: float) -> float:
        """Radius of a parallel, over the longer half-axis."""
        return cos(latitude) / sqrt(1.0 - self.e2 * sin(latitude) ** 2)

    def authalic(self, latitude: NDArray[np.float64]) -> NDArray[np.float64]:
        """Twice the area between equator and parallel, over what a radian has of it on a sphere."""
        s = np.sin(latitude)
        return (1.0 - self.e2) * (s / (1.0 - self.e2 * s * s) + np.arctanh(self.e * s) / self.e)

    def of_authalic(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Latitude from `authalic`."""
        phi = np.arcsin(np.clip(q / self.authalic(np.array(_HALF_PI)), -1.0, 1.0))
        for _ in range(_STEPS):
            slope = 2.0 * (1.0 - self.e2) * np.cos(phi) / (1.0 - self.e2 * np.sin(phi) ** 2) ** 2
            phi = phi + (q - self.authalic(phi)) / np.maximum(slope, 1e-9)
        return phi

    def at(self, longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places (n, 3) on the ellipsoid, metres from the middle of the Earth."""
        nu = self.a / np.sqrt(1.0 - self.e2 * np.sin(latitude) ** 2)
        flat = nu * np.cos(latitude)
        return np.stack(
            [flat * np.cos(longitude), flat * np.sin(longitude), nu * (1.0 - self.e2) * np.sin(latitude)], axis=1
        )

    def of(self, places: NDArray[np.float64]) -> _Pair:
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
    """A coordinate system.

    Attributes
    ----------
    method : str
        A key of `METHODS`, or ``geo`` for longitude and latitude.
    ellipsoid : Ellipsoid
    shift : tuple of 7 floats
        To WGS 84: metres, seconds of arc, and parts in a million, as of a position vector.
    meridian : float
        Of longitude 0, degrees east of Greenwich.
    unit : float
        Metres.
    parameters : tuple of floats
        Degrees and metres, in the order that the method has them.
    """

    method: str
    ellipsoid: Ellipsoid = WGS84
    shift: tuple[float, ...] = (0.0,) * 7
    meridian: float = 0.0
    unit: float = 1.0
    parameters: tuple[float, ...] = ()

    @cached_property
    def ways(self) -> tuple[_Way, _Way, float]:
        """From longitude and latitude, back, and the meridian that longitudes count from, degrees."""
        lengths, angles = self.parameters[-2:], np.radians(self.parameters[:-2])
        east, north, longitude = *lengths, self.parameters[1]
        if self.method in _SCALED:
            angles[-1] = self.parameters[-3]
        forward, backward = METHODS[self.method](self.ellipsoid, *angles.tolist())

        def there(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
            x, y = forward(x, y)
            return (x + east) / self.unit, (y + north) / self.unit

        def back(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
            return backward(x * self.unit - east, y * self.unit - north)

        return there, back, longitude + self.meridian

    @property
    def _turned(self) -> NDArray[np.float64]:
        """Matrix (3, 3) of the turn and the scale of the shift."""
        x, y, z = np.radians(np.array(self.shift[3:6]) / 3600.0)
        return (1.0 + 1e-6 * self.shift[6]) * np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])

    def to_wgs84(self, longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
        """Longitude and latitude on WGS 84 of those on the own datum."""
        if not any(self.shift):
            return longitude, latitude
        return WGS84.of(self.ellipsoid.at(longitude, latitude) @ self._turned.T + self.shift[:3])

    def from_wgs84(self, longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
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

    def northing(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
        conformal = ell.conformal(np.tan(latitude))
        cosine = np.cos(longitude)
        xi = np.arctan2(conformal, cosine)
        eta = np.arcsinh(np.sin(longitude) / np.hypot(conformal, cosine))
        along, across = xi, eta
        for j, alpha in enumerate(alphas, 1):
            along = along + alpha * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
            across = across + alpha * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
        return radius * across, radius * along

    start = float(northing(np.zeros(1), np.array([foot]))[1][0])

    def forward(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
        x, y = northing(np.where(np.abs(longitude) < np.radians(MOST_OFF), longitude, np.nan), latitude)
        return x, y - start

    def backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
        along, across = (y + start) / radius, x / radius
        xi, eta = along, across
        for j, beta in enumerate(betas, 1):
            xi = xi - beta * np.sin(2 * j * along) * np.cosh(2 * j * across)
            eta = eta - beta * np.cos(2 * j * along) * np.sinh(2 * j * across)
        wanted = np.sin(xi) / np.hypot(np.sinh(eta), np.cos(xi))
        return np.arctan2(np.sinh(eta), np.cos(xi)), ell.latitude(wanted)

    return forward, backward


def _cone(n: float, foot: float, radius: Callable, latitude: Callable) -> tuple[_Way, _Way]:
    """A cone of which radii of parallels are known, and back; ``foot`` is the latitude of y = 0."""
    middle = float(radius(np.array(foot)))

    def forward(longitude: NDArray[np.float64], phi: NDArray[np.float64]) -> _Pair:
        r = radius(phi)
        return r * np.sin(n * longitude), middle - r * np.cos(n * longitude)

    def backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
        side = np.sign(n)
        return np.arctan2(side * x, side * (middle - y)) / n, latitude(side * np.hypot(x, middle - y))

    return forward, backward


def _lambert(ell: Ellipsoid, foot: float, _meridian: float, *others: float) -> tuple[_Way, _Way]:
    """Lambert's conformal cone, with one parallel and a scale, or with two."""
    first, second = others if len(others) == 2 else (foot, foot)
    scale = 1.0 if len(others) == 2 else others[0]
    n, psi = sin(first), float(ell.isometric(np.array(first)))
    if abs(first - second) > 1e-9:
        n = log(ell.cosine(first) / ell.cosine(second)) / (float(ell.isometric(np.array(second))) - psi)
    size = scale * ell.a * ell.cosine(first) * exp(n * psi) / n
    return _cone(
        n,
        foot,
        lambda phi: size * np.exp(-n * ell.isometric(phi)),
        lambda r: ell.latitude(np.sinh(-np.log(r / size) / n)),
    )


def _albers(ell: Ellipsoid, foot: float, _meridian: float, first: float, second: float) -> tuple[_Way, _Way]:
    """Albers' cone, true to area."""
    m1, m2 = ell.cosine(first) ** 2, ell.cosine(second) ** 2
    q1, q2 = ell.authalic(np.array([first, second])).tolist()
    n = (m1 - m2) / (q2 - q1) if abs(first - second) > 1e-9 else sin(first)
    c = m1 + n * q1
    return _cone(
        n,
        foot,
        lambda phi: ell.a * np.sqrt(c - n * ell.authalic(phi)) / n,
        lambda r: ell.of_authalic((c - (r * n / ell.a) ** 2) / n),
    )


def _mercator(ell: Ellipsoid, latitude: float, _meridian: float, scale: float | None = None) -> tuple[_Way, _Way]:
    """Mercator, with a scale or a parallel that is true to it."""
    radius = ell.a * (ell.cosine(latitude) if scale is None else scale)
    return (
        lambda longitude, phi: (radius * longitude, radius * ell.isometric(phi)),
        lambda x, y: (x / radius, ell.latitude(np.sinh(y / radius))),
    )


def _double(ell: Ellipsoid, foot: float, _meridian: float, scale: float) -> tuple[_Way, _Way]:
    """Oblique stereographic projection of a sphere, onto which the ellipsoid is projected before."""
    e2, s = ell.e2, sin(foot)
    radius = ell.a * sqrt(1.0 - e2) / (1.0 - e2 * s * s)
    n = sqrt(1.0 + e2 * cos(foot) ** 4 / (1.0 - e2))
    psi = float(ell.isometric(np.array(foot)))
    w1 = exp(2.0 * n * psi)
    start = (w1 - 1.0) / (w1 + 1.0)
    c = (n + s) * (1.0 - start) / ((n - s) * (1.0 + start))
    shift = log(c) / 2.0
    sine = np.tanh(n * psi + shift)
    cosine = sqrt(1.0 - sine**2)
    size = 2.0 * scale * radius

    def forward(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
        chi = np.arctan(np.sinh(n * ell.isometric(latitude) + shift))
        turn = n * longitude
        b = 1.0 + np.sin(chi) * sine + np.cos(chi) * cosine * np.cos(turn)
        return (
            size * np.cos(chi) * np.sin(turn) / b,
            size * (np.sin(chi) * cosine - np.cos(chi) * sine * np.cos(turn)) / b,
        )

    def backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
        off = 2.0 * np.arctan(np.hypot(x, y) / size)
        slope = np.sin(off) / np.maximum(np.hypot(x, y), 1e-12)
        chi = np.arcsin(np.clip(np.cos(off) * sine + y * slope * cosine, -1.0, 1.0))
        turn = np.arctan2(x * slope, cosine * np.cos(off) - y * slope * sine)
        return turn / n, ell.latitude(np.sinh((np.arctanh(np.sin(chi)) - shift) / n))

    return forward, backward


def _polar(ell: Ellipsoid, latitude: float, _meridian: float, scale: float | None = None) -> tuple[_Way, _Way]:
    """Polar stereographic projection, with a scale or a parallel that is true to it."""
    side = np.sign(latitude)
    rim = sqrt((1.0 + ell.e) ** (1.0 + ell.e) * (1.0 - ell.e) ** (1.0 - ell.e))
    if scale is None:
        scale = ell.cosine(latitude) * rim * exp(abs(float(ell.isometric(np.array(latitude))))) / 2.0
    size = 2.0 * ell.a * scale / rim

    def forward(longitude: NDArray[np.float64], phi: NDArray[np.float64]) -> _Pair:
        r = size * np.exp(-side * ell.isometric(phi))
        return r * np.sin(longitude), -side * r * np.cos(longitude)

    def backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
        r = np.maximum(np.hypot(x, y), 1e-9)
        return np.arctan2(x, -side * y), ell.latitude(np.sinh(-side * np.log(r / size)))

    return forward, backward


def _azimuthal(ell: Ellipsoid, foot: float, _meridian: float) -> tuple[_Way, _Way]:
    """Lambert's azimuthal projection, true to area."""
    whole, q = ell.authalic(np.array([_HALF_PI, foot])).tolist()
    sine = q / whole
    cosine, radius = sqrt(1.0 - sine**2), ell.a * sqrt(whole / 2.0)
    d = ell.a * ell.cosine(foot) / (radius * cosine)

    def forward(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
        s = ell.authalic(latitude) / whole
        c = np.sqrt(np.maximum(1.0 - s * s, 0.0))
        b = radius * np.sqrt(2.0 / (1.0 + sine * s + cosine * c * np.cos(longitude)))
        return b * d * c * np.sin(longitude), b / d * (cosine * s - sine * c * np.cos(longitude))

    def backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
        x, y = x / d, y * d
        r = np.hypot(x, y)
        off = 2.0 * np.arcsin(np.clip(r / (2.0 * radius), -1.0, 1.0))
        slope = np.sin(off) / np.maximum(r, 1e-12)
        s = np.cos(off) * sine + y * slope * cosine
        return np.arctan2(x * slope, cosine * np.cos(off) - y * slope * sine), ell.of_authalic(whole * s)

    return forward, backward


def _oblique(
    ell: Ellipsoid, foot: float, _meridian: float, azimuth: float, skew: float, scale: float, middle: bool = False
) -> tuple[_Way, _Way]:
    """Hotine's oblique Mercator; ``middle``: lengths count from the centre (variant B), not from the equator."""
    e2, side = ell.e2, 1.0 if foot >= 0.0 else -1.0
    b = sqrt(1.0 + e2 * cos(foot) ** 4 / (1.0 - e2))
    radius = ell.a * b * scale * sqrt(1.0 - e2) / (1.0 - e2 * sin(foot) ** 2)
    d = max(b * sqrt(1.0 - e2) / ell.cosine(foot) / (1.0 - e2 * sin(foot) ** 2), 1.0)
    f = d + side * sqrt(d * d - 1.0)
    h = f * exp(-b * float(ell.isometric(np.array(foot))))
    tilt = asin(sin(azimuth) / d)
    across = abs(azimuth - _HALF_PI) < 1e-9
    # To the meridian in which the initial line crosses the equator.
    lead = side * _HALF_PI / b if across else asin(max(min((f - 1.0 / f) / 2.0 * tan(tilt), 1.0), -1.0)) / b
    start = radius * lead if across else side * radius / b * atan2(sqrt(d * d - 1.0), cos(azimuth))
    start = start if middle else 0.0

    def forward(longitude: NDArray[np.float64], latitude: NDArray[np.float64]) -> _Pair:
        q = h * np.exp(b * ell.isometric(latitude))
        s, t, turn = (q - 1.0 / q) / 2.0, (q + 1.0 / q) / 2.0, b * (longitude + lead)
        sink = (s * sin(tilt) - np.sin(turn) * cos(tilt)) / t
        v = radius * np.log((1.0 - sink) / (1.0 + sink)) / (2.0 * b)
        u = radius * np.arctan2(s * cos(tilt) + np.sin(turn) * sin(tilt), np.cos(turn)) / b - start
        return v * cos(skew) + u * sin(skew), u * cos(skew) - v * sin(skew)

    def backward(x: NDArray[np.float64], y: NDArray[np.float64]) -> _Pair:
        v, u = x * cos(skew) - y * sin(skew), y * cos(skew) + x * sin(skew) + start
        q = np.exp(-b * v / radius)
        s, t, turn = (q - 1.0 / q) / 2.0, (q + 1.0 / q) / 2.0, b * u / radius
        sink = (np.sin(turn) * cos(tilt) + s * sin(tilt)) / t
        psi = (np.log((1.0 + sink) / (1.0 - sink)) / 2.0 - log(h)) / b
        turned = np.arctan2(s * cos(tilt) - np.sin(turn) * sin(tilt), np.cos(turn))
        return -turned / b - lead, ell.latitude(np.sinh(psi))

    return forward, backward


#: Functions that make the two ways of a method from its ellipsoid and angles, a factor last.
METHODS: dict[str, Callable[..., tuple[_Way, _Way]]] = {
    "tm": _transverse,
    "lcc1": _lambert,
    "lcc2": _lambert,
    "aea": _albers,
    "sterea": _double,
    "stereA": _polar,
    "stereB": _polar,
    "mercA": _mercator,
    "mercB": _mercator,
    "web": lambda ell, *_: _mercator(Ellipsoid(ell.a, inf), 0.0, 0.0),  # as if that were a sphere
    "laea": _azimuthal,
    "omercA": _oblique,
    "omercB": lambda *given: _oblique(*given, True),
}
#: Those whose last parameter before the lengths is a factor.
_SCALED = {"tm", "lcc1", "sterea", "stereA", "mercA", "omercA", "omercB"}
#: Those that keep angles, and lengths to some thousandths where anybody uses them.
TRUE = {"tm", "lcc1", "lcc2", "sterea", "omercA", "omercB"}
