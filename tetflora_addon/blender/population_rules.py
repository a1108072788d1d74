# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From what a population stores to the engine's rules, and settings that pass from one population to another."""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2b
from math import inf
from typing import Any

import bpy

from ..planting.rules import Companion, Rules
from .species_edits import catalogue
from .species_items import default_species

#: Up to this many become empties if nobody says otherwise; beyond, Blender becomes slow.
EMPTIES_UNASKED = 10_000
#: Square metres of the area that densities are counted on: foresters count trees by the hectare.
HECTARE = 10_000.0
#: What a population is and what became of it; all else are settings, which can be copied and written to files.
IDENTITY = {
    *("rna_type", "name", "uid", "frozen", "collection", "made", "message", "placed_by", "erased"),
    "mix_index",
}
_ENTRY = ("species", "weight", "companion", "companion_strength", "companion_distance")


def settings_of(group: type[bpy.types.PropertyGroup] | bpy.types.PropertyGroup) -> list[bpy.types.Property]:
    """Properties of a population that say how plants are placed."""
    return [p for p in group.bl_rna.properties if p.identifier not in IDENTITY]


def fingerprint(population: bpy.types.PropertyGroup) -> str:
    """A short text that is another one when settings are; what is left at its default does not count.

    So a setting that comes with another version changes nothing of populations that do not use it.
    """
    values: list[Any] = [[e.object.name_full for e in population.grounds if e.object is not None]]
    values += [[getattr(entry, name) for name in _ENTRY] for entry in population.mix]
    for name, default in _defaults(type(population)):
        value = getattr(population, name)
        if isinstance(value, bpy.types.ID):
            value = value.name_full
        if value != default:
            values.append([name, value])
    return blake2b(repr(values).encode(), digest_size=8).hexdigest()


@lru_cache(maxsize=1)
def _defaults(kind: type[bpy.types.PropertyGroup]) -> tuple[tuple[str, Any], ...]:
    """Names and defaults of settings that are single values; kept, because panels ask at every redraw."""
    simple = [p for p in settings_of(kind) if p.type != 'COLLECTION']
    return tuple((p.identifier, None if p.type == 'POINTER' else p.default) for p in simple)


def is_outdated(population: bpy.types.PropertyGroup) -> bool:
    """Whether an update would place by other settings than those by which the plants stand; grounds are not read."""
    return bool(population.placed_by) and not population.frozen and population.placed_by != fingerprint(population)


def awaits_update(population: bpy.types.PropertyGroup) -> bool:
    """Whether a population has no plants yet, or others than an update would give it."""
    if not population.uid or population.frozen:
        return False
    return not population.made or not population.placed_by or is_outdated(population)


def copy_settings(source: bpy.types.PropertyGroup, target: bpy.types.PropertyGroup) -> None:
    """Give a population the settings of another; identity, grounds and plants stay its own."""
    for prop in settings_of(source):
        if prop.type != 'COLLECTION':
            setattr(target, prop.identifier, getattr(source, prop.identifier))
    target.mix.clear()
    for entry in source.mix:
        new = target.mix.add()
        new.species, new.weight = entry.species, entry.weight
        copy_companion(entry, new)


def copy_companion(source: bpy.types.PropertyGroup, target: bpy.types.PropertyGroup) -> None:
    """Let one species stand to others as another entry says."""
    for name in ("companion", "companion_strength", "companion_distance"):
        setattr(target, name, getattr(source, name))


def active_population(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    """The population that buttons act on; None where there is none."""
    settings = scene.tetflora
    number = settings.populations_index
    return settings.populations[number] if 0 <= number < len(settings.populations) else None


def shown_population(scene: bpy.types.Scene) -> bpy.types.PropertyGroup:
    """What the panel shows: the active population, or the settings for new ones where there is none."""
    return active_population(scene) or scene.tetflora.populate


def rules_from(population: bpy.types.PropertyGroup) -> tuple[Rules, tuple[str, ...]]:
    """A population's settings as the engine takes them, and the species that its shares count through.

    Companions that are none of the mixture's species follow it with a share of 0.
    """
    mix = [(e.species or default_species(), e) for e in population.mix]
    shares: dict[str, float] = {}
    for identifier, entry in mix:
        shares[identifier] = shares.get(identifier, 0.0) + entry.weight
    if not mix:
        shares[default_species()] = 1.0
    for _, entry in mix:
        if entry.companion:
            shares.setdefault(entry.companion, 0.0)
    species = tuple(shares)
    companions = tuple(
        Companion(species.index(identifier), species.index(e.companion), e.companion_strength, e.companion_distance)
        for identifier, e in mix
        if e.companion and e.companion_strength
    )
    free = ("altitude_min", "altitude_max", "density", "shares", "companions")
    given = {name: getattr(population, name) for name in Rules.__dataclass_fields__ if name not in free}
    low, high = (population.altitude_min, population.altitude_max) if population.use_altitude else (-inf, inf)
    rules = Rules(
        **given,
        altitude_min=low,
        altitude_max=high,
        density=population.density / HECTARE,
        shares=tuple(shares.values()),
        companions=companions,
    )
    return rules, species


def makes_field(population: bpy.types.PropertyGroup, number: int) -> bool:
    """Whether so many plants of a population are made as one field."""
    return population.as_field == 'FIELD' or (population.as_field == 'AUTOMATIC' and number > EMPTIES_UNASKED)


def unknown_species(population: bpy.types.PropertyGroup) -> list[str]:
    """Species of a population that the catalogue does not have."""
    known = catalogue()
    return [e.species for e in population.mix if e.species and e.species not in known]
