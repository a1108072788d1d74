# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Budgets of polygons: the result fits, and the error falls as the budget grows.

On the landscape seen close: refined without a limit it has more polygons than any of the budgets, and that image is
the reference.
"""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path

import bpy

from examples import landscape

from .compare import difference, plant_mask
from .report import Targets
from .row80 import timed_refine, timed_render

BUDGETS = (1_000_000, 2_000_000, 4_000_000, 8_000_000)
PIXELS, SAMPLES, QUICK_SAMPLES = 1024, 32, 8

TARGETS: Targets = {
    **{f"used_{n // 1_000_000}m": {"max": 1.0} for n in BUDGETS},
    "falls": {"min": 1.0},
}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    samples = QUICK_SAMPLES if quick else SAMPLES
    scene = bpy.context.scene
    landscape.build(scene, pixels=PIXELS)
    scene.tetflora.refine_at_render = False
    scene.render.resolution_percentage = 50 if quick else 100
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        # Finer than any budget allows, and refined for the full size even where the image is made smaller.
        scene.tetflora.leaf_limit, scene.tetflora.facet = 0.25, 0.4
        free, seconds = timed_refine(scene, max_polygons=0)
        figures["polygons_free"] = free.polygons_meshed + free.polygons_proxy
        figures["refine_emit_s_free"] = seconds
        timed_render(scene, out / "free.png", samples)
        mask = plant_mask(scene, out / "mask.png")
        errors = []
        for budget in BUDGETS:
            name = f"{budget // 1_000_000}m"
            fitted, seconds = timed_refine(scene, max_polygons=budget)
            timed_render(scene, out / f"{name}.png", samples)
            errors.append(difference(out / "free.png", out / f"{name}.png", mask).flip)
            figures[f"used_{name}"] = (fitted.polygons_meshed + fitted.polygons_proxy) / budget
            figures[f"flip_{name}"] = errors[-1]
            figures[f"facet_pixels_{name}"] = fitted.facet_pixels
            figures[f"refine_emit_s_{name}"] = seconds
    figures["falls"] = float(all(a > b for a, b in pairwise(errors)))
    return figures
