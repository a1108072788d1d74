# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground of biomes: a hectare of land where there is none, and soil in the colors of what stands and lies on it."""

from collections.abc import Iterable, Mapping, Sequence
from math import radians, tan
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ...arrays import Floats, Integers
from ...growth.hashing import key_of_seed
from ...planting.cover import Sheet
from ...planting.plane import gradient_noise
from ..attributes import world_matrix
from ..materials.soil import SHADED, lay_soil, may_have_soil
from ..placing.populations import own_objects
from ..placing.terrain import grid_mesh, read_ground
from ..placing.zones import biomes_in
from ..scene.crowns import crown_for
from ..scene.fields import fields_of, read_field
from .library import GROUND, data_of

NAME = "Land"
#: Side of land that is made, and of its squares, meters.
SIDE, STEP = 100.0, 1.0
_CELL, _MOST = 0.5, 400_000  # of the map of the soil
#: Waves of hills: meters from one to the next, and their height over that of the hills.
_WAVES = ((46.0, 0.42), (17.0, 0.1), (5.0, 0.016))
#: Of a valley, meters: half of its level floor, and from there to where it has half of its depth left; half the width
#: and the depth of its brook.
_FLOOR, _BANK, _BROOK, _DEEP = 7.0, 22.0, 4.5, 0.16


def heights(x: Floats, y: Floats, ground: Mapping[str, Any], seed: int = 0) -> Floats:
    """Of land for a biome, meters: hills, a slope that rises to the north, and a valley from west to east."""
    value = {name: ground.get(name, GROUND[name][0]) for name in ("hills", "slope", "valley")}
    points, key = np.stack([x, y], axis=-1).reshape(-1, 2), key_of_seed(seed)
    waves = sum(part * gradient_noise(points / size, key).reshape(x.shape) for size, part in _WAVES)
    aside = np.abs(y - brook(x))
    deep = 1.0 / (1.0 + (np.maximum(aside - _FLOOR, 0.0) / _BANK) ** 2)
    bed = _DEEP * np.exp(-((aside / _BROOK) ** 2))
    rough = waves * (1.0 - 0.85 * deep * (value["valley"] > 0.0))
    # Water runs west.
    low = (value["valley"] > 0.0) * (0.012 * x - bed) - value["valley"] * deep
    return value["hills"] * 2.0 * rough + tan(radians(value["slope"])) * y + low


def brook(x: Floats) -> Floats:
    """Where the middle of a valley is, y by x, meters."""
    return 7.0 * np.sin(np.asarray(x) / 19.0) + 3.0 * np.sin(np.asarray(x) / 7.3 + 1.0)


def make_land(scene: bpy.types.Scene, ground: Mapping[str, Any], seed: int = 0) -> bpy.types.Object:
    """A hectare of land around the 3D cursor."""
    along = np.arange(-SIDE / 2, SIDE / 2 + 0.1, STEP)
    x, y = np.meshgrid(along, along)
    land = bpy.data.objects.new(NAME, grid_mesh(NAME, np.stack([x, y, heights(x, y, ground, seed)], axis=2)))
    land.location = scene.cursor.location
    land.tetflora.is_occluder = True
    scene.collection.objects.link(land)
    return land


def make_line(scene: bpy.types.Scene, name: str, grounds: Iterable[bpy.types.Object]) -> bpy.types.Collection:
    """A collection with a curve that winds across the grounds from west to east, for biomes that follow lines."""
    corners = np.array([obj.matrix_world @ Vector(corner) for obj in grounds for corner in obj.bound_box])
    (west, south, low), (east, north, _) = corners.min(axis=0), corners.max(axis=0)
    x = np.linspace(west, east, 60)
    y = 0.5 * (south + north) + 0.012 * (north - south) * brook(100.0 * (x - 0.5 * (west + east)) / (east - west))
    curve = bpy.data.curves.new(name, 'CURVE')
    curve.dimensions = '3D'
    spline = curve.splines.new('POLY')
    spline.points.add(len(x) - 1)
    spline.points.foreach_set("co", np.stack([x, y, 0.0 * x + low, 0.0 * x + 1.0], axis=1).ravel().tolist())
    made = bpy.data.collections.new(name)
    scene.collection.children.link(made)
    made.objects.link(bpy.data.objects.new(name, curve))
    return made


def lay_biome_soil(depsgraph: bpy.types.Depsgraph, grounds: Sequence[bpy.types.Object]) -> list[str]:
    """Give ground a soil in the colors of the low plants and the litter of all biomes on it.

    Returns
    -------
    list of str
        Names of grounds that keep a material of the artist's.
    """
    fits = [obj for obj in grounds if may_have_soil(obj)]
    if not fits:
        return [obj.name for obj in grounds]
    triangles = read_ground(fits, depsgraph).triangles
    sheet = Sheet.over(triangles.reshape(-1, 3), _CELL, _MOST)
    cells = sheet.rows * sheet.columns
    on_it = set(fits)
    # Groups of the artist's own layers have no file, which says what soil is like.
    found = [b for b in biomes_in(depsgraph.scene) if b.source and on_it & {entry.object for entry in b.grounds}]
    if not found:
        return []
    earth, turf, share, here = np.zeros((cells, 3)), np.zeros((cells, 3)), np.zeros(cells), np.full(cells, 1e-9)
    hidden, color = np.zeros(cells), np.zeros((cells, 3))
    for biome in found:
        ground = data_of(biome).get("ground", {})
        value = {name: np.array(ground.get(name, GROUND[name][0])) for name in ("earth", "turf", "turf_share")}
        own = np.full(cells, 1e-6)
        for low, cell, area, colors in _low_plants(depsgraph, biome.uid, sheet):
            own += np.bincount(cell, minlength=cells)
            if low:
                hidden += np.bincount(cell, area, cells)
                color += np.stack([np.bincount(cell, area * c, cells) for c in colors.T], axis=1)
        own = _blurred(own.reshape(sheet.rows, sheet.columns)).reshape(-1)
        here += own
        earth += own[:, None] * value["earth"]
        turf += own[:, None] * value["turf"]
        share += own * value["turf_share"]
    earth, turf, share = earth / here[:, None], turf / here[:, None], share / here
    square = sheet.cell**2
    lying = 1.0 - np.exp(-hidden / square)
    mean = SHADED * color / np.maximum(hidden, 1e-12)[:, None]
    ground = earth + (lying * (1.0 - share))[:, None] * (mean - earth)
    shape = sheet.rows, sheet.columns
    earth, share = ground.reshape(*shape, 3), share.reshape(shape)
    return lay_soil("Land", grounds, earth, share, turf.mean(axis=0), sheet.low, sheet.cell)


def _low_plants(
    depsgraph: bpy.types.Depsgraph, uid: str, sheet: Sheet
) -> Iterable[tuple[bool, Integers, Floats, Floats]]:
    """Plants of the layers of a biome: whether they are low, their cells, what each hides, m², and its color."""
    scene = depsgraph.scene
    for population in scene.tetflora.layers:
        if population.biome != uid:
            continue
        for obj in fields_of(own_objects(scene, population)):
            read = read_field(obj, depsgraph, world_matrix(obj, depsgraph)[None])
            place = ((read.position[:, :2] - sheet.low) / sheet.cell).astype(np.int64)
            place = np.clip(place, 0, (sheet.columns - 1, sheet.rows - 1))
            crowns = [crown_for(scene, kind) for kind in read.identifiers]
            seen = np.array([crown.seen for crown in crowns])[read.species] * read.scale**2
            colors = np.array([crown.color for crown in crowns])[read.species]
            yield bool(population.covers), place[:, 1] * sheet.columns + place[:, 0], seen, colors


def _blurred(grid: Floats, reach: int = 8) -> Floats:
    """Means over squares of 2 · reach + 1 cells, (rows, columns)."""
    for axis in (0, 1):
        sums = np.cumsum(np.pad(grid, [(reach + 1, reach) if a == axis else (0, 0) for a in (0, 1)], mode="edge"), axis)
        long = sums.shape[axis]
        grid = np.take(sums, range(2 * reach + 1, long), axis) - np.take(sums, range(long - 2 * reach - 1), axis)
    return grid / (2 * reach + 1) ** 2
