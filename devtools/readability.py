# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether documents can be read: ``python -m devtools.readability`` lists broken links, long pages and poor sentences.

Links are those of all Markdown files under version control, to files, pictures and headings of the repository.
Addresses elsewhere are not asked for. Rules of language are in devtools/prose.py. The check runs in ``make lint``.
"""

from __future__ import annotations

import posixpath
import re
import sys
from collections import Counter
from collections.abc import Collection
from urllib.parse import unquote

from . import prose, result_tables
from .house import ROOT, files

README, MANUAL = "README.md", "docs/manual"
TUTORIALS = "docs/manual/tutorials.md"
#: Most words of pages, or of all whose path begins so. Tutorials of the manual are not counted.
MOST_WORDS = {
    README: 600,
    MANUAL: 7_500,
    "docs/results.md": 1_600,
    "docs/features.md": 1_600,
    "docs/measurements.md": 11_000,
}

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_CODE = re.compile(r"^(```|~~~).*?^\1|(?<!`)(`+)(?!`).+?(?<!`)\2(?!`)", re.DOTALL | re.MULTILINE)
_FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
_TARGET = re.compile(
    r"\]\(\s*<?([^)\s>]+)"  # [text](target) and ![picture](target), also one in the other
    r"|^\[[^\]]+\]:\s*(\S+)"  # [text]: target
    r"|<(?:a|img|source|video)\b[^>]*?\b(?:href|src)=[\"']([^\"']+)",
    re.MULTILINE,
)


def _clear(match: re.Match[str]) -> str:
    """As many lines, so that numbers of lines stay."""
    return "\n" * match[0].count("\n")


def words(text: str) -> int:
    """Words of a page as they are read: code and what pictures show counts; comments and targets of links do not."""
    text = re.sub(r"\]\([^)]*\)", "]", _COMMENT.sub("", text))
    return sum(any(c.isalnum() for c in word) for word in text.split())


def anchors(text: str) -> set[str]:
    """Names by which links reach the headings of a page, as GitHub makes them."""
    seen: Counter[str] = Counter()
    found = set()
    for heading in re.findall(r"^#+ +(.+?)[ #]*$", _FENCE.sub("", text), re.MULTILINE):
        shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        name = re.sub(r"[^\w\- ]", "", shown).replace(" ", "-")
        found.add(f"{name}-{seen[name]}" if seen[name] else name)
        seen[name] += 1
    return found | set(re.findall(r"<a\s+(?:id|name)=[\"']([^\"']+)", text))


def broken_links(pages: dict[str, str], names: Collection[str]) -> list[str]:
    """Links of pages to what is not there, one line each.

    Parameters
    ----------
    pages : dict of str to str
        Text of each Markdown file by its path below the root.
    names : collection of str
        Paths of all files, in letters as they are; their folders can be linked as well.
    """
    there = set(names) | {folder for name in names for folder in _folders(name)}
    headings = {name: anchors(text) for name, text in pages.items()}
    found = []
    for page, text in pages.items():
        text = _CODE.sub(_clear, _COMMENT.sub(_clear, text))
        for match in _TARGET.finditer(text):
            target = next(filter(None, match.groups()))
            if re.match(r"[a-z][a-z0-9+.-]*:", target, re.IGNORECASE):
                continue  # elsewhere
            path, _, anchor = unquote(target).partition("#")
            path = posixpath.normpath(posixpath.join(posixpath.dirname(page), path)) if path else page
            line = text.count("\n", 0, match.start()) + 1
            if path not in there:
                found.append(f"{page}:{line}: {target}: no such file in the repository")
            elif anchor and anchor not in headings.get(path, {anchor}):
                found.append(f"{page}:{line}: {target}: no such heading in {path}")
    return found


def _folders(name: str) -> list[str]:
    parts = name.split("/")[:-1]
    return [".", *("/".join(parts[: i + 1]) for i in range(len(parts)))]


def problems() -> list[str]:
    """What makes the repository's documents hard to read, one line each."""
    names = {path.relative_to(ROOT).as_posix(): path for path in files()}
    pages = {name: path.read_text(encoding="utf-8") for name, path in names.items() if path.suffix == ".md"}
    found = broken_links(pages, names)
    for begin, most in MOST_WORDS.items():
        if (count := length(pages, begin)) > most:
            found.append(f"{begin}: {count:,} words; {most:,} is the most")
    found += [line for name, text in pages.items() for line in prose.problems(name, text)]
    return found + result_tables.problems()


def length(pages: dict[str, str], begin: str) -> int:
    """Words of all pages whose path begins so, but for the tutorials."""
    return sum(words(text) for name, text in pages.items() if name.startswith(begin) and name != TUTORIALS)


def main() -> int:
    """Print the problems, and how long pages are; 1 when there are any problems."""
    found = problems()
    pages = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in files() if path.suffix == ".md"}
    print("\n".join(found) or "documents: all links lead somewhere, and no sentence breaks a rule")
    print(", ".join(f"{begin}: {length(pages, begin):,} words" for begin in MOST_WORDS))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
