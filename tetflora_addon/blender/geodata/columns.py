# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of an inventory as a dialog shows them: title, some values, and what they are taken for."""

import json
from collections.abc import Iterable
from pathlib import Path

import bpy

from ...errors import SceneError
from ...geodata.inventories import FIELDS, preview
from ..declare import HIDDEN, choice, string

_UNITS = ("Meters", "Centimeters", "Millimeters", "Feet", "Inches")


class TetFloraInventoryColumn(bpy.types.PropertyGroup):
    """A column, whose title is the name."""

    field: choice(
        "Meaning", "What the column holds", [(name.upper() or 'NONE', label, "") for name, label in FIELDS.items()]
    )
    unit: choice(
        "Unit",
        "Unit of its numbers, where neither they nor the title name one",
        [
            ('AUTO', "Automatic", ""),
            *((unit, label, "") for unit, label in zip(("m", "cm", "mm", "ft", "in"), _UNITS, strict=True)),
        ],
    )
    values: string("Values", **HIDDEN)


def show_columns(table: bpy.types.bpy_prop_collection, path: Path) -> None:
    """Fill a table with the columns of a file. Errors are those of `preview`."""
    for column in preview(path):
        row = table.add()
        row.name, row.field, row.values = column.title, column.field.upper() or 'NONE', ", ".join(column.values)


def chosen_columns(table: Iterable[TetFloraInventoryColumn]) -> str:
    """What was chosen for columns, as scripts write it."""
    chosen = {row.name: row.field.lower() if row.field != 'NONE' else "" for row in table}
    return json.dumps(chosen | {row.name: f"{chosen[row.name]} {row.unit}" for row in table if row.unit != 'AUTO'})


def columns_in(text: str) -> dict[str, str]:
    """What columns hold by their titles, from JSON.

    Raises
    ------
    SceneError
        It is none.
    """
    try:
        columns = json.loads(text or "{}")
    except (ValueError, RecursionError) as error:
        raise SceneError(f"Columns is not valid JSON: {error}") from None
    if not isinstance(columns, dict) or not all(isinstance(value, str) for value in columns.values()):
        raise SceneError('Columns is not a JSON object of texts, such as {"H": "height"}')
    return columns
