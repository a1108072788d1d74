# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sliders of the species editor, made from the keys of species files: a new key gets its slider by itself.

The properties store nothing. They read the JSON of the chosen species and write it into this file
(`species.edits`), so there is nothing to keep in step with undo, loading or other scenes.
"""

from math import degrees, isfinite, radians
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, IntProperty

from ...errors import SpeciesError, readable
from ...leaves.models import LEAF_MODELS
from ...parameters import Key
from ...species.catalog import LENGTH_HIGH, ORDER_KEYS
from ...species.skeletons import MAX_ORDERS
from ...species.species import BARKS, QUALITY_LIMITS
from ..declare import FIXED, HIDDEN, boolean, integer, once
from ..settings import SUBTYPES
from .catalog import SpeciesChoice
from .edits import catalog, change_species, species_data, species_for, tell_listeners

#: Items of ``leaf_form`` and ``blossom_form`` that are no built-in model.
OBJECT, OWN, NONE = "OBJECT", "OWN", "NONE"
_SIGNIFICANT = 6  # digits of a slider's single precision that count
_kept: dict[tuple[str, ...], list[tuple[str, str, str, int]]] = {}  # Blender keeps no copy of the strings of items


def present_species(editor: bpy.types.PropertyGroup) -> str:
    """Identifier of the species that the editor shows; what the drop-down shows when none was chosen yet."""
    return editor.species or next(iter(catalog()), "")


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
    return max(min(editor.order_index, len(parts_of(editor)) - 1), 0)


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
    index = max(min(editor.order_index, len(parts) - 1), 0)
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
        return 0.0 if path[0] else number_in(value)
    try:
        for step in path:
            value = value[step]
        number = float(value)
    except (TypeError, ValueError, IndexError, KeyError):
        return 0.0
    return number if isfinite(number) else 0.0


def rounded(value: float) -> float:
    """A slider's value without the noise of single precision."""
    return float(f"{value:.{_SIGNIFICANT}g}")


def write(editor: bpy.types.PropertyGroup, name: str, value: Any) -> None:
    """Write a key of the shown order; Blender swallows errors of setters, so the panel has to show them."""
    index = present_order(editor)
    if len(parts_of(editor)) > index:

        def change(data: dict[str, Any]) -> None:
            orders = data["orders"]
            (orders[index] if index < len(orders) else data["spur"])[name] = value

        change_species(editor.id_data, present_species(editor), change)


def _order_items(editor: bpy.types.PropertyGroup, _context: Any) -> list[tuple[str, str, str, int]]:
    orders = len(orders_of(editor))
    labels = tuple(order_label(i, part, i >= orders) for i, part in enumerate(parts_of(editor)[: MAX_ORDERS + 1]))
    if labels not in _kept:
        if len(_kept) > 256:  # every number on the way of a slider is another text
            _kept.clear()
        _kept[labels] = [(str(i), text, "Edit the branches of this order", i) for i, text in enumerate(labels)] or [
            ("0", "No orders", "This species cannot be read", 0)
        ]
    return _kept[labels]


_LEAF_ITEMS = [
    *((name, name.capitalize(), f"{m.polygons} faces", i) for i, (name, m) in enumerate(LEAF_MODELS.items())),
    (OBJECT, "Mesh Object", "Mesh object of this file, one unit long along +Y", len(LEAF_MODELS)),
    (OWN, "From Species File", "Polygons from the species file, or several forms", len(LEAF_MODELS) + 1),
]  # fmt: skip
_BLOSSOM_ITEMS = [*_LEAF_ITEMS, (NONE, "None", "The species has no blossoms or fruit", len(_LEAF_ITEMS))]


def _forms(editor: bpy.types.PropertyGroup, kind: str) -> dict[str, Any]:
    """The only form of a kind of leaf as JSON; empty where there are several, or none."""
    forms = species_value(editor, kind, {})
    return forms if isinstance(forms, dict) else {}


def _form(editor: bpy.types.PropertyGroup, kind: str) -> str:
    form = _forms(editor, kind)
    if "object" in form:
        return OBJECT
    if kind == "blossom" and species_value(editor, kind, None) is None:
        return NONE
    model = form.get("model")  # of a file with errors anything at all
    return model if isinstance(model, str) and model in LEAF_MODELS and "outline" not in form else OWN


def _set_form(editor: bpy.types.PropertyGroup, kind: str, identifier: str) -> None:
    if identifier == OBJECT:
        set_species_value(editor, kind, {"object": str(_forms(editor, kind).get("object") or kind.capitalize())})
    elif identifier == NONE:
        set_species_value(editor, kind, None)
    elif identifier != OWN:  # polygons cannot be invented here
        set_species_value(editor, kind, {"model": identifier})


def _form_property(kind: str, items: list[tuple[str, str, str, int]], name: str, description: str) -> Any:
    return once.choice(
        name,
        description,
        items,
        get=lambda self: next(i for key, _, _, i in items if key == _form(self, kind)),
        set=lambda self, number: _set_form(self, kind, {i: key for key, _, _, i in items}.get(number, OWN)),
    )


def _object_property(kind: str) -> Any:
    return once.string(
        f"{kind.capitalize()} Object",
        f"Mesh object used as the {kind}: stalk at the origin, pointing along +Y, upper side facing +Z",
        get=lambda self: readable(str(_forms(self, kind).get("object", ""))),
        set=lambda self, value: set_species_value(self, kind, {"object": value}),
    )


def _number(key: str, name: str, description: str, default: float = 0.0, **options: Any) -> Any:
    """A number of the whole species; from 0 to 1 unless the options say otherwise."""
    return once.real(
        name,
        description,
        default,
        get=lambda self: number_in(species_value(self, key, default)),
        set=lambda self, value: set_species_value(self, key, rounded(value)),
        **(options or {"min": 0.0, "max": 1.0, "subtype": 'FACTOR'}),
    )


def _text(key: str, name: str, description: str) -> Any:
    return once.string(
        name,
        description,
        get=lambda self: readable(str(species_value(self, key, ""))),
        set=lambda self, value: set_species_value(self, key, value),
    )


_THROUGH = "Fraction of the light scattered by a {} that passes through it"
_QUALITY = {"min": QUALITY_LIMITS[0], "max": QUALITY_LIMITS[1], "soft_min": 0.02, "soft_max": 10.0, "precision": 3}


class TetFloraSpeciesEditor(bpy.types.PropertyGroup, SpeciesChoice):
    """What the species editor shows; values come from the species' JSON and go there."""

    takes_assets = False  # there is nothing to edit in them

    shown: boolean("Species Editor", "Show the tab Species in the sidebar, to edit species", **FIXED)
    order_index: integer("Active Order", min=0, **HIDDEN)
    order: once.choice(
        "Order",
        "Generation of branches to edit: 0 is the trunk, 1 grows on the trunk",
        _order_items,
        get=present_order,
        set=lambda self, number: setattr(self, "order_index", number),
    )
    preview_seed: integer(
        "Seed", "Individual to show in the preview", 1, min=0, update=lambda _self, _context: tell_listeners(), **FIXED
    )
    species_name: _text("name", "Name", "Name shown in menus; the identifier that plants refer to does not change")
    species_description: _text("description", "Description", "Tooltip of the species in menus, in one sentence")
    leaf_form: _form_property("leaf", _LEAF_ITEMS, "Leaf Model", "Shape of each leaf")
    leaf_object: _object_property("leaf")
    leaf_transmission: _number("leaf_transmission", "Leaf Translucency", _THROUGH.format("leaf"), 0.4)
    blossom_form: _form_property(
        "blossom", _BLOSSOM_ITEMS, "Blossom Model", "Shape of blossoms or fruit, used by orders of this Leaf Kind"
    )
    blossom_object: _object_property("blossom")
    blossom_transmission: _number("blossom_transmission", "Blossom Translucency", _THROUGH.format("blossom"), 0.4)
    exact: once.boolean(
        "Exact Plant",
        "Make all plants of the species identical: ignore variation and seeds",
        get=lambda self: species_value(self, "exact", False) is True,
        set=lambda self, value: set_species_value(self, "exact", value),
    )
    bark: once.choice(
        "Bark",
        "Pattern of the bark",
        [(name, name.capitalize(), "", number) for number, name in enumerate(BARKS)],
        get=lambda self: BARKS.index(value) if (value := species_value(self, "bark", BARKS[0])) in BARKS else 0,
        set=lambda self, number: set_species_value(self, "bark", BARKS[number]),
    )
    quality: _number(
        "quality",
        "Quality",
        "Polygon multiplier for this species: below 1 fewer, larger leaves; above 1 more, finer ones",
        1.0,
        **_QUALITY,
    )
    habit: _number(
        "habit",
        "Forest Habit",
        "0: trees that stand free; 1: those of dense stands, with bare trunks and narrow crowns",
    )


#: Added to a key's name for the property of a color's variation.
VARIATION = "_variation"
_VARIES = "Maximum deviation from the mean, in both directions"
_COLOR = {"subtype": 'COLOR', "size": 3, "min": 0.0, "max": 1.0}


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
    mean = abs(number_in(key.default, 0)) if isinstance(key.default, tuple) else 0.0
    if key.high > 1000:
        return 60.0
    return 10.0 * mean if 0.0 < 50.0 * mean < key.high else min(key.high, 360.0)


def _number_options(key: Key) -> dict[str, Any]:
    """How a number, or both of a range, are typed; those of a range are kept within limits of their own."""
    ranged = key.kind == "range"
    low, high = min(key.low, 0.0) if ranged else key.low, key.high
    if key.unit == "degrees":
        options = {"min": radians(low), "max": radians(high), "subtype": 'ANGLE', "step": 100, "precision": 4}
    else:
        options = {"min": low, "max": high, "soft_max": min(_soft_high(key), high), "precision": 3}
    if key.unit == "m":
        options |= {"subtype": 'DISTANCE', "step": 1}
    elif (low, high) == (0, 1):
        options["subtype"] = 'FACTOR'
    if ranged:
        options["subtype"] = SUBTYPES.get(options.get("subtype"), 'NONE')
    return options


def _range(name: str, key: Key, said: dict[str, Any]) -> Any:
    """A range is one setting of two numbers, as in the file: mean and variation."""
    to_file, to_slider = (degrees, radians) if key.unit == "degrees" else (float, float)
    limits = ((key.low, key.high), (0.0, key.high - key.low))

    def read(editor: bpy.types.PropertyGroup) -> tuple[float, ...]:
        value = value_of(editor, name)
        return tuple(to_slider(number_in(value, part)) for part in (0, 1))

    def store(editor: bpy.types.PropertyGroup, pair: Any) -> None:
        typed = zip(map(to_file, pair), limits, strict=True)
        write(editor, name, [rounded(min(max(number, low), high)) for number, (low, high) in typed])

    said = {**said, "description": f"{said['description']}. Mean, and {_VARIES.lower()}"}
    return FloatVectorProperty(size=2, get=read, set=store, **said, **_number_options(key))


def _single(name: str, key: Key, said: dict[str, Any]) -> Any:
    to_file, to_slider = (degrees, radians) if key.unit == "degrees" else (float, float)
    return FloatProperty(
        get=lambda self: to_slider(number_in(value_of(self, name))),
        set=lambda self, value: write(self, name, rounded(to_file(value))),
        **said,
        **_number_options(key),
    )


def _integer(name: str, key: Key, said: dict[str, Any]) -> Any:
    return IntProperty(
        min=int(key.low),
        max=int(key.high),
        get=lambda self: int(min(max(number_in(value_of(self, name)), key.low), key.high)),
        set=lambda self, value: write(self, name, value),
        **said,
    )


def _tone(name: str, key: Key, said: dict[str, Any], varies: bool = False) -> Any:
    """A color, or that of a mean and its variation."""
    part = () if key.kind == "rgb" else (int(varies),)

    def read(editor: bpy.types.PropertyGroup) -> tuple[float, ...]:
        return tuple(number_in(value_of(editor, name), *part, c) for c in range(3))

    def store(editor: bpy.types.PropertyGroup, value: Any) -> None:
        new = [rounded(c) for c in value]
        if part:
            old = value_of(editor, name)
            new = [new if i in part else [rounded(number_in(old, i, c)) for c in range(3)] for i in (0, 1)]
        write(editor, name, new)

    return FloatVectorProperty(get=read, set=store, **_COLOR, **said)


def _choice(name: str, key: Key, said: dict[str, Any]) -> Any:
    choices = key.choices
    return EnumProperty(
        items=[(choice, _label(choice), "", number) for number, choice in enumerate(choices)],
        get=lambda self: choices.index(value) if (value := value_of(self, name)) in choices else 0,
        set=lambda self, number: write(self, name, choices[number]),
        **said,
    )


_MAKERS = {"range": _range, "number": _single, "integer": _integer, "color": _tone, "rgb": _tone, "choice": _choice}


def _sliders() -> dict[str, Any]:
    """A property for each key of an order, and another for the variation of a color."""
    sliders = {}
    for name, key in ORDER_KEYS.items():
        said = {"name": _label(name), "description": _description(name, key), "options": set()}
        sliders[name] = _MAKERS[key.kind](name, key, said)
        if key.kind == "color":
            said |= {"name": f"{said['name']} Variation", "description": f"{_VARIES}: {key.meaning}"}
            sliders[name + VARIATION] = _tone(name, key, said, varies=True)
    return sliders


TetFloraSpeciesEditor.__annotations__ |= _sliders()
