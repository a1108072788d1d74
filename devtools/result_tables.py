# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the tables of docs/results.md from the records in docs/results: ``python -m devtools.result_tables``.

Tables stand between two comments, ``<!-- measured: NAME -->`` and ``<!-- end -->``. Those of the paper come from
docs/results/paper (examples/paper/tables.py), all others from docs/results/figures.json. `problems` finds tables that
are not those of the records, for devtools/readability.py.
"""

from __future__ import annotations

import json
import re
import sys
from typing import Any

from .house import ROOT

_NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?")
PAGE, FIGURES = ROOT / "docs" / "results.md", ROOT / "docs" / "results" / "figures.json"


def put(text: str, name: str, content: str) -> str:
    """Put something between the comments that name it.

    Raises
    ------
    ValueError
        The page has no such comments.
    """
    begin, end = f"<!-- measured: {name} -->", "<!-- end -->"
    found = re.compile(f"({re.escape(begin)}\n).*?(\n{re.escape(end)})", re.DOTALL)
    if not found.search(text):
        raise ValueError(f"the page has no {begin} … {end} to write a table to")
    return found.sub(lambda match: f"{match[1]}\n{content}\n{match[2]}", text, count=1)


def _shown(value: Any) -> str:
    if isinstance(value, int):
        return f"{value:,}"
    return str(value).replace("-", "−") if isinstance(value, float) else value


def table(record: dict[str, Any]) -> str:
    """A table in Markdown: what it is about, its command and spread, and the rows with date and commit."""
    head = [*record["columns"], "measured at"]
    rows = [
        [*map(_shown, row["values"]), f"{int(row['date'][-2:])} Nov, `{row['commit'][:7]}`"] for row in record["rows"]
    ]
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, ["---"] * len(head), *rows)]
    command = f"`{record['command']}`" if record["command"] else ""
    spread = f"Spread: {record['spread']}." if record["spread"] else ""
    about = " ".join(filter(None, (record["about"], f"{command}." if command else "", spread)))
    return f"{about}\n\n" + "\n".join(lines)


def written(text: str) -> str:
    """The page with the tables of the records."""
    record = json.loads(FIGURES.read_text(encoding="utf-8"))
    for name, one in record["tables"].items():
        text = put(text, name, table(one))
    return text


def problems() -> list[str]:
    """Whether the page has other tables than the records, and numbers of the README that the page does not have."""
    text = PAGE.read_text(encoding="utf-8")
    found = []
    if text != written(text):
        found.append("docs/results.md: tables are not those of docs/results; run python -m devtools.result_tables")
    measured = re.search(r"^Measured on.*?\n\n(?:\|.*\n)+", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    cells = re.findall(r"^\|[^|]*\|([^|]*)\|", measured[0] if measured else "", re.MULTILINE)[2:]
    numbers = {number for cell in cells for number in _NUMBER.findall(cell)}
    here = set(_NUMBER.findall(text))
    found += [f"README.md: {n} is measured, but not in docs/results.md" for n in sorted(numbers - here)]
    return found


def main() -> int:
    """Write the tables."""
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
