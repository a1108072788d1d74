# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of woods, meadows, water, roads and buildings, told apart by the keys that OpenStreetMap has for them, by
words of what others call kinds of things, or by the name of their layer.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats, spread
from ..errors import NAME, SceneError, readable
from . import table
from .layers import LAYER, list_of, parts_of, read_features
from .projection import System
from .tables import MAX_POINTS, coordinates, flat_tags

WOOD, MEADOW, WATER, ROAD, BUILDING, OTHER = "Woods", "Meadows", "Water", "Roads", "Buildings", "Others"
KINDS = (WOOD, MEADOW, WATER, ROAD, BUILDING, OTHER)
#: Most outlines of a file: each becomes an object.
MAX_OUTLINES = 20_000
_TABLES = table("kinds")
#: Kinds by keys and values of OpenStreetMap.
_VALUES = {(key, value): kind for key, values in _TABLES["values"].items() for value, kind in values.items()}
#: Keys that tell by themselves, whatever their value; the first that a feature has counts.
_KEYS = {"building": BUILDING, "highway": ROAD, "waterway": WATER, "railway": ROAD, "water": WATER}
#: Widths of lines in meters, by the value of their key.
_WIDTHS: dict[str, float] = _TABLES["widths"]
_ROAD_WIDTH, _LANE, _STOREY, _BUILDING_HEIGHT = 5.0, 3.25, 3.0, 7.0
_MOST_WIDTH, _MOST_HEIGHT = 200.0, 1000.0
# Brackets stand for the beginning and the end of a word.
_PATTERNS = {
    key: re.compile(text.replace("<", "(?<![a-z])").replace(">", "(?![a-z])"))
    for key, text in _TABLES["patterns"].items()
}
#: Kinds by words of values, of layers and of files.
_WORDS = {kind: _PATTERNS[kind] for kind in (BUILDING, WATER, WOOD, ROAD, MEADOW)}
#: Values that are roads where they are lines.
_ROADS = set(_WIDTHS) - {"river", "canal", "stream", "ditch", "drain"}
_FEET = re.compile(r"(ft|feet)$")
_Tags = dict[str, Any]


@dataclass(frozen=True)
class MapFeature:
    """One feature of a map."""

    kind: str  # one of `KINDS`
    name: str
    #: (k, 2) each: a line, or border and holes of an area without the last point, which is the first.
    rings: tuple[Floats, ...]
    closed: bool  # whether it is an area
    #: width and height: of a line and a building, meters.
    width: float = 0.0
    height: float = 0.0


def read_outlines(path: Path, epsg: int = 0, kind: str = "") -> tuple[list[MapFeature], System, list[str]]:
    """Read areas and lines of a file, and what is to be told of it; points are left out.

    Parameters
    ----------
    epsg : int
        As of `chosen_system`.
    kind : str
        What all are taken for; empty to tell them by their keys.

    Raises
    ------
    OSError, SceneError
        It cannot be read, is broken, or has no outlines; names the feature.
    """
    features, system = read_features(path, epsg)
    outlines: list[MapFeature] = []
    points = slivers = 0
    for number, feature in enumerate(features, 1):
        where = f"{path.name}: feature {number:,}"
        tags = flat_tags(feature.get("properties") or {}).items()
        tags = {str(key).strip().lower(): value for key, value in tags if value not in (None, "")}
        names = (str(feature.get(LAYER, "")), path.stem)
        for rings, closed in _rings(feature["geometry"], where):
            points += sum(map(len, rings))
            if system.geographic and any((np.abs(ring) > (360.0, 90.0)).any() for ring in rings):
                raise SceneError(f"{where}: its coordinates are no longitude and latitude; set Coordinate System")
            if not len(rings) or len(rings[0]) < (3 if closed else 2):
                slivers += 1
                continue
            rings = tuple(ring for ring in rings if len(ring) > 2 or not closed)
            outlines.append(_outline(tags, names, rings, closed, kind))
        if len(outlines) > MAX_OUTLINES or points > MAX_POINTS:
            raise SceneError(
                f"{path.name}: more than {MAX_OUTLINES:,} outlines, or {MAX_POINTS:,} points; cut it, for example with "
                "ogr2ogr -spat"
            )
    if not outlines:
        few = f" but {slivers:,} of too few points" if slivers else ""
        raise SceneError(f"{path.name}: it has no areas and no lines{few}")
    notes = [f"{slivers:,} of too few points left out"] if slivers else []
    others = sum(feature.kind == OTHER for feature in outlines)
    if 2 * others > len(outlines):
        notes.append(f"nothing tells what {others:,} of them are; import them again with Take All As")
    return outlines, system, notes


def _rings(geometry: dict[str, Any] | None, where: str) -> Iterator[tuple[tuple[Floats, ...], bool]]:
    """Areas and lines of a geometry, an area as border and holes without their last points, which are the first."""
    for kind, values in parts_of(geometry, where):
        if kind == "LineString":
            yield (coordinates(values, where),), False
        elif kind == "Polygon" and values != []:
            rings = [coordinates(ring, where) for ring in list_of(values, where)]
            yield tuple(r[:-1] if len(r) > 1 and (r[0] == r[-1]).all() else r for r in rings), True


def _outline(tags: _Tags, names: tuple[str, ...], rings: tuple[Floats, ...], closed: bool, chosen: str) -> MapFeature:
    """A feature of its kind, with width and height."""
    kind, value = _kind(tags, names, closed)
    kind = chosen or kind
    width = height = 0.0
    if not closed:
        lanes = _measure(tags.get("lanes"))
        usual = _WIDTHS.get(value, _LANE * lanes if lanes else _ROAD_WIDTH if kind == ROAD else 0.0)
        width = min(_measured(tags, "width", _PATTERNS["widths"]) or usual, _MOST_WIDTH)
    elif kind == BUILDING:
        storeys = _STOREY * _measured(tags, "building:levels", _PATTERNS["storeys"])
        height = min(_measured(tags, "height", _PATTERNS["heights"]) or storeys or _BUILDING_HEIGHT, _MOST_HEIGHT)
    name = tags.get("name")
    name = name if isinstance(name, str) and name.strip() else value or kind
    return MapFeature(kind, readable(name.strip(), NAME), rings, closed, width, height)


def _kind(tags: _Tags, names: tuple[str, ...], closed: bool) -> tuple[str, str]:
    """Kind of a feature, and the value that tells it."""
    for key, kind in _KEYS.items():
        value = tags.get(key)
        if isinstance(value, str) and value.lower() not in ("no", "0", "false"):
            return kind, value
    for (key, value), kind in _VALUES.items():
        if tags.get(key) == value:
            return kind, value
    for key, value in tags.items():
        if isinstance(value, str) and _PATTERNS["classes"].fullmatch(re.sub(r"[^a-zäöüß]", "", key)):
            text = re.sub(r"[_\W]+", " ", value.lower()).strip()
            if not closed and text.removesuffix(" link") in _ROADS:
                return ROAD, text.removesuffix(" link")
            kind = next((kind for kind, words in _WORDS.items() if words.search(text)), "")
            if kind:
                return kind, value if len(value) < NAME else ""
    keys = " ".join(re.sub(r"[_\W]+", " ", key) for key in tags)
    if closed and _WORDS[BUILDING].search(keys):
        return BUILDING, ""
    for name in names:
        text = re.sub(r"[_\W\d]+", " ", name.lower()).strip()
        kind = next((kind for kind, words in _WORDS.items() if words.search(text)), "")
        if kind and (closed or kind in (ROAD, WATER)):
            return kind, ""
    return OTHER, ""


def _measured(tags: _Tags, usual: str, keys: re.Pattern) -> float:
    """The first measure under the usual key, or under any whose letters fit."""
    if meters := _measure(tags.get(usual)):
        return meters
    for key, value in tags.items():
        plain = re.sub(r"[^a-zäöüß]", "", key)
        if not key.startswith("roof:") and keys.fullmatch(plain) and (meters := _measure(value)):
            return meters * (0.3048 if _FEET.search(plain) else 1.0)
    return 0.0


def _measure(value: Any) -> float:
    """Meters of a width or height, or a number; 0 for what tells none. Maps have texts of all kinds there."""
    text = str(value) if isinstance(value, str | int | float) else ""
    match = re.match(r"[~≈\s]*(\d+(?:[.,]\d+)?)\s*(m|ft|')?", text)
    if match is None:
        return 0.0
    return float(match[1].replace(",", ".")[:20]) * (0.3048 if match[2] in ("ft", "'") else 1.0)


def one_ring(rings: tuple[Floats, ...]) -> Floats:
    """Border and holes of an area as one ring, (k, 2): a bridge without width leads to each hole and back."""
    outer = rings[0]
    for hole in rings[1:]:
        # From the hole's easternmost point to the point of the border that is nearest.
        start = int(np.argmax(hole[:, 0]))
        to = int(np.argmin(((outer - hole[start]) ** 2).sum(axis=1)))
        turned = np.roll(hole, -start, axis=0)
        outer = np.concatenate([outer[: to + 1], turned, turned[:1], outer[to:]])
    return outer


def denser(line: Floats, step: float) -> Floats:
    """A line (k, 2) with more points, none farther than so many meters from the next."""
    number = np.maximum(np.ceil(np.linalg.norm(np.diff(line, axis=0), axis=1) / step), 1).astype(np.int64)
    place, index = spread(number)
    between = line[place] + (index / number[place])[:, None] * (line[place + 1] - line[place])
    return np.concatenate([between, line[-1:]])
