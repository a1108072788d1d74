# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The row of eighty (paper, section 8.1): different trees that recede from the viewer, 3.79 million polygons in all."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

from . import stage
from .terrain import Terrain

COUNT = 80
SPACING = 7.0
CORNER = (20, 40)
_ROW_X = 70.0
_FIRST_Y = 36.0


def build(scene: bpy.types.Scene, count: int = COUNT, species: str = "broadleaf_tree") -> None:
    """Fill an empty scene with ground, plants, camera, sun and sky.

    Parameters
    ----------
    scene : bpy.types.Scene
    count : int
        Number of plants.
    species : str
        Identifier in the catalog.
    """
    ground = Terrain(corner=CORNER, shape=(72, 18), scale=0.1)
    ground.add_object(scene, "Ground", spacing=5.0)
    place = np.arange(count)
    # A planted row is never quite straight; the golden ratio spreads the deviations evenly.
    aside = 1.6 * ((place * 0.618034) % 1 - 0.5)
    x, y = _ROW_X + aside, _FIRST_Y + SPACING * place
    z = ground.height(x, y)
    plants = bpy.data.collections.new("Row of eighty")
    scene.collection.children.link(plants)
    for i in range(count):
        empty = bpy.data.objects.new(f"Tree {i + 1:02d}", None)
        empty.empty_display_type, empty.empty_display_size = 'SINGLE_ARROW', 8.0
        empty.location = x[i], y[i], z[i] - 0.05
        empty.rotation_euler.z = 2.399963 * i  # golden angle
        empty.scale = (0.9 + 0.25 * ((i * 0.754878) % 1),) * 3
        empty.tetflora.is_plant, empty.tetflora.species, empty.tetflora.seed = True, species, 1000 + i
        plants.objects.link(empty)
    eye = Vector((_ROW_X - 17.0, 7.0, 0.0))
    eye.z = float(ground.height(eye.x, eye.y)) + 3.2
    target = Vector((_ROW_X - 2.0, _FIRST_Y + 50.0, 0.0))
    target.z = float(ground.height(target.x, target.y)) + 7.0
    stage.camera(scene, eye, target, (800, 450))
    stage.daylight(scene, elevation=38.0, azimuth=70.0)
    stage.film(scene)
    scene.eevee.use_raytracing = True  # or the sky would shine through crowns
    scene.eevee.fast_gi_thickness_near = 3.0
