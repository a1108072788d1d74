# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a column of an inventory holds, from the words in its title; and what words in its cells say of a tree.

The words are in `titles.json`. A title is cut into them wherever it hides them: ``crownDiameterM``, ``hauteurenm``,
``TREE_HEIGH`` of a shapefile, whose names end after ten letters.
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from . import table
from .species_names import plain_words

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
    found = best[-1][1]
    # Short words within others are chance: "age" in "page", "art" in "start".
    chance = any(word.startswith("?") for word in found)
    return [word if len(word) >= _SHORTEST or not chance else "?" + word.lstrip("?") for word in found]


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
    """The field that meanings of words make up, and the doubt, by the first rule that fits.

    Of a rule ``a|b !c =d|e`` there is one of a and b, no c, and nothing but d and e.
    """
    for rule, name, doubt in _TABLE["rules"]:
        parts = [(part[0], meant.intersection(part.lstrip("!=").split("|"))) for part in rule.split()]
        if all(some == meant if way == "=" else bool(some) != (way == "!") for way, some in parts):
            return name, doubt
    return "", 0


@cache
def _values() -> dict[tuple[str, ...], str]:
    """What words of cells say, by these words."""
    values = {what: texts for what, texts in _TABLE["values"].items() if what != "rest"}
    return {tuple(plain_words(text)): what for what, texts in values.items() for text in texts.split(";")}


@cache
def said_of(text: str) -> str:
    """What a cell says of a tree: ``dead``, ``vacant``, ``stump``, ``planned``, ``removed``, or ``yes``; else nothing.

    "Dead" and "dead tree" say it, "dead branches" does not; after "vacant" anything may stand.
    """
    words, rest = tuple(plain_words(text)), set(_TABLE["values"]["rest"].split())
    for end in range(min(len(words), 4), 0, -1):
        what = _values().get(words[:end], "")
        if what and (what in ("vacant", "stump", "planned") or rest.issuperset(words[end:])):
            return what
    return ""
