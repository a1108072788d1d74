# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables from files: comma-separated values, and features of GeoJSON with their properties and geometry."""

from __future__ import annotations

import csv
import io
import math
import re
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NAME, SceneError, readable, shown
from ..files import json_of, read_whole
from .cells import LONGEST, middle_of
from .layers import MAX_BYTES, MAX_ROWS, parts_of, read_features
from .projection import System

MAX_COLUMNS = 500
_DELIMITERS = ",;\t|"
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
    system : System, optional
        That goes with them.
    broken : int
        Rows that were left out because they are not like the others.
    first : str
        What is wrong with the first of them.
    notes : list of str
        What else was left out.
    """

    name: str
    row: str
    numbers: NDArray[np.int64]
    columns: dict[str, NDArray[np.str_]]
    points: NDArray[np.float64] | None = None
    system: System | None = None
    broken: int = 0
    first: str = ""
    notes: list[str] = field(default_factory=list)

    def where(self, index: int, column: str = "") -> str:
        """A place in the file, for messages."""
        text = f"{self.name}: {self.row} {self.numbers[index]:,}"
        return f"{text}, column {shown(column)}" if column else text


def read_csv(path: Path, skip: bool = False, most: int | None = None) -> Table:
    """Read separated values; the first line names the columns, or the second after one such as ``sep=;``.

    Parameters
    ----------
    skip : bool
        Leave out rows with other numbers of values than the first line.
    most : int, optional
        Rows at most, for a preview.
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
    """
    features, system = read_features(path, chosen)
    name, without = path.name, 0
    points, numbers, rows = [np.zeros((0, 2))], [], []
    for number, feature in enumerate(features[:most], 1):
        found = _points_of(feature["geometry"], f"{name}: feature {number:,}")
        without += not len(found)
        points.append(found)
        numbers += [number] * len(found)
        rows += [flat_tags(feature.get("properties") or {})] * len(found)
    titles = dict.fromkeys(title for row in rows for title in row)
    if len(titles) > MAX_COLUMNS:
        raise SceneError(f"{name}: {len(titles):,} kinds of properties; {MAX_COLUMNS} is the limit")
    columns = {title: _texts([_text(row.get(title)) for row in rows]) for title in titles}
    notes = [f"{without:,} feature{'s' * (without > 1)} without a place"] if without else []
    return Table(name, "feature", np.array(numbers, np.int64), columns, np.concatenate(points), system, notes=notes)


def _points_of(geometry: dict[str, Any] | None, where: str) -> NDArray[np.float64]:
    """Places (n, 2) of a geometry: its points, or the middle of its first area."""
    parts = list(parts_of(geometry, where))
    points = [values for kind, values in parts if kind == "Point"]
    area = next(
        (values[0] for kind, values in parts if kind == "Polygon" and isinstance(values, list) and values), None
    )
    if points or area is None:
        return coordinates(points, where, texts=True)
    return np.array([middle_of(coordinates(area, where, texts=True))])


def flat_tags(properties: dict[str, Any]) -> dict[str, Any]:
    """Properties with those that lie within others, as OpenStreetMap's tags do."""
    out = dict(properties)
    for title, value in properties.items():
        if title in ("other_tags", "all_tags", "tags") and isinstance(value, str):  # as GDAL writes them
            pairs = re.findall(r'"((?:[^"\\]|\\.)*)"=>"((?:[^"\\]|\\.)*)"', value)
            value = {key: re.sub(r"\\(.)", r"\1", text) for key, text in pairs}
            with suppress(ValueError):
                value = value or json_of(properties[title].encode())
        if isinstance(value, dict) and value:
            out.pop(title)
            out = flat_tags(value) | out if len(value) < MAX_COLUMNS else out
    return out


def coordinates(values: Any, where: str, texts: bool = False) -> NDArray[np.float64]:
    """Positions of GeoJSON as (n, 2); heights do not count, and numbers may be texts if asked for."""
    try:
        points = np.array([(x, y) for x, y, *_ in values], np.float64).reshape(-1, 2)
        kinds = {type(number) for x, y, *_ in values for number in (x, y)}
        if kinds <= {int, float, str if texts else int} and np.isfinite(points).all():
            return points
    except (TypeError, ValueError, OverflowError):
        pass
    raise SceneError(f"{where}: its coordinates are no positions of two or three finite numbers; correct them")


def _texts(cells: Any) -> NDArray[np.str_]:
    """Cells (n,) without spaces around them."""
    return np.char.strip(np.array([cell[:LONGEST] for cell in cells], dtype=np.str_))


def _text(value: Any) -> str:
    """A property as a cell of a table."""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, float) and not math.isfinite(value):
        return "infinite"
    return value if isinstance(value, str) else "" if value is None or isinstance(value, dict | list) else str(value)
