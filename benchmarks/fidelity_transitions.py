# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What changes in the image when a limit changes by a tenth: a row of plants that recedes.

``transition_flip`` is of the cutoff, ``transition_flip_leaf`` of the leaf limit, which turns real leaves into facets
wherever they are near it. The heights of a species' plants in the row differ by two fifths; four steps of a tenth take
each species' leaves through the limit at one of them.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from examples import stands

from .compare import flip_map, plant_mask, read_picture, render
from .row80 import timed_refine

SIZES, QUICK_SIZES = (110, 24), (80, 40)
STEPS, QUICK_STEPS = 4, 1
SAMPLES, QUICK_SAMPLES = 512, 64
FACTOR = 1.1
#: Side of the squares of which the worst is reported, pixels.
_SQUARE = 16


def run(folder: Path, quick: bool) -> dict[str, float]:
    """FLIP between limits that differ by a tenth, same seed: of the worst step, and of its worst square.

    ``transition_noise`` is what other seeds do to the first image.
    """
    scene = bpy.context.scene
    stands.receding(scene, *(QUICK_SIZES if quick else SIZES), "side")
    scene.cycles.transparent_max_bounces = 256
    samples, steps = (QUICK_SAMPLES, QUICK_STEPS) if quick else (SAMPLES, STEPS)
    begin = {"cutoff": scene.tetflora.cutoff, "leaf_limit": scene.tetflora.leaf_limit}
    timed_refine(scene, expand_everything=False)
    first = _picture(scene, folder / "transition-0.png", samples, 0)
    mask = plant_mask(scene, folder / "mask.png")
    error = flip_map(first, _picture(scene, folder / "transition-noise.png", samples, 1))
    figures = {"transition_noise": float(error[mask].mean()), "transition_noise_square": worst_square(error, mask)}
    print(f"  noise: {figures['transition_noise']:.4f}", flush=True)
    for limit, suffix in (("cutoff", ""), ("leaf_limit", "_leaf")):
        means, squares, before = [], [], first
        for step in range(1, steps + 1):
            timed_refine(scene, expand_everything=False, **{**begin, limit: begin[limit] * FACTOR**step})
            picture = _picture(scene, folder / f"transition-{limit}-{step}.png", samples, 0)
            error = flip_map(before, picture)
            means.append(float(error[mask].mean()))
            squares.append(worst_square(error, mask))
            print(f"  {limit} {step}: {means[-1]:.4f}, worst square {squares[-1]:.4f}", flush=True)
            before = picture
        figures |= {f"transition_flip{suffix}": max(means), f"transition_flip_square{suffix}": max(squares)}
    return figures


def worst_square(error: np.ndarray, mask: np.ndarray) -> float:
    """Largest mean of an error (height, width) over a square's pixels in the mask, of squares that are half in it."""
    height, width = (n // _SQUARE * _SQUARE for n in error.shape)
    shape = height // _SQUARE, _SQUARE, width // _SQUARE, _SQUARE
    inside = mask[:height, :width].reshape(shape)
    count = inside.sum(axis=(1, 3))
    sums = (error[:height, :width].reshape(shape) * inside).sum(axis=(1, 3))
    return float((sums / np.maximum(count, 1))[count >= _SQUARE**2 / 2].max(initial=0.0))


def _picture(scene: bpy.types.Scene, path: Path, samples: int, seed: int) -> np.ndarray:
    render(scene, path, samples, seed)
    return read_picture(path)[:, :, :3]
