# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables from files: comma-separated values, and features of GeoJSON with their properties and geometry; and what
cells say: numbers as people write them, with units, as ranges, or as words for nothing, and places.
"""

import csv
import io
import json
import math
import re
import struct
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers
from ..errors import NAME, SceneError, quoted, readable
from ..files import parse_json, read_whole
from . import table
from .layers import MAX_BYTES, MAX_ROWS, parts_of, read_features
from .projection import System

MAX_COLUMNS = 500
_DELIMITERS = ",;\t|"
_MARKS = (b"\xff\xfe", b"\xfe\xff")  # of UTF-16
#: Most points of all lines of a file of outlines.
MAX_POINTS = 5_000_000


@dataclass(frozen=True)
class Table:
    """Rows of texts under names."""

    name: str  # of the file
    row: str  # what a row is called, such as "line"
    numbers: Integers  # (n,): number of each row in the file
    columns: dict[str, NDArray[np.str_]]  # texts (n,) of each column by its name
    points: Floats | None = None  # (n, 2): coordinates from geometry
    system: System | None = None  # that goes with them
    broken: int = 0  # rows that were left out because they are not like the others
    first: str = ""  # what is wrong with the first of them
    notes: list[str] = field(default_factory=list)  # what else was left out

    def where(self, index: int, column: str = "") -> str:
        """A place in the file, for messages."""
        text = f"{self.name}: {self.row} {self.numbers[index]:,}"
        return f"{text}, column {quoted(column)}" if column else text


def read_csv(path: Path, skip: bool = False, most: int | None = None) -> Table:
    """Read separated values; the first line names the columns, or the second after one such as ``sep=;``.

    Parameters
    ----------
    skip : bool
        Leave out rows with other numbers of values than the first line.
    most : int, optional
        Rows at most, for a preview.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken; names the line.
    """
    content = read_whole(path, MAX_BYTES)
    name = path.name
    wide = content.startswith(_MARKS)
    if b"\0" in content and not wide:
        raise SceneError(f"{name}: this is no text; save it as CSV in UTF-8")
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
    told = re.match(r"\"?sep=(.)\"?\r?\n", text)
    text, above = (text[told.end() :], 1) if told else (text, 0)
    first = text[: text.find("\n") + 1 or len(text)]
    delimiter = told[1] if told else max(_DELIMITERS, key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    rows, numbers, broken, wrong = [], [], 0, ""
    try:
        header = [readable(cell.strip(), NAME) for cell in next(reader, [])]
        if len(header) < 2 or len(header) > MAX_COLUMNS:
            raise SceneError(f"{name}: line 1: {len(header)} columns; names of columns must stand there; add them")
        before = reader.line_num
        for row in reader:
            while len(row) > len(header) and not row[-1].strip():
                row.pop()
            if len(row) == len(header) and any(map(str.strip, row)):
                rows.append(row)
                numbers.append(above + before + 1)
            elif any(map(str.strip, row)):
                broken += 1
                text = f"{name}: line {above + before + 1:,}: {len(row)} values, and line {above + 1} has {len(header)}"
                wrong = wrong or text
                if not skip:
                    raise SceneError(f"{text}. Correct it, or turn on Skip Broken Rows")
            before = reader.line_num
            if most is not None and len(rows) >= most:
                break
            if len(rows) > MAX_ROWS:
                raise SceneError(f"{name}: more than {MAX_ROWS:,} rows; cut it into pieces")
    except csv.Error as error:
        raise SceneError(f"{name}: line {above + reader.line_num:,}: {error}; correct it") from None
    columns: dict[str, NDArray[np.str_]] = {}
    for title, texts in zip(header, zip(*rows, strict=True), strict=False):
        columns.setdefault(title, _texts(texts))
    return Table(name, "line", np.array(numbers, np.int64), columns, broken=broken, first=wrong)


def read_points(path: Path, _skip: bool = False, most: int | None = None, chosen: int = 0) -> Table:
    """Points of a GeoJSON file with their properties; an area counts as its middle, lines do not count.

    Parameters
    ----------
    most : int, optional
        Features at most, for a preview.
    chosen : int
        As of `read_features`.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken; names the feature.
    """
    features, system = read_features(path, chosen)
    name, without = path.name, 0
    points, numbers, rows = [np.zeros((0, 2))], [], []
    for number, feature in enumerate(features[:most], 1):
        places = _points_of(feature["geometry"], f"{name}: feature {number:,}")
        without += not len(places)
        points.append(places)
        numbers += [number] * len(places)
        rows += [flat_tags(feature.get("properties") or {})] * len(places)
    titles = dict.fromkeys(title for row in rows for title in row)
    if len(titles) > MAX_COLUMNS:
        raise SceneError(f"{name}: {len(titles):,} kinds of properties; {MAX_COLUMNS} is the limit")
    columns = {title: _texts([_text(row.get(title)) for row in rows]) for title in titles}
    notes = [f"{without:,} feature{'s' * (without > 1)} without a place"] if without else []
    return Table(name, "feature", np.array(numbers, np.int64), columns, np.concatenate(points), system, notes=notes)


def _points_of(geometry: dict[str, Any] | None, where: str) -> Floats:
    """Places (n, 2) of a geometry: its points, or the middle of its first area."""
    parts = list(parts_of(geometry, where))
    points = [values for kind, values in parts if kind == "Point"]
    areas = [values for kind, values in parts if kind == "Polygon" and isinstance(values, list) and values]
    if points or not areas:
        return coordinates(points, where, texts=True)
    return np.array([_middle(coordinates(areas[0][0], where, texts=True))])


def flat_tags(properties: dict[str, Any]) -> dict[str, Any]:
    """Properties with those that lie within others, as OpenStreetMap's tags do."""
    out = dict(properties)
    for title, value in properties.items():
        if title in ("other_tags", "all_tags", "tags") and isinstance(value, str):  # as GDAL writes them
            pairs = re.findall(r'"((?:[^"\\]|\\.)*)"=>"((?:[^"\\]|\\.)*)"', value)
            value = {key: re.sub(r"\\(.)", r"\1", text) for key, text in pairs}
            with suppress(ValueError):
                value = value or parse_json(properties[title].encode())
        if isinstance(value, dict) and value:
            out.pop(title)
            out = flat_tags(value) | out if len(value) < MAX_COLUMNS else out
    return out


def coordinates(values: Any, where: str, texts: bool = False) -> Floats:
    """Positions of GeoJSON as (n, 2); heights do not count, and numbers may be texts if asked for.

    Raises
    ------
    SceneError
        They are no positions; ``where`` begins the message.
    """
    try:
        points = np.array([(x, y) for x, y, *_ in values], np.float64).reshape(-1, 2)
        kinds = {type(number) for x, y, *_ in values for number in (x, y)}
        if kinds <= {int, float, str if texts else int} and np.isfinite(points).all():
            return points
    except (TypeError, ValueError, OverflowError):
        pass
    raise SceneError(f"{where}: its coordinates are no positions of two or three finite numbers; correct them")


def _texts(values: Any) -> NDArray[np.str_]:
    """Cells (n,) without spaces around them."""
    return np.char.strip(np.array([value[:LONGEST] for value in values], dtype=np.str_))


def _text(value: Any) -> str:
    """A property as a cell of a table."""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, float) and not math.isfinite(value):
        return "infinite"
    return value if isinstance(value, str) else "" if value is None or isinstance(value, dict | list) else str(value)


_CELLS: dict[str, Any] = table("titles")["cells"]
_MISSING, _METERS = _CELLS["missing"], {float(meters): forms for meters, forms in _CELLS["units"].items()}
_NUMBER, _UNIT = r"\d+(?:[.,’' ]\d{3})*(?:[.,]\d+)?(?:e[+-]?\d+)?|[.,]\d+", "|".join(_METERS.values())
_SHAPE = re.compile(
    rf"(?:{_CELLS['class']})?\s*(?:{_CELLS['about']})?\s*(?:(?P<less>{_CELLS['less']})|(?P<more>{_CELLS['more']}))?\s*"
    rf"(?P<low>-?(?:{_NUMBER}))(?P<over>\+)?\s*(?P<first>{_UNIT})?\.?\s*(?:(?P<sep>{_CELLS['to']})\s*(?:<=?\s*)?"
    rf"(?P<high>{_NUMBER})\s*(?P<second>{_UNIT})?\.?\s*)?(?P<plus>{_CELLS['plus']})?"
)
_FLOAT = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
#: Characters of a cell that count.
LONGEST = 200
_WITH_CODE = 0x20000000  # of well-known binary
#: What a cell holds.
NUMBER, RANGE, NOTHING, WORD, WRONG = range(5)


class Quantity(NamedTuple):
    """A number, the meters of the unit that it names, 0 if none, and what the cell holds."""

    value: float
    unit: float = 0.0
    kind: int = NUMBER


def _cell(text: str, points: bool) -> Quantity:
    """What a cell says; where others have decimal points, a comma before three digits parts thousands."""
    text = text.strip().lower().strip("*").strip()
    if text in _MISSING:
        return Quantity(0.0, kind=NOTHING)
    if not any(c.isdecimal() for c in text):
        return Quantity(0.0, kind=WORD)
    aside = re.fullmatch(r"([^()]*)\(([^()]*)\)([^()]*)", text)  # "small (0-15 ft)", "12 m (measured)"
    if aside is not None:
        inner, outer = _cell(aside[2], points), _cell(aside[1] + aside[3], points)
        return inner if inner.kind == RANGE or outer.kind in (NOTHING, WORD) else outer
    match = _SHAPE.fullmatch(text)
    if match is None:
        return Quantity(math.nan, kind=WRONG)
    low, high = _value(match["low"], points), _value(match["high"], points) if match["high"] else math.nan
    unit = _unit(match["second"] or match["first"])
    if match["high"] is None:
        open_ = any(match[mark] for mark in ("less", "more", "plus", "over"))
        return Quantity(low / 2.0 if match["less"] else low, unit, RANGE if open_ else NUMBER)
    if match["first"] and not match["sep"]:
        return Quantity(math.nan, kind=WRONG)
    if match["sep"] in ("/", ";", "+"):  # several stems
        return Quantity(max(low, high), unit)
    return Quantity((low + high) / 2.0, unit, RANGE) if high >= low else Quantity(math.nan, kind=WRONG)


def _value(text: str, points: bool) -> float:
    """A number as people write it."""
    text = re.sub(r"[’' ]", "", text)
    comma, point = text.rfind(","), text.rfind(".")
    if min(comma, point) >= 0:  # the last one parts decimals
        text = text.replace("," if point > comma else ".", "")
    if text.count(",") > 1 or (points and re.fullmatch(r"-?[1-9]\d{0,2},\d{3}", text)):
        text = text.replace(",", "")
    if text.count(".") > 1:
        text = text.replace(".", "")
    return float(text.replace(",", "."))


def _unit(text: str | None) -> float:
    """Meters of a unit by its name; 0 for none."""
    return next((meters for meters, forms in _METERS.items() if text and re.fullmatch(forms, text)), 0.0)


def cells(texts: NDArray[np.str_]) -> tuple[Floats, Floats, Integers]:
    """Numbers (n,), 0 for nothing and nan for what is wrong; meters of their units, 0 if they name none; kinds."""
    distinct, index = np.unique(texts, return_inverse=True)
    points = any("." in text for text in distinct.tolist())
    quantities = [
        Quantity(float(text)) if _FLOAT.fullmatch(text) else _in_parts(text) or _cell(text, points)
        for text in distinct.tolist()
    ]
    values, units, kinds = (np.array(column) for column in zip(*quantities, strict=True))
    values = np.where(np.isfinite(values), values, np.nan)
    return values[index], units[index].astype(np.float64), kinds[index].astype(np.int64)


def _in_parts(text: str) -> Quantity | None:
    """Feet and inches, or degrees, minutes and seconds; None for others."""
    match = re.fullmatch(r"(\d+)\s*(?:ft|feet|['′])\s*(\d+(?:\.\d+)?)\s*(?:in|inches|\"|″|'')?", text.strip().lower())
    if match:
        return Quantity(float(match[1]) + float(match[2]) / 12.0, 0.3048)
    match = re.fullmatch(_ANGLE, text.strip().upper())
    if match is None:
        return None
    value = float(match[2]) + float(match[3]) / 60.0 + float((match[4] or "0").replace(",", ".")) / 3600.0
    return Quantity(-value if match[1] or match[5] in ("S", "W") else value)


_ANGLE = r"(-)?(\d{1,3})\s*[°º]\s*(\d{1,2})\s*['′’]\s*(\d{1,2}(?:[.,]\d+)?)?\s*(?:\"|″|”|'')?\s*([NSEW])?"
_PAIR = re.compile(r"\(?\s*(-?\d+(?:[.,]\d+)?)°?\s*[,;/ ]\s*(-?\d+(?:[.,]\d+)?)°?\s*\)?")
_WELL_KNOWN = re.compile(r"(?i)(?:srid=(\d+);\s*)?(?:multi)?(?:point|polygon|linestring)\s*(?:zm?|m)?\s*\((.*)\)")


def place_in(text: str) -> tuple[float, float, int]:
    """A place in one cell: both numbers, nan for none, and how it says it.

    Returns
    -------
    x, y : float
        The middle of what is larger than a point.
    way : int
        -1 for two plain numbers, whose order nobody tells; else the EPSG code that stands there, or 0.
    """
    plain = _PAIR.fullmatch(text.strip()) or re.search(r"\((-?\d+\.\d+), *(-?\d+\.\d+)\)\s*$", text)  # below an address
    if plain is not None:
        return float(plain[1].replace(",", ".")), float(plain[2].replace(",", ".")), -1
    if len(text) == LONGEST:  # a large area that was cut
        text = text.rpartition(",")[0] + ")"
    known = _WELL_KNOWN.fullmatch(text.strip())
    try:
        if re.fullmatch(r"0[01](?:[0-9a-fA-F]{2}){20,}", text):  # well-known binary, as databases write it
            data = bytes.fromhex(text)
            order = "<" if data[0] else ">"
            kind, code = struct.unpack_from(f"{order}2I", data, 1)
            code, byte = (code, 9) if kind & _WITH_CODE else (0, 5)
            return (*struct.unpack_from(f"{order}2d", data, byte), code) if kind & 255 == 1 else (math.nan, math.nan, 0)
        if known is not None:
            first = known[2].lstrip("( ").split(")")[0]
            points = [[float(number) for number in point.strip("() ").split()[:2]] for point in first.split(",")]
            return *_middle(points), int(known[1] or 0)
        if text.strip().startswith("{"):
            return *_middle(_positions(json.loads(text).get("coordinates"))), 0
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, RecursionError, struct.error):
        pass
    return math.nan, math.nan, 0


def _positions(values: object) -> list[list[float]]:
    """The first ring of nested coordinates, or the point alone, as a list."""
    while isinstance(values, list) and values and isinstance(values[0], list) and isinstance(values[0][0], list):
        values = values[0]
    return values if isinstance(values, list) and values and isinstance(values[0], list) else [values]  # type: ignore


def _middle(points: Sequence[Sequence[float]]) -> tuple[float, float]:
    """The centroid of a ring (n, 2), or the mean of less than three points; an error where they are none."""
    ring = np.array([(x, y) for x, y, *_ in points], np.float64).reshape(-1, 2)
    if not np.isfinite(ring).all() or not len(ring):
        raise ValueError
    foot = ring[0]
    (x, y), (u, v) = (ring - foot).T, np.roll(ring - foot, -1, axis=0).T
    cross = x * v - u * y
    if abs(cross.sum()) < 1e-300:
        return tuple(ring.mean(axis=0).tolist())
    return tuple((foot + np.array([((x + u) * cross).sum(), ((y + v) * cross).sum()]) / (3.0 * cross.sum())).tolist())
