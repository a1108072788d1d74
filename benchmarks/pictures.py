# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Images compared by numbers: FLIP (Andersson et al., 2020) where plants are, and where plants are."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import flip_evaluator
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from devtools.formats import set_format
from tetflora_addon.blender.job import refine


def read_picture(path: Path) -> NDArray[np.float32]:
    """RGBA (height, width, 4) of an image as it is stored (sRGB if it has 8 bits), top row first."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.alpha_mode = 'CHANNEL_PACKED'
        width, height = image.size
        pixels = np.zeros(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1]


@dataclass(frozen=True)
class Difference:
    """How far an image is from its reference.

    Attributes
    ----------
    flip : float
        Mean FLIP over the mask.
    flip_all : float
        Mean FLIP over the whole image.
    color : float
        Difference of the masked mean colors (linear light), relative to the reference's mean.
    """

    flip: float
    flip_all: float
    color: float


def difference(reference: Path, test: Path, mask: NDArray[np.bool_] | None = None) -> Difference:
    """Compare two 8-bit images of equal size; ``mask`` is (height, width), by default all."""
    a, b = (read_picture(p)[:, :, :3] for p in (reference, test))
    error = flip_map(a, b)
    mask = np.ones(a.shape[:2], bool) if mask is None else mask
    return Difference(float(error[mask].mean()), float(error.mean()), color_error(a, b, mask))


def flip_map(reference: NDArray[np.floating], test: NDArray[np.floating]) -> NDArray[np.float32]:
    """FLIP (height, width) of each pixel of two images (height, width, 3) as they are stored (sRGB)."""
    a, b = (np.ascontiguousarray(p[:, :, :3]) for p in (reference, test))
    return np.asarray(flip_evaluator.evaluate(a, b, "LDR", inputsRGB=True, applyMagma=False)[0]).reshape(a.shape[:2])


def linear_light(stored: NDArray[np.floating]) -> NDArray[np.floating]:
    """Radiance from what an sRGB image stores, any shape."""
    return np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)


def color_error(reference: NDArray[np.floating], test: NDArray[np.floating], mask: NDArray[np.bool_]) -> float:
    """Difference of the mean colors (linear light) where the mask is set, relative to the reference's mean."""
    a, b = (linear_light(p[:, :, :3][mask]).mean(axis=0) for p in (reference, test))
    return float(np.abs(b - a).mean() / a.mean())


def render(
    scene: bpy.types.Scene, path: Path, samples: int, seed: int = 0, engine: str = 'CYCLES', form: str = 'PNG'
) -> None:
    """Render a frame of a scene without denoising, as an 8-bit PNG or in another format; EEVEE knows no seeds."""
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.seed = samples, seed
    scene.eevee.taa_render_samples = samples
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    set_format(scene.render.image_settings, form)
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


@contextmanager
def changed(*changes: tuple[Any, str, Any]) -> Iterator[None]:
    """While it lasts, properties have other values: owners, names, values."""
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in changes]
    for owner, name, value in changes:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for owner, name, value in before:
            setattr(owner, name, value)


def save_picture(path: Path, picture: NDArray[np.floating]) -> None:
    """Write an image (height, width) or (height, width, 3), 0 to 1 as it is stored, with 8 bits, top row first."""
    Image.fromarray(np.round(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8)).save(path, quality=80)


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


def plant_mask(scene: bpy.types.Scene, path: Path, samples: int = 8, threshold: float = 0.05) -> NDArray[np.bool_]:
    """Where plants are seen, with the objects that the scene holds now: everything else is made a hole.

    Returns
    -------
    (height, width) bool
        Pixels that plants cover by more than the threshold.
    """
    return coverage(scene, path, samples) > threshold


def coverage(scene: bpy.types.Scene, path: Path, samples: int, engine: str = 'CYCLES') -> NDArray[np.float32]:
    """How much of each pixel plants cover, with the objects that the scene holds now: everything else is a hole.

    Returns
    -------
    (height, width) float32
        0 to 1; what is left to 1 is transmittance. Light does not count, so Cycles follows no ray beyond plants.
    """
    others = [
        o for o in scene.objects if o.type in {'MESH', 'POINTCLOUD'} and "tetflora_kind" not in o and not o.is_holdout
    ]
    with changed(
        *((o, "is_holdout", True) for o in others),
        (scene.render, "film_transparent", True),
        (scene.render.image_settings, "color_mode", 'RGBA'),
        (scene.cycles, "max_bounces", 0),
    ):
        render(scene, path, samples, engine=engine)
    return read_picture(path)[:, :, 3]
