# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which form of proxy comes closer to the plants: the row of eighty as microsurfaces and as shells.

With the leaf limit at 3 pixels nearly all of it is drawn as proxies, so that the figures are theirs, not the meshes'.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy

from examples import row80

from .compare import difference, plant_mask
from .report import Targets
from .row80 import timed_refine, timed_render

TARGETS: Targets = {"flip_ratio": {"max": 1.0}}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure both forms; ``flip_ratio`` is that of the default form over that of the other."""
    scene = bpy.context.scene
    row80.build(scene)
    scene.tetflora.refine_at_render = False
    scene.render.resolution_percentage = 50
    scene.cycles.transparent_max_bounces = 256  # two hits a shell
    samples = 16 if quick else 128
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        timed_refine(scene, expand_everything=True)
        figures["render_expanded_s"] = timed_render(scene, out / "expanded.png", samples)
        mask = plant_mask(scene, out / "mask.png")
        timed_render(scene, out / "again.png", samples, seed=1)
        figures["flip_noise"] = difference(out / "expanded.png", out / "again.png", mask).flip
        default = scene.tetflora.bl_rna.properties["proxy_form"].default
        for form in ('MICROSURFACES', 'SHELLS'):
            statistics, _ = timed_refine(scene, expand_everything=False, leaf_limit=3.0, proxy_form=form)
            key = form.lower()
            figures[f"render_{key}_s"] = timed_render(scene, out / f"{key}.png", samples, seed=2)
            error = difference(out / "expanded.png", out / f"{key}.png", mask)
            figures[f"flip_{key}"] = error.flip
            figures[f"colour_{key}"] = error.colour
            figures[f"faces_{key}"] = statistics.polygons_proxy
            figures[f"meshed_{key}"] = statistics.polygons_meshed
        other = next(f for f in ('microsurfaces', 'shells') if f != default.lower())
        figures["flip_ratio"] = figures[f"flip_{default.lower()}"] / figures[f"flip_{other}"]
    return figures
