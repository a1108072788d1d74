# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A landscape as the paper's (section 8.2): 8,636 plants of ten species on the Jacksboro fault, as one plant field.

The density stays the same whatever the number: more plants cover more land, behind those that are there already.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session
from tetflora_addon.blender.placing import plant_objects, terrain
from tetflora_addon.planting import places, rules

from . import stage
from .haze import add_haze
from .paper.scenes import refined, rendered
from .terrain import Terrain, elevation

PLANTS = 8_636
#: Relative numbers of the species.
SPECIES = {
    "bush": 0.40,
    "grass": 0.50,
    "flower": 0.35,
    "broadleaf_tree": 0.045,
    "aspen": 0.03,
    "conifer": 0.02,
    "fern": 0.02,
    "birch": 0.008,
    "dead_tree": 0.004,
    "rowan": 0.003,
}
_SCALE = 0.1
_ACROSS = 420.0  # meters that the paper's number of plants takes along each side
_ROW, _COLUMN = 96, 120  # of the elevation model, where the land begins that the camera sees first

#: Of the picture of the documentation: height of the sun and where its light goes, degrees; extinction, 1/m, and
#: airlight.
_SUN, _HAZE = (24.0, 112.0), (0.0003, (0.40, 0.47, 0.58))


def build(scene: bpy.types.Scene, plants: int = PLANTS, pixels: int = 512) -> None:
    """Fill an empty scene with ground, a field of plants, camera, sun and sky.

    Parameters
    ----------
    scene : bpy.types.Scene
    plants : int
        Number of plants.
    pixels : int
        Sides of the image.
    """
    heights, spacing = elevation()
    side = _ACROSS * np.sqrt(plants / PLANTS)
    # The elevation model has room for some half a million; for more it is a larger copy of the land.
    scale = max(_SCALE, side / ((min(heights.shape) - 2) * spacing))
    wanted = int(side / (spacing * scale)) + 2
    rows, columns = min(wanted, heights.shape[0]), min(wanted, heights.shape[1])
    # Land grows away from the camera and to both sides of it.
    row = min(_ROW, heights.shape[0] - rows)
    column = int(np.clip(_COLUMN + (_ACROSS / (spacing * scale) - columns) / 2, 0, heights.shape[1] - columns))
    ground = Terrain(corner=(row, column), shape=(rows, columns), scale=scale)
    surface = ground.add_object(scene, "Ground", spacing=max(3.0, side / 400))
    plant(scene, surface, plants)
    width, length = ground.size
    eye = Vector((width / 2, -25.0, 0.0))
    eye.z = float(ground.height(eye.x, 0.0)) + 38.0
    target = Vector((width / 2, min(length, _ACROSS) * 0.4, 0.0))
    target.z = float(ground.height(target.x, target.y)) - 6.0
    stage.camera(scene, eye, target, (pixels, pixels), lens=32.0, far=20_000.0)
    stage.daylight(scene, elevation=35.0, azimuth=75.0)
    stage.film(scene)


def render_landscape(path: Path, width: int = 960, samples: int = 32) -> None:
    """Refine the landscape in a file of its own and render it, wide, in Cycles."""
    session.clean_file()
    scene = bpy.context.scene
    build(scene)
    bpy.data.objects.remove(scene.objects["Sun"])
    stage.daylight(scene, *_SUN)
    add_haze(scene, *_HAZE)
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.tetflora.refine_at_render = False
    refined(scene)
    rendered(scene, path, samples)


def plant(scene: bpy.types.Scene, surface: bpy.types.Object, plants: int) -> bpy.types.Object:
    """Scatter plants over a surface, as one object of points."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    scattered = rules.Rules(
        count=plants,
        seed=7,
        slope_max=np.radians(60.0),
        min_distance=0.9,
        scale_min=0.8,
        scale_max=1.35,
        weights=tuple(SPECIES.values()),
    )
    ground = terrain.read_ground([surface], depsgraph)
    found = places.place(ground, scattered)
    return plant_objects.add_field(scene, found, tuple(SPECIES))
