# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A million plants: a forest over the valleys of the Jacksboro fault, conifers above, broadleaved trees below.

``python -m examples.million`` renders it; ``--plants``, ``--width`` and ``--memory`` make it smaller.
"""

# ruff: noqa: E402  (run as a program, it starts Blender before it imports what needs Blender)
from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from devtools import session

session.start()

import bpy
import numpy as np
from mathutils import Vector

from tetflora_addon.blender.job import refine
from tetflora_addon.blender.placing import plant_objects, terrain
from tetflora_addon.planting import places, rules

from . import stage
from .haze import add_haze
from .terrain import Terrain

PLANTS = 1_000_000
#: Relative numbers of species in the valleys and on the heights.
VALLEYS = {"broadleaf_tree": 0.3, "oak": 0.1, "maple": 0.15, "birch": 0.1, "aspen": 0.1, "bush": 0.25}
HEIGHTS = {"spruce": 0.45, "conifer": 0.3, "birch": 0.1, "bush": 0.15}
#: Square meters for each plant.
_ROOM = 22.0
_CORNER, _SCALE = (80, 100), 0.5
EXTINCTION, AIRLIGHT = 0.00012, (0.50, 0.60, 0.75)


def build(scene: bpy.types.Scene, plants: int = PLANTS, width: int = 960) -> None:
    """Fill an empty scene with ground, two fields of plants, camera, sun, sky and haze."""
    samples = int(np.sqrt(plants * _ROOM) / (93.0 * _SCALE)) + 3
    land = Terrain(corner=_CORNER, shape=(samples, samples), scale=_SCALE)
    surface = land.add_object(scene, "Ground", spacing=12.0)
    _plant(scene, surface, land, plants)
    across = land.size[0]
    eye = Vector((across / 2, 40.0, 0.0))
    eye.z = float(land.height(eye.x, eye.y)) + 48.0
    stage.camera(scene, eye, eye + Vector((0.0, 1.0, -0.13)), (width, width * 9 // 16), lens=30.0, far=20_000.0)
    stage.daylight(scene, elevation=28.0, azimuth=-75.0)
    add_haze(scene, EXTINCTION, AIRLIGHT)
    stage.film(scene)


def _plant(scene: bpy.types.Scene, surface: bpy.types.Object, land: Terrain, plants: int) -> None:
    """Broadleaved trees up to two thirds of the height, conifers from the middle on, both in stands and glades."""
    add_field = plant_objects.add_field
    ground = terrain.read_ground([surface], bpy.context.evaluated_depsgraph_get())
    low, high = float(land.heights.min()), float(land.heights.max())
    common = {"min_distance": 2.0, "scale_min": 0.75, "scale_max": 1.4, "clump_size": 110.0}
    valleys = places.place(
        ground,
        rules.Rules(
            count=plants * 3 // 5,
            seed=1,
            altitude_max=low + 0.7 * (high - low),
            altitude_falloff=0.25 * (high - low),
            clumping=0.95,
            weights=tuple(VALLEYS.values()),
            **common,
        ),
    )
    heights = places.place(
        ground,
        rules.Rules(
            count=plants - len(valleys),
            seed=2,
            altitude_min=low + 0.35 * (high - low),
            altitude_falloff=0.25 * (high - low),
            clumping=0.8,
            scale_at_top=0.8,
            weights=tuple(HEIGHTS.values()),
            **common,
        ),
        valleys.position,
    )
    add_field(scene, valleys, tuple(VALLEYS))
    add_field(scene, heights, tuple(HEIGHTS))


def render_million(
    path: Path, plants: int = PLANTS, width: int = 960, samples: int = 64, memory: float = 8.0
) -> dict[str, float]:
    """Refine and render it in a file of its own, in Cycles, within so many gigabytes.

    Returns
    -------
    dict
        Plants, polygons if expanded, polygons and facets that were made, and seconds.
    """
    session.clean_file()
    scene = bpy.context.scene
    build(scene, plants, width)
    render = scene.render
    render.engine, render.image_settings.file_format, render.filepath = 'CYCLES', 'PNG', str(path)
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.tetflora.refine_at_render = False
    scene.tetflora.max_memory = memory
    begin = time.perf_counter()
    statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    refined = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    return {
        "plants": statistics.plants,
        "polygons_full": statistics.polygons_full,
        "polygons": statistics.polygons_meshed,
        "facets": statistics.polygons_proxy,
        "refine_s": refined - begin,
        "render_s": time.perf_counter() - refined,
    }


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=PLANTS)
    parser.add_argument("--width", type=int, default=960)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--memory", type=float, default=8.0, help="gigabytes for plants and renderer")
    parser.add_argument("--output", type=Path, default=Path("out") / "million.png")
    arguments = parser.parse_args()
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    made = render_million(
        arguments.output.resolve(), arguments.plants, arguments.width, arguments.samples, arguments.memory
    )
    print(", ".join(f"{name} {value:,.1f}" for name, value in made.items()))
    session.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
