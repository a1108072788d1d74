# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of woods, meadows, water, roads and buildings, told apart by the keys that OpenStreetMap has for them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NAME, SceneError, readable, shown
from .projection import System, system_of
from .tables import MAX_POINTS, coordinates, read_features

WOOD, MEADOW, WATER, ROAD, BUILDING, OTHER = "Woods", "Meadows", "Water", "Roads", "Buildings", "Others"
KINDS = (WOOD, MEADOW, WATER, ROAD, BUILDING, OTHER)
#: Most outlines of a file: each becomes an object.
MAX_OUTLINES = 20_000
_VALUES = {
    ("landuse", "forest"): WOOD,
    ("natural", "wood"): WOOD,
    ("natural", "scrub"): WOOD,
    ("landuse", "orchard"): WOOD,
    ("landcover", "trees"): WOOD,
    **dict.fromkeys((("landuse", v) for v in ("meadow", "grass", "farmland", "village_green", "allotments")), MEADOW),
    **dict.fromkeys((("natural", v) for v in ("grassland", "heath", "fell", "wetland")), MEADOW),
    **dict.fromkeys((("leisure", v) for v in ("park", "garden", "common", "golf_course")), MEADOW),
    **dict.fromkeys((("natural", v) for v in ("water", "bay", "strait")), WATER),
    **dict.fromkeys((("landuse", v) for v in ("reservoir", "basin")), WATER),
}
#: Keys that tell by themselves, whatever their value; the first that a feature has counts.
_KEYS = {"building": BUILDING, "highway": ROAD, "waterway": WATER, "railway": ROAD, "water": WATER}
#: Widths of lines in metres, by the value of their key.
_WIDTHS = {
    **dict.fromkeys(("motorway", "trunk"), 11.0),
    **dict.fromkeys(("primary",), 8.0),
    **dict.fromkeys(("secondary",), 7.0),
    **dict.fromkeys(("tertiary",), 6.0),
    **dict.fromkeys(("residential", "unclassified", "living_street", "pedestrian", "road"), 5.5),
    **dict.fromkeys(("service", "rail", "light_rail", "tram"), 4.0),
    **dict.fromkeys(("track",), 3.0),
    **dict.fromkeys(("path", "footway", "cycleway", "bridleway", "steps", "ditch", "drain"), 1.5),
    **dict.fromkeys(("river",), 12.0),
    **dict.fromkeys(("canal",), 10.0),
    **dict.fromkeys(("stream",), 2.0),
}
_ROAD_WIDTH, _LANE, _STOREY, _BUILDING_HEIGHT = 5.0, 3.25, 3.0, 7.0
_MOST_WIDTH, _MOST_HEIGHT = 200.0, 1000.0


@dataclass(frozen=True)
class MapFeature:
    """One feature of a map.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    name : str
    rings : tuple of (k, 2) float64
        Coordinates. Of an area its border and the holes in it, without the last point, which is the first; or a line.
    closed : bool
        Whether it is an area.
    width, height : float
        Of a line and a building, metres.
    """

    kind: str
    name: str
    rings: tuple[NDArray[np.float64], ...]
    closed: bool
    width: float = 0.0
    height: float = 0.0


def read_outlines(path: Path, code: int = 0) -> tuple[list[MapFeature], System]:
    """Read areas and lines of a GeoJSON file; points are left out.

    Parameters
    ----------
    code : int
        EPSG code of the coordinates; 0 where the file tells.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken, or has no outlines; names the feature.
    """
    features, own = read_features(path)
    system = system_of(code or own, f"{path.name}: ")
    found: list[MapFeature] = []
    points = 0
    for number, feature in enumerate(features, 1):
        where = f"{path.name}: feature {number:,}"
        for rings, closed in _rings(feature["geometry"], where):
            points += sum(map(len, rings))
            if system.geographic and any((np.abs(ring) > (360.0, 90.0)).any() for ring in rings):
                raise SceneError(f"{where}: its coordinates are no longitude and latitude; set Coordinate System")
            found.append(_outline(feature.get("properties") or {}, rings, closed))
        if len(found) > MAX_OUTLINES or points > MAX_POINTS:
            raise SceneError(
                f"{path.name}: more than {MAX_OUTLINES:,} outlines, or {MAX_POINTS:,} points; cut it, for example with "
                "ogr2ogr -spat"
            )
    if not found:
        raise SceneError(f"{path.name}: it has no areas and no lines")
    return found, system


def _rings(geometry: dict[str, Any] | None, where: str) -> list[tuple[tuple[NDArray[np.float64], ...], bool]]:
    """Areas and lines of a geometry, an area as border and holes."""
    kind = None if geometry is None else geometry["type"]
    if kind in (None, "Point", "MultiPoint"):
        return []
    if kind == "GeometryCollection":
        parts = geometry.get("geometries")
        if not isinstance(parts, list) or not all(
            isinstance(p, dict) and isinstance(p.get("type"), str) and p["type"] != kind for p in parts
        ):
            raise SceneError(f"{where}: its geometries are no list of geometries")
        return [found for part in parts for found in _rings(part, where)]
    given = geometry.get("coordinates")
    many = {"LineString": lambda: [given], "MultiLineString": lambda: given}.get(kind)
    if many is not None:
        lines = [coordinates(line, where) for line in _list(many(), where)]
        if any(len(line) < 2 for line in lines):
            raise SceneError(f"{where}: a line of less than two points")
        return [((line,), False) for line in lines]
    if kind not in ("Polygon", "MultiPolygon"):
        raise SceneError(f"{where}: {shown(kind)} is no geometry of GeoJSON")
    areas = [given] if kind == "Polygon" else _list(given, where)
    return [(tuple(_ring(ring, where) for ring in _list(area, where)), True) for area in areas if area != []]


def _list(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise SceneError(f"{where}: its coordinates are {shown(value)}, not a list")
    return value


def _ring(values: Any, where: str) -> NDArray[np.float64]:
    ring = coordinates(values, where)
    if len(ring) > 1 and (ring[0] == ring[-1]).all():
        ring = ring[:-1]
    if len(ring) < 3:
        raise SceneError(f"{where}: an area of less than three points")
    return ring


def _outline(properties: dict[str, Any], rings: tuple[NDArray[np.float64], ...], closed: bool) -> MapFeature:
    kind, value = _kind(properties)
    width = height = 0.0
    if not closed:
        lanes = _measure(properties.get("lanes"))
        usual = _WIDTHS.get(value, _LANE * lanes if lanes else _ROAD_WIDTH if kind == ROAD else 0.0)
        width = min(_measure(properties.get("width")) or usual, _MOST_WIDTH)
    elif kind == BUILDING:
        storeys = _STOREY * _measure(properties.get("building:levels"))
        height = min(_measure(properties.get("height")) or storeys or _BUILDING_HEIGHT, _MOST_HEIGHT)
    name = properties.get("name")
    name = name if isinstance(name, str) and name.strip() else value or kind
    return MapFeature(kind, readable(name.strip(), NAME), rings, closed, width, height)


def _kind(properties: dict[str, Any]) -> tuple[str, str]:
    """Kind of a feature, and the value that tells it."""
    for key, kind in _KEYS.items():
        value = properties.get(key)
        if isinstance(value, str) and value not in ("", "no"):
            return kind, value
    for (key, value), kind in _VALUES.items():
        if properties.get(key) == value:
            return kind, value
    return OTHER, ""


def _measure(value: Any) -> float:
    """Metres of a width or height, or a number; 0 for what tells none. Maps have texts of all kinds there."""
    found = re.match(r"\s*(\d+(?:[.,]\d+)?)\s*(m|ft|')?", str(value)) if isinstance(value, str | int | float) else None
    if found is None:
        return 0.0
    return float(found[1].replace(",", ".")[:20]) * (0.3048 if found[2] in ("ft", "'") else 1.0)


def one_ring(rings: tuple[NDArray[np.float64], ...]) -> NDArray[np.float64]:
    """Border and holes of an area as one ring, (k, 2): a bridge without width leads to each hole and back."""
    outer = rings[0]
    for hole in rings[1:]:
        # From the hole's easternmost point to the point of the border that is nearest.
        start = int(np.argmax(hole[:, 0]))
        to = int(np.argmin(((outer - hole[start]) ** 2).sum(axis=1)))
        turned = np.roll(hole, -start, axis=0)
        outer = np.concatenate([outer[: to + 1], turned, turned[:1], outer[to:]])
    return outer


def denser(line: NDArray[np.float64], step: float, closed: bool = False) -> NDArray[np.float64]:
    """A line (k, 2) with more points, none farther than so many metres from the next."""
    ends = np.concatenate([line, line[:1]]) if closed else line
    pieces = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    number = np.maximum(np.ceil(pieces / step), 1).astype(np.int64)
    place = np.repeat(np.arange(len(number)), number)
    part = (np.arange(len(place)) - np.repeat(np.cumsum(number) - number, number)) / number[place]
    between = ends[place] + part[:, None] * (ends[place + 1] - ends[place])
    return between if closed else np.concatenate([between, ends[-1:]])
