# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inventories of trees: what columns mean, in which units, and what they say of each tree."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, shown
from .projection import LONGITUDE_LATITUDE, System, system_of
from .species_names import is_name, key_of, plain_words, species_named, table
from .tables import Table, read_csv, read_points

#: Metres of units that a header may name.
_UNITS = {
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres", "metri", "metros"), 1.0),
    **dict.fromkeys(("dm",), 0.1),
    **dict.fromkeys(("cm", "centimeter", "centimetre", "centimeters", "centimetres", "centimetri"), 0.01),
    **dict.fromkeys(("mm",), 0.001),
    **dict.fromkeys(("ft", "feet", "foot"), 0.3048),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
}
_FILLERS = {"in", "en", "of", "baum", "tree"}
#: Texts that stand for a value that nobody knows.
_MISSING = ("", "-", "--", "?", "na", "n/a", "nan", "none", "null", "unknown", "unbekannt", "k.a.", "n.d.", "nd", ".")
#: Largest value of each size, metres or years: taller than any tree that lives.
_MOST = {
    "height": 150.0,
    "diameter": 15.0,
    "girth": 48.0,
    "crown_width": 100.0,
    "crown_radius": 50.0,
    "crown_base": 120.0,
    "age": 10_000.0,
}
#: Medians of trunks without a unit, metres, beyond which it was centimetres, and beyond which millimetres.
_TRUNKS = {"diameter": (2.5, 150.0), "girth": (8.0, 500.0)}
#: Years since the death of trees of which only is known that they are dead: twigs have fallen, limbs have not.
DEAD_YEARS = 5.0
_SPREAD = 2.0  # degrees within which all points of an inventory may lie that calls degrees x and y
#: Choices of units.
METRIC, IMPERIAL = 'METRIC', 'IMPERIAL'


@dataclass(frozen=True)
class Inventory:
    """Trees of a file, in the order of their rows; sizes in metres, 0 where nobody knows.

    Attributes
    ----------
    names : tuple of tuple of str
        Names of a tree in the order in which they count, each combination once.
    name : (n,) int64
        Index into them.
    points : (n, 2) float64
        Coordinates.
    system : System
    sizes : dict
        ``height``, ``diameter`` (of the trunk), ``crown_width``, ``crown_base``, ``age`` and ``dead`` (years since
        then), each (n,) float32.
    notes : list of str
        What was guessed, and which columns were not used.
    skipped : int
        Rows that were broken.
    first : str
        What was wrong with the first of them.
    """

    names: tuple[tuple[str, ...], ...]
    name: NDArray[np.int64]
    points: NDArray[np.float64]
    system: System
    sizes: dict[str, NDArray[np.float32]]
    notes: list[str] = field(default_factory=list)
    skipped: int = 0
    first: str = ""


def read_inventory(path: Path, code: int = 0, units: str = METRIC, skip: bool = False) -> Inventory:
    """Read a file.

    Parameters
    ----------
    code : int
        EPSG code of the coordinates; 0 where the file tells.
    units : {'METRIC', 'IMPERIAL'}
        Of columns that do not name theirs: metres, and centimetres for trunks; or feet, and inches for trunks.
    skip : bool
        Leave out broken rows instead of refusing the file.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken; names line or feature, and column.
    """
    table_ = read_points(path) if path.suffix.lower() in (".geojson", ".json") else read_csv(path)
    if not len(table_.numbers):
        raise SceneError(f"{table_.name}: it has no {'points' if table_.points is not None else 'rows'}")
    return _Reading(table_, units, skip).inventory(code)


@cache
def _titles() -> dict[str, str]:
    return {"".join(plain_words(title)): name for name, titles in table()["fields"].items() for title in titles}


def meaning(title: str) -> tuple[str, float]:
    """What a column holds, empty if unknown, and the metres of its unit, 0 if it names none."""
    words = re.findall(r"[^\W_]+", title.lower())
    unit = 0.0
    if len(words) > 1 and words[-1] in _UNITS:
        unit = _UNITS[words.pop()]
        while len(words) > 1 and words[-1] in _FILLERS:
            words.pop()
    return _titles().get("".join(plain_words(" ".join(words))), ""), unit


class _Reading:
    """One table on its way to an inventory."""

    def __init__(self, table_: Table, units: str, skip: bool) -> None:
        self.table, self.units, self.skip = table_, units, skip
        self.good = np.ones(len(table_.numbers), bool)
        self.notes, self.first = [], ""
        self.found: dict[str, list[tuple[str, float]]] = {}
        unused = []
        for title in table_.columns:
            name, unit = meaning(title)
            if name:
                self.found.setdefault(name, []).append((title, unit))
            else:
                unused.append(title)
        if unused:
            self.notes.append(f"columns not used: {', '.join(unused[:12])}")

    def inventory(self, code: int) -> Inventory:
        sizes = {name: self._size(name) for name in _MOST}
        for name, source, factor in (("diameter", "girth", 1.0 / math.pi), ("crown_width", "crown_radius", 2.0)):
            sizes[name] = np.where(sizes[name] > 0.0, sizes[name], factor * sizes.pop(source))
        base, height = sizes["crown_base"], sizes["height"]
        above = (base >= height) & (height > 0.0) & (base > 0.0)
        self._refuse(above, "crown_base", lambda i: f"{base[i]:g} m is not below the height of {height[i]:g} m")
        sizes["dead"] = self._dead()
        points, system = self._points(code)
        names, index = self._names()
        if not self.good.any():
            raise SceneError(self.first or f"{self.table.name}: none of its rows can be used")
        kept = {name: values[self.good].astype(np.float32) for name, values in sizes.items()}
        if not any(values.any() for values in (kept["height"], kept["diameter"], kept["crown_width"])):
            self.notes.append("no column of heights, trunks or crowns: all trees are full-grown")
        skipped = int((~self.good).sum())
        return Inventory(names, index[self.good], points[self.good], system, kept, self.notes, skipped, self.first)

    def _refuse(self, bad: NDArray[np.bool_], column: str, why: Callable[[int], str]) -> None:
        """Refuse the file, or leave out rows."""
        bad = bad & self.good
        if not bad.any():
            return
        index = int(np.argmax(bad))
        title = self.found[column][0][0] if column in self.found else column
        text = f"{self.table.where(index, title)}: {why(index)}"
        if not self.skip:
            raise SceneError(f"{text}. Correct it, or turn on Skip Broken Rows")
        self.first = self.first or text
        self.good &= ~bad

    def _size(self, name: str) -> NDArray[np.float64]:
        """Sizes in metres, ages in years; 0 for unknown."""
        if name not in self.found:
            return np.zeros(len(self.good))
        title, unit = self.found[name][0]
        texts = self.table.columns[title]
        values = self._numbers(name, texts)
        if name != "age":
            values = values * (unit or self._guess(name, values[values > 0.0]))
        most = _MOST[name]
        self._refuse(
            ~((values >= 0.0) & (values <= most)),
            name,
            lambda i: f"{shown(str(texts[i]))} is not from 0 to {most:,.0f} {'years' if name == 'age' else 'm'}",
        )
        return np.where(self.good, values, 0.0)

    def _guess(self, name: str, known: NDArray[np.float64]) -> float:
        """Metres of the unit of a column that names none."""
        if self.units == IMPERIAL:
            unit, text = (0.0254, "inches") if name in _TRUNKS else (0.3048, "feet")
        elif name not in _TRUNKS or not len(known):
            return 1.0
        else:
            centimetres, millimetres = _TRUNKS[name]
            middle = float(np.median(known))
            found = (1.0, "m"), (0.01, "cm"), (0.001, "mm")
            unit, text = found[int(middle > centimetres) + int(middle > millimetres)]
        self.notes.append(f'"{self.found[name][0][0]}" read as {text}')
        return unit

    def _numbers(self, name: str, texts: NDArray[np.str_]) -> NDArray[np.float64]:
        """Numbers of a column, 0 where there is none."""
        texts = np.char.lower(texts)
        texts = np.where(np.isin(texts, _MISSING), "0", texts)
        comma = np.char.find(texts, ",") >= 0
        if comma.any() and not (np.char.find(texts, ".") >= 0).any():
            texts = np.char.replace(texts, ",", ".")
        values = _floats(texts)
        self._refuse(np.isnan(values), name, lambda i: f"{shown(str(texts[i]))} is not a number")
        return values

    def _dead(self) -> NDArray[np.float64]:
        if "dead" not in self.found:
            return np.zeros(len(self.good))
        title = self.found["dead"][0][0]
        texts = self.table.columns[title]
        distinct, index = np.unique(texts, return_inverse=True)
        yes = {tuple(plain_words(text)) for text in table()["dead"]}
        values = np.where([tuple(plain_words(text)) in yes for text in distinct], DEAD_YEARS, 0.0)
        years = _floats(distinct)
        if "year" in title.lower():
            values = np.where((years >= 0.0) & (years <= _MOST["age"]), years, 0.0)
        return values[index]

    def _points(self, code: int) -> tuple[NDArray[np.float64], System]:
        """Coordinates and their system."""
        name, given = self.table.name, self.table.points
        if given is not None:
            points, code = given, code or self.table.code
        else:
            degrees = "longitude" in self.found and "latitude" in self.found
            metres = "x" in self.found and "y" in self.found
            if not degrees and not metres:
                raise SceneError(
                    f"{name}: line 1: no columns of coordinates; name them x and y, or longitude and latitude"
                )
            metres = metres and (not degrees or (code and not system_of(code).geographic))
            pair = ("x", "y") if metres else ("longitude", "latitude")
            points = np.stack([self._coordinate(column) for column in pair], axis=1)
            if metres and not code and _are_degrees(points[self.good]):
                metres = False
                self.notes.append("x and y read as longitude and latitude")
            code = code or (0 if metres else LONGITUDE_LATITUDE)
        system = system_of(code, f"{name}: ") if code else System()
        if system.geographic:
            low, high = (-360.0, -90.0), (360.0, 90.0)
            self._refuse(
                ~((points >= low) & (points <= high)).all(axis=1),
                "coordinates" if given is not None else pair[0],
                lambda i: f"{points[i, 0]:g}, {points[i, 1]:g} are no longitude and latitude; set Coordinate System",
            )
        return points, system

    def _coordinate(self, column: str) -> NDArray[np.float64]:
        title, unit = self.found[column][0]
        texts = self.table.columns[title]
        self._refuse(np.isin(np.char.lower(texts), _MISSING), column, lambda _: "a tree without coordinates")
        values = self._numbers(column, texts)
        self._refuse(~(np.abs(values) < 1e9), column, lambda i: f"{shown(str(texts[i]))} is not a coordinate")
        return np.where(self.good, values, 0.0) * (unit or 1.0)

    def _names(self) -> tuple[tuple[tuple[str, ...], ...], NDArray[np.int64]]:
        """Names of the trees: each combination once, and the index of each tree."""
        titles = [title for kind in ("genus", "name", "common", "leaf") for title, _ in self.found.get(kind, ())]
        genera = len(self.found.get("genus", ()))
        if not titles:
            self.notes.append("no column of species")
            return ((),), np.zeros(len(self.good), np.int64)
        codes = np.zeros(len(self.good), np.int64)
        for title in titles:  # numbers of combinations, column by column
            distinct, own = np.unique(self.table.columns[title], return_inverse=True)
            codes = np.unique(codes * len(distinct) + own, return_inverse=True)[1]
        first = np.unique(codes, return_index=True)[1]
        rows = zip(*(self.table.columns[title][first].tolist() for title in titles), strict=True)
        return tuple(_ordered(row[:genera], row[genera:]) for row in rows), codes


def _ordered(genera: tuple[str, ...], others: tuple[str, ...]) -> tuple[str, ...]:
    """Names of one tree: genus and epithet together, the others, the genus alone."""
    genus = next((g for g in genera if is_name(g)), "")
    joined = [f"{genus} {name}" for name in others if genus and is_name(name) and key_of(genus) not in key_of(name)]
    scientific = [name for name in joined if (match := species_named(name)) and match.certainty == 0]
    return tuple(name for name in (*scientific, *others, genus) if is_name(name))


def _are_degrees(points: NDArray[np.float64]) -> bool:
    """Whether coordinates that are called x and y are degrees: nobody lists trees of a plot so small."""
    if len(points) < 3 or (np.abs(points) > (180.0, 90.0)).any():
        return False
    return bool((np.ptp(points, axis=0) < _SPREAD).all() and (points != np.round(points, 3)).mean() > 0.5)


def _floats(texts: NDArray[np.str_]) -> NDArray[np.float64]:
    """Numbers of texts, nan for what is none."""
    try:
        values = texts.astype(np.float64)
    except ValueError:
        values = np.array([_float(text) for text in texts.tolist()])
    return np.where(np.isfinite(values), values, np.nan)


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
