# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 9: the landscape of 8,636 plants in haze."""

from __future__ import annotations

from pathlib import Path

import bpy
from PIL import Image

from devtools import session

from .. import landscape
from ..haze import add_haze
from .pictures import save_jpeg
from .scenes import paper_figures, refined, rendered

PIXELS, SMALL_PIXELS = 512, 32
SMALL_PLANTS = 200
EXTINCTION, AIRLIGHT = 0.0024, (0.40, 0.45, 0.52)


def make(out: Path, images: Path, small: bool) -> dict[str, float]:
    """Make ``paper-figure9.jpg``; returns what section 8.1 tells of it."""
    session.clean_file()
    scene = bpy.context.scene
    landscape.build(scene, *((SMALL_PLANTS, SMALL_PIXELS) if small else (landscape.PLANTS, PIXELS)))
    scene.tetflora.refine_at_render = False
    add_haze(scene, EXTINCTION, AIRLIGHT)
    statistics = refined(scene)
    picture = out / "figure9.png"
    render_s = rendered(scene, picture, 1 if small else 32)
    save_jpeg(Image.open(picture).convert("RGB"), images / "paper-figure9.jpg")
    return {**paper_figures(statistics), "render_s": render_s}
