# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of plants, in several languages and abbreviations, as species of the catalog or their nearest kin.

The table is `species_names.json`, in which each entry stands below the source that it has. Names are compared without
case, accents, hyphens and cultivars, and *ae* counts as *a*. A name means the species that it spells out, or else its
genus, in Latin or by the word that a language builds names of: English, German and Dutch put it last, French, Spanish
and Italian first. A genus that is not in the catalog stands for its nearest kin there. Parts of words count only
where German and Dutch join words: ``Sumpfeiche`` is an oak, ``pseudoacacia`` no acacia.
"""

import re
import unicodedata
from collections.abc import Container, Iterator, Sequence
from functools import cache
from typing import NamedTuple

from ..errors import readable
from . import table

#: How sure a name is: the species itself, another of its genus, of nearest kin, or only conifer or broadleaf.
SPECIES, GENUS, KIN, KIND = range(4)
_LETTERS = str.maketrans({"ß": "ss", "ø": "o", "ł": "l", "æ": "ae", "œ": "oe", "đ": "d", "×": " "})
_CULTIVARS = re.compile(r"'[^']*'|\"[^\"]*\"|‘[^’]*’|“[^”]*”|„[^“]*“")
_PARTS = re.compile(r"[,;/|()\[\]{}:=]|\s[-–—]\s")
_RANKS = {"x", "var", "subsp", "ssp", "cv", "cf", "f", "spec", "spp", "sp", "hybr", "hybrid", "agg", "species"}
#: Languages whose names begin with what they name, and those that join words.
_FIRST, _JOINING = {"fr", "es", "it"}, {"de", "nl"}
#: Words that the former have between others, and adjectives that they put first.
_LINKS = {"de", "du", "des", "d", "del", "della", "dei", "di", "do", "da", "a", "al", "aux", "la", "le", "les", "el"}
_BEFORE = {"grand", "petit", "gran", "gros", "vrai", "faux", "fausse", "jeune", "arbre", "arbol", "albero", "grande"}
_FALSE = {"faux", "fausse", "falso", "falsa", "false"}
_AFTER = {"tree", "trees", "shrub", "bush", "baum", "strauch", "arbre", "arbol", "albero", "boom", "common", "other"}
_LEAST = 4  # letters of a word that may be the end of another
_LONG = 6  # letters of a genus that may be misspelled by one


class Match(NamedTuple):
    """A species of the catalog, by its identifier, and how sure it is."""

    species: str
    certainty: int


class _Names(NamedTuple):
    """The table as it is looked up; keys are joined words. Common names may begin or end longer ones."""

    whole: dict[str, Match]
    genera: dict[str, Match]
    misspelled: dict[str, set[str]]
    first: dict[str, Match]
    last: dict[str, Match]
    endings: dict[str, Match]
    codes: dict[str, Match]


def words_of(name: str) -> list[str]:
    """Words of a name in plain small letters, without cultivars, brackets and ranks."""
    name = re.sub(r"\([^)]*\)", " ", _CULTIVARS.sub(" ", name[:200]))
    return [word for word in plain_words(name) if word not in _RANKS]


def plain_words(text: str) -> list[str]:
    """Words of a text in plain small letters, and its numbers."""
    text = text[:200].lower().translate(_LETTERS)
    text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return re.findall(r"[a-z]+|\d+|[^\W\d_a-z]+", re.sub("([aou])e", r"\1", text))


def key_of(name: str) -> str:
    """A name as it is looked up."""
    return "".join(words_of(name))


def names_in(groups: dict[str, dict[str, str]], separator: str | None = None) -> Iterator[tuple[str, str]]:
    """Each key of groups by source, with each of its names."""
    for group in groups.values():
        for key, names in group.items():
            yield from ((key, name.strip()) for name in names.split(separator))


def _shorter(word: str) -> Iterator[str]:
    """A word, and without one of its letters after the first."""
    yield word
    yield from (word[:i] + word[i + 1 :] for i in range(1, len(word)))


@cache
def _known() -> _Names:
    """The table, indexed by joined words."""
    data, known = table("species_names"), _Names(*({} for _ in _Names._fields))
    genera = {words_of(name)[0] for names in data["species"].values() for name in names["scientific"]}
    for family, groups in data["families"].items():
        for kin, genus in names_in(groups):
            key = key_of(genus)
            match = Match(kin, GENUS if key in genera else KIN)
            known.genera[key] = match
            known.whole.setdefault(key_of(family), Match(kin, KIN))
            for short in _shorter(key) if len(key) >= _LONG else ():
                known.misspelled.setdefault(short, set()).add(key)
    for species, names in data["species"].items():
        for name in (*names["scientific"], *names["common"]):
            known.whole.setdefault(key_of(name), Match(species, SPECIES))
    for species, names in data["kin"].items():
        known.whole.update((key_of(name), Match(species, KIN)) for name in names)
    known.first.update(known.genera)
    known.last.update(known.genera)
    for language, groups in data["common"].items():
        for genus, name in names_in(groups, ","):
            match = known.genera.get(key_of(genus)) or known.whole[key_of(genus)]
            key = key_of(name)
            if language in _JOINING and len(key) >= _LEAST:
                known.endings.setdefault(key, match)
            way = known.first if language in _FIRST else known.last
            way[key] = known.first.get(key) or known.last.get(key) or match
    for key, match in known.whole.items():
        if len(key) > _LONG and key not in known.first and key not in known.last:
            known.first[key] = known.last[key] = match
    for kind, names in data["kinds"].items():
        known.whole.update((key_of(name), Match(kind, KIND)) for name in names)
    scientific = [name.split()[:2] for names in data["species"].values() for name in names["scientific"]]
    for genus, epithet in [*scientific, *((g, e) for g, es in data["epithets"].items() for e in es.split())]:
        match = known.whole.get(key_of(f"{genus} {epithet}")) or known.genera[key_of(genus)]
        for first, second in ((2, 2), (3, 2), (3, 3), (4, 4), (1, None)):
            known.codes.setdefault(key_of(genus[:first] + epithet[:second]), match)
    return known


@cache
def species_named(name: str) -> Match | None:
    """The species of the catalog that a name means; None for names that nobody knows."""
    known, text = _known(), _CULTIVARS.sub(" ", name[:200])
    parts = [words for part in _PARTS.split(text) if (words := words_of(part))]
    whole = words_of(text)
    if not is_name(" ".join(map(" ".join, parts))):
        return None
    turned = [parts[1] + parts[0]] if "," in text and len(parts) > 1 else []  # "oak, northern red"
    beside = [words for words in parts if len(words) > 1 and words != whole]  # a scientific name in brackets
    tries = (
        (_scientific, beside),
        (_exactly, [whole, *(turned or parts)]),
        (_scientific, [whole, *turned, *parts]),
        (_named, [*(turned or [whole]), *parts]),
    )
    match = next((match for look, ways in tries for words in ways if words and (match := look(words))), None)
    if match is not None:
        return match
    code = re.fullmatch(r"([a-z]{3,8})\d{0,2}", "".join(whole)) if len(parts) == 1 and len(parts[0]) <= 2 else None
    if code is not None and code[1] in known.codes:
        return known.codes[code[1]]
    match = next((match for word in whole if (match := known.whole.get(word)) and match.certainty >= KIN), None)
    if match is None and len(whole) > 1 and len(whole[0]) >= _LONG:  # a letter too much, too few or wrong
        near = set().union(*(known.misspelled.get(short, ()) for short in _shorter(whole[0])))
        match = known.genera[near.pop()] if len(near) == 1 else None
    return match


def best_of(names: Sequence[str], among: Container[str] | None = None) -> tuple[Match | None, str]:
    """The surest species of several names of a plant, and the name: a scientific one of two words comes first.

    Parameters
    ----------
    among : container of str, optional
        Identifiers of species that there are.
    """
    matches = [(match, name) for name in names if (match := species_named(name))]
    available = [(match, name) for match, name in matches if among is None or match.species in among]
    for match, name in available:
        ways = [words_of(part) for part in _PARTS.split(name)]
        if any(len(words) > 1 and _scientific(words) for words in ways):
            return match, name
    return min(available, key=lambda pair: pair[0].certainty, default=(None, names[0] if names else ""))


def _named(words: list[str]) -> Match | None:
    """What words mean as a whole or as a common name."""
    return _exactly(words) or _common(words)


def _exactly(words: list[str]) -> Match | None:
    """What words mean as a whole."""
    known, key = _known(), "".join(words)
    return known.whole.get(key) or known.first.get(key) or known.last.get(key)


def _scientific(words: list[str]) -> Match | None:
    """What begins with a genus; authors and cultivars may follow."""
    known = _known()
    genus = words[0]
    if len(words) > 1 and len(genus) == 1:
        return known.codes.get(genus + words[1])
    for number in (3, 2):
        match = known.whole.get(genus + "".join(words[1:number]))
        if match is not None and genus in known.genera and len(words) >= number:
            return match
    return known.genera.get(genus)


def _common(words: list[str]) -> Match | None:
    """What a common name names: its first or last words."""
    known = _known()
    keys = ["".join(words[i:]) for i in range(len(words))]
    last = next((known.last[key] for key in keys if key in known.last), None)
    if last is None and len(words) > 1 and words[-1] in _AFTER:
        return _named(words[:-1])
    begin, false = words, next((i for i, word in enumerate(words) if i and word in _FALSE), 0)
    if false and (match := _named(words[:false])):  # "robinier faux acacia"
        return match
    while begin and begin[0] in (_LINKS if len(begin) < len(words) else _BEFORE):
        begin = begin[1:]
    keys = ["".join(way[:i]) for way in (words, begin) for i in range(len(way), 0, -1)]
    first = next((known.first[key] for key in keys if key in known.first), None)
    chosen = first or last if _LINKS.intersection(words) else last or first
    if chosen is not None:
        return chosen
    for word in reversed(words):
        for start in range(2, len(word) - _LEAST + 1):
            match = known.endings.get(word[start:])
            if match is not None:
                return match
    inner = ("".join(words[i:j]) for j in range(len(words) - 1, 0, -1) for i in range(j))
    return next((known.last[key] for key in inner if key in known.last and len(key) > 2), None)


@cache
def is_name(text: str) -> bool:
    """Whether a text names any plant at all."""
    return not set(plain_words(text)).issubset(table("species_names")["unknown"].split())


def name_counts(names: dict[str, int], most: int = 8) -> str:
    """Names with how often each occurs, the most frequent first, for a report."""
    ordered = sorted(names, key=lambda name: (-names[name], name))
    text = ", ".join(f"{readable(name, 40) or '(none)'} ({names[name]:,})" for name in ordered[:most])
    return f"{text} and {len(ordered) - most:,} other names" if len(ordered) > most else text
