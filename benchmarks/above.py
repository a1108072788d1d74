# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Thirty plants from above, orthographic: *Automatic* refined against fully expanded, and species by species.

A view that nobody had tuned for: crowns are seen from where their light comes from, and each has open ground around it.
``out/above`` keeps the images. A species' pixels are those nearest to its plants that the expanded plants cover.
"""

from __future__ import annotations

import bpy
import numpy as np

from examples import stands

from .compare import color_error, coverage, flip_map, linear_light, read_picture, render
from .fidelity_frames import LEAST_COVERAGE
from .report import ROOT, Targets
from .row80 import timed_refine

FOLDER = ROOT / "out" / "above"
SPECIES = ("beech", "spruce", "birch", "willow", "palm")
EACH, SIDE, PIXELS = 6, 60.0, 480
#: Samples of the images, and of coverage.
SAMPLES, QUICK_SAMPLES, COVERED = 32, 16, 32

TARGETS: Targets = {"flip_beyond_noise": {"max": 0.01}, "color_error": {"max": 0.02}}
QUICK_TARGETS: Targets = {"flip_beyond_noise": {"max": 0.02}, "color_error": {"max": 0.03}}


def run(quick: bool, light: str = "side") -> dict[str, float]:
    """Measure: FLIP and its noise where plants are, color, luminance and transmittance, of all and of each species."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    scene = bpy.context.scene
    made = stands.above(scene, SPECIES, EACH, SIDE, PIXELS // 2 if quick else PIXELS, light)
    samples = QUICK_SAMPLES if quick else SAMPLES
    paths = [FOLDER / f"{name}.png" for name in ("expanded", "again", "refined")]
    expanded, _ = timed_refine(scene, expand_everything=True)
    covered = coverage(scene, FOLDER / "coverage.png", COVERED)
    for seed, path in enumerate(paths[:2]):
        render(scene, path, samples, seed)
    refined, seconds = timed_refine(scene, expand_everything=False)
    bare = covered - coverage(scene, FOLDER / "coverage.png", COVERED)
    render(scene, paths[2], samples, 2)
    pictures = [read_picture(path)[:, :, :3] for path in paths]
    mask = covered > LEAST_COVERAGE
    figures = {
        "refine_emit_s": seconds,
        "polygons_full": expanded.polygons_meshed,
        "polygons_meshed": refined.polygons_meshed,
        "polygons_proxy": refined.polygons_proxy,
        **_compared(*pictures, bare, mask, ""),
    }
    for number, name in enumerate(SPECIES):
        figures |= _compared(*pictures, bare, mask & (made.kind == number), f"_{name}")
    return figures


def _compared(
    expanded: np.ndarray, again: np.ndarray, refined: np.ndarray, bare: np.ndarray, mask: np.ndarray, suffix: str
) -> dict[str, float]:
    """Figures of some pixels; ``bare`` is the transmittance of refined plants less that of the expanded ones."""
    flip, noise = (float(flip_map(expanded, picture)[mask].mean()) for picture in (refined, again))
    weights = [0.2126, 0.7152, 0.0722]
    dark, light = (float(linear_light(picture[mask]).mean(axis=0) @ weights) for picture in (expanded, refined))
    figures = {
        "flip": flip,
        "flip_noise": noise,
        "flip_beyond_noise": flip - noise,
        "color_error": color_error(expanded, refined, mask),
        "brightness": light / dark - 1.0,
        "dT": float(bare[mask].mean()),
    }
    return {f"{name}{suffix}": value for name, value in figures.items()}
