# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of biomes that are stands: trees that grew together instead of being placed."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from math import radians
from typing import Any

import bpy

from ...errors import shown
from ...files import IDENTIFIER_RULE, is_identifier
from ...jobs import Progress
from ..placing.file_checks import check_keys, check_text, check_value, list_of, value_for
from ..scene.field_sizes import has_history
from ..stands.growing import GrownStand, is_stand, new_stand_steps

#: Keys of a species of a stand.
_ENTRY = ("species", "planted", "rain")


def _properties() -> Any:
    """Properties of a stand, by way of Blender: files of biomes need none of what grows them."""
    return bpy.types.Object.bl_rna.properties["tetflora"].fixed_type.properties["stand"].fixed_type.properties


def _settings() -> dict[str, bpy.types.Property]:
    """Settings of stands that mean something in any file."""
    found = {p.identifier: p for p in _properties() if p.type in {'INT', 'FLOAT', 'BOOLEAN'}}
    return {
        name: prop
        for name, prop in found.items()
        if name not in ("is_grown", "last_year", "species_index", "path_distance")
    }


def check_stand(where: str, layer: dict[str, Any]) -> None:
    """Refuse what cannot be a stand.

    Raises
    ------
    ValueError
        Something is not as it must be; names the key.
    """
    known = _settings()
    check_keys(where, layer, {"kind", "name", "species"}, {"kind", "name", "species", *known})
    check_text(f'{where}: "name"', layer["name"])
    for key in known.keys() & layer.keys():
        check_value(f'{where}: "{key}"', known[key], layer[key])
    parts, entry = list_of(f'{where}: "species"', layer["species"]), _properties()["species"].fixed_type.properties
    for index, part in enumerate(parts, 1):
        check_keys(f"{where}: species {index}", part, {"species"}, set(_ENTRY))
        for key, value in part.items():
            check_value(f'{where}: species {index}: "{key}"', entry[key], value)
        if not is_identifier(part["species"]):
            raise ValueError(f'{where}: species {index}: {shown(part["species"])}; use only {IDENTIFIER_RULE}')


def stands_of(scene: bpy.types.Scene, uid: str) -> list[bpy.types.Object]:
    """Fields of a biome that are stands."""
    return [obj for obj in scene.objects if is_stand(obj) and obj.tetflora.stand.biome == uid]


def growing_of(scene: bpy.types.Scene, uid: str) -> list[bpy.types.Object]:
    """Those of them that have their years, and may be grown again: *Keep Year* makes a stand the artist's own."""
    return [obj for obj in stands_of(scene, uid) if has_history(obj) and not (obj.library or obj.data.library)]


def grow_layer_steps(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    uid: str,
    layer: Mapping[str, Any],
    renamed: Mapping[str, str],
    grounds: Iterable[bpy.types.Object],
    seed: int,
) -> Generator[Progress, object, GrownStand]:
    """Grow a checked layer as a field of the biome; closing the steps, or an error, leaves the scene as it was.

    Raises
    ------
    SceneError
        Nothing can grow.
    """

    def fill(stand: bpy.types.PropertyGroup) -> None:
        for name, prop in _settings().items():
            if name in layer:
                setattr(stand, name, radians(layer[name]) if prop.subtype == 'ANGLE' else layer[name])
        stand.biome, stand.seed = uid, (stand.seed + seed) % 2**31
        for part in layer["species"]:
            entry = stand.species.add()
            for key, value in part.items():
                setattr(entry, key, renamed.get(value, value) if key == "species" else value)

    return new_stand_steps(scene, depsgraph, grounds, layer["name"], fill)


def stand_data(field: bpy.types.Object) -> dict[str, Any]:
    """A stand as a layer of a file: what differs from a new one."""
    stand = field.tetflora.stand
    data: dict[str, Any] = {"kind": "stand", "name": field.name}
    for name, prop in _settings().items():
        value = value_for(prop, getattr(stand, name))
        if value != value_for(prop, prop.default):
            data[name] = value
    properties = _properties()["species"].fixed_type.properties
    data["species"] = [
        {key: value_for(properties[key], getattr(entry, key)) for key in _ENTRY} for entry in stand.species
    ]
    return data
