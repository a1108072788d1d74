# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Images as pyramids of ever coarser copies, so that one look at the right copy is the mean over a piece of it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..attributes import image_pixels, linear_rgb

#: Columns or rows of the finest copy that is kept; finer ones say nothing about whole faces of a plant.
MOST_TEXELS = 2048
#: Pixels that are worked on at once, so that they stay in the processor's cache.
_PIXELS = 1 << 16
#: Bytes of pyramids that are kept for the next material.
_MOST_BYTES = 512 << 20


@dataclass(frozen=True)
class Pyramid:
    """Copies of an image, each half as wide as the one before.

    Attributes
    ----------
    texels : (n,) uint64
        Of all copies; each is four float16: linear RGB times alpha, and alpha.
    start, columns, rows : (l,) int32
        First texel, and size, of each copy.
    width, height : (l,) float32
        Texels that the whole image would be wide and high in each copy; of sizes that are no power of two, the last
        texels stick out.
    """

    texels: NDArray[np.uint64]
    start: NDArray[np.int32]
    columns: NDArray[np.int32]
    rows: NDArray[np.int32]
    width: NDArray[np.float32]
    height: NDArray[np.float32]

    @property
    def side(self) -> float:
        """Texels across in the finest copy: the root of their number."""
        return float(np.sqrt(self.width[0] * self.height[0]))

    @property
    def levels(self) -> int:
        """Number of copies l."""
        return len(self.start)

    def look(
        self, u: NDArray[np.float32], v: NDArray[np.float32], size: NDArray[np.float32], extension: str
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean colours (3, p, k) and alpha (p, k) around some points.

        Parameters
        ----------
        u, v : (p, k) or (1, 1) float32
        size : (1, k) float32
            Side of the square that counts, in units of the image.
        extension : {'REPEAT', 'EXTEND', 'CLIP', 'MIRROR'}
        """
        with np.errstate(divide="ignore"):
            # Of long images the short side counts: more noise, but nothing from beside the square.
            level = np.floor(np.log2(size * min(self.width[0], self.height[0])))
        level = np.clip(np.nan_to_num(level), 0, self.levels - 1).astype(np.int32)
        outside = None
        if extension == 'CLIP':
            outside = (u < 0) | (u > 1) | (v < 0) | (v > 1)
        x, x0, x1 = _columns(u, self.width[level], self.columns[level], extension)
        y, y0, y1 = _columns(v, self.height[level], self.rows[level], extension)
        first, stride = self.start[level], self.columns[level]
        low, high = first + y0 * stride, first + y1 * stride
        found = self._texels(low + x0) * ((1 - x) * (1 - y))[..., None]
        found += self._texels(low + x1) * (x * (1 - y))[..., None]
        found += self._texels(high + x0) * ((1 - x) * y)[..., None]
        found += self._texels(high + x1) * (x * y)[..., None]
        if outside is not None:
            found[outside] = 0
        colour, alpha = np.ascontiguousarray(np.moveaxis(found[..., :3], -1, 0)), found[..., 3].copy()
        return colour / np.maximum(alpha, 1e-6), alpha

    def _texels(self, index: NDArray[np.int32]) -> NDArray[np.float32]:
        return np.take(self.texels, index).view(np.float16).reshape(*index.shape, 4).astype(np.float32)


def _columns(
    u: NDArray[np.float32], width: NDArray[np.float32], columns: NDArray[np.int32], extension: str
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int32]]:
    """Of one axis: where between two texels, and both of these."""
    if extension == 'REPEAT':
        u = u - np.floor(u)
    elif extension == 'MIRROR':
        u = 1 - np.abs(1 - (u - 2 * np.floor(u * np.float32(0.5))))
    else:
        u = np.clip(u, 0, 1)
    x = u * width - np.float32(0.5)
    whole = np.floor(x)
    x -= whole
    first = whole.astype(np.int32)
    second = first + 1
    if extension == 'REPEAT':
        first = np.where(first < 0, columns - 1, np.minimum(first, columns - 1))
        return x, first, np.where(second >= columns, 0, second)
    return x, np.clip(first, 0, columns - 1), np.clip(second, 0, columns - 1)


class Pyramids:
    """Pyramids of images, each read once; all are forgotten when they take too much memory."""

    def __init__(self, most: int = MOST_TEXELS) -> None:
        self._most = most
        self._known: dict[tuple[bpy.types.Image, bool], Pyramid | None] = {}

    def of(self, image: bpy.types.Image, weighted: bool) -> Pyramid | None:
        """The pyramid of an image, see `pyramid_of`."""
        key = image, weighted
        if key not in self._known:
            if sum(p.texels.nbytes for p in self._known.values() if p is not None) > _MOST_BYTES:
                self._known.clear()
            self._known[key] = pyramid_of(image, weighted, self._most)
        return self._known[key]


def pyramid_of(image: bpy.types.Image, weighted: bool, most: int = MOST_TEXELS) -> Pyramid | None:
    """The pyramid of an image; None if it has no pixels.

    Parameters
    ----------
    image : bpy.types.Image
    weighted : bool
        Whether its alpha counts: coarser copies then have the colour of what is not transparent.
    most : int
        If less than `MOST_TEXELS`, only about as many columns or rows are looked at.
    """
    if not (all(image.size) and image.channels):
        return None
    pixels = image_pixels(image)
    if most < MOST_TEXELS:
        # An odd step, so that a power of two of columns does not make a few of them stand for all.
        step = max(1, max(image.size) // most) | 1
        pixels = pixels[::step, ::step]
    height, width = pixels.shape[:2]
    halvings = max(0, int(np.ceil(np.log2(max(width, height) / MOST_TEXELS))))
    levels = [_finest(image, pixels, weighted, halvings)]
    widths = [np.array([width, height], np.float32) / (1 << halvings)]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(levels[-1]))
        widths.append(widths[-1] / 2)
    sizes = [level.shape[0] * level.shape[1] for level in levels]
    texels = np.concatenate([level.astype(np.float16).reshape(-1, 4) for level in levels])
    return Pyramid(
        texels=texels.view(np.uint64).reshape(-1),
        start=np.cumsum([0, *sizes[:-1]]).astype(np.int32),
        columns=np.array([level.shape[1] for level in levels], np.int32),
        rows=np.array([level.shape[0] for level in levels], np.int32),
        width=np.array(widths, np.float32)[:, 0],
        height=np.array(widths, np.float32)[:, 1],
    )


def _finest(image: bpy.types.Image, pixels: NDArray[np.float32], weighted: bool, halvings: int) -> NDArray[np.float16]:
    """The finest copy that is kept (h, w, 4): linear RGB times alpha, and alpha."""
    height, width, channels = pixels.shape
    # Eight bits have 256 values: a table is ten times as fast as a power.
    table = None if image.is_float else linear_rgb(image, np.linspace(0, 1, 256, dtype=np.float32)[:, None])[:, 0]
    table = None if table is None else table.astype(np.float32)
    has_alpha = channels == 4 and image.alpha_mode != 'NONE'
    # Pixels of floating point images are multiplied by their alpha already.
    associated = image.is_float and image.alpha_mode != 'CHANNEL_PACKED'
    step = max(1 << halvings, _PIXELS // width >> halvings << halvings)
    found = np.zeros((-(-height // (1 << halvings)), -(-width // (1 << halvings)), 4), np.float16)
    for row in range(0, height, step):
        block = pixels[row : row + step]
        alpha = np.clip(block[..., 3:], 0, 1) if has_alpha else None
        if table is None:
            out = np.ones((*block.shape[:2], 4), np.float32)
            out[..., :3] = np.clip(linear_rgb(image, block), 0, 60_000)
        else:
            block = np.broadcast_to(block[..., :1], (*block.shape[:2], 4)) if channels < 3 else block
            out = np.take(table, (block * np.float32(255) + np.float32(0.5)).astype(np.uint8))
            out = np.concatenate([out, np.ones_like(out[..., :1])], axis=2) if channels == 3 else out
        if has_alpha and associated:
            out /= np.maximum(alpha, 1e-6)
        if has_alpha and weighted:
            out *= alpha
            out[..., 3:] = alpha
        else:
            out[..., 3] = 1
        for _ in range(halvings):
            out = _halved(out)
        start = row >> halvings
        found[start : start + len(out)] = np.minimum(out, np.float32(60_000))
    return found


def _halved(level: NDArray[np.floating]) -> NDArray[np.float32]:
    """Half as many columns and rows; the last ones count twice where their number is odd."""
    height, width = level.shape[:2]
    level = np.pad(level, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge") if height % 2 or width % 2 else level
    halves = level[0::2].astype(np.float32) + level[1::2]
    return (halves[:, 0::2] + halves[:, 1::2]) * np.float32(0.25)
