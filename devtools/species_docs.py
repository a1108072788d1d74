# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m devtools.species_docs`` writes the tables of docs/species.md.

Keys, crowns and leaves come from the tables that the reader checks by, forms of the shipped species from published
figures and plants that are measured. Tests say whether the page is current.
"""

from __future__ import annotations

import datetime
import json
import re

from tetflora_addon.leaves.models import LEAF_MODELS, OUTLINES, Spines
from tetflora_addon.parameters import Key, keys_of
from tetflora_addon.species.catalog import LENGTH_HIGH, ORDER_KEYS, builtin_folder, load_species
from tetflora_addon.species.species import CROWN_PROFILES, DAYS, LEAF_KINDS

from . import forms
from .house import ROOT

PAGE = ROOT / "docs" / "species.md"

_WRITTEN = {
    "range": "`[mean, variation]`, or the mean",
    "number": "number",
    "integer": "whole number",
    "choice": "name",
    "rgb": "`[r, g, b]`",
    "color": "`[[r, g, b], [variation of each]]`",
}


def _limits(key: Key) -> str:
    if key.choices == CROWN_PROFILES:
        return "see below"
    if key.choices:
        return ", ".join(f"`{name}`" for name in key.choices)
    limits = f"{key.low:g} to {key.high:g}"
    return f"{limits}; {key.low:g} to {LENGTH_HIGH:g} after order 0" if key is ORDER_KEYS["length"] else limits


def _default(key: Key) -> str:
    if key.follows:
        return f"mean of `{key.follows}`"
    if key.needed:
        return "required"
    return f"`{json.dumps(key.default)}`"


def key_table() -> str:
    """Markdown table of the keys of an order."""
    lines = ["| key | written | limits | unit | default | meaning |", "|---|---|---|---|---|---|"]
    for name, key in ORDER_KEYS.items():
        cells = (f"`{name}`", _WRITTEN[key.kind], _limits(key), key.unit or "–", _default(key), key.meaning)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def crown_list() -> str:
    """Names of the crown shapes in one line."""
    return ", ".join(f"`{name}`" for name in CROWN_PROFILES)


def leaf_table() -> str:
    """Markdown table of the built-in leaves."""
    lines = ["| model | faces | width | one-sided area |", "|---|---|---|---|"]
    lines += [f"| `{n}` | {m.polygons} | {m.width:.2f} | {m.area:.3f} |" for n, m in LEAF_MODELS.items()]
    return "\n".join(lines)


def outline_tables() -> str:
    """Markdown tables of the fields of outlines, by kind, and of spines."""
    blocks = []
    for kind, shape in {**OUTLINES, "spines": Spines}.items():
        lines = [f"| `{kind}` | limits | default | meaning |", "|---|---|---|---|"]
        for name, key in keys_of(shape).items():
            default = "–" if name == "leaflet" else f"`{json.dumps(key.default)}`"
            limits = "a `blade`" if name == "leaflet" else _limits(key)
            lines.append(f"| `{name}` | {limits} | {default} | {key.meaning} |")
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def form_table() -> str:
    """Markdown table of published figures of the shipped species beside those of plants, and a list of the sources."""
    sources: dict[str, int] = {}
    lines = ["| species | figure | published | measured | source |", "|---|---|---|---|---|"]
    for identifier in forms.species():
        name = load_species(identifier).name
        for one in forms.compared(identifier):
            title, unit, decimals = forms.FIGURES[one.figure]
            low, high, value = (f"{number:.{decimals}f}" for number in (one.low, one.high, one.value))
            paper, _, of = one.source.partition(". Of ")
            number = sources.setdefault(paper, len(sources) + 1)
            where = f"{name}, in a stand" if one.habit else name
            cells = (where, f"{title}, {unit}", f"{low} to {high}", value, f"[{number}] {of}".strip())
            lines.append(f"| {' | '.join(cells)} |")
    lines += ["", *(f"{number}. {paper}" for paper, number in sources.items())]
    return "\n".join(lines)


def year_table() -> str:
    """Markdown table of the days of the shipped species' leaves, and blossoms or fruit, and where they are from."""
    lines = ["| species | at | appear | full-grown | turn | fall | source |", "|---|---|---|---|---|---|---|"]
    for path in sorted(builtin_folder().glob("*.json")):
        species = load_species(path.stem)
        year = species.year
        for part in LEAF_KINDS if year is not None else ():
            one = getattr(year, part)
            if one is not None:
                days = (one.appear, one.appear + one.growth, one.turn, one.fall)
                where = species.name if part == "leaf" else f"{species.name}, {part}"
                cells = (where, f"{year.latitude:g}° N", *(_date(day) for day in days), year.source)
                lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _date(day: float) -> str:
    """A day of the year, as a date of one that is no leap year."""
    when = datetime.date(2001, 1, 1) + datetime.timedelta(days=round(day % DAYS) - 1)
    return f"{when:%b} {when.day}"


def updated(page: str) -> str:
    """The page with the tables of the file format written anew; they stand between comments that name them."""
    tables = {"keys": key_table(), "crowns": crown_list(), "leaves": leaf_table(), "outlines": outline_tables()}
    return _filled(page, {**tables, "years": year_table()})


def with_forms(page: str) -> str:
    """The page with the table of forms written anew; takes a few seconds, because plants are grown."""
    return _filled(page, {"forms": form_table()})


def _filled(page: str, texts: dict[str, str]) -> str:
    for name, text in texts.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
        if not pattern.search(page):
            raise ValueError(f"{PAGE.name} has no place for {name}")
        page = pattern.sub(lambda match, text=text: f"{match[1]}\n{text}\n\n{match[2]}", page)
    return page


if __name__ == "__main__":
    PAGE.write_text(with_forms(updated(PAGE.read_text(encoding="utf-8"))), encoding="utf-8")
