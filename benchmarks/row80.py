# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's row of eighty trees: refined against fully expanded, in time, memory and image."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import bpy

from examples import row80
from tetflora_addon.blender.job import refine

from .compare import difference, plant_mask, render
from .report import Targets, peak_mb

SAMPLES, QUICK_SAMPLES = 64, 8
PAPER_POLYGONS = 3.79e6

TARGETS: Targets = {
    "polygons_full": {"min": 0.9 * PAPER_POLYGONS, "max": 1.1 * PAPER_POLYGONS},
    "meshed_share": {"max": 0.25},
    "refine_emit_s": {"max": 10.0},
    "flip": {"max": 0.08},
}
QUICK_TARGETS: Targets = {key: TARGETS[key] for key in ("polygons_full", "meshed_share", "refine_emit_s")}


def timed_refine(scene: bpy.types.Scene, **settings: object) -> tuple[object, float]:
    """Refine with some settings of the scene changed; returns the statistics and the seconds."""
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    start = time.perf_counter()
    statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    return statistics, time.perf_counter() - start


def timed_render(scene: bpy.types.Scene, path: Path, samples: int, seed: int = 0, engine: str = 'CYCLES') -> float:
    """Render what the scene holds; returns seconds."""
    start = time.perf_counter()
    render(scene, path, samples, seed, engine)
    return time.perf_counter() - start


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    scene = bpy.context.scene
    row80.build(scene)
    scene.tetflora.refine_at_render = False
    samples = QUICK_SAMPLES if quick else SAMPLES
    if quick:
        scene.render.resolution_percentage = 50
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        refined, refine_s = timed_refine(scene)
        peak = peak_mb()
        render_refined_s = timed_render(scene, out / "refined.png", samples)
        expanded, expand_s = timed_refine(scene, expand_everything=True)
        render_expanded_s = timed_render(scene, out / "expanded.png", samples)
        mask = plant_mask(scene, out / "mask.png")
        timed_render(scene, out / "again.png", samples, seed=1)
        error = difference(out / "expanded.png", out / "refined.png", mask)
        noise = difference(out / "expanded.png", out / "again.png", mask)
        return {
            "refine_emit_s": refine_s,
            "expand_s": expand_s,
            "time_ratio": refine_s / expand_s,
            "polygons_full": expanded.polygons_meshed,
            "polygons_meshed": refined.polygons_meshed,
            "polygons_proxy": refined.polygons_proxy,
            "meshed_share": refined.polygons_meshed / expanded.polygons_meshed,
            "tetrahedra_made": refined.tetrahedra_made,
            "tetrahedra_proxy": refined.tetrahedra_proxy,
            "flip": error.flip,
            "flip_noise": noise.flip,
            "flip_whole_picture": error.flip_all,
            "color_error": error.color,
            "peak_mb": peak,
            "render_refined_s": render_refined_s,
            "render_expanded_s": render_expanded_s,
        }
