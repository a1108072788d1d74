# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populations as JSON files: the rules by which plants are placed, for other scenes and other people.

Keys are the names of the settings in Python. Angles are degrees, lengths metres. Objects, images and collections are
named; those missing in another file are left empty and reported. Everything unknown is refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from math import degrees, inf, radians
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...errors import NAME, SceneError, readable, shown
from ...files import IDENTIFIER_RULE, is_identifier, json_of, read_whole, write_whole
from ..settings import limits_of
from .populations import add_population, set_grounds
from .properties import TetFloraMixEntry, TetFloraPopulation
from .rules import settings_of

ENDING = ".json"
FORMAT = "TetFlora populations"
VERSION = 1

_MIX = ("species", "weight", "companion", "companion_strength", "companion_distance", "habitat", "shed_by")
#: Keys that are written only where they say something: earlier versions do not know them.
_RARE = {
    "habitat": 'ANYWHERE',
    "shed_by": "",
    "age": 0.0,
    "age_spread": 0.0,
    "wetness_min": 0.0,
    "wetness_max": 1.0,
    "wetness_softness": float(np.float32(0.2)),
}
#: Settings that hold identifiers of species.
_IDENTIFIERS = ("species", "companion", "shed_by")
MAX_FILE_BYTES = 4_000_000
MAX_TEXT = 1000
#: Most entries of a list: populations of a file, species and grounds of a population.
MAX_ENTRIES = 1000


def as_data(populations: Iterable[TetFloraPopulation]) -> dict[str, Any]:
    """Populations as what a file of them holds."""
    return {"format": FORMAT, "version": VERSION, "populations": [population_data(p) for p in populations]}


def write_populations(populations: Iterable[TetFloraPopulation], path: Path) -> Path:
    """Write populations to a file, whole or not at all.

    Raises
    ------
    SceneError
        The file cannot be written.
    """
    text = json.dumps(as_data(populations), indent=2, ensure_ascii=False) + "\n"
    try:
        write_whole(path, text)
    except OSError as error:
        raise SceneError(f"Cannot write {path.name}: {error.strerror}") from None
    return path


def read_populations(
    scene: bpy.types.Scene, path: Path, grounds: Iterable[bpy.types.Object] = ()
) -> tuple[int, list[str]]:
    """Add the populations of a file to a scene, without plants.

    Parameters
    ----------
    grounds : iterable of bpy.types.Object
        Where populations grow of whose own grounds the scene has none.

    Returns
    -------
    number : int
        Populations added.
    missing : list of str
        What the file names and this one does not have.

    Raises
    ------
    SceneError
        The file cannot be read, or breaks a rule of the format; names file and key. Nothing is added.
    """
    try:
        entries = _checked(json_of(read_whole(path, MAX_FILE_BYTES), _refuse_constant))
    except OSError as error:
        raise SceneError(f"{path.name}: cannot read the file: {error.strerror}") from None
    except ValueError as error:
        raise SceneError(f"{path.name}: {error}") from None
    grounds, missing, group = list(grounds), [], scene.tetflora
    before, active = len(group.populations), group.populations_index
    try:
        for entry in entries:
            population = add_population(scene, name=entry["name"])
            fill_population(population, entry, scene, missing)
            if not population.grounds and population.ground_collection is None:
                set_grounds(population, grounds)
    except BaseException:  # all or nothing
        while len(group.populations) > before:
            group.populations.remove(before)
        group.populations_index = active
        raise
    return len(entries), list(dict.fromkeys(missing))


def population_data(population: TetFloraPopulation) -> dict[str, Any]:
    """A population as a file has it."""
    data: dict[str, Any] = {"name": population.name}
    data["grounds"] = [entry.object.name for entry in population.grounds if entry.object is not None]
    data["species"] = [
        {
            name: value_for(entry.bl_rna.properties[name], getattr(entry, name))
            for name in _MIX
            if getattr(entry, name) != _RARE.get(name)
        }
        for entry in population.mix
    ]
    for prop in _simple_settings(population):
        value = getattr(population, prop.identifier)
        if value == _RARE.get(prop.identifier, ...):
            continue
        data[prop.identifier] = (
            (value.name if value is not None else None) if _is_pointer(prop) else value_for(prop, value)
        )
    return data


def _simple_settings(group: type[bpy.types.PropertyGroup] | bpy.types.PropertyGroup) -> list[bpy.types.Property]:
    return [p for p in settings_of(group) if p.type != 'COLLECTION']


def _is_pointer(prop: bpy.types.Property) -> bool:
    return prop.type == 'POINTER'


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


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def _checked(data: Any) -> list[dict[str, Any]]:
    """Populations of a decoded file.

    Raises
    ------
    ValueError
        Something is not as it must be; names the key.
    """
    check_keys("the file", data, {"format", "version", "populations"}, {"format", "version", "populations"})
    check_format(data, FORMAT, VERSION, "population files")
    entries = list_of("populations", data["populations"])
    for number, entry in enumerate(entries, 1):
        check_population(f"population {number}", entry)
    return entries


def check_format(data: dict[str, Any], expected: str, version: int, files: str) -> None:
    """Refuse a file of another format or version with a `ValueError`."""
    if data["format"] != expected:
        raise ValueError(f'"format" is {shown(data["format"])}; {files} have "{expected}"')
    if data["version"] != version or isinstance(data["version"], bool):
        raise ValueError(
            f'"version" is {shown(data["version"])}; this version of TetFlora reads {version}; update the extension'
        )


def check_population(where: str, entry: Any, more: Iterable[str] = ()) -> None:
    """Refuse what cannot be a population.

    Parameters
    ----------
    where : str
        What messages call it.
    entry : Any
        Decoded.
    more : iterable of str
        Keys that somebody else checks.

    Raises
    ------
    ValueError
        Something is not as it must be; names the key.
    """
    simple = {p.identifier: p for p in _simple_settings(TetFloraPopulation)}
    mix = {name: TetFloraMixEntry.bl_rna.properties[name] for name in _MIX}
    check_keys(where, entry, {"name"}, {"name", "grounds", "species", *simple, *more})
    check_text(f'{where}: "name"', entry["name"])
    for name in list_of(f'{where}: "grounds"', entry.get("grounds", [])):
        check_text(f'{where}: "grounds"', name)
    for index, part in enumerate(list_of(f'{where}: "species"', entry.get("species", [])), 1):
        check_keys(f"{where}: species {index}", part, {"species"}, set(mix))
        for key, value in part.items():
            check_value(f'{where}: species {index}: "{key}"', mix[key], value)
            if key in _IDENTIFIERS and value and not is_identifier(value):
                raise ValueError(f'{where}: species {index}: "{key}" is {shown(value)}; use only {IDENTIFIER_RULE}')
    for key in simple.keys() & entry.keys():
        check_value(f'{where}: "{key}"', simple[key], entry[key])


def check_value(where: str, prop: bpy.types.Property, value: Any) -> None:
    """Refuse a value that a property could not have with a `ValueError`."""
    if _is_pointer(prop):
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


def fill_population(
    population: TetFloraPopulation, entry: dict[str, Any], scene: bpy.types.Scene, missing: list[str]
) -> None:
    """Give a new population what a checked entry says, and defaults for the rest."""
    for prop in _simple_settings(population):
        name = prop.identifier
        population.property_unset(name)
        if _is_pointer(prop):
            setattr(population, name, _named(prop.fixed_type.identifier, entry.get(name), missing))
        elif name in entry:
            angle = prop.subtype == 'ANGLE' and prop.type == 'FLOAT'
            setattr(population, name, radians(entry[name]) if angle else entry[name])
    population.mix.clear()
    for part in entry.get("species", []):
        new = population.mix.add()
        for key, value in part.items():
            setattr(new, key, value)
    found = [(name, scene.objects.get(name)) for name in entry.get("grounds", [])]
    missing += [f'the ground "{name}"' for name, obj in found if obj is None]
    set_grounds(population, [obj for _, obj in found if obj is not None and obj.type == 'MESH'])


def _named(kind: str, name: str | None, missing: list[str]) -> bpy.types.ID | None:
    if name is None:
        return None
    found = (bpy.data.images if kind == "Image" else bpy.data.collections).get(name)
    if found is None:
        missing.append(f'the {kind.lower()} "{name}"')
    return found
