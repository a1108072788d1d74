# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes as JSON files: a name, a ground, limits, and layers of plants from the tallest to what lies on the ground.

A layer is a population, with the keys of population files, or a stand that grows. Everything unknown is refused, with
the name of the file and of the key.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import bpy

from ...errors import SceneError, SpeciesError, shown
from ...files import IDENTIFIER_RULE, is_identifier, json_of, read_whole
from ...planting.zones import Limits
from ...species.schema import species_from_dict
from ..file_library import MAX_FILE_BYTES
from ..placing.file_checks import check_format, check_keys, check_text, check_value, list_of, refuse_constant, value_for
from ..placing.population_data import check_population, population_data
from ..placing.properties import TetFloraPopulation
from ..placing.zones import limits_of_zone
from ..species.edits import find_edit, species_data
from .biome import GROUND, Biome, data_of
from .properties import TetFloraBiome
from .stands import check_stand, stand_data, stands_of

FORMAT = "TetFlora biome"
VERSION = 1
#: What a layer is: plants that keep their distance from others and shade the ground; what grows and lies under them,
#: and does neither; a stand that grows.
KINDS = ("population", "cover", "stand")
#: When a biome is as its picture shows it.
SEASON = {"day": (1.0, 365.0), "latitude": (-66.0, 66.0)}
_KEYS = {"format", "version", "name", "layers"}
_MORE = {"description", "species", "limits", "gives_way", "ground", "season"}
#: Settings of populations that mean something in one file only.
_LOCAL = ("grounds", "ground_collection", "vertex_group", "image", "uv_layer", "areas", "paths")


def read_biome(path: Path) -> Biome:
    """Read and check a file.

    Raises
    ------
    SceneError
        It cannot be read, or breaks a rule of the format; names file and key.
    """
    try:
        return checked(json_of(read_whole(path, MAX_FILE_BYTES), refuse_constant), path.stem)
    except OSError as error:
        raise SceneError(f"{path.name}: cannot read the file: {error.strerror}") from None
    except (ValueError, SpeciesError) as error:
        raise SceneError(f"{path.name}: {error}") from None


def checked(data: Any, identifier: str) -> Biome:
    """A decoded file.

    Raises
    ------
    ValueError, SpeciesError
        Something is not as it must be; names the key.
    """
    check_keys("the file", data, _KEYS, _KEYS | _MORE)
    check_format(data, FORMAT, VERSION, "files of biomes")
    for key in ("name", "description"):
        check_text(f'"{key}"', data.get(key, ""))
    if not data["name"].strip():
        raise ValueError('"name" is empty')
    _check_limits(data.get("limits", {}))
    if not isinstance(data.get("gives_way", True), bool):
        raise ValueError(f'"gives_way" is {shown(data["gives_way"])}; it must be true or false')
    _check_ground(data.get("ground", {}))
    season = data.get("season", {})
    check_keys('"season"', season, set(), set(SEASON))
    for key, value in season.items():
        _check_number(f'"season": "{key}"', value, *SEASON[key])
    _check_species(data.get("species", {}))
    layers = list_of("layers", data["layers"])
    if not layers:
        raise ValueError('"layers" is empty')
    for number, layer in enumerate(layers, 1):
        _check_layer(f"layer {number}", layer)
    own = {key: data[key] for key in ("name", "layers", *sorted(_MORE)) if key in data}
    return Biome(identifier, **own)


def biome_data(
    scene: bpy.types.Scene,
    populations: Iterable[bpy.types.PropertyGroup],
    biome: bpy.types.PropertyGroup | None,
    name: str,
    description: str,
) -> dict[str, Any]:
    """Populations as the layers of a file, with the limits of their biome and species that only this file has."""
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "name": name, "description": description}
    stored = data_of(biome) if biome is not None else {}
    data |= {key: value for key, value in stored.items() if key in ("ground", "season") and value}
    layers = [_layer_data(population) for population in populations]
    stands = [] if biome is None else [stand_data(field) for field in stands_of(scene, biome.uid)]
    species = _species_data(scene, [part for layer in (*stands, *layers) for part in layer["species"]])
    if species:
        data["species"] = species
    if biome is not None:
        limits = limits_of_zone(biome)
        changed = {
            one.name: value_for(TetFloraBiome.bl_rna.properties[one.name], getattr(limits, one.name))
            for one in fields(Limits)
            if getattr(limits, one.name) not in (one.default, TetFloraBiome.bl_rna.properties[one.name].default)
        }
        data |= {"limits": changed} if changed else {}
        data |= {} if biome.gives_way else {"gives_way": False}
    data["layers"] = [*stands, *layers]
    return data


def _layer_data(population: bpy.types.PropertyGroup) -> dict[str, Any]:
    """What differs from a new population."""
    whole = population_data(population)
    layer: dict[str, Any] = {"kind": "cover" if population.covers else "population", "name": whole.pop("name")}
    for key, value in whole.items():
        prop = TetFloraPopulation.bl_rna.properties[key] if key != "species" and key != "grounds" else None
        if key in _LOCAL or key == "species" or value == value_for(prop, prop.default):
            continue
        layer[key] = value
    properties = type(population.mix[0]).bl_rna.properties if population.mix else {}
    layer["species"] = [
        {k: v for k, v in part.items() if k == "species" or v != value_for(properties[k], properties[k].default)}
        for part in whole["species"]
    ]
    return layer


def _species_data(scene: bpy.types.Scene, parts: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Pages of those species that are edited or new in this file; what they shed is made from them."""
    names = {part.get("shed_by", "") for part in parts} - {""}
    names |= {part["species"] for part in parts if not part["species"].startswith(part.get("shed_by", "?") + "_")}
    return {name: dict(species_data(scene, name)) for name in sorted(names) if find_edit(scene, name) is not None}


def _check_limits(limits: Any) -> None:
    known = {one.name for one in fields(Limits)}
    check_keys('"limits"', limits, set(), known)
    for key, value in limits.items():
        check_value(f'"limits": "{key}"', TetFloraBiome.bl_rna.properties[key], value)


def _check_ground(ground: Any) -> None:
    check_keys('"ground"', ground, set(), set(GROUND))
    for key, value in ground.items():
        default, low, high = GROUND[key]
        if isinstance(default, float):
            _check_number(f'"ground": "{key}"', value, low, high)
            continue
        if not isinstance(value, list) or len(value) != 3:
            raise ValueError(f'"ground": "{key}" is {shown(value)}; it must be three numbers')
        for part in value:
            _check_number(f'"ground": "{key}"', part, low, high)


def _check_number(where: str, value: Any, low: float, high: float) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(f"{where} is {shown(value)}; it must be a number from {low:g} to {high:g}")


def _check_species(species: Any) -> None:
    check_keys('"species"', species, set(), set(species) if isinstance(species, Mapping) else set())
    for identifier, page in species.items():
        where = f'species "{identifier}"'
        if not is_identifier(identifier):
            raise ValueError(f"{shown(identifier)} cannot name a species; use only {IDENTIFIER_RULE}")
        if not isinstance(page, dict):
            raise ValueError(f"{where} is {type(page).__name__}; it must be an object with keys")
        if "of" not in page:
            species_from_dict(page, identifier, where)
        elif not isinstance(page["of"], str) or not is_identifier(page["of"]):
            raise ValueError(f'{where}: "of" is {shown(page["of"])}; use only {IDENTIFIER_RULE}')
        elif not isinstance(page.get("every_order", {}), dict):
            raise ValueError(f'{where}: "every_order" is {shown(page["every_order"])}; it must be an object with keys')


def _check_layer(where: str, layer: Any) -> None:
    if not isinstance(layer, dict):
        raise ValueError(f"{where} is {type(layer).__name__}; it must be an object with keys")
    kind = layer.get("kind")
    if kind not in KINDS:
        raise ValueError(f'{where}: "kind" is {shown(kind)}; it must be one of {", ".join(KINDS)}')
    if kind == "stand":
        check_stand(where, layer)
    else:
        check_population(where, layer, ("kind",))
        if not layer.get("species"):
            raise ValueError(f'{where} has no "species"')
