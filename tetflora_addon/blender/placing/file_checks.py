# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What files that artists exchange must be: checks of decoded JSON against properties, whose errors name the key."""

from __future__ import annotations

from math import degrees, inf, radians
from typing import Any

import bpy
import numpy as np

from ...errors import NAME, readable, shown
from ..settings import limits_of

MAX_TEXT = 1000
#: Most entries of a list: populations of a file, species and grounds of a population.
MAX_ENTRIES = 1000


def check_format(data: dict[str, Any], expected: str, version: int, files: str) -> None:
    """Refuse a file of another format or version with a `ValueError`."""
    if data["format"] != expected:
        raise ValueError(f'"format" is {shown(data["format"])}; {files} have "{expected}"')
    if data["version"] != version or isinstance(data["version"], bool):
        raise ValueError(
            f'"version" is {shown(data["version"])}; this version of TetFlora reads {version}; update the extension'
        )


def check_value(where: str, prop: bpy.types.Property, value: Any) -> None:
    """Refuse a value that a property could not have with a `ValueError`."""
    if is_pointer(prop):
        if value is not None:
            check_text(where, value)
    elif prop.type == 'BOOLEAN':
        if not isinstance(value, bool):
            raise ValueError(f"{where} is {shown(value)}; it must be true or false")
    elif prop.type == 'ENUM':
        known = [item.identifier for item in prop.enum_items]
        if value not in known:
            raise ValueError(f"{where} is {shown(value)}; it must be one of {', '.join(known)}")
    elif prop.type == 'STRING':
        check_text(where, value)
    else:
        _check_number(where, prop, value)


def _check_number(where: str, prop: bpy.types.Property, value: Any) -> None:
    whole = prop.type == 'INT'
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
        raise ValueError(f"{where} is {shown(value)}; it must be a {'whole ' if whole else ''}number")
    if not whole and not -inf < value < inf:
        raise ValueError(f"{where} is {shown(value)}; it must be a finite number")
    angle = prop.subtype == 'ANGLE'
    # Bounds are single-precision numbers: 0.1 as a file has it is less than 0.1 as Blender stores it.
    with np.errstate(over="ignore"):
        stored = value if whole else float(np.float32(radians(value) if angle else value))
    if not prop.hard_min <= stored <= prop.hard_max:
        raise ValueError(f"{where} is {shown(value)}; it must be {limits_of(prop)}")


def check_keys(where: str, data: Any, needed: set[str], known: set[str]) -> None:
    """Refuse what is no object, lacks a key or has an unknown one with a `ValueError`."""
    if not isinstance(data, dict):
        raise ValueError(f"{where} is {type(data).__name__}; it must be an object with keys")
    if needed - data.keys():
        raise ValueError(f'{where} has no "{min(needed - data.keys())}"')
    if data.keys() - known:
        raise ValueError(f'{where} has an unknown key "{readable(min(data.keys() - known), NAME)}"')


def list_of(where: str, value: Any) -> list:
    """A list that is not too long; anything else is a `ValueError`."""
    if not isinstance(value, list):
        raise ValueError(f"{where} is {type(value).__name__}; it must be a list")
    if len(value) > MAX_ENTRIES:
        raise ValueError(f"{where} has {len(value):,} entries; {MAX_ENTRIES:,} is the limit")
    return value


def check_text(where: str, value: Any) -> None:
    """Refuse what is not one line of text with a `ValueError`."""
    if not isinstance(value, str):
        raise ValueError(f"{where} is {shown(value)}; it must be a string")
    if readable(value, MAX_TEXT) != value:
        raise ValueError(
            f"{where} is {shown(value)}; it must be one line of at most {MAX_TEXT} characters, and none that control "
            "terminals"
        )


def value_for(prop: bpy.types.Property, value: Any) -> Any:
    """A stored value as files have it; numbers in as few digits as give the same single-precision number back."""
    if prop.type != 'FLOAT':
        return value
    forth, back = (degrees, radians) if prop.subtype == 'ANGLE' else (float, float)
    for digits in range(6, 18):
        short = float(f"{forth(value):.{digits}g}")
        if np.float32(back(short)) == np.float32(value):
            return short
    return forth(value)


def refuse_constant(name: str) -> float:
    """Refuse a number that JSON does not have with a `ValueError`."""
    raise ValueError(f"{name} is not a number")


def is_pointer(prop: bpy.types.Property) -> bool:
    """Whether a property is another datablock, which files name."""
    return prop.type == 'POINTER'
