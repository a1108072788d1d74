# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of plants, in several languages and abbreviations, as species of the catalogue or their nearest kin.

The table is `synonyms.json`. Names are compared without case, accents, hyphens, cultivars and authors, and *ae* counts
as *a*, so that ``Stiel-Eiche``, ``Q. robur 'Fastigiata'`` and ``Chêne pédonculé`` are found.
"""

from __future__ import annotations

import json
import re
import unicodedata
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ..errors import readable

#: How sure a name is: the species itself, another of its genus, of nearest kin, or only conifer or broadleaf.
SPECIES, GENUS, KIN, KIND = range(4)
_LETTERS = str.maketrans({"ß": "ss", "ø": "o", "ł": "l", "æ": "ae", "œ": "oe", "đ": "d", "×": " "})
_NOT_NAMES = re.compile(r"'[^']*'|\"[^\"]*\"|‘[^’]*’|“[^”]*”|„[^“]*“|\([^)]*\)")
_RANKS = {"x", "var", "subsp", "ssp", "cv", "cf", "f", "spec", "spp", "sp", "hybr", "hybrid", "agg"}
_LEAST = 4  # letters of a word that may be the end of another, as in "Sumpfeiche"
_UNKNOWN = {"", "unknown", "unbekannt", "inconnu", "indeterminate", "indetermine", "na", "none", "null", "tree", "baum"}


class Match(NamedTuple):
    """A species of the catalogue, by its identifier, and how sure it is."""

    species: str
    certainty: int


@cache
def table() -> dict[str, dict]:
    """What `synonyms.json` holds."""
    return json.loads(Path(__file__).with_name("synonyms.json").read_text(encoding="utf-8"))


def words_of(name: str) -> list[str]:
    """Words of a name in plain small letters, without cultivars and ranks."""
    return [word for word in plain_words(_NOT_NAMES.sub(" ", name[:200])) if word not in _RANKS]


def plain_words(text: str) -> list[str]:
    """Words of a text in plain small letters, and its numbers."""
    text = text[:200].lower().translate(_LETTERS)
    text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return re.findall(r"[a-z]+|\d+", re.sub("([aou])e", r"\1", text))


def key_of(name: str) -> str:
    """A name as it is looked up."""
    return "".join(words_of(name))


@cache
def _known() -> tuple[dict[str, Match], dict[str, Match]]:
    """Whole names, and words that make up a name or end it."""
    data, whole, words = table(), {}, {}
    for certainty, groups in (
        (SPECIES, ("scientific", "names")),
        (GENUS, ("genera", "vernacular")),
        (KIN, ("kin",)),
        (KIND, ("kinds",)),
    ):
        for group in groups:
            for species, names in data[group].items():
                for name in names:
                    match = Match(species, certainty)
                    whole.setdefault(key_of(name), match)
                    if certainty > SPECIES:
                        words.setdefault(key_of(name), match)
                    elif group == "scientific":
                        genus, *epithet = words_of(name)
                        whole.setdefault(genus[0] + "".join(epithet), match)
    return whole, words


@cache
def species_named(name: str) -> Match | None:
    """The species of the catalogue that a name means; None for names that nobody knows."""
    whole, endings = _known()
    words = words_of(name)
    # Cultivars and authors follow a scientific name of two words, or of three.
    for number in (len(words), 3, 2):
        match = whole.get("".join(words[:number]))
        if match is not None:
            return match
    for word in (*words[:1], *reversed(words[1:])):
        match = endings.get(word)
        if match is not None:
            return match
    # German joins words, and so do others of its family.
    for word in words:
        for start in range(1, len(word) - _LEAST + 1):
            match = endings.get(word[start:])
            if match is not None:
                return match
    return None


def is_name(text: str) -> bool:
    """Whether a text names any plant at all."""
    return key_of(text) not in _UNKNOWN


def told(names: dict[str, int], most: int = 8) -> str:
    """Names with how often each occurs, the most frequent first, for a report."""
    ordered = sorted(names, key=lambda name: (-names[name], name))
    text = ", ".join(f"{readable(name, 40) or '(none)'} ({names[name]:,})" for name in ordered[:most])
    return f"{text} and {len(ordered) - most:,} other names" if len(ordered) > most else text
