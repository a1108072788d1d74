# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What several figures need: the row of eighty in a new file, refined, rendered."""

from __future__ import annotations

import time
from pathlib import Path

import bpy

from devtools import session
from devtools.formats import set_format
from tetflora_addon.blender.job import refine

from .. import row80

#: Of the row, its image, and one of a test.
SIZE, SMALL_SIZE = (800, 450), (64, 36)
SMALL_ROW = 8


def row(small: bool, size: tuple[int, int] = SIZE) -> bpy.types.Scene:
    """The row of eighty in an empty file; it is refined when asked, not at each render."""
    session.clean_file()
    scene = bpy.context.scene
    row80.build(scene, count=SMALL_ROW if small else row80.COUNT)
    scene.render.resolution_x, scene.render.resolution_y = SMALL_SIZE if small else size
    scene.tetflora.refine_at_render = False
    return scene


def refined(scene: bpy.types.Scene) -> object:
    """Refine the scene for its frame; returns the statistics."""
    bpy.context.view_layer.update()
    return refine.refine(scene, bpy.context.evaluated_depsgraph_get())


def choose_cycles(scene: bpy.types.Scene, samples: int) -> None:
    """Render in Cycles, denoised, as 8-bit PNGs."""
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = samples, True
    scene.cycles.use_adaptive_sampling = False
    set_format(scene.render.image_settings, 'PNG')


def rendered(scene: bpy.types.Scene, path: Path, samples: int) -> float:
    """Render an image, see `choose_cycles`; returns seconds."""
    choose_cycles(scene, samples)
    scene.render.filepath = str(path)
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    return time.perf_counter() - start


def paper_figures(statistics: object) -> dict[str, float]:
    """What the paper tells about an image (sections 8.1 and 8.3), from the statistics of its refinement."""
    return {
        "plants": statistics.plants,
        "polygons_full": statistics.polygons_full,
        "polygons_meshed": statistics.polygons_meshed,
        "polygons_proxy": statistics.polygons_proxy,
        "tetrahedra_made": statistics.tetrahedra_made,
        "tetrahedra_proxy": statistics.tetrahedra_proxy,
        "refine_s": sum(statistics.seconds.values()),
        "polygons_mb": statistics.memory_mb,
        "tetrahedra_mb": statistics.steps[-1].memory_mb,
    }
