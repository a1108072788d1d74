# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of inventories: numbers as people write them, with units, as ranges, or as words for nothing; and places."""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import table

_CELLS: dict[str, Any] = table("titles")["cells"]
_MISSING, _METRES = _CELLS["missing"], {float(metres): forms for metres, forms in _CELLS["units"].items()}
_NUMBER, _UNIT = r"\d+(?:[.,’' ]\d{3})*(?:[.,]\d+)?(?:e[+-]?\d+)?|[.,]\d+", "|".join(_METRES.values())
_SHAPE = re.compile(
    rf"(?:{_CELLS['class']})?\s*(?:{_CELLS['about']})?\s*(?:(?P<less>{_CELLS['less']})|(?P<more>{_CELLS['more']}))?\s*"
    rf"(?P<low>-?(?:{_NUMBER}))(?P<over>\+)?\s*(?P<first>{_UNIT})?\.?\s*(?:(?P<sep>{_CELLS['to']})\s*(?:<=?\s*)?"
    rf"(?P<high>{_NUMBER})\s*(?P<second>{_UNIT})?\.?\s*)?(?P<plus>{_CELLS['plus']})?",
)
_FLOAT = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
#: Characters of a cell that count.
LONGEST = 200
_WITH_CODE = 0x20000000  # of well-known binary
#: What a cell holds.
NUMBER, RANGE, NOTHING, WORD, WRONG = range(5)


class Quantity(NamedTuple):
    """A number, the metres of the unit that it names, 0 if none, and what the cell holds."""

    value: float
    unit: float = 0.0
    kind: int = NUMBER


def cell_of(text: str, points: bool = False) -> Quantity:
    """What a cell says.

    Parameters
    ----------
    points : bool
        Other cells have decimal points, so that a comma before three digits parts thousands.
    """
    text = text.strip().lower().strip("*").strip()
    if text in _MISSING:
        return Quantity(0.0, kind=NOTHING)
    if not any(c.isdecimal() for c in text):
        return Quantity(0.0, kind=WORD)
    aside = re.fullmatch(r"([^()]*)\(([^()]*)\)([^()]*)", text)  # "small (0-15 ft)", "12 m (measured)"
    if aside is not None:
        inner, outer = cell_of(aside[2], points), cell_of(aside[1] + aside[3], points)
        return inner if inner.kind == RANGE or outer.kind in (NOTHING, WORD) else outer
    found = _SHAPE.fullmatch(text)
    if found is None:
        return Quantity(math.nan, kind=WRONG)
    low, high = _value(found["low"], points), _value(found["high"], points) if found["high"] else math.nan
    unit = _unit(found["second"] or found["first"])
    if found["high"] is None:
        first = _unit(found["first"])
        value = low / 2.0 if found["less"] else low
        return Quantity(
            value, first, RANGE if found["less"] or found["more"] or found["plus"] or found["over"] else NUMBER
        )
    if found["first"] and not found["sep"]:
        return Quantity(math.nan, kind=WRONG)
    if found["sep"] in ("/", ";", "+"):  # several stems
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
    """Metres of a unit by its name; 0 for none."""
    return next((metres for metres, forms in _METRES.items() if text and re.fullmatch(forms, text)), 0.0)


def cells(texts: NDArray[np.str_]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Numbers (n,), 0 for nothing and nan for what is wrong; metres of their units, 0 if they name none; kinds."""
    distinct, index = np.unique(texts, return_inverse=True)
    points = any("." in text for text in distinct.tolist())
    found = [
        Quantity(float(text)) if _FLOAT.fullmatch(text) else _in_parts(text) or cell_of(text, points)
        for text in distinct.tolist()
    ]
    values, units, kinds = (np.array(column) for column in zip(*found, strict=True))
    values = np.where(np.isfinite(values), values, np.nan)
    return values[index], units[index].astype(np.float64), kinds[index].astype(np.int64)


def _in_parts(text: str) -> Quantity | None:
    """Feet and inches, or degrees, minutes and seconds; None for others."""
    found = re.fullmatch(r"(\d+)\s*(?:ft|feet|['′])\s*(\d+(?:\.\d+)?)\s*(?:in|inches|\"|″|'')?", text.strip().lower())
    if found:
        return Quantity(float(found[1]) + float(found[2]) / 12.0, 0.3048)
    found = re.fullmatch(_ANGLE, text.strip().upper())
    if found is None:
        return None
    value = float(found[2]) + float(found[3]) / 60.0 + float((found[4] or "0").replace(",", ".")) / 3600.0
    return Quantity(-value if found[1] or found[5] in ("S", "W") else value)


_ANGLE = r"(-)?(\d{1,3})\s*[°º]\s*(\d{1,2})\s*['′’]\s*(\d{1,2}(?:[.,]\d+)?)?\s*(?:\"|″|”|'')?\s*([NSEW])?"
_PAIR = re.compile(r"\(?\s*(-?\d+(?:[.,]\d+)?)°?\s*[,;/ ]\s*(-?\d+(?:[.,]\d+)?)°?\s*\)?")
_WELL_KNOWN = re.compile(
    r"(?:srid=(\d+);\s*)?(?:multi)?(?:point|polygon|linestring)\s*(?:zm?|m)?\s*\((.*)\)", re.IGNORECASE
)


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
            code, at = (code, 9) if kind & _WITH_CODE else (0, 5)
            return (*struct.unpack_from(f"{order}2d", data, at), code) if kind & 255 == 1 else (math.nan, math.nan, 0)
        if known is not None:
            first = known[2].lstrip("( ").split(")")[0]
            points = [[float(number) for number in point.strip("() ").split()[:2]] for point in first.split(",")]
            return *middle_of(points), int(known[1] or 0)
        if text.strip().startswith("{"):
            return *middle_of(_positions(json.loads(text).get("coordinates"))), 0
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, RecursionError, struct.error):
        pass
    return math.nan, math.nan, 0


def _positions(values: object) -> list[list[float]]:
    """The first ring of nested coordinates, or the point alone, as a list."""
    while isinstance(values, list) and values and isinstance(values[0], list) and isinstance(values[0][0], list):
        values = values[0]
    return values if isinstance(values, list) and values and isinstance(values[0], list) else [values]  # type: ignore


def middle_of(points: Sequence[Sequence[float]]) -> tuple[float, float]:
    """The centroid of a ring (n, 2), or the mean of less than three points.

    Raises
    ------
    ValueError
        They are no points.
    """
    ring = np.array([(x, y) for x, y, *_ in points], np.float64).reshape(-1, 2)
    if not np.isfinite(ring).all() or not len(ring):
        raise ValueError
    foot = ring[0]
    (x, y), (u, v) = (ring - foot).T, np.roll(ring - foot, -1, axis=0).T
    cross = x * v - u * y
    if abs(cross.sum()) < 1e-300:
        return tuple(ring.mean(axis=0).tolist())
    return tuple((foot + np.array([((x + u) * cross).sum(), ((y + v) * cross).sum()]) / (3.0 * cross.sum())).tolist())
