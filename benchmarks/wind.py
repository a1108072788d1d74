# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What wind costs: the row of eighty in a breeze, in one with velocities, and in a gale, beside the row at rest.

Seconds are the processor's, of refining and emitting: the least of several runs of each in turn, in one process.
"""

from __future__ import annotations

import time

import bpy

from examples import row80
from tetflora_addon.blender.job import refine

from .report import Targets

REPEATS, QUICK_REPEATS = 4, 2
BREEZE, GALE = 4.0, 20.0

TARGETS: Targets = {"breeze_ratio": {"max": 1.3}}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    scene = bpy.context.scene
    row80.build(scene)
    if quick:
        scene.render.resolution_percentage = 50
    seconds: dict[str, list[float]] = {}
    statistics = {}
    for repeat in range(QUICK_REPEATS if quick else REPEATS):
        for name, speed in (("still", 0.0), ("breeze", BREEZE), ("gale", GALE), ("blurred", BREEZE)):
            scene.frame_set(1 + repeat)
            scene.render.use_motion_blur = name == "blurred"
            took, statistics[name] = _refined(scene, speed)
            seconds.setdefault(name, []).append(took)
    least = {name: min(some[1:]) for name, some in seconds.items()}  # the first one compiles and warms up
    figures = {f"{name}_ratio": least[name] / least["still"] for name in ("breeze", "gale", "blurred")}
    for name, took in least.items():
        one = statistics[name]
        figures |= {f"{name}_s": took, f"{name}_polygons": one.polygons_meshed + one.polygons_proxy}
        figures[f"{name}_tetrahedra"] = one.tetrahedra_made
    return figures


def _refined(scene: bpy.types.Scene, speed: float) -> tuple[float, object]:
    """Seconds of a refinement in a wind, and its statistics."""
    scene.tetflora.wind.enabled, scene.tetflora.wind.speed = speed > 0, speed
    begun = time.process_time()
    statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    return time.process_time() - begun, statistics
