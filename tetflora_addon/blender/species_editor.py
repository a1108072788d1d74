# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sliders of the species editor, made from the keys of species files: a new key gets its slider by itself.

The properties store nothing. They read the JSON of the chosen species and write it into this file
(`species_edits`), so there is nothing to keep in step with undo, loading or other scenes.
"""

from collections.abc import Callable
from math import degrees, isnan, radians
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

from ..errors import SpeciesError
from ..plants.leaf_models import LEAF_MODELS
from ..plants.schema import CHOICES, LENGTH_HIGH, ORDER_KEYS, QUALITY_LIMITS, Key
from ..plants.species import BARKS, MAX_ORDERS
from .species_choice import SpeciesChoice
from .species_edits import change_species, species_data, species_for, tell_listeners
from .species_items import catalogue

#: Added to a key's name for the property of a range's second number.
VARIATION = "_variation"
#: Items of ``leaf_form`` that are no built-in model.
OBJECT_LEAF, OWN_LEAF = "OBJECT", "OWN"
_SIGNIFICANT = 6  # digits of a slider's float32 that are meant
_VARIES = "By how much single ones differ from the mean, to both sides"


def order_keys() -> dict[str, Key]:
    """Keys of an order that the editor shows; a key of an unknown kind can still be written by hand."""
    return {name: key for name, key in ORDER_KEYS.items() if key.kind in _MAKERS or _choices(key)}


def present_species(editor: bpy.types.PropertyGroup) -> str:
    """Identifier of the species that the editor shows; what the drop-down shows when none was chosen yet."""
    return editor.species or next(iter(catalogue()), "")


def orders_of(editor: bpy.types.PropertyGroup) -> list[dict[str, Any]]:
    """Decoded orders of the species that the editor shows; empty where there is none that could be shown."""
    try:
        orders = species_data(editor.id_data, present_species(editor)).get("orders")
    except SpeciesError:
        return []
    return orders if isinstance(orders, list) and all(isinstance(o, dict) for o in orders) else []


def present_order(editor: bpy.types.PropertyGroup) -> int:
    """Index of the order that the sliders show."""
    return max(min(editor.order_index, len(orders_of(editor)) - 1), 0)


def order_label(index: int, order: dict[str, Any]) -> str:
    """A line of the list of orders."""
    name = ("Trunk", "Branches", "Twigs")[index] if index < 3 else f"Order {index}"
    counts = [f"{text} {what}" for what in ("branches", "leaves") if (text := _count(order.get(what)))]
    return f"{index}  {name}: {', '.join(counts)}" if counts else f"{index}  {name}"


def _count(value: Any) -> str:
    try:
        mean, variation = map(float, value)
    except (TypeError, ValueError):
        return ""
    return f"{mean:g}" if mean + variation > 0 else ""


def value_of(editor: bpy.types.PropertyGroup, name: str) -> Any:
    """Value of a key of the shown order as JSON; the default if the file does not give it."""
    orders, index, key = orders_of(editor), present_order(editor), ORDER_KEYS[name]
    if orders and name in orders[index]:
        return orders[index][name]
    try:
        # Some defaults follow from other keys, and only the reader knows how.
        return getattr(species_for(editor.id_data, present_species(editor)).orders[index], name)
    except (SpeciesError, IndexError):
        return key.default


def _number(value: Any, *path: int) -> float:
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


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT}g}")


def _write(editor: bpy.types.PropertyGroup, name: str, value: Any) -> None:
    """Write a key of the shown order; Blender swallows errors of setters, so the panel has to show them."""
    index = present_order(editor)
    if len(orders_of(editor)) > index:
        change_species(
            editor.id_data, present_species(editor), lambda data: data["orders"][index].update({name: value})
        )


def _write_range(editor: bpy.types.PropertyGroup, name: str, part: int, value: float) -> None:
    old = value_of(editor, name)
    _write(editor, name, [value if i == part else _rounded(_number(old, i)) for i in (0, 1)])


def _label(name: str) -> str:
    return name.replace("_", " ").title()


def _description(name: str, key: Key) -> str:
    limits = f"{key.low:g} to {key.high:g}" if key.high > key.low else ""
    if name == "length":
        limits += f", {key.low:g} to {LENGTH_HIGH:g} after the trunk"
    detail = "; ".join(text for text in (key.unit, limits) if text)
    text = key.meaning[:1].upper() + key.meaning[1:]
    return f"{text} ({detail})" if detail else text


def _soft_high(key: Key) -> float:
    """Where a slider ends: limits of files are far beyond what plants have."""
    mean = abs(_number(key.default, 0)) if isinstance(key.default, list) else 0.0
    if key.high > 1000:
        return 60.0
    return 10.0 * mean if 0.0 < 50.0 * mean < key.high else min(key.high, 360.0)


def _float_options(key: Key, low: float, high: float) -> dict[str, Any]:
    if key.unit == "degrees":
        return {
            "min": radians(low),
            "max": radians(high),
            "subtype": 'ANGLE',
            "unit": 'ROTATION',
            "step": 100,
            "precision": 4,
        }
    options: dict[str, Any] = {"min": low, "max": high, "soft_max": min(_soft_high(key), high), "precision": 3}
    if key.unit == "m":
        options |= {"subtype": 'DISTANCE', "unit": 'LENGTH', "step": 1}
    elif (low, high) == (0, 1):
        options |= {"subtype": 'FACTOR'}
    return options


def _floats(
    name: str,
    key: Key,
    read: Callable[[bpy.types.PropertyGroup], float],
    write: Callable[[bpy.types.PropertyGroup, float], None],
    variation: bool = False,
) -> Any:
    to_file, to_slider = (degrees, radians) if key.unit == "degrees" else (float, float)
    low, high = (0.0, key.high - key.low) if variation else (key.low, key.high)
    return FloatProperty(
        name=_label(name) + (" Variation" if variation else ""),
        description=f"{_VARIES}: {key.meaning}" if variation else _description(name, key),
        get=lambda self: to_slider(read(self)),
        set=lambda self, value: write(self, _rounded(to_file(value))),
        options=set(),
        **_float_options(key, low, high),
    )


def _range(name: str, key: Key) -> dict[str, Any]:
    parts = {}
    for part, suffix in enumerate(("", VARIATION)):
        parts[name + suffix] = _floats(
            name,
            key,
            lambda self, part=part: _number(value_of(self, name), part),
            lambda self, value, part=part: _write_range(self, name, part, value),
            variation=part == 1,
        )
    return parts


def _single(name: str, key: Key) -> dict[str, Any]:
    return {
        name: _floats(
            name, key, lambda self: _number(value_of(self, name)), lambda self, value: _write(self, name, value)
        )
    }


def _integer(name: str, key: Key) -> dict[str, Any]:
    made = IntProperty(
        name=_label(name),
        description=_description(name, key),
        min=int(key.low),
        max=int(key.high),
        get=lambda self: int(_number(value_of(self, name))),
        set=lambda self, value: _write(self, name, value),
        options=set(),
    )
    return {name: made}


def _colour(name: str, key: Key) -> dict[str, Any]:
    return {name + suffix: _colour_part(name, key, part) for part, suffix in enumerate(("", VARIATION))}


def _rgb(name: str, key: Key) -> dict[str, Any]:
    made = FloatVectorProperty(
        name=_label(name),
        description=_description(name, key),
        subtype='COLOR',
        size=3,
        min=0.0,
        max=1.0,
        get=lambda self: tuple(_number(value_of(self, name), c) for c in range(3)),
        set=lambda self, value: _write(self, name, [_rounded(c) for c in value]),
        options=set(),
    )
    return {name: made}


def _colour_part(name: str, key: Key, part: int) -> Any:
    def write(self: bpy.types.PropertyGroup, value: Any) -> None:
        old = value_of(self, name)
        new = [[_rounded(_number(old, i, c)) for c in range(3)] for i in (0, 1)]
        new[part] = [_rounded(c) for c in value]
        _write(self, name, new)

    return FloatVectorProperty(
        name=_label(name) + (" Variation" if part else ""),
        description=f"{_VARIES}: {key.meaning}" if part else _description(name, key),
        subtype='COLOR',
        size=3,
        min=0.0,
        max=1.0,
        get=lambda self: tuple(_number(value_of(self, name), part, c) for c in range(3)),
        set=write,
        options=set(),
    )


def _choices(key: Key) -> tuple[str, ...]:
    return CHOICES.get(key.kind, ())


def _choice(name: str, key: Key) -> dict[str, Any]:
    choices = _choices(key)
    made = EnumProperty(
        name=_label(name),
        description=_description(name, key),
        items=[(choice, choice.capitalize(), "", number) for number, choice in enumerate(choices)],
        get=lambda self: choices.index(value) if (value := value_of(self, name)) in choices else 0,
        set=lambda self, number: _write(self, name, choices[number]),
        options=set(),
    )
    return {name: made}


_MAKERS: dict[str, Callable[[str, Key], dict[str, Any]]] = {
    "range": _range,
    "number": _single,
    "integer": _integer,
    "colour": _colour,
    "rgb": _rgb,
    "shape": _choice,
    "kind": _choice,
}

# Blender keeps no copy of the strings of dynamic items, so somebody has to.
_kept: dict[tuple[str, ...], list[tuple[str, str, str, int]]] = {}


def _order_items(editor: bpy.types.PropertyGroup, _context: Any) -> list[tuple[str, str, str, int]]:
    labels = tuple(order_label(i, order) for i, order in enumerate(orders_of(editor)[:MAX_ORDERS]))
    if labels not in _kept:
        if len(_kept) > 256:  # every number on the way of a slider is another text
            _kept.clear()
        _kept[labels] = [(str(i), text, "Edit the branches of this order", i) for i, text in enumerate(labels)] or [
            ("0", "No orders", "This species cannot be read", 0)
        ]
    return _kept[labels]


_LEAF_ITEMS = [
    *((name, name.capitalize(), f"{m.polygons} faces", i) for i, (name, m) in enumerate(LEAF_MODELS.items())),
    (OBJECT_LEAF, "Mesh Object", "A mesh object of this file, one unit long, along +Y", len(LEAF_MODELS)),
    (OWN_LEAF, "Polygons of the Species", "The species file brings polygons of its own", len(LEAF_MODELS) + 1),
]  # fmt: skip


def _species_value(editor: bpy.types.PropertyGroup, name: str, default: Any) -> Any:
    try:
        return species_data(editor.id_data, present_species(editor)).get(name, default)
    except SpeciesError:
        return default


def _set_species_value(editor: bpy.types.PropertyGroup, name: str, value: Any) -> None:
    change_species(editor.id_data, present_species(editor), lambda data: data.update({name: value}))


def _leaf(editor: bpy.types.PropertyGroup) -> dict[str, Any]:
    leaf = _species_value(editor, "leaf", {})
    return leaf if isinstance(leaf, dict) else {}


def _leaf_form(editor: bpy.types.PropertyGroup) -> int:
    leaf = _leaf(editor)
    if "object" in leaf:
        return len(LEAF_MODELS)
    return list(LEAF_MODELS).index(model) if (model := leaf.get("model")) in LEAF_MODELS else len(LEAF_MODELS) + 1


def _set_leaf_form(editor: bpy.types.PropertyGroup, number: int) -> None:
    identifier = _LEAF_ITEMS[number][0]
    if identifier == OBJECT_LEAF:
        _set_species_value(editor, "leaf", {"object": str(_leaf(editor).get("object") or "Leaf")})
    elif identifier != OWN_LEAF:  # polygons cannot be invented here
        _set_species_value(editor, "leaf", {"model": identifier})


class _Fixed(SpeciesChoice):
    """Properties of the editor that do not come from the keys of an order."""

    order_index: IntProperty(name="Active Order", min=0, options={'HIDDEN'})
    order: EnumProperty(
        name="Order",
        description="Generation of branches that the sliders show: 0 is the trunk, 1 grows on the trunk",
        items=_order_items,
        get=present_order,
        set=lambda self, number: setattr(self, "order_index", number),
        options={'SKIP_SAVE'},
    )
    preview_seed: IntProperty(
        name="Seed",
        description="Which individual of the species the preview shows",
        default=1,
        min=0,
        update=lambda _self, _context: tell_listeners(),
        options=set(),
    )
    species_name: StringProperty(
        name="Name",
        description="What menus show; the identifier that plants refer to stays",
        get=lambda self: str(_species_value(self, "name", "")),
        set=lambda self, value: _set_species_value(self, "name", value),
        options={'SKIP_SAVE'},
    )
    species_description: StringProperty(
        name="Description",
        description="One sentence for the tooltip in menus",
        get=lambda self: str(_species_value(self, "description", "")),
        set=lambda self, value: _set_species_value(self, "description", value),
        options={'SKIP_SAVE'},
    )
    leaf_form: EnumProperty(
        name="Leaf Model",
        description="Polygons that are copied to every leaf",
        items=_LEAF_ITEMS,
        get=_leaf_form,
        set=_set_leaf_form,
        options={'SKIP_SAVE'},
    )
    leaf_object: StringProperty(
        name="Leaf Object",
        description="Mesh object that is the leaf: its stalk at the origin, along +Y, its upper side towards +Z",
        get=lambda self: str(_leaf(self).get("object", "")),
        set=lambda self, value: _set_species_value(self, "leaf", {"object": value}),
        options={'SKIP_SAVE'},
    )
    bark: EnumProperty(
        name="Bark",
        description="Character of the bark's pattern",
        items=[(name, name.capitalize(), "", number) for number, name in enumerate(BARKS)],
        get=lambda self: BARKS.index(value) if (value := _species_value(self, "bark", BARKS[0])) in BARKS else 0,
        set=lambda self, number: _set_species_value(self, "bark", BARKS[number]),
        options={'SKIP_SAVE'},
    )
    quality: FloatProperty(
        name="Quality",
        description="Polygons of a plant, of those that are described: fewer and larger leaves, or more and finer ones",
        min=QUALITY_LIMITS[0],
        max=QUALITY_LIMITS[1],
        soft_min=0.02,
        soft_max=10.0,
        default=1.0,
        precision=3,
        get=lambda self: _number(_species_value(self, "quality", 1.0)),
        set=lambda self, value: _set_species_value(self, "quality", _rounded(value)),
        options={'SKIP_SAVE'},
    )
    leaf_transmission: FloatProperty(
        name="Translucency",
        description="Share of the light scattered by a leaf that goes through it",
        subtype='FACTOR',
        min=0.0,
        max=1.0,
        get=lambda self: _number(_species_value(self, "leaf_transmission", 0.4)),
        set=lambda self, value: _set_species_value(self, "leaf_transmission", _rounded(value)),
        options={'SKIP_SAVE'},
    )


def _annotations() -> dict[str, Any]:
    made: dict[str, Any] = {}
    for name, key in order_keys().items():
        made |= _MAKERS.get(key.kind, _choice)(name, key)
    return made


#: ``Scene.tetflora.species_editor``: what the panel shows, and a property for each key of an order.
TetFloraSpeciesEditor = type(
    "TetFloraSpeciesEditor",
    (bpy.types.PropertyGroup, _Fixed),
    {
        "__annotations__": _annotations(),
        "__doc__": "What the species editor shows; values come from the species' JSON and go there.",
        "__module__": __name__,
    },
)
