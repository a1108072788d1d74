# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Endurance: two hundred frames of an animation, refined for each, in memory that does not grow.

The camera goes to and fro before a row of plants, so that both halves see the same; images are tiny, so that what is
measured is refinement, emission, and what Blender does with meshes that come and go. Frames share no results: each is
refined anew.
"""

from __future__ import annotations

import gc
import os
import tempfile
from pathlib import Path

import numpy as np

from .report import Targets

#: Frames for the way there or back, and metres of it.
LEG, WAY = 10, 4.0
FRAMES, QUICK_FRAMES = 20 * LEG, 8 * LEG
#: Frames before memory counts: the first ones fill caches, compile species and load the renderer's kernels.
WARM_UP = 2 * LEG

TARGETS: Targets = {
    "growth": {"max": 0.03},
    "datablocks_left": {"max": 0},
    "different_frames": {"min": LEG},
    "frames": {"min": 200},
    "errors": {"max": 0},
}
QUICK_TARGETS: Targets = {**TARGETS, "frames": {"min": QUICK_FRAMES}}


def resident_mb() -> float:
    """Memory of this process that is in use, megabytes; asks Linux."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def run(quick: bool) -> dict[str, float]:
    """Render the animation; see ``docs/results.md`` for what the figures mean."""
    import bpy

    from examples import row80
    from tetflora_addon.blender.job import render

    scene = bpy.context.scene
    row80.build(scene, count=6)
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    scene.cycles.samples = 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    frames = QUICK_FRAMES if quick else FRAMES
    scene.frame_start, scene.frame_end = 1, WARM_UP + frames
    scene.tetflora.share_frames = False
    camera, begin = scene.camera, scene.camera.location.x
    for leg in range(scene.frame_end // LEG + 1):
        camera.location.x = begin + WAY * (leg % 2)
        camera.keyframe_insert("location", frame=1 + leg * LEG)
    scene.frame_set(1)
    memory: list[float] = []
    polygons: list[int] = []

    def look(_scene: object, _depsgraph: object = None) -> None:
        gc.collect()
        memory.append(resident_mb())
        polygons.append(sum(len(mesh.polygons) for mesh in bpy.data.meshes))

    before = _datablocks()
    bpy.app.handlers.render_post.append(look)
    try:
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = str(Path(folder) / "frame_####")
            bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.render_post.remove(look)
    counted = np.array(memory[WARM_UP:])
    first, last = counted[: frames // 2].mean(), counted[-(frames // 2) :].mean()
    return {
        "frames": len(counted),
        "growth": last / first - 1.0,
        "first_half_mb": first,
        "last_half_mb": last,
        "most_mb": counted.max(),
        "polygons_mean": float(np.mean(polygons)),
        "different_frames": len(set(polygons)),
        "datablocks_left": _datablocks() - before,
        "errors": len(render.render_errors()),
    }


def _datablocks() -> int:
    """How many the file has, but for what Blender itself makes of a render."""
    import bpy

    kinds = ("objects", "meshes", "pointclouds", "collections", "materials", "node_groups", "images", "curves")
    return sum(d.name != "Render Result" for kind in kinds for d in getattr(bpy.data, kind))
