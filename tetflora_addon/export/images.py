# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures of exported plants: atlases of leaves and wood in their colors, and PNG files.

Formats have no node that would vary the color from leaf to leaf. So the colors of a species' leaves are clustered to a
few, an atlas has a cell for each of them, and texture coordinates of a leaf lie in the cell nearest to its color.

Source of the file format: W3C, "Portable Network Graphics (PNG) Specification (Third Edition)".
"""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, srgb_of
from ..buffers import MeshBuffers
from .levels import PlantLevel, corner_triangles

#: Texels to a side of a cell, and by which part of these its content is within it, so that what lies beside an outline
#: is of its color in coarser levels of the texture.
TEXELS, MARGIN = 256, 8
#: Columns and rows of cells: of leaves, and of wood, whose coordinates repeat along a branch.
_LEAVES, _WOOD = (4, 4), (4, 1)
_ROUNDS, _SAMPLE = 8, 50_000


@dataclass(frozen=True)
class Palette:
    """Colors of leaves or wood, each of a cell, and the rectangle of texture coordinates that cells show."""

    colors: Floats32  # (k, 3): linear RGB
    low: Floats  # (2,)
    size: Floats  # (2,)
    grid: tuple[int, int]  # columns and rows

    def cells_of(self, color: Floats32) -> Integers:
        """Cells (n,) nearest to colors (n, 3)."""
        return ((color[:, None] - self.colors) ** 2).sum(axis=2).argmin(axis=1)

    def placed(self, uv: Floats32, cell: Integers) -> Floats32:
        """Texture coordinates (n, 2) in the atlas, from those of leaves or wood and their cells (n,)."""
        columns, rows = self.grid
        margin = MARGIN / TEXELS
        inside = margin + np.clip((uv - self.low) / self.size, 0.0, 1.0) * (1.0 - 2.0 * margin)
        u = (cell % columns + inside[:, 0]) / columns
        v = uv[:, 1] if rows == 1 else (cell // columns + inside[:, 1]) / rows
        return np.stack([u, v], axis=1).astype(np.float32)


def palette_of(meshes: Sequence[MeshBuffers], wood: bool) -> Palette:
    """Colors that are nearest to those of all faces of meshes, by clusters, and where their coordinates lie."""
    every = np.concatenate([mesh.attributes["tf_color"][1] for mesh in meshes])
    uv = np.concatenate([mesh.attributes["UVMap"][1] for mesh in meshes])
    sample = every[:: max(len(every) // _SAMPLE, 1)]
    grid = _WOOD if wood else _LEAVES
    number = grid[0] * grid[1]
    bright = np.argsort(sample.sum(axis=1), kind="stable")
    colors = sample[bright[np.linspace(0, len(sample) - 1, number).astype(int)]]
    for _ in range(_ROUNDS):
        cell = ((sample[:, None] - colors) ** 2).sum(axis=2).argmin(axis=1)
        count = np.bincount(cell, minlength=number)[:, None]
        sums = np.stack([np.bincount(cell, column, number) for column in sample.T], axis=1)
        colors = np.where(count > 0, sums / np.maximum(count, 1), colors).astype(np.float32)
    if wood:  # once around a branch, and a meter along it
        return Palette(colors, np.zeros(2), np.ones(2), grid)
    low = uv.min(axis=0).astype(np.float64)
    return Palette(colors, low, np.maximum(uv.max(axis=0) - low, 1e-6), grid)


def in_atlas(level: PlantLevel, palettes: dict[str, Palette]) -> PlantLevel:
    """A level whose leaves have texture coordinates of atlases, by the kind of parts."""
    parts = []
    for kind, mesh in level.parts:
        if kind in palettes:
            palette = palettes[kind]
            cell = np.repeat(palette.cells_of(mesh.attributes["tf_color"][1]), np.diff(mesh.face_offsets))
            uv = palette.placed(mesh.attributes["UVMap"][1], cell)
            mesh = replace(mesh, attributes={**mesh.attributes, "UVMap": ("CORNER", uv)})
        parts.append((kind, mesh))
    return replace(level, parts=tuple(parts))


def outline(palette: Palette, mesh: MeshBuffers, faces: int = 4000) -> NDArray[np.bool_]:
    """Texels (t, t) of a cell that some faces of a mesh cover."""
    owner, corner = corner_triangles(mesh)
    uv = palette.placed(mesh.attributes["UVMap"][1], np.zeros(len(mesh.corner_verts), np.int64))[corner[owner < faces]]
    shown = np.zeros((TEXELS, TEXELS), bool)
    flat = np.unique(np.round(uv * (np.array(palette.grid) * TEXELS) - 0.5, 2), axis=0)
    for a, b, c in flat:
        low = np.floor(np.minimum(np.minimum(a, b), c)).astype(int).clip(0, TEXELS - 1)
        high = np.ceil(np.maximum(np.maximum(a, b), c)).astype(int).clip(0, TEXELS - 1)
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        inside = np.all([s >= -0.5 for s in sides], axis=0) | np.all([s <= 0.5 for s in sides], axis=0)
        shown[y[inside], x[inside]] = True
    return grown(shown, 2)


def grown(shown: NDArray[np.bool_], texels: int) -> NDArray[np.bool_]:
    """A shape that is larger by so many texels all around."""
    for _ in range(texels):
        padded = np.pad(shown, 1)
        shown = padded[1:-1, 1:-1] | padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    return shown


def atlas(palette: Palette, detail: Floats32) -> Floats32:
    """Texels (h, w, 3) of an atlas, row 0 lowest, linear RGB, by factors (t, t, 3) on colors."""
    columns, rows = palette.grid
    colors = palette.colors.reshape(rows, 1, columns, 1, 3)
    return (colors * detail[:, None]).reshape(rows * TEXELS, columns * TEXELS, 3)


def within(detail: Floats32) -> Floats32:
    """A square (t, t, n) as a cell has it, smaller by its margin, beside which it goes on as at its border."""
    inner = TEXELS - 2 * MARGIN
    texels = np.clip((np.arange(TEXELS) - MARGIN + 0.5) / inner * len(detail), 0, len(detail) - 1).astype(int)
    return detail[texels][:, texels]


def tiled(texels: Floats32) -> Floats32:
    """A texture (h, w, n) that repeats along its height without a seam: it goes over into itself."""
    h = len(texels)
    part = h // 4
    blend = np.linspace(0.0, 1.0, part, dtype=np.float32)[:, None, None]
    out = np.roll(texels, h // 2, axis=0)  # its seam is in the middle now, and what was there has none
    seam = slice(h // 2 - part // 2, h // 2 - part // 2 + part)
    ramp = 1.0 - np.abs(2.0 * blend - 1.0)
    out[seam] = out[seam] * (1.0 - ramp) + texels[seam] * ramp
    return out


def halved(texels: Floats32) -> Floats32:
    """Texels of an image of half the size."""
    h, w, n = texels.shape
    return texels.reshape(h // 2, 2, w // 2, 2, n).mean(axis=(1, 3))


def png(texels: Floats32, linear: bool = False) -> bytes:
    """A PNG file of texels (h, w, n) from 0 to 1, row 0 lowest; stored as sRGB, unless numbers mean no colors."""
    height, width, channels = texels.shape
    values = np.clip(texels[::-1], 0.0, 1.0).astype(np.float64)
    if not linear:
        values[..., :3] = srgb_of(values[..., :3])
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each begins with the number of its filter
    rows[:, 1:] = np.rint(values * 255.0).astype(np.uint8).reshape(height, -1)
    kind = {1: 0, 3: 2, 4: 6}[channels]
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows.tobytes(), 6)),
        (b"IEND", b""),
    )
    chunks = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)
