# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules of language for pages that users read; `problems` finds the lines that break one, for devtools/readability.py.

A rule is a pattern with the better wording. Code, comments, targets of links and pictures do not count. Sentences,
paragraphs and cells of tables have a length at most.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatch

#: Pages that keep to the rules.
PAGES = (
    "README.md",
    "docs/manual.md",
    "docs/manual/*.md",
    "docs/features.md",
    "docs/results.md",
    "docs/measurements.md",
    "docs/release/*.md",
    "docs/extension-page.md",
)
SENTENCE, PARAGRAPH, CELL = 36, 90, 27  # most words

_UNITS = "pixels?|plants?|bytes?|meters?|seconds?|faces|facets?|triangles|polygons|trees|spheres?|kites?|rays"
_WHOLES = "crown|hectare|triangle|second|frame|species|instance|leaf|pixel|year|layer|megapixel|meter|tree|view"
RULES = {
    # Noun clauses and weak beginnings
    r"\bwhat(?:ever)?\b(?![^.!]*\?)": "name the thing: near plants, not what is near",
    r"\bthere (?:is|are|was|were|be)\b|\b(?:is|are) there\b": "say who does what",
    r"\bit follows that\b": "say so",
    r"\b(?:is|are) no (?!longer\b)\w+": "is not a …",
    r"\bthat (?:is|are) none\b": "say what they are",
    # Numbers
    r"(?<![\w.,…])\.\d": "0.63, not .63",
    rf"\b(?:{_UNITS}) an? (?:{_WHOLES})\b": "per, not a: pixels per crown",
    r"\btimes (?:as|more|less) (?:\w+ ){0,2}as\b.*\btimes\b": "one ratio per sentence",
    r"\btakes 0?\.\d+ times\b": "40 % less, or ×0.6",
    # History belongs into the changelog
    r"\bno longer\b|\bused to be\b|\bformerly\b|\bnowadays\b|\bever since\b": "history belongs into the changelog",
    r"\bwas 0?\.\d": "history belongs into the changelog",
    # American, and the field's words
    r"\bbeside[s]?\b": "next to, compared with, in addition to",
    r"\ban[e]w\b": "again",
    r"\bgo(?:es)? on\b": "continue",
    r"\bh[e]ld against\b": "compared with",
    r"\bb[e]ar shade\b": "tolerate shade",
    r"\bb[e]lieves?\b": "trust",
    r"\blime trees?\b|\blimes\b": "linden",
    r"\bwhilst\b|\bamongst\b|\bthereby\b|\bthereof\b|\bwherein\b|\bhitherto\b|\bsuffices?\b": "a plain word",
    r"\bthe very\b|\bone's own\b|\bof one's\b": "your own",
    r"\bas good as\b|\bby and by\b|\bat rest\b|\bis to be\b": "a plain word",
    r"\bgoals?\b": "target",
    # Claims
    r"\b(?:simply|easily|obviously|of course|powerful|seamless(?:ly)?|stunning|blazing(?:ly)?)\b": "leave it out",
    r"\bindistinguishable\b|\bphotorealistic\b|\bunlimited\b": "give a number",
}
_PATTERNS = [(re.compile(old, re.IGNORECASE), new) for old, new in RULES.items()]
#: Pronouns that are used once in a sentence at most.
_PRONOUNS = re.compile(r"\b(it|they|them|those)\b", re.IGNORECASE)

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
_CODE = re.compile(r"`[^`\n]*`")
_PICTURE = re.compile(r"!\[[^\]]*\]\([^)]*\)")
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)|<https?://[^>]*>|https?://\S+")
_QUOTED = re.compile(r"\*…[^*]*\*|\"[^\"\n]*\"")  # messages and the words of others
_ABBREVIATED = re.compile(r"\b(?:e\.g|i\.e|vs|et al|No|St)\.", re.IGNORECASE)


def _lines(match: re.Match[str]) -> str:
    return "\n" * match[0].count("\n")


def plain(text: str) -> str:
    """The words of a page as they are read, on their lines."""
    text = _FENCE.sub(_lines, _COMMENT.sub(_lines, text))
    text = _QUOTED.sub("…", _CODE.sub("code", _PICTURE.sub(_lines, text)))
    return _LINK.sub(lambda match: match[1] or "", text)


def _words(text: str) -> int:
    return sum(any(c.isalnum() for c in word) for word in text.split())


def _parts(text: str) -> Iterator[tuple[int, str, str]]:
    """Paragraphs, items of lists and cells of tables: line, kind, text on one line."""
    begin, held = 0, []

    def flush() -> Iterator[tuple[int, str, str]]:
        if held:
            yield begin, "paragraph", " ".join(held)
            held.clear()

    for number, line in enumerate([*text.split("\n"), ""], 1):
        line = line.strip()
        if line.startswith("|"):
            yield from flush()
            yield from ((number, "cell", cell.strip()) for cell in line.strip("|").split("|"))
            continue
        if not line or line.startswith("#"):
            yield from flush()
            if line:
                yield number, "heading", line.strip("# ")
            continue
        if re.match(r"(?:[-*]|\d+\.) ", line):
            yield from flush()
        if not held:
            begin = number
        held.append(line)


def sentences(text: str) -> list[str]:
    """Sentences of a text on one line."""
    text = _ABBREVIATED.sub("…", text)
    return [part for part in re.split(r"(?<=[.!?:;])\s+(?=[A-Z*`\[(\d])", text) if part]


def problems(name: str, text: str) -> list[str]:
    """Lines of a page that break a rule, one line each; none for other pages.

    Parameters
    ----------
    name : str
        Path below the root.
    text : str
        The page, as Markdown.
    """
    if not any(fnmatch(name, page) for page in PAGES):
        return []
    found = []
    for line, kind, part in _parts(plain(text)):
        for pattern, better in _PATTERNS:
            if match := pattern.search(part):
                found.append(f'{name}:{line}: "{match[0]}": {better}')
        most = CELL if kind == "cell" else PARAGRAPH
        if kind in {"cell", "paragraph"} and (count := _words(part)) > most:
            found.append(f"{name}:{line}: {kind} of {count} words; {most} is the most")
        for sentence in sentences(part):
            if (count := _words(sentence)) > SENTENCE:
                found.append(f'{name}:{line}: sentence of {count} words, "{sentence[:30]}…"; {SENTENCE} is the most')
            often = [w for w, n in Counter(w.lower() for w in _PRONOUNS.findall(sentence)).items() if n > 1]
            found += [f'{name}:{line}: "{word}" twice in a sentence: name the thing' for word in often]
    return found
