# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One population as files have it: its settings by their names in Python, checked before they are used."""

from __future__ import annotations

from collections.abc import Iterable
from math import radians
from typing import Any

import bpy

from ...errors import shown
from ...files import IDENTIFIER_RULE, is_identifier
from .file_checks import check_keys, check_text, check_value, is_pointer, list_of, value_for
from .properties import TetFloraMixEntry, TetFloraPopulation
from .rules import set_grounds, settings_of

#: Keys of a species.
MIX = ("species", "weight", "companion", "companion_strength", "companion_distance", "habitat", "shed_by")
#: Settings that hold identifiers of species.
_IDENTIFIERS = ("species", "companion", "shed_by")


def population_data(population: TetFloraPopulation) -> dict[str, Any]:
    """A population as a file has it."""
    data: dict[str, Any] = {"name": population.name}
    data["grounds"] = [entry.object.name for entry in population.grounds if entry.object is not None]
    data["species"] = [
        {name: value_for(entry.bl_rna.properties[name], getattr(entry, name)) for name in MIX}
        for entry in population.mix
    ]
    for prop in simple_settings(population):
        value = getattr(population, prop.identifier)
        data[prop.identifier] = (
            (value.name if value is not None else None) if is_pointer(prop) else value_for(prop, value)
        )
    return data


def simple_settings(group: type[bpy.types.PropertyGroup] | bpy.types.PropertyGroup) -> list[bpy.types.Property]:
    """Settings that are single values."""
    return [p for p in settings_of(group) if p.type != 'COLLECTION']


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
    simple = {p.identifier: p for p in simple_settings(TetFloraPopulation)}
    mix = {name: TetFloraMixEntry.bl_rna.properties[name] for name in MIX}
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


def fill_population(
    population: TetFloraPopulation, entry: dict[str, Any], scene: bpy.types.Scene, missing: list[str]
) -> None:
    """Give a new population what a checked entry says, and defaults for the rest."""
    for prop in simple_settings(population):
        name = prop.identifier
        population.property_unset(name)
        if is_pointer(prop):
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
