# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing the species that the editor shows, key by key, in its JSON."""

from __future__ import annotations

from math import isnan
from typing import Any

import bpy

from ..errors import SpeciesError
from ..plants.schema import ORDER_KEYS
from .species_edits import catalogue, change_species, species_data, species_for

_SIGNIFICANT = 6  # digits of a slider's float32 that are meant


def present_species(editor: bpy.types.PropertyGroup) -> str:
    """Identifier of the species that the editor shows; what the drop-down shows when none was chosen yet."""
    return editor.species or next(iter(catalogue()), "")


def _data_of(editor: bpy.types.PropertyGroup) -> dict[str, Any]:
    """The decoded species that the editor shows; empty where there is none that could be shown."""
    try:
        return species_data(editor.id_data, present_species(editor))
    except SpeciesError:
        return {}


def _orders_in(data: dict[str, Any]) -> list[dict[str, Any]]:
    orders = data.get("orders")
    return orders if isinstance(orders, list) and all(isinstance(o, dict) for o in orders) else []


def orders_of(editor: bpy.types.PropertyGroup) -> list[dict[str, Any]]:
    """Decoded orders of the species that the editor shows; empty where there is none that could be shown."""
    return _orders_in(_data_of(editor))


def parts_of(editor: bpy.types.PropertyGroup) -> list[dict[str, Any]]:
    """The orders, and after them the short shoot of species that have one."""
    data = _data_of(editor)  # looked up once: each slider of the panel asks for it at each redraw
    orders, spur = _orders_in(data), data.get("spur")
    return orders + ([spur] if isinstance(spur, dict) and orders else [])


def present_order(editor: bpy.types.PropertyGroup) -> int:
    """Index among `parts_of` of what the sliders show."""
    return _order_in(editor, parts_of(editor))


def _order_in(editor: bpy.types.PropertyGroup, parts: list[dict[str, Any]]) -> int:
    return max(min(editor.order_index, len(parts) - 1), 0)


def order_label(index: int, order: dict[str, Any], spur: bool = False) -> str:
    """A line of the list of orders."""
    name = "Short shoots" if spur else ("Trunk", "Branches", "Twigs")[index] if index < 3 else f"Order {index}"
    counts = [f"{text} {what}" for what in ("branches", "leaves") if (text := _count(order.get(what)))]
    number = "+" if spur else index
    return f"{number}  {name}: {', '.join(counts)}" if counts else f"{number}  {name}"


def _count(value: Any) -> str:
    try:
        mean, variation = map(float, value)
    except (TypeError, ValueError):
        return ""
    return f"{mean:g}" if mean + variation > 0 else ""


def value_of(editor: bpy.types.PropertyGroup, name: str) -> Any:
    """Value of a key of the shown order as JSON; the default if the file does not give it."""
    parts, key = parts_of(editor), ORDER_KEYS[name]
    index = _order_in(editor, parts)
    if parts and name in parts[index]:
        return parts[index][name]
    try:
        # Some defaults follow from other keys, and only the reader knows how.
        species = species_for(editor.id_data, present_species(editor))
        return getattr(species.orders[index] if index < len(species.orders) else species.spur, name)
    except (SpeciesError, AttributeError):
        return key.default


def species_value(editor: bpy.types.PropertyGroup, name: str, default: Any) -> Any:
    """Value of a key of the whole species as JSON."""
    return _data_of(editor).get(name, default)


def set_species_value(editor: bpy.types.PropertyGroup, name: str, value: Any) -> None:
    """Write a key of the whole species; None takes it out."""

    def change(data: dict[str, Any]) -> None:
        data[name] = value
        if value is None:
            del data[name]

    change_species(editor.id_data, present_species(editor), change)


def number_in(value: Any, *path: int) -> float:
    """A number inside nested lists; 0 where there is none. A range may be written as its mean alone."""
    if path and isinstance(value, int | float):
        return 0.0 if path[0] else float(value)
    try:
        for step in path:
            value = value[step]
        number = float(value)
    except (TypeError, ValueError, IndexError, KeyError):
        return 0.0
    return 0.0 if isnan(number) else number


def rounded(value: float) -> float:
    """The digits of a slider's single precision that are meant."""
    return float(f"{value:.{_SIGNIFICANT}g}")


def write(editor: bpy.types.PropertyGroup, name: str, value: Any) -> None:
    """Write a key of the shown order; Blender swallows errors of setters, so the panel has to show them."""
    index = present_order(editor)
    if len(parts_of(editor)) > index:

        def change(data: dict[str, Any]) -> None:
            orders = data["orders"]
            (orders[index] if index < len(orders) else data["spur"])[name] = value

        change_species(editor.id_data, present_species(editor), change)


def write_range(editor: bpy.types.PropertyGroup, name: str, part: int, value: float) -> None:
    """Write the mean (0) or the variation (1) of a range of the shown order."""
    old = value_of(editor, name)
    write(editor, name, [value if i == part else rounded(number_in(old, i)) for i in (0, 1)])
