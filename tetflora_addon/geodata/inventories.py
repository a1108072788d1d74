# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inventories of trees: what columns mean, in which units, and what they say of each tree.

What a column holds follows from the words in its title, which are in `titles.json`. A title is cut into them wherever
it hides them: ``crownDiameterM``, ``hauteurenm``, ``TREE_HEIGH`` of a shapefile, whose names end after ten letters.
"""

import datetime
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Mask
from ..errors import SceneError, quoted
from . import table
from .layers import ENDINGS
from .projection import LONGITUDE_LATITUDE, MOST_AWAY, PLAIN, System, between, chosen_system, place_about
from .species_names import KIND, is_name, key_of, plain_words, species_named
from .tables import NOTHING, NUMBER, RANGE, WORD, Table, cells, place_in, read_csv, read_points

_TABLE = table("titles")
#: What a column may hold, with its name for artists.
FIELDS: dict[str, str] = _TABLE["fields"]
#: Fields that may be told by several columns.
NAMES = ("genus", "name", "common", "leaf", "family")
_SIZES = {"h": "height", "d": "diameter", "z": "z", "e": "x", "n": "y"}  # of a single letter
#: Meanings of what may stand beside them, as in "H tot" and "E UTM"; True for numbers, as in "LV95 E".
_BESIDE = {"h": {"filler", "dead"}, "d": {"filler"}, "z": {"filler"}, "e": {"grid", True}, "n": {"grid", True}}
_MOST_UNKNOWN = 4  # letters that may stand beside words that are known
_SHORTEST = 4  # letters of the beginning of a word, where a name ends after ten
_STRONG = {"breast", "girth"}
NEVER = 9
_Texts = NDArray[np.str_]


class Title(NamedTuple):
    """What a title says."""

    field: str  # one of `FIELDS`, or ``z``
    unit: float  # meters; 0 if it names none
    #: 0 for what is plain, more for what only values can confirm; `NEVER` for what is known to be something else.
    doubt: int
    classes: bool = False  # whether it speaks of classes, so that whole numbers may be theirs


@cache
def _words() -> tuple[dict[str, str], dict[str, float], dict[str, str]]:
    """Meanings of words, meters of units, and the words that begin with some letters."""
    words, begun = {}, {}
    for meaning, texts in _TABLE["words"].items():
        for text in texts.split():
            word = "".join(plain_words(text))
            if word not in words:
                words[word] = meaning
            for end in range(3, len(word)):
                begun.setdefault(word[:end], word)
    units = {"".join(plain_words(u)): float(m) for m, us in _TABLE["units"].items() for u in us.split()}
    return words, units, begun


def _cut(text: str) -> list[str]:
    """A token as words, the fewest of them; what is none stands there as it is."""
    words, units, begun = _words()
    best: list[tuple[float, list[str]]] = [(0.0, [])]
    for end in range(1, len(text) + 1):
        ways = [(best[end - 1][0] + 4.0, [*best[end - 1][1], "?" + text[end - 1]])]
        for start in range(end):
            part, (cost, before) = text[start:end], best[start]
            whole = start == 0 and end == len(text)
            if part in words and (len(part) > 2 or whole):
                ways.append((cost + 1.0, [*before, part]))
            elif part in units and (whole or (start > 0 and end == len(text))):
                ways.append((cost + 1.2, [*before, part]))
            elif part in ("in", "en") and start > 0 and text[end:] in units:
                ways.append((cost + 0.5, [*before, part]))
            elif end == len(text) and part in begun and len(part) >= (_SHORTEST if start == 0 else 3):
                ways.append((cost + 1.5, [*before, begun[part]]))
        best.append(min(ways, key=lambda way: way[0]))
    parts = best[-1][1]
    # Short words within others are chance: "age" in "page", "art" in "start".
    chance = any(word.startswith("?") for word in parts)
    return [word if len(word) >= _SHORTEST or not chance else "?" + word.lstrip("?") for word in parts]


@cache
def read_title(title: str) -> Title:
    """What a title says."""
    words, units, _ = _words()
    title = re.sub(r"(?i)\bd[ _]?(?:1[.,]?30?|bh)(?![a-z0-9])", "dbh", title[:200])  # the diameter at 1.3 m
    title = re.sub(r"(?i)(stamm|kronen?)[ _]?dm(?![a-z])", r"\1durchmesser", title)
    once = re.sub(r"[^\W\d_]+", lambda run: re.sub(r"(?<=[a-z])(?=[A-Z])", " ", run[0]), title)
    ways = [[part for word in plain_words(text) for part in _parts(word)] for text in dict.fromkeys((title, once))]
    parts = min(ways, key=lambda way: (sum(part.startswith("?") for part in way), len(way)))
    unit, meant, unknown = 0.0, [], 0
    for index, part in enumerate(parts):
        if part in units and index and not parts[index - 1].isdigit() and (part != "in" or index == len(parts) - 1):
            unit = units[part]
        elif part in words:
            meant.append(words[part])
        elif not part.isdigit() and part not in units:
            unknown += len(part.lstrip("?"))
    plain = [part.lstrip("?") for part in parts if part not in units or part == parts[0]]
    letter = next((part for part in plain if part in _SIZES), None)
    if letter and all(part == letter or words.get(part, part.isdigit()) in _BESIDE[letter] for part in plain):
        return Title(_SIZES[letter], unit, 0)
    field, doubt = _field(set(meant) - {"filler"})
    if unknown > _MOST_UNKNOWN and not _STRONG.intersection(meant):
        field = ""
    if (unknown > 1 and field == "place") or (unknown and field == "crown_width" and "crown" not in meant):
        field = ""
    return Title(field, unit if field else 0.0, doubt + (unknown > 0), "class" in meant)


def _parts(word: str) -> list[str]:
    """A whole word, or what it is put together from."""
    words, units, _ = _words()
    return [word] if word in words or word in units or word.isdigit() else _cut(word)


def _field(meant: set[str]) -> tuple[str, int]:
    """Field and doubt by the first rule that fits: of ``a|b !c =d|e`` one of a and b, no c, nothing but d and e."""
    for rule, name, doubt in _TABLE["rules"]:
        parts = [(part[0], meant.intersection(part.lstrip("!=").split("|"))) for part in rule.split()]
        if all(common == meant if way == "=" else bool(common) != (way == "!") for way, common in parts):
            return name, doubt
    return "", 0


@cache
def _values() -> dict[tuple[str, ...], str]:
    """What words of cells say, by these words."""
    values = {what: texts for what, texts in _TABLE["values"].items() if what != "rest"}
    return {tuple(plain_words(text)): what for what, texts in values.items() for text in texts.split(";")}


@cache
def said_of(text: str) -> str:
    """What a cell says of a tree: ``dead``, ``vacant``, ``stump``, ``planned``, ``removed``, ``yes`` or nothing."""
    words, rest = tuple(plain_words(text)), set(_TABLE["values"]["rest"].split())
    # "Dead" and "dead tree" say it, "dead branches" does not; after "vacant" anything may stand.
    for end in range(min(len(words), 4), 0, -1):
        what = _values().get(words[:end], "")
        if what and (what in ("vacant", "stump", "planned") or rest.issuperset(words[end:])):
            return what
    return ""


#: Largest value of each size, meters or years: taller than any tree that lives.
_MOST: dict[str, float] = table("titles")["most"]
_TRUNKS = ("diameter", "girth")
#: Medians without a unit, meters, beyond which it was centimeters, and beyond which millimeters.
_SMALLER = {"diameter": (2.5, 150.0), "girth": (8.0, 500.0)}
#: Years since the death of trees of which only is known that they are dead: twigs have fallen, limbs have not.
DEAD_YEARS = 5.0
#: Degrees within which all points of an inventory may lie that calls degrees x and y; and meters that no plot has.
_SPREAD, _NARROW = 2.0, 0.1
#: Choices of units.
METRIC, IMPERIAL = 'METRIC', 'IMPERIAL'
_PREVIEWED, _SAMPLE, _SHOWN = 300, 60, 3  # rows that are looked at, values of them, and values that are shown
_CLASSES = 12  # the most that a class of sizes is numbered
_YEAR = re.compile(r"(?<!\d)(1[5-9]\d\d|20\d\d)(?!\d)")
_STRAY = 20.0  # times as far from the middle as half of all are
_NAMED = 6  # rows that a message names


@dataclass(frozen=True)
class Inventory:
    """Trees of a file, in the order of their rows; sizes in meters, 0 where nobody knows."""

    names: tuple[tuple[str, ...], ...]  # names of a tree in the order in which they count, each combination once
    name: Integers  # (n,): index into them
    points: Floats  # (n, 2): coordinates
    system: System
    #: (n,) each: ``height``, ``diameter`` of trunk, ``crown_width``, ``crown_base``, ``age``, ``dead`` (years since).
    sizes: dict[str, Floats32]
    notes: list[str] = field(default_factory=list)  # what was guessed, and which columns were used and which not
    skipped: int = 0  # rows that were broken
    first: str = ""  # what was wrong with the first of them
    left_out: Counter = field(default_factory=Counter)  # rows that are no trees, by what they are


class Column(NamedTuple):
    """A column as a dialog shows it: its title, the field that it was taken for, and some of its values."""

    title: str
    field: str
    values: tuple[str, ...]


def read_inventory(
    path: Path, epsg: int = 0, units: str = METRIC, skip: bool = False, columns: Mapping[str, str] | None = None
) -> Inventory:
    """Read a file.

    Parameters
    ----------
    epsg : int
        EPSG code of the coordinates; 0 where the file tells.
    units : {'METRIC', 'IMPERIAL'}
        Of columns that do not name theirs: meters, and centimeters for trunks; or feet, and inches for trunks.
    skip : bool
        Leave out broken rows instead of refusing the file.
    columns : mapping, optional
        What columns hold by their titles, for those that are not to be told by title and values: one of `FIELDS`, with
        a unit if the title does not name it, such as ``height ft``; empty for none.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken; names line or feature, and column.
    """
    table_ = _table(path, skip, epsg=epsg)
    return _Reading(table_, units, skip, _chosen(table_, columns or {})).inventory(epsg)


def preview(path: Path) -> list[Column]:
    """Columns of a file as they are taken from its first rows.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken.
    """
    table_ = _table(path, True, _PREVIEWED, PLAIN)
    taken = taken_for(table_, {})
    return [
        Column(title, taken[title].field, tuple(list(dict.fromkeys(filter(None, texts.tolist())))[:_SHOWN]))
        for title, texts in table_.columns.items()
    ]


def _table(path: Path, skip: bool, most: int | None = None, epsg: int = 0) -> Table:
    """Rows of a file, of which there is at least one."""
    layer = path.suffix.lower() in ENDINGS
    table_ = read_points(path, skip, most, epsg) if layer else read_csv(path, skip, most)
    if not len(table_.numbers):
        rows = "rows" if table_.points is None else "points"
        raise SceneError(table_.first or f"{table_.name}: it has no {rows}; choose another one")
    return table_


def _chosen(table_: Table, columns: Mapping[str, str]) -> dict[str, Title]:
    chosen = {}
    for title, text in columns.items():
        name, _, unit = text.strip().partition(" ")
        meters = read_title(f"height {unit}").unit if unit else 0.0
        why = "no such column" if title not in table_.columns else ""
        if name not in FIELDS or (unit and not meters):
            why = why or f"{quoted(text)} is none of {', '.join(filter(None, FIELDS))}"
        if why:
            raise SceneError(f"{table_.name}: column {quoted(title)}: {why}; correct Columns")
        told = read_title(title)
        chosen[title] = Title(name, meters or told.unit, told.doubt if told.field == name else -1)
    return chosen


def taken_for(table_: Table, chosen: Mapping[str, Title]) -> dict[str, Title]:
    """What each column is taken for, by its title and its first values."""
    titles, samples = dict(chosen), {}
    decided = {title.field for title in chosen.values()}.difference(NAMES, ("status", "dead"))
    for title, texts in table_.columns.items():
        if title not in chosen:
            sample = samples[title] = np.unique(texts[: 4 * _PREVIEWED])[: 4 * _SAMPLE]
            sample = samples[title] = sample[sample != ""][:_SAMPLE]
            titles[title] = _confirmed(read_title(title), sample)
            if titles[title].field in decided:
                titles[title] = titles[title]._replace(field="")
    fields = {title.field for title in titles.values()}
    if "longitude" in fields and "latitude" not in fields:  # the German word for latitude is that for width, too
        titles |= {title: Title("latitude", 0.0, 1) for title in samples if title.lower() == "breite"}
        fields = {title.field for title in titles.values()}
    free = [title for title in samples if not titles[title].field and titles[title].doubt < NEVER]
    if table_.points is None and not ({"longitude", "latitude"} <= fields or {"x", "y"} <= fields or "place" in fields):
        _by_values(titles, free, samples, "place", 0.9)
    if not fields.intersection(NAMES):
        _by_values(titles, free, samples, "name", 0.5)
    sizes = fields.intersection((*_MOST, *NAMES))
    for title in [title for title in samples if titles[title].field == "z"]:  # treetops of a laser scan
        titles[title] = titles[title]._replace(field="" if sizes else "height")
    return {title: titles[title] for title in table_.columns}


def _by_values(titles: dict[str, Title], free: list[str], samples: dict[str, _Texts], name: str, least: float) -> None:
    """Take the column for a field whose values suit best."""
    shares = {title: _share(name, samples[title]) for title in free}
    best = max(shares, key=lambda title: shares[title], default="")
    if best and shares[best] >= least:
        titles[best] = Title(name, 0.0, 1)


def _share(name: str, sample: _Texts) -> float:
    """How many of some values suit a field of names or places, 0 to 1."""
    if name == "place":
        fits = [not math.isnan(place_in(text)[0]) for text in sample.tolist()]
    else:
        matches = [species_named(text) for text in sample.tolist() if is_name(text)]
        fits = [match is not None and (match.certainty < KIND or name == "leaf") for match in matches]
    return sum(fits) / max(len(fits), 1)


def _confirmed(title: Title, sample: _Texts) -> Title:
    """A title, or one for nothing where its values cannot be what it says."""
    name, none = title.field, title._replace(field="")
    if not len(sample):
        return title
    if name == "place":
        return title if _share("place", sample) >= 0.5 else none
    values, units, kinds = cells(sample)
    numbers = np.isin(kinds, (NUMBER, RANGE))
    if name in NAMES:
        doubtful = (title.doubt > 0 or name == "leaf") and _share(name, sample) < 0.3
        return none if numbers.all() or doubtful else title
    if name == "planted":
        return title if any(map(_YEAR.search, sample.tolist())) else none
    if name in _MOST:
        known = values[kinds == NUMBER]
        bare = len(known) > 0 and not (kinds == RANGE).any() and not units.any()
        # Numbers of classes, of which nobody tells the sizes.
        classes = title.classes and bare and (known <= _CLASSES).all() and (known == np.round(known)).all()
        return none if classes or (kinds == WORD).all() else title
    return title


class _Reading:
    """One table on its way to an inventory."""

    def __init__(self, table_: Table, units: str, skip: bool, chosen: Mapping[str, Title]) -> None:
        self.table, self.units, self.skip = table_, units, skip
        self.good = np.ones(len(table_.numbers), bool)
        self.notes, self.first, self.left_out = list(table_.notes), table_.first, Counter()
        self.titles: dict[str, list[tuple[str, Title]]] = {}
        self.used: dict[str, str] = {}
        for title, what in sorted(taken_for(table_, chosen).items(), key=lambda pair: pair[1].doubt):
            if what.field:
                self.titles.setdefault(what.field, []).append((title, what))

    def inventory(self, epsg: int) -> Inventory:
        """The trees of the table; refuses the file or leaves out rows."""
        self._leave_out()
        sizes = {name: self._size(name) for name in _MOST}
        for name, source, factor in (("diameter", "girth", 1.0 / math.pi), ("crown_width", "crown_radius", 2.0)):
            sizes[name] = np.where(sizes[name] > 0.0, sizes[name], factor * sizes.pop(source))
        sizes["age"] = np.where(sizes["age"] > 0.0, sizes["age"], self._since_planting())
        base, height = sizes["crown_base"], sizes["height"]
        above = (base >= height) & (height > 0.0) & (base > 0.0)
        self._refuse(above, "crown_base", lambda i: f"{base[i]:g} m is not below the height of {height[i]:g} m")
        sizes["dead"] = self._dead()
        points, system = self._points(epsg)
        names, index = self._names()
        if not self.good.any():
            none = f"{self.table.name}: none of its rows is a tree that can be used; choose another one"
            raise SceneError(self.first or none)
        kept = {name: values[self.good].astype(np.float32) for name, values in sizes.items()}
        if not any(values.any() for values in (kept["height"], kept["diameter"], kept["crown_width"], kept["age"])):
            self.notes.append("no column of heights, trunks or crowns: all trees are full-grown")
        used = ", ".join(f"{title} ({FIELDS[name]})" for title, name in self.used.items())
        self.notes += [f"columns used: {used}"] * bool(used)
        unused = [title for title in self.table.columns if title not in self.used]
        if unused:
            self.notes.append(f"columns not used: {', '.join(unused)}")
        skipped = int((~self.good).sum()) - self.left_out.total() + self.table.broken
        trees = names, index[self.good], points[self.good], system, kept
        return Inventory(*trees, self.notes, skipped, self.first, self.left_out)

    def _texts(self, title: str) -> _Texts:
        """Texts of a column, which is one that is used."""
        self.used[title] = next(name for name, columns in self.titles.items() if title in dict(columns))
        return self.table.columns[title]

    def _each(self, title: str, what: Callable[[str], Any]) -> NDArray[Any]:
        """What each text (n,) of a column says."""
        distinct, index = np.unique(self._texts(title), return_inverse=True)
        return np.array([what(text) for text in distinct.tolist()])[index]

    def _refuse(self, bad: Mask, column: str, why: Callable[[int], str]) -> None:
        """Refuse the file, or leave out rows."""
        bad = bad & self.good
        if not bad.any():
            return
        index, *more = np.flatnonzero(bad).tolist()
        title = self.titles[column][0][0] if column in self.titles else column
        text = f"{self.table.where(index, title)}: {why(index)}"
        if more:
            also = ", ".join(f"{number:,}" for number in self.table.numbers[more[: _NAMED - 1]].tolist())
            text += f"; {len(more):,} more, {self.table.row} {also}{' ...' if len(more) >= _NAMED else ''}"
        if not self.skip:
            raise SceneError(f"{text}. Correct it, or turn on Skip Broken Rows")
        self.first = self.first or text
        self.good &= ~bad

    def _leave_out(self) -> None:
        """Leave out rows that are no trees, by what stands in place of a species or of their condition."""
        for name in ("status", *NAMES):
            for title, _ in self.titles.get(name, ()):
                what = self._each(title, partial(_no_tree, condition=name == "status"))
                self.left_out.update(what[(what != "") & self.good].tolist())
                self.good &= what == ""

    def _size(self, name: str) -> Floats:
        """Sizes in meters, ages in years; 0 for unknown."""
        read = [(title, what, *cells(self.table.columns[title])) for title, what in self.titles.get(name, ())]
        if not read:
            return np.zeros(len(self.good))
        chosen = read[0]
        for other in read[1:]:  # classes beside what they stand for
            (_, _, bare, _, kind), middle = chosen, other[2]
            both = (kind == NUMBER) & (other[4] == RANGE) & (middle > 0.0)
            if both.any() and np.median(np.abs(bare[both] / middle[both] - 1.0)) > 0.5:
                chosen = other
        title, what, values, units, kinds = chosen
        texts = self._texts(title)
        self.titles[name].sort(key=lambda pair: pair[0] != title)  # messages name the one that counts
        self._refuse(np.isnan(values), name, lambda i: f"{quoted(str(texts[i]))} is not a number")
        words = kinds == WORD
        if words.any():
            example = quoted(str(texts[np.argmax(words)]))
            self.notes.append(f'{words.sum():,} of "{title}" are no numbers, such as {example}')
        known = values[(units == 0.0) & (values > 0.0)]
        if name != "age":
            unit = what.unit or (self._guess(title, name, known) if len(known) else 1.0)
            values = values * np.where(units > 0.0, units, unit)
        elif len(known) and np.median(known) > 1500.0:  # years of planting
            self.titles.setdefault("planted", []).append((title, what))
            return np.zeros(len(self.good))
        beyond = ~((values >= 0.0) & (values <= _MOST[name]))
        limits = f"0 to {_MOST[name]:,.0f} {'years' if name == 'age' else 'm'}"
        self._refuse(beyond, name, lambda i: f"{quoted(str(texts[i]))} is not from {limits}")
        return np.where(self.good, values, 0.0)

    def _guess(self, title: str, name: str, known: Floats) -> float:
        """Meters of the unit of a column that names none."""
        if self.units == IMPERIAL:
            unit, text = (0.0254, "inches") if name in _TRUNKS else (0.3048, "feet")
        else:
            centimeters, millimeters = _SMALLER.get(name, (_MOST[name], 100.0 * _MOST[name]))
            middle = float(np.median(known))
            units = (1.0, "m"), (0.01, "cm"), (0.001, "mm")
            unit, text = units[int(middle > centimeters) + int(middle > millimeters)]
            if name not in _TRUNKS and unit == 1.0:
                return unit
        self.notes.append(f'"{title}" read as {text}')
        return unit

    def _since_planting(self) -> Floats:
        """Ages from years of planting, 0 for unknown."""
        if "planted" not in self.titles:
            return np.zeros(len(self.good))
        title = self.titles["planted"][0][0]
        years = self._each(title, lambda text: int(match[0]) if (match := _YEAR.search(text)) else 0)
        now = datetime.date.today().year
        self.notes.append(f'ages from "{title}" to {now}')
        return np.where(years > 0, np.maximum(now - years, 1), 0).astype(np.float64)

    def _dead(self) -> Floats:
        """Years since death, 0 for those alive."""
        years = np.zeros(len(self.good))
        for name in ("dead", "status", "name", "common"):
            for title, _ in self.titles.get(name, ()):
                words = ("dead", "yes") if name == "dead" else ("dead",)
                says = self._each(title, lambda text, words=words: said_of(text) in words and not species_named(text))
                values = np.where(says, DEAD_YEARS, 0.0)
                if name == "dead" and re.search("year|jahr|ann|año", title.lower()):
                    values = np.nan_to_num(np.clip(cells(self.table.columns[title])[0], 0.0, _MOST["age"]))
                years = np.maximum(years, values)
        return years

    def _points(self, epsg: int) -> tuple[Floats, System]:
        name, points, system, pair = self.table.name, self.table.points, self.table.system, ("coordinates",)
        if points is None:
            degrees, meters, one = ("longitude", "latitude"), ("x", "y"), ("place",)
            pair, *more = [pair for pair in (degrees, meters, one) if self.titles.keys() >= set(pair)] or [()]
            if not pair:
                raise SceneError(
                    f"{name}: line 1: no columns of coordinates; name them x and y, or longitude and latitude"
                )
            if meters in more and epsg and not chosen_system(epsg, System(), "").geographic:
                pair = meters
            if pair == one:
                points, code = self._places()
                epsg = epsg or code
                plain = (np.abs(points[self.good]) > (360.0, 180.0)).any()
            else:
                points = np.stack([self._coordinate(column) for column in pair], axis=1)
                plain = pair == meters
                if not plain and not epsg and len(low := points[self.good]) and np.median(np.abs(low[:, 1])) > 360.0:
                    plain = True
                    self.notes.append("longitude and latitude read as meters")
            if plain and not epsg and _are_degrees(points[self.good]):
                plain = False
                self.notes.append("x and y read as longitude and latitude")
            system = chosen_system(epsg or (0 if plain else LONGITUDE_LATITUDE), System(), f"{name}: ")
        if system.geographic:
            amount = np.abs(points[self.good])
            if len(amount) and 90.0 < np.median(amount[:, 1]) <= 180.0 and np.median(amount[:, 0]) <= 90.0:
                points = points[:, ::-1]
                self.notes.append("coordinates read as latitude, longitude")
            beyond = ~(np.abs(points) <= (360.0, 90.0)).all(axis=1)
            told = "are no longitude and latitude; set Coordinate System"
            self._refuse(beyond, pair[0], lambda i: f"{points[i, 0]:g}, {points[i, 1]:g} {told}")
        self._refuse_far(points, system, pair[0])
        return points, system

    def _refuse_far(self, points: Floats, system: System, column: str) -> None:
        """Refuse rows that lie far from most others, as those do whose coordinates are 0 or wrong."""
        good = np.flatnonzero(self.good)
        if not len(good):
            return
        middle, away = np.median(points[good], axis=0), np.zeros(len(points))
        place = place_about(system, middle, middle, f"{self.table.name}: ")
        local = between(points[good], system, place.system) - [place.east, place.north]
        away[good] = np.nan_to_num(np.abs(local).max(axis=1), nan=np.inf)
        far = (away >= MOST_AWAY) & (away > _STRAY * np.median(away[good]))
        if 2 * far[good].sum() < len(good):
            apart = [f"{one / 1000.0:,.0f} km from" if math.isfinite(one) else "too far from" for one in away.tolist()]
            self._refuse(far, column, lambda i: f"{points[i, 0]:g}, {points[i, 1]:g} is {apart[i]} most other trees")

    def _places(self) -> tuple[Floats, int]:
        """Coordinates that stand in one column, and the EPSG code that stands there too, or 0."""
        title = self.titles["place"][0][0]
        texts = self._texts(title)
        places = np.array([place_in(text) for text in texts.tolist()], np.float64).reshape(-1, 3)
        points, plain = places[:, :2], places[:, 2] < 0.0
        self._refuse(np.isnan(points).any(axis=1), "place", lambda i: f"{quoted(str(texts[i]))} is no place")
        points = np.where(np.isnan(points), 0.0, points)
        amount = np.abs(points[plain & self.good])
        first = bool(re.match(r"(?i).*lon.*lat|.*\bx.*y\b", title)) or (len(amount) > 0 and (amount[:, 0] > 90.0).any())
        if len(amount) and (amount <= 180.0).all() and not first:  # latitude comes first, unless it cannot be one
            points[plain] = points[plain][:, ::-1]
            self.notes.append(f'"{title}" read as latitude, longitude')
        return points, int(places[:, 2].max(initial=0.0))

    def _coordinate(self, column: str) -> Floats:
        """Numbers (n,) of a column of coordinates, in meters or degrees."""
        title, what = self.titles[column][0]
        texts = self._texts(title)
        values, _, kinds = cells(texts)
        self._refuse(np.isin(kinds, (NOTHING, WORD)), column, lambda _: "a tree without coordinates")
        bad = np.isnan(values) | (kinds == RANGE) | ~(np.abs(values) < 1e9)
        self._refuse(bad, column, lambda i: f"{quoted(str(texts[i]))} is not a coordinate")
        return np.where(self.good, values, 0.0) * (what.unit or 1.0)

    def _names(self) -> tuple[tuple[tuple[str, ...], ...], Integers]:
        """Names of the trees: each combination once, and the index of each tree."""
        titles = [title for kind in NAMES for title, _ in self.titles.get(kind, ())]
        genera, names = (len(self.titles.get(kind, ())) for kind in NAMES[:2])
        if not titles:
            self.notes.append("no column of species")
            return ((),), np.zeros(len(self.good), np.int64)
        codes = np.zeros(len(self.good), np.int64)
        for title in titles:  # numbers of combinations, column by column
            distinct, index = np.unique(self._texts(title), return_inverse=True)
            codes = np.unique(codes * len(distinct) + index, return_inverse=True)[1]
        first = np.unique(codes, return_index=True)[1]
        rows = zip(*(self.table.columns[title][first].tolist() for title in titles), strict=True)
        return tuple(_ordered(row[:genera], row[genera : genera + names], row[genera + names :]) for row in rows), codes


def _ordered(genera: tuple[str, ...], names: tuple[str, ...], others: tuple[str, ...]) -> tuple[str, ...]:
    """Names of one tree: genus and epithet together, the others, the genus alone."""
    genus = next((g for g in genera if is_name(g)), "")
    joined = [f"{genus} {name}" for name in names if genus and is_name(name) and key_of(genus) not in key_of(name)]
    return tuple(name for name in (*joined[:1], *names, *others, genus) if is_name(name))


def _are_degrees(points: Floats) -> bool:
    """Whether coordinates that are called x and y are degrees: nobody lists trees of a plot so small."""
    if not len(points) or (np.abs(points) > (180.0, 90.0)).any():
        return False
    spread = np.ptp(points, axis=0).max()
    return bool(spread < _SPREAD and ((points != np.round(points, 3)).mean() > 0.5 or 0.0 < spread < _NARROW))


def _no_tree(text: str, condition: bool) -> str:
    """What stands in place of a tree, if a cell of its condition or of its species says so."""
    what = said_of(text)
    return what if what in ("vacant", "stump", "planned", "removed") and (condition or not species_named(text)) else ""
