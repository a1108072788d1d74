# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Near-copies: runs of ten lines and more that stand twice.

    python -m devtools.duplicates                        in the product; exit code 1 where there are any
    python -m devtools.duplicates tests benchmarks       in other folders

Two runs are near-copies where their statements have the same shape, but for one line between others, and most of their
names are the same. Comments, docstrings, imports and declarations of fields do not count; numbers and texts may
differ.
"""

from __future__ import annotations

import argparse
import io
import keyword
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import rooms

ROOT = Path(__file__).resolve().parent.parent
#: Lines of a run that counts, and the share of its names that are the same in both.
LINES, SAME = 10, 0.75
#: Statements with which a run begins to be looked at, and those that follow a line that differs.
_SEED, _AFTER = 4, 2
_SKIPPED = {tokenize.COMMENT, tokenize.NL, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING, tokenize.ENDMARKER}


@dataclass(frozen=True)
class Statement:
    """One logical line: its first and last line, its shape without names, and its names."""

    first: int
    last: int
    shape: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Copy:
    """Two runs: files, first and last lines of each, lines of the shorter one, and the share of names they share.

    Lines are those of statements: what stands between and does not count is left out.
    """

    one: str
    other: str
    one_lines: tuple[int, int]
    other_lines: tuple[int, int]
    lines: int
    same: float

    def __str__(self) -> str:
        places = (f"{path}:{a}-{b}" for path, (a, b) in ((self.one, self.one_lines), (self.other, self.other_lines)))
        return f"{self.lines:3d} lines, {self.same:4.0%} of names: {' and '.join(places)}"


def statements(source: str) -> list[Statement]:
    """Logical lines of a source but imports, declarations, and texts that stand by themselves."""
    found: list[Statement] = []
    tokens: list[tokenize.TokenInfo] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _SKIPPED and token.type != tokenize.NEWLINE:
            tokens.append(token)
        elif token.type == tokenize.NEWLINE and tokens:
            words = [t.string for t in tokens]
            declares = len(words) > 1 and words[1] == ":" and not keyword.iskeyword(words[0])
            if words[0] not in ("import", "from") and not declares and any(t.type != tokenize.STRING for t in tokens):
                found.append(_statement(tokens))
            tokens = []
    return found


def _statement(tokens: list[tokenize.TokenInfo]) -> Statement:
    shape, names = [], []
    for token in tokens:
        if token.type == tokenize.NAME and not keyword.iskeyword(token.string):
            shape.append("n")
            names.append(token.string)
        else:
            shape.append({tokenize.NUMBER: "0", tokenize.STRING: "s"}.get(token.type, token.string))
    return Statement(tokens[0].start[0], tokens[-1].end[0], " ".join(shape), tuple(names))


def _run(one: Sequence[Statement], i: int, other: Sequence[Statement], j: int) -> tuple[int, float]:
    """How many statements from i and j on are near-copies, and the share of their names that are the same."""
    length = gaps = 0
    while i + length < len(one) and j + length < len(other):
        if one[i + length].shape != other[j + length].shape:
            after = [
                a.shape == b.shape
                for a, b in zip(
                    one[i + length + 1 : i + length + 1 + _AFTER],
                    other[j + length + 1 : j + length + 1 + _AFTER],
                    strict=False,
                )
            ]
            if gaps or len(after) < _AFTER or not all(after):
                break
            gaps += 1
        length += 1
    names = [
        name == again
        for a, b in zip(one[i : i + length], other[j : j + length], strict=True)
        for name, again in zip(a.names, b.names, strict=False)
    ]
    return length, sum(names) / max(len(names), 1)


def copies(sources: dict[str, str], least: int = LINES) -> list[Copy]:
    """Near-copies among sources by name, the longest first; what lies within another one is left out."""
    parsed = {name: statements(text) for name, text in sources.items()}
    seeds: dict[tuple[str, ...], list[tuple[str, int]]] = defaultdict(list)
    for name, lines in parsed.items():
        for i in range(len(lines) - _SEED + 1):
            seeds[tuple(line.shape for line in lines[i : i + _SEED])].append((name, i))
    found: list[Copy] = []
    for places in seeds.values():
        for n, (one, i) in enumerate(places):
            for other, j in places[n + 1 :]:
                found += (copy for copy in _copy(parsed, one, i, other, j) if copy.lines >= least)
    kept: list[Copy] = []
    for copy in sorted(found, key=lambda c: (-c.lines, c.one, c.one_lines)):
        if not any(_within(copy, longer) for longer in kept):
            kept.append(copy)
    return kept


def _copy(parsed: dict[str, list[Statement]], one: str, i: int, other: str, j: int) -> Iterator[Copy]:
    a, b = parsed[one], parsed[other]
    if i and j and a[i - 1].shape == b[j - 1].shape and one != other:
        return  # found from its beginning
    length, same = _run(a, i, b, j)
    if one == other:
        length = min(length, j - i)
    ends = (a[i].first, a[i + length - 1].last), (b[j].first, b[j + length - 1].last)
    lines = min(sum(s.last - s.first + 1 for s in some) for some in (a[i : i + length], b[j : j + length]))
    if same >= SAME:
        yield Copy(one, other, *ends, lines, same)


def _within(copy: Copy, longer: Copy) -> bool:
    return (copy.one, copy.other) == (longer.one, longer.other) and all(
        a[0] <= b[1] and b[0] <= a[1]
        for a, b in ((copy.one_lines, longer.one_lines), (copy.other_lines, longer.other_lines))
    )


def main(arguments: list[str]) -> int:
    """Print near-copies; 1 where there are any."""
    parser = argparse.ArgumentParser(prog="python -m devtools.duplicates", description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", default=rooms.PRODUCT, help="by default those of the product")
    parser.add_argument("--lines", type=int, default=LINES, help=f"of the shortest that count (default: {LINES})")
    given = parser.parse_args(arguments)
    folders = given.folders
    paths = sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))
    found = copies({path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}, given.lines)
    print("\n".join(map(str, found)) or "no near-copies")
    print(f"{len(found)} near-copies of {given.lines} lines and more in {', '.join(folders)}")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
