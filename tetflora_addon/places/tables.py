# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables from files: comma-separated values, and features of GeoJSON with their properties and geometry."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NAME, SceneError, readable, shown
from ..files import json_of, read_whole
from .projection import LONGITUDE_LATITUDE, code_in

MAX_BYTES, MAX_ROWS, MAX_COLUMNS = 200_000_000, 2_000_000, 500
_DELIMITERS = ",;\t"
_MARKS = (b"\xff\xfe", b"\xfe\xff")  # of UTF-16
#: Most points of all lines of a file of outlines.
MAX_POINTS = 5_000_000


@dataclass(frozen=True)
class Table:
    """Rows of texts under names.

    Attributes
    ----------
    name : str
        Of the file.
    row : str
        What a row is called, such as "line".
    numbers : (n,) int64
        Number of each row in the file.
    columns : dict
        Texts (n,) of each column by its name.
    points : (n, 2) float64, optional
        Coordinates from geometry.
    code : int, optional
        EPSG code that goes with them.
    """

    name: str
    row: str
    numbers: NDArray[np.int64]
    columns: dict[str, NDArray[np.str_]]
    points: NDArray[np.float64] | None = None
    code: int | None = None

    def where(self, index: int, column: str = "") -> str:
        """A place in the file, for messages."""
        text = f"{self.name}: {self.row} {self.numbers[index]:,}"
        return f"{text}, column {shown(column)}" if column else text


def read_csv(path: Path) -> Table:
    """Read separated values; the first line names the columns.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken; names the line.
    """
    content = read_whole(path, MAX_BYTES)
    name = path.name
    if content.startswith(_MARKS) or b"\0" in content:
        raise SceneError(f"{name}: this is no text in UTF-8; save it as CSV in UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
    first = text[: text.find("\n") + 1 or len(text)]
    delimiter = max(_DELIMITERS, key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    rows, numbers = [], []
    try:
        header = [readable(cell.strip(), NAME) for cell in next(reader, [])]
        if len(header) < 2 or len(header) > MAX_COLUMNS:
            raise SceneError(f"{name}: line 1: {len(header)} columns; names of columns must stand there")
        before = reader.line_num
        for row in reader:
            if any(map(str.strip, row)):
                if len(row) != len(header):
                    raise SceneError(f"{name}: line {before + 1:,}: {len(row)} values, and line 1 has {len(header)}")
                rows.append(row)
                numbers.append(before + 1)
            before = reader.line_num
            if len(rows) > MAX_ROWS:
                raise SceneError(f"{name}: more than {MAX_ROWS:,} rows; cut it into pieces")
    except csv.Error as error:
        raise SceneError(f"{name}: line {reader.line_num:,}: {error}") from None
    columns: dict[str, NDArray[np.str_]] = {}
    for title, cells in zip(header, zip(*rows, strict=True), strict=False):
        columns.setdefault(title, _texts(cells))
    return Table(name, "line", np.array(numbers, np.int64), columns)


def read_features(path: Path) -> tuple[list[dict[str, Any]], int]:
    """Features of a GeoJSON file, of which each is an object with a geometry, and their EPSG code.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken; names the feature.
    """
    name = path.name
    try:
        data = json_of(read_whole(path, MAX_BYTES))
    except ValueError as error:
        raise SceneError(f"{name}: {error}") from None
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "Feature":
        data = {"features": [data]}
    elif kind != "FeatureCollection":
        raise SceneError(f'{name}: "type" is {shown(kind)}; a GeoJSON file is a FeatureCollection')
    features = data.get("features")
    if not isinstance(features, list) or len(features) > MAX_ROWS:
        raise SceneError(f'{name}: "features" must be a list of at most {MAX_ROWS:,}')
    for number, feature in enumerate(features, 1):
        geometry = feature.get("geometry", ...) if isinstance(feature, dict) else ...
        properties = feature.get("properties") if isinstance(feature, dict) else None
        if not isinstance(geometry, dict | None) or not isinstance(properties, dict | None):
            raise SceneError(f"{name}: feature {number:,}: it has no geometry, or properties that are no object")
        if geometry is not None and not isinstance(geometry.get("type"), str):
            raise SceneError(f"{name}: feature {number:,}: its geometry has no type")
    return features, _code(data.get("crs"), name)


def _code(crs: Any, name: str) -> int:
    """EPSG code of the member ``crs`` that GeoJSON of before 2016 has, and GDAL still writes."""
    if crs is None:
        return LONGITUDE_LATITUDE
    properties = crs.get("properties") if isinstance(crs, dict) else None
    text = properties.get("name") if isinstance(properties, dict) else None
    code = code_in(text) if isinstance(text, str) else None
    if code is None:
        raise SceneError(f'{name}: "crs" is {shown(crs)}, which is no EPSG code; write it with -t_srs EPSG:4326')
    return code


def read_points(path: Path) -> Table:
    """Points of a GeoJSON file with their properties; an area counts as its middle, other features do not.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken; names the feature.
    """
    features, code = read_features(path)
    name = path.name
    points, numbers, rows = [], [], []
    for number, feature in enumerate(features, 1):
        geometry = feature["geometry"]
        if geometry is None or geometry["type"] not in ("Point", "MultiPoint"):
            continue
        where = f"{name}: feature {number:,}"
        found = coordinates(
            [geometry.get("coordinates")] if geometry["type"] == "Point" else geometry.get("coordinates"), where
        )
        points.append(found)
        numbers += [number] * len(found)
        rows += [feature.get("properties") or {}] * len(found)
    titles = dict.fromkeys(title for row in rows for title in row)
    if len(titles) > MAX_COLUMNS:
        raise SceneError(f"{name}: {len(titles):,} kinds of properties; {MAX_COLUMNS} is the limit")
    columns = {title: _texts([_text(row.get(title)) for row in rows]) for title in titles}
    where = np.concatenate(points) if points else np.zeros((0, 2))
    return Table(name, "feature", np.array(numbers, np.int64), columns, where, code)


def coordinates(values: Any, where: str) -> NDArray[np.float64]:
    """Positions of GeoJSON as (n, 2); heights do not count.

    Raises
    ------
    SceneError
        They are no positions; ``where`` begins the message.
    """
    try:
        points = np.array([(x, y) for x, y, *_ in values], np.float64).reshape(-1, 2)
        if (
            all(type(x) in (int, float) and type(y) in (int, float) for x, y, *_ in values)
            and np.isfinite(points).all()
        ):
            return points
    except (TypeError, ValueError, OverflowError):
        pass
    raise SceneError(f"{where}: its coordinates are no positions of two or three finite numbers")


def _texts(cells: Any) -> NDArray[np.str_]:
    return np.char.strip(np.array([cell[:_LONGEST] for cell in cells], dtype=np.str_))


_LONGEST = 200  # characters of a value that count


def _text(value: Any) -> str:
    """A property as a cell of a table."""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, float) and not math.isfinite(value):
        return "infinite"
    return value if isinstance(value, str) else "" if value is None or isinstance(value, dict | list) else str(value)
