# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of images as arrays of numbers, which they are not always: a sun in an EXR may be infinite."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray


def image_pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    """Pixels (height, width, channels) of an image that has some, row 0 lowest, in its own colour space.

    One with a channel that is infinite or no number is black and transparent, as in Cycles.
    """
    width, height, channels = *image.size, image.channels
    pixels = np.zeros(width * height * channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, channels)
    if image.is_float:
        pixels[~np.isfinite(pixels).all(axis=2)] = 0.0
    return pixels


def linear_rgb(image: bpy.types.Image, pixels: NDArray[np.floating]) -> NDArray[np.floating]:
    """Linear RGB (..., 3) of some pixels (..., channels) of an image."""
    colour = pixels[..., :3] if pixels.shape[-1] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    if image.colorspace_settings.name == "sRGB" and not image.is_float:
        colour = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return colour
