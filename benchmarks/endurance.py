# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Endurance: two hundred frames of an animation, and two hundred rounds of an artist, in memory that does not grow.

The camera goes to and fro before a row of plants, so that both halves see the same; images are tiny, so that what is
measured is refinement, emission, and what Blender does with meshes that come and go. Frames share no results: each is
refined anew.

In a round an artist refines on another day of the year, undoes that and does it again, renames the scene and a plant,
and disables and enables the extension. Refinement is work enough for other processes. When the extension is disabled,
none of them and none of its threads may be there.
"""

from __future__ import annotations

import gc
import os
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from .report import Targets, children

#: Frames for the way there or back, and meters of it.
LEG, WAY = 10, 4.0
FRAMES, QUICK_FRAMES = 20 * LEG, 8 * LEG
#: Frames before memory counts: the first ones fill caches, compile species and load the renderer's kernels.
WARM_UP = 2 * LEG
#: Rounds of an artist, those before memory counts, and undo steps that Blender keeps, so that they are full by then.
ROUNDS, QUICK_ROUNDS, FIRST_ROUNDS, UNDO_STEPS = 200, 26, 10, 6
#: Days of the year, which come round.
DAYS = 8

TARGETS: Targets = {
    "growth": {"max": 0.03},
    "datablocks_left": {"max": 0},
    "different_frames": {"min": LEG},
    "frames": {"min": 200},
    "errors": {"max": 0},
    "rounds": {"min": ROUNDS},
    "leak_percent": {"max": 5.0},
    "processes_left": {"max": 0},
    "threads_left": {"max": 0},
    "handles_left": {"max": 0},
    "processes_used": {"min": 2},
    "seasons": {"min": 6},
}
QUICK_TARGETS: Targets = {**TARGETS, "frames": {"min": QUICK_FRAMES}, "rounds": {"min": QUICK_ROUNDS}}


def resident_mb() -> float:
    """Memory of this process that is in use, megabytes; asks Linux."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def run(quick: bool) -> dict[str, float]:
    """Render the animation, and go the rounds; see ``docs/measurements.md`` for what the figures mean."""
    from devtools import session

    found = _frames(QUICK_FRAMES if quick else FRAMES)
    session.clean_file()
    return {**found, **_rounds(QUICK_ROUNDS if quick else ROUNDS)}


def _rounds(number: int) -> dict[str, float]:
    """An artist's rounds; memory is that in use when the extension is enabled again and nothing is under way."""
    import addon_utils
    import bpy

    from devtools import session
    from examples import row80
    from tetflora_addon import memory, parallel
    from tetflora_addon.processes import pool

    scene = bpy.context.scene
    row80.build(scene, count=3, species="birch")
    scene.render.resolution_x, scene.render.resolution_y = 480, 24
    scene.tetflora.year.enabled = True
    bpy.context.preferences.edit.undo_steps = UNDO_STEPS
    parallel.set_threads(2)
    threads, used, polygons = threading.active_count(), 0, set()
    left, handles, resident = {"processes": 0, "threads": 0}, [], []
    for round in range(number):
        scene = bpy.context.scene
        scene.tetflora.year.day = 85 + 30 * (round % DAYS)
        scene.tetflora.cutoff = 2.0  # so that other processes are worth it
        bpy.ops.ed.undo_push(message="Before")
        if bpy.ops.tetflora.refine() != {'FINISHED'}:
            raise RuntimeError("Refine did not finish")
        bpy.ops.ed.undo_push(message="Refine")
        bpy.ops.ed.undo()
        bpy.ops.ed.redo()
        used = max(used, sum(1 for _ in children()))
        polygons.add(sum(len(mesh.polygons) for mesh in bpy.data.meshes))
        scene = bpy.context.scene
        scene.name = f"round {round % 3}"
        next(obj for obj in scene.objects if obj.tetflora.is_plant).name = f"renamed {round % 5}"
        addon_utils.disable(session.PACKAGE)
        left["processes"] = max(left["processes"], sum(1 for _ in children()))
        end = time.monotonic() + 5.0
        while threading.active_count() > threads and time.monotonic() < end:
            time.sleep(0.01)  # those of `parallel` end when they have seen that they may
        left["threads"] = max(left["threads"], threading.active_count() - threads)
        addon_utils.enable(session.PACKAGE)
        gc.collect()
        memory.give_back()
        resident.append(resident_mb())
        handles.append(len(os.listdir("/proc/self/fd")))
    pool.stop()
    counted = np.array(resident[FIRST_ROUNDS:])
    some = DAYS * max(len(counted) // (10 * DAYS), 1)  # whole years, as each day has memory of its own
    first, last = counted[:some].mean(), counted[-some:].mean()
    return {
        "rounds": number,
        "leak_percent": float(100.0 * (last / first - 1.0)),
        "first_rounds_mb": float(first),
        "last_rounds_mb": float(last),
        "processes_used": used,
        "seasons": len(polygons),
        "processes_left": left["processes"],
        "threads_left": left["threads"],
        "handles_left": handles[-1] - handles[FIRST_ROUNDS],
    }


def _frames(frames: int) -> dict[str, float]:
    """The animation."""
    import bpy

    from examples import row80
    from tetflora_addon.blender.job import render

    scene = bpy.context.scene
    row80.build(scene, count=6)
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    scene.cycles.samples = 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
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
