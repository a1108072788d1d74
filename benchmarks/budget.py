# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Budgets of polygons: the result fits, and the error falls as the budget grows.

On the landscape seen close. The image of what is refined without a limit is the reference. An image has a number of
polygons and facets that are enough for it, and more are never made: budgets are parts of what is made without one.
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

SHARES = (10, 20, 40, 80)  # per cent
PIXELS, SAMPLES, QUICK_SAMPLES = 1024, 32, 8

TARGETS: Targets = {
    **{f"used_{share}": {"min": 0.9, "max": 1.0} for share in SHARES},
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
        # Finer than any budget allows.
        scene.tetflora.leaf_limit, scene.tetflora.facet = 0.25, 0.4
        free, seconds = timed_refine(scene, max_polygons=0)
        figures["polygons_free"] = free.polygons_meshed + free.polygons_proxy
        figures["refine_emit_s_free"] = seconds
        timed_render(scene, out / "free.png", samples)
        mask = plant_mask(scene, out / "mask.png")
        errors = []
        for share in SHARES:
            budget = int(figures["polygons_free"] * share / 100)
            fitted, seconds = timed_refine(scene, max_polygons=budget)
            timed_render(scene, out / f"{share}.png", samples)
            errors.append(difference(out / "free.png", out / f"{share}.png", mask).flip)
            figures[f"used_{share}"] = (fitted.polygons_meshed + fitted.polygons_proxy) / budget
            figures[f"flip_{share}"] = errors[-1]
            figures[f"facet_pixels_{share}"] = fitted.facet_pixels
            figures[f"refine_emit_s_{share}"] = seconds
    figures["falls"] = float(all(a > b for a, b in pairwise(errors)))
    return figures
