# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sliders of the species editor, made from the keys of species files: a new key gets its slider by itself.

The properties store nothing. They read the JSON of the chosen species and write it into this file
(`species.edits`), so there is nothing to keep in step with undo, loading or other scenes.
"""

from collections.abc import Callable
from math import degrees, radians
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, IntProperty

from ...parameters import Key
from ...species.schema import LENGTH_HIGH, ORDER_KEYS
from .values import WholeSpecies, number_in, rounded, value_of, write, write_range

#: Added to a key's name for the property of a range's second number.
VARIATION = "_variation"
_VARIES = "Maximum deviation from the mean, in both directions"


def _label(name: str) -> str:
    return name.replace("_", " ").replace("colour", "color").title()


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
        set=lambda self, value: write(self, rounded(to_file(value))),
        options=set(),
        **_float_options(key, low, high),
    )


def _range(name: str, key: Key) -> dict[str, Any]:
    parts = {}
    for part, suffix in enumerate(("", VARIATION)):
        parts[name + suffix] = _floats(
            name,
            key,
            lambda self, part=part: number_in(value_of(self, name), part),
            lambda self, value, part=part: write_range(self, name, part, value),
            variation=part == 1,
        )
    return parts


def _single(name: str, key: Key) -> dict[str, Any]:
    return {
        name: _floats(
            name, key, lambda self: number_in(value_of(self, name)), lambda self, value: write(self, name, value)
        )
    }


def _integer(name: str, key: Key) -> dict[str, Any]:
    made = IntProperty(
        name=_label(name),
        description=_description(name, key),
        min=int(key.low),
        max=int(key.high),
        get=lambda self: int(min(max(number_in(value_of(self, name)), key.low), key.high)),
        set=lambda self, value: write(self, name, value),
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
        get=lambda self: tuple(number_in(value_of(self, name), c) for c in range(3)),
        set=lambda self, value: write(self, name, [rounded(c) for c in value]),
        options=set(),
    )
    return {name: made}


def _colour_part(name: str, key: Key, part: int) -> Any:
    def set_part(self: bpy.types.PropertyGroup, value: Any) -> None:
        old = value_of(self, name)
        new = [[rounded(number_in(old, i, c)) for c in range(3)] for i in (0, 1)]
        new[part] = [rounded(c) for c in value]
        write(self, name, new)

    return FloatVectorProperty(
        name=_label(name) + (" Variation" if part else ""),
        description=f"{_VARIES}: {key.meaning}" if part else _description(name, key),
        subtype='COLOR',
        size=3,
        min=0.0,
        max=1.0,
        get=lambda self: tuple(number_in(value_of(self, name), part, c) for c in range(3)),
        set=set_part,
        options=set(),
    )


def _choice(name: str, key: Key) -> dict[str, Any]:
    choices = key.choices
    made = EnumProperty(
        name=_label(name),
        description=_description(name, key),
        items=[(choice, _label(choice), "", number) for number, choice in enumerate(choices)],
        get=lambda self: choices.index(value) if (value := value_of(self, name)) in choices else 0,
        set=lambda self, number: write(self, name, choices[number]),
        options=set(),
    )
    return {name: made}


_MAKERS: dict[str, Callable[[str, Key], dict[str, Any]]] = {
    "range": _range,
    "number": _single,
    "integer": _integer,
    "colour": _colour,
    "rgb": _rgb,
    "choice": _choice,
}


def _annotations() -> dict[str, Any]:
    made: dict[str, Any] = {}
    for name, key in ORDER_KEYS.items():
        made |= _MAKERS[key.kind](name, key)
    return made


#: ``Scene.tetflora.species_editor``: what the panel shows, and a property for each key of an order.
TetFloraSpeciesEditor = type(
    "TetFloraSpeciesEditor",
    (bpy.types.PropertyGroup, WholeSpecies),
    {
        "__annotations__": _annotations(),
        "__doc__": "What the species editor shows; values come from the species' JSON and go there.",
        "__module__": __name__,
    },
)


CLASSES = (TetFloraSpeciesEditor,)
