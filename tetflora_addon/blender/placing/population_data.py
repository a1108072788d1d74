# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings as files that artists exchange have them, of populations and of other groups: written, checked, and read.

What cannot be is refused by a `ValueError` that names the key.
"""

from collections.abc import Collection, Container, Iterable, Mapping
from math import degrees, radians
from sys import float_info
from typing import Any

import bpy
import numpy as np
from bpy.types import Property, PropertyGroup, Scene

from ...errors import NAME, quoted, readable
from ...files import IDENTIFIER_RULE, is_identifier
from ..settings import limits_of
from .properties import TetFloraLayer, TetFloraMixEntry
from .rules import ENTRY, set_grounds, settings_of

MAX_TEXT = 1000
#: Most entries of a list: populations of a file, species and grounds of a population.
MAX_ENTRIES = 1000
#: Settings that hold identifiers of species.
_IDENTIFIERS = {"species", "companion", "shed_by"}


def population_data(population: TetFloraLayer) -> dict[str, Any]:
    """A population as a file has it: what differs from a new one."""
    data: dict[str, Any] = {"name": population.name}
    data["grounds"] = [entry.object.name for entry in population.grounds if entry.object is not None]
    data["species"] = [settings_data(entry, ENTRY, {"species"}) for entry in population.mix]
    return data | settings_data(population, [p.identifier for p in simple_settings(population)])


def simple_settings(group: type[PropertyGroup] | PropertyGroup) -> list[Property]:
    """Settings that are single values."""
    return [p for p in settings_of(group) if p.type != 'COLLECTION']


def settings_data(group: PropertyGroup, names: Iterable[str], always: Container[str] = ()) -> dict[str, Any]:
    """Settings of a group as files have them: those that differ from their defaults, and some of them always."""
    data = {}
    for name in names:
        prop, value = group.bl_rna.properties[name], getattr(group, name)
        if prop.type == 'POINTER':
            value, default = value.name if value is not None else None, None
        else:
            value, default = value_for(prop, value), value_for(prop, prop.default)
        if name in always or value != default:
            data[name] = value
    return data


def set_setting(group: PropertyGroup, name: str, value: Any) -> None:
    """Give a group a setting as a checked file has it; none for an image or a collection that is not there."""
    prop = group.bl_rna.properties[name]
    if prop.type == 'POINTER' and value is not None:
        known = bpy.data.images if prop.fixed_type.identifier == "Image" else bpy.data.collections
        value = known.get(value)
    setattr(group, name, radians(value) if prop.type == 'FLOAT' and prop.subtype == 'ANGLE' else value)


def check_population(where: str, entry: Any) -> None:
    """Refuse what cannot be a population with a `ValueError`, which calls it as ``where`` says."""
    simple = {p.identifier for p in simple_settings(TetFloraLayer)}
    check_keys(where, entry, {"name"}, {"kind", "name", "grounds", "species", *simple})
    check_text(f'{where}: "name"', entry["name"])
    for name in list_of(f'{where}: "grounds"', entry.get("grounds", [])):
        check_text(f'{where}: "grounds"', name)
    check_species(where, entry.get("species", []), TetFloraMixEntry, ENTRY)
    check_settings(where, entry, TetFloraLayer, simple)


def check_species(where: str, parts: Any, kind: type[PropertyGroup], names: Collection[str]) -> None:
    """Refuse what cannot be the list of species of a layer with a `ValueError`."""
    for index, part in enumerate(list_of(f'{where}: "species"', parts), 1):
        here = f"{where}: species {index}"
        check_keys(here, part, {"species"}, set(names))
        check_settings(here, part, kind, names)
        for key in _IDENTIFIERS & part.keys():
            if part[key] and not is_identifier(part[key]):
                raise ValueError(f'{here}: "{key}" is {quoted(part[key])}; use only {IDENTIFIER_RULE}')


def check_settings(where: str, entry: Mapping[str, Any], kind: type[PropertyGroup], names: Iterable[str]) -> None:
    """Refuse values of settings that a group could not have with a `ValueError`."""
    for key in names:
        if key in entry:
            check_value(f'{where}: "{key}"', kind.bl_rna.properties[key], entry[key])


def fill_population(population: TetFloraLayer, entry: dict[str, Any], scene: Scene) -> None:
    """Give a new population what a checked entry says, as far as the scene has it, and defaults for the rest."""
    for prop in simple_settings(population):
        name = prop.identifier
        population.property_unset(name)
        if name in entry:
            set_setting(population, name, entry[name])
    population.mix.clear()
    for part in entry.get("species", []):
        new = population.mix.add()
        for key, value in part.items():
            setattr(new, key, value)
    grounds = (scene.objects.get(name) for name in entry.get("grounds", []))
    set_grounds(population, [obj for obj in grounds if obj is not None and obj.type == 'MESH'])


def check_value(where: str, prop: Property, value: Any) -> None:
    """Refuse a value that a property could not have with a `ValueError`."""
    if prop.type == 'POINTER':
        if value is not None:
            check_text(where, value)
    elif prop.type == 'BOOLEAN':
        if not isinstance(value, bool):
            raise ValueError(f"{where} is {quoted(value)}; it must be true or false")
    elif prop.type == 'ENUM':
        known = [item.identifier for item in prop.enum_items]
        if value not in known:
            raise ValueError(f"{where} is {quoted(value)}; it must be one of {', '.join(known)}")
    elif prop.type == 'STRING':
        check_text(where, value)
    else:
        _check_number(where, prop, value)


def _check_number(where: str, prop: Property, value: Any) -> None:
    whole = prop.type == 'INT'
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
        raise ValueError(f"{where} is {quoted(value)}; it must be a {'whole ' if whole else ''}number")
    if not whole and not abs(value) <= float_info.max:  # of whole numbers, which have no end, as well
        raise ValueError(f"{where} is {quoted(value)}; it must be a finite number")
    # Bounds are single-precision numbers: 0.1 as a file has it is less than 0.1 as Blender stores it.
    with np.errstate(over="ignore"):
        stored = value if whole else float(np.float32(radians(value) if prop.subtype == 'ANGLE' else value))
    if not prop.hard_min <= stored <= prop.hard_max:
        raise ValueError(f"{where} is {quoted(value)}; it must be {limits_of(prop)}")


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
        raise ValueError(f"{where} is {quoted(value)}; it must be a string")
    if readable(value, MAX_TEXT) != value:
        raise ValueError(
            f"{where} is {quoted(value)}; it must be one line of at most {MAX_TEXT} characters, and none that control "
            "terminals"
        )


def value_for(prop: Property, value: Any) -> Any:
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
