# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inventories of trees that are written in unusual ways, and column titles: what is right of each, and what is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tetflora_addon.errors import SceneError
from tetflora_addon.geodata.inventories import Inventory, preview, read_inventory, read_title
from tetflora_addon.geodata.species_names import KIND, best_of, species_named

FOLDER = Path(__file__).parent.parent / "tests" / "data" / "geodata"
#: Fields that read what a list of titles says they hold. Genus and epithet are names, and a girth tells the diameter.
_FITS = {
    "common name": ("common", "name"),
    "scientific name": ("name", "common", "genus"),
    "epithet or species": ("name", "common"),
    "genus": ("genus", "name"),
    "height": ("height",),
    "crown width": ("crown_width",),
    "trunk diameter": ("diameter", "girth"),
    "trunk girth": ("girth",),
}


def cases() -> dict[str, dict[str, Any]]:
    """What is right of each file."""
    return json.loads((FOLDER / "inventories.json").read_text(encoding="utf-8"))


def problems(name: str) -> list[str]:
    """What is wrong with how a file is read; empty when all is right."""
    expected = cases()[name]
    found = _read(name, False)
    if "refused" not in expected:
        return _compared(found, expected) if isinstance(found, Inventory) else [f"refused: {found}"]
    if isinstance(found, Inventory):
        return ["not refused"]
    wrong = [f"{text!r} is not in {found!r}" for text in expected["refused"] if not _names(found, text)]
    wrong += [f"{text!r} is in {found!r}" for text in expected.get("never", ()) if text in found]
    skipped = _read(name, True)
    return wrong + (_compared(skipped, expected["skip"]) if isinstance(skipped, Inventory) else [f"refused: {skipped}"])


def _read(name: str, skip: bool) -> Inventory | str:
    """What is read, or the refusal; the same if the columns are those that the dialog proposes."""
    path = FOLDER / name
    try:
        asked = {column.title: column.field for column in preview(path)}
        alone, found = (read_inventory(path, skip=skip, columns=columns) for columns in (None, asked))
        same = all(np.array_equal(alone.sizes[key], found.sizes[key]) for key in alone.sizes)
        return found if same and np.array_equal(alone.points, found.points) else "the dialog proposes other columns"
    except SceneError as error:
        return str(error)


def _names(message: str, text: str) -> bool:
    """Whether a message has a text, or names a line by its number."""
    return text in message or (text.startswith("line ") and text.split()[1] in message.replace(",", " ").split())


def _compared(found: Inventory, expected: dict[str, Any]) -> list[str]:
    """Where an inventory differs from what is right."""
    told = "; ".join([*found.notes, found.first])
    matches = [best_of(found.names[i])[0] for i in found.name]
    have = {
        "species": ["" if m is None or m.certainty == KIND else m.species for m in matches],
        "left_out": found.left_out.total(),
        "skipped": found.skipped,
        "epsg": found.system.epsg,
    }
    numbers = {**found.sizes, "points": found.points, "girth": np.pi * found.sizes["diameter"]}
    wrong = []
    for key, right in expected.items():
        if key == "told":
            wrong += [f"{text!r} is not in {told!r}" for text in right if not _names(told, text)]
        elif key in have:
            wrong += [f"{key}: {have[key]} and not {right}"] * (have[key] != right)
        else:
            same = np.shape(right) == numbers[key].shape and np.allclose(numbers[key], right, rtol=1e-5, atol=1e-6)
            wrong += [f"{key}: {numbers[key].tolist()} and not {right}"] * (not same)
    return wrong


def titles() -> list[tuple[str, str, str]]:
    """What a column holds, its title, and the field that it is read as."""
    lines = (FOLDER / "titles.tsv").read_text(encoding="utf-8").splitlines()[1:]
    return [(*line.split("\t"), read_title(line.split("\t")[1]).field) for line in lines]


def titles_read() -> float:
    """The fraction of titles that are read, 0 to 1."""
    return float(np.mean([field in _FITS[holds] for holds, _, field in titles()]))


def titles_not_read() -> list[str]:
    """Titles that are read as something else, or not."""
    return [title for holds, title, field in titles() if field not in _FITS[holds]]


def names_unknown() -> list[str]:
    """Common names of trees of streets and parks, in five languages, that mean nothing."""
    texts = json.loads((FOLDER / "names.json").read_text(encoding="utf-8")).values()
    names = [name for text in texts for name in text.split("; ")]
    return [name for name in names if (match := species_named(name)) is None or match.certainty == KIND]


def figures() -> dict[str, float]:
    """The figures of the benchmark."""
    right = [not problems(name) for name in cases()]
    return {
        "cases": float(len(right)),
        "cases_right": float(sum(right)),
        "cases_wrong": float(len(right) - sum(right)),
        "titles_read": titles_read(),
        "names_unknown": float(len(names_unknown())),
    }
