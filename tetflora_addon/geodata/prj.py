# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate systems as files tell them: well-known text of both kinds, ArcInfo's older words, keys of GeoTIFF.

What is described in full becomes the system of the EPSG code that has the same figures, or one by itself.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from math import degrees, isclose, isfinite
from typing import Any

import numpy as np

from . import table
from .projection import LONGITUDE_LATITUDE, METHODS, WGS84, Definition, Ellipsoid, System, code_in, known_systems

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
        found = re.search(r"[A-Z]\w*\s*[\[(]", text, re.IGNORECASE)
        if found and "," in text:
            root = _nodes(text[found.start() :])
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
    projected, flat = (
        ("PROJCS", "PROJCRS", "PROJECTEDCRS"),
        ("GEOGCS", "GEOGCRS", "GEODCRS", "GEOGRAPHICCRS", "GEODETICCRS"),
    )
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
        own = next((part[1][1] for part in rest[1:] if isinstance(part, tuple) and part[0].endswith("UNIT")), None)
        if key in ("east", "north"):
            given[key] = rest[0] * (meters if own is None else own)
        else:
            scale = 1.0 if key == "scale" else angle if own is None else degrees(own)
            given[key] = rest[0] * (1.0 if isclose(scale, 1.0, rel_tol=1e-6) else scale)
    name = "web" if "pseudo" in _plain(node[1][0]) else method[1][0] if method else ""
    zone = re.search(r"utmzone(\d{1,2})([ns])", _plain(node[1][0]))
    if zone and not given:  # a name that says all
        name, given = "transverse", utm_zone(int(zone[1]), zone[2] == "s")
    return described(name, given, replace(datum, unit=meters))


def _code(node: _Node) -> int:
    """The EPSG code that a node names; 0 for none."""
    own = _child(node, "AUTHORITY", "ID")
    return int(own[1][1]) if own and str(own[1][0]).upper() == "EPSG" else 0


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
    own = replace(datum, method=kind, parameters=tuple(float(given[key]) for key in order))
    own.ways[0](*_SOMEWHERE)  # figures that no map can have are an error, and no system
    return _system(own)


_SOMEWHERE = (np.array([0.1]), np.array([0.1]))


def _system(own: Definition) -> System:
    """The system with the same figures that has a code, or one by itself."""
    return System(code) if (code := _codes().get(_figures(own))) else System(-2, own=own)


@cache
def _codes() -> dict[Any, int]:
    """Lowest codes of systems by their figures."""
    usual = {code for first, last in _FIGURES["usual"] for code in range(first, last + 1)}
    codes = sorted(known_systems(), key=lambda code: (code not in usual, code))
    return {_figures(known_systems()[code]): code for code in reversed(codes)}


def _figures(own: Definition) -> tuple:
    """Figures of a system, rounded so that the same ones are equal."""
    shape = round(own.ellipsoid.a, 1), round(own.ellipsoid.inverse, 6)
    if own.method == "geo":
        return own.method, *shape, tuple(round(v, 2) for v in own.shift), round(own.meridian, 6)
    # Datums follow from ellipsoids here: whoever writes the figures of a national map means that map.
    angles, lengths = own.parameters[:-2], own.parameters[-2:]
    if own.method in ("lcc2", "aea"):  # of two parallels either may come first
        angles = *angles[:2], *sorted(angles[2:])
    numbers = (*(round(v, 6) for v in angles), *(round(v, 2) for v in lengths))
    return own.method, *shape, round(own.meridian, 6), round(own.unit, 7), numbers


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
    keys = (
        ("scale", "longitude", "latitude") if name.startswith("TRANS") else ("first", "second", "longitude", "latitude")
    )
    numbers = []
    for line in tail.splitlines():
        parts = [float(word) for word in re.sub(r"/\*.*", "", line).split()]
        if parts:
            sign = -1.0 if line.strip().startswith("-") else 1.0
            numbers.append(sign * sum(abs(part) / 60.0**power for power, part in enumerate(parts)))
    return described(name, dict(zip((*keys, "east", "north"), numbers, strict=False)), datum)
