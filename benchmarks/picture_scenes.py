# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of the benchmark `time_to_picture` that no example has: the edge of a stand, and a part of a field."""

from __future__ import annotations

import bpy
import numpy as np

from tetflora_addon.blender.job.contents import read_scene
from tetflora_addon.blender.placing import plant_objects, terrain
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.planting import places, rules

from .forest_scene import Case, add_camera, add_light

#: Plants of the stand, and relative numbers of its species.
PLANTS = 800
SPECIES = {"broadleaf_tree": 0.15, "bush": 0.85}
SIDE, DISTANCE = 80.0, 1.6
#: At eye level, across a meadow. From 45 m, expanded leaves that are seen so close have more polygons, 30 instead of 11
#: million in all; from 14 m Cycles takes more than 13.6 GB.
_EYE, _BEFORE = 2.5, 100.0
SIZE = 1920, 1080


def stand(scene: bpy.types.Scene, plants: int = PLANTS, size: tuple[int, int] = SIZE) -> None:
    """Fill an empty scene with trees and bushes, all different, and a camera that stands before their edge."""
    bpy.ops.mesh.primitive_grid_add(size=2.0 * SIDE, x_subdivisions=8, y_subdivisions=8)
    ground = bpy.context.object
    wood = bpy.data.objects.new("Wood", ground.data.copy())
    wood.data.transform(np.diag([0.5, 0.5, 1.0, 1.0]))
    scene.collection.objects.link(wood)
    bpy.context.view_layer.update()
    rule = rules.Rules(count=plants, seed=7, min_distance=DISTANCE, weights=tuple(SPECIES.values()))
    found = places.place(terrain.read_ground([wood], bpy.context.evaluated_depsgraph_get()), rule)
    plant_objects.add_field(scene, found, tuple(SPECIES))
    bpy.data.objects.remove(wood)
    add_camera(scene, Case(tuple(SPECIES), eye=_EYE, side=SIDE, away=SIDE / 2 + _BEFORE))
    add_light(scene)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    bpy.context.view_layer.update()


def keep_part(scene: bpy.types.Scene, part: int, parts: int) -> int:
    """Replace a scene's fields by one of every so many-th plant, beginning with one of the first; their number."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seeds: Seeds = read_scene(scene, depsgraph, depsgraph.view_layer).seeds
    kept = seeds.take(np.arange(part, len(seeds), parts))
    for field in [one for one in scene.objects if one.tetflora.is_field]:
        bpy.data.objects.remove(field)
    azimuth = np.arctan2(kept.frame[:, 1, 0], kept.frame[:, 0, 0])
    seed = kept.seed.astype(np.int32)
    found = places.Placement(kept.position, azimuth, kept.scale, kept.species, seed, len(kept), up=kept.frame[:, :, 2])
    plant_objects.add_field(scene, found, kept.identifiers)
    bpy.context.view_layer.update()
    return len(kept)
