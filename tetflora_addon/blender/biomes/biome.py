# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A biome as its file has it, and the biomes of a scene with their layers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Any

import bpy

from ...files import json_of
from ...species.schema import species_from_dict
from ..species.edits import species_data

#: Ground: linear RGB of bare soil and of turf, the share that turf hides; and the shape of ground that is made for it:
#: hills in meters, slope in degrees, depth of a brook's valley in meters. Least and most of each number.
GROUND = {
    "earth": ((0.036, 0.025, 0.016), 0.0, 1.0),
    "turf": ((0.05, 0.08, 0.02), 0.0, 1.0),
    "turf_share": (0.0, 0.0, 1.0),
    "hills": (2.0, 0.0, 30.0),
    "slope": (0.0, 0.0, 45.0),
    "valley": (0.0, 0.0, 30.0),
}


@dataclass(frozen=True)
class Biome:
    """A biome as its file has it, checked.

    Attributes
    ----------
    layers : list of dict
        Each with ``kind`` and the keys of that.
    species : dict
        Species of its own by identifier: whole pages, or what differs from one ``of`` the catalog, and what differs
        in ``every_order`` of that.
    """

    identifier: str
    name: str
    layers: list[dict[str, Any]]
    description: str = ""
    species: dict[str, dict[str, Any]] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    gives_way: bool = True
    ground: dict[str, Any] = field(default_factory=dict)
    season: dict[str, float] = field(default_factory=dict)


def find_biome(scene: bpy.types.Scene, uid: str) -> bpy.types.PropertyGroup | None:
    """A biome of a scene by its identity."""
    return next((biome for biome in scene.tetflora.biomes if biome.uid == uid), None)


def active_biome(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    """The biome that buttons act on; None where there is none."""
    group = scene.tetflora
    return group.biomes[group.biomes_index] if 0 <= group.biomes_index < len(group.biomes) else None


def layers_of(scene: bpy.types.Scene, uid: str) -> list[bpy.types.PropertyGroup]:
    """Populations of a biome, in their order."""
    return [population for population in scene.tetflora.populations if population.biome == uid]


def data_of(biome: bpy.types.PropertyGroup) -> dict[str, Any]:
    """What a biome keeps of its file beside its layers; nothing where that cannot be read."""
    try:
        data = json_of(biome.data) if biome.data else {}
    except ValueError:
        data = {}
    return data if isinstance(data, dict) else {}


def set_limits(biome: bpy.types.PropertyGroup, limits: Mapping[str, float]) -> None:
    """Give a biome of a scene checked limits."""
    for key, value in limits.items():
        angle = biome.bl_rna.properties[key].subtype == 'ANGLE'
        setattr(biome, key, radians(value) if angle else value)
    biome.use_altitude = bool({"altitude_min", "altitude_max"} & limits.keys())


def pages_of(scene: bpy.types.Scene, biome: Biome) -> dict[str, dict[str, Any]]:
    """Pages of the species of a biome's own, complete.

    Raises
    ------
    SceneError, SpeciesError
        One is made from a species that the catalog does not have, or is broken.
    """
    pages: dict[str, dict[str, Any]] = {}
    for identifier, given in biome.species.items():
        page = dict(given)
        if "of" in page:
            of = page.pop("of")
            each = page.pop("every_order", {})
            page = {**(pages[of] if of in pages else species_data(scene, of)), **page}
            if each and isinstance(page.get("orders"), list):
                # Where an order has the key already: what bears no leaves has no color of leaves.
                page["orders"] = [
                    {**order, **{k: each[k] for k in each.keys() & order.keys()}} if isinstance(order, dict) else order
                    for order in page["orders"]
                ]
            species_from_dict(page, identifier, f'{biome.name}: species "{identifier}"')
        pages[identifier] = page
    return pages
