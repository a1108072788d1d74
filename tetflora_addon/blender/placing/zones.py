# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of the biomes of a scene: which part of its ground each biome takes, and which comes first.

Biomes with limits or a mask come first, in the order of the list; those without take what is left. So a riparian wood
that is added to a beech forest pushes it back from the water.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from math import inf
from typing import Any

import bpy
import numpy as np

from ...planting.plane import Terrain
from ...planting.site import Limits, Spots, Zone, distance_lines
from ...planting.wetness import wet_ground
from ..settings import BIOME, with_identity
from .terrain import lines_within, read_ground

#: Settings of a biome's mask, by the names that `read_ground` has for them.
MASK = ("vertex_group", "invert_group", "image", "invert_image", "uv_layer")


def biomes_in(scene: bpy.types.Scene) -> list[bpy.types.PropertyGroup]:
    """Biomes of a scene, those above first."""
    return [layer for layer in scene.tetflora.layers if layer.kind == BIOME]


def biome_of(scene: bpy.types.Scene, population: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup | None:
    """The biome of which a population is a layer; None of others."""
    return with_identity(scene.tetflora.layers, population.biome) if population.biome else None


def limits_of_zone(biome: bpy.types.PropertyGroup) -> Limits:
    """The limits of a biome; those that are switched off are open."""
    given = {field.name: getattr(biome, field.name) for field in fields(Limits)}
    if not biome.use_altitude:
        given |= {"altitude_min": -inf, "altitude_max": inf}
    if biome.paths is None:
        given |= {"path_min": 0.0, "path_max": inf}
    return Limits(**given)


def is_limited(biome: bpy.types.PropertyGroup) -> bool:
    """Whether a biome takes only a part of its ground."""
    return bool(biome.vertex_group or biome.image or not limits_of_zone(biome).open)


def come_before(scene: bpy.types.Scene, biome: bpy.types.PropertyGroup) -> list[bpy.types.PropertyGroup]:
    """Biomes to which one gives way: those with limits that stand above it or, if it has none itself, all of them.

    Only where they share a ground.
    """
    if not biome.gives_way:
        return []
    own, found = {entry.object for entry in biome.grounds}, []
    limited = is_limited(biome)
    for other in biomes_in(scene):
        if other.uid == biome.uid:
            if limited:
                break
        elif is_limited(other) and own & {entry.object for entry in other.grounds}:
            found.append(other)
    return found


def zone_values(scene: bpy.types.Scene, population: bpy.types.PropertyGroup) -> list[Any]:
    """All that decides the zone of a population or stand, for its fingerprint; empty without a biome."""
    biome = biome_of(scene, population) if population.biome else None
    if biome is None:
        return []
    values = []
    for one in (biome, *come_before(scene, biome)):
        masks = [getattr(value, "name_full", value) for value in (getattr(one, name) for name in MASK)]
        limits = repr(limits_of_zone(one)) if is_limited(one) else ""
        values.append([*masks, limits, one.paths.name_full if one.paths else ""])
    return values if len(values) > 1 or is_limited(biome) else []


def read_zones(
    depsgraph: bpy.types.Depsgraph, population: bpy.types.PropertyGroup, grounds: Sequence[bpy.types.Object]
) -> tuple[Zone, ...]:
    """Zones that limit a population on its grounds: its biome's, and the inverse of those to which that gives way.

    Raises
    ------
    SceneError
        A mask or a path cannot be read, as the message says.
    """
    biome = biome_of(depsgraph.scene, population)
    if biome is None:
        return ()
    own = [_zone(biome, grounds, depsgraph)] if is_limited(biome) else []
    others = [replace(_zone(other, grounds, depsgraph), inverse=True) for other in come_before(depsgraph.scene, biome)]
    return (*own, *others)


def zoned(
    depsgraph: bpy.types.Depsgraph, owner: bpy.types.PropertyGroup, grounds: Sequence[bpy.types.Object], ground: Terrain
) -> Terrain:
    """A ground with the zones of a layer, a population or a stand, in its weights: as they are at the corners.

    Raises
    ------
    SceneError
        As `read_zones`.
    """
    zones = read_zones(depsgraph, owner, grounds)
    if not zones:
        return ground
    corners, count = ground.triangles, len(ground.triangles)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.abs(normal) / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    each = np.repeat(np.arange(count), 3)
    spots = Spots(each, np.tile(np.eye(3), (count, 1)), corners.reshape(-1, 3), normal[each])
    wet = wet_ground(corners) if any(zone.asks_for_water for zone in zones) else None
    share = np.prod([zone.share(spots, wet) for zone in zones], axis=0).reshape(count, 3)
    return replace(ground, weight=share if ground.weight is None else share * ground.weight)


def _zone(biome: bpy.types.PropertyGroup, grounds: Sequence[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> Zone:
    limits = limits_of_zone(biome)
    lines = () if biome.paths is None else lines_within(biome.paths, depsgraph, "Paths")
    mask = {name: getattr(biome, name) for name in MASK}
    if not (biome.vertex_group or biome.image):
        return Zone(limits, lines=distance_lines(lines, limits))
    ground = read_ground(grounds, depsgraph, **mask)
    return Zone(limits, ground.weight, ground.uv, ground.image, distance_lines(lines, limits))
