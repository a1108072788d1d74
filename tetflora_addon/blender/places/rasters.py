# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters from files: by the engine's own readers, and pixels of PNG by Blender's.

Blender divides whole numbers by the largest of their type, as long as the image's color space is Non-Color.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...files import read_whole
from ...jobs import Progress
from ...places.grids import ENDINGS, mosaic, read_grid
from ...places.projection import chosen_system
from ...places.rasters import MAX_CELLS, Raster, checked_size, in_degrees, world_file
from ..worker import call_in_thread, steps_in_thread
from .origin import Import

#: For windows that choose files.
PATTERN = ";".join(f"*{ending}" for ending in (*ENDINGS, ".png"))
_PNG_HEAD = struct.Struct(">8s4x4sIIBB")  # signature, length and name of the first chunk, size, bits, colours
_MOST_FILE = 4_000_000_000
_VOIDS = (-32768.0, -32767.0, -99999.0)  # what stands for nothing where no file says so
_MOST = 100_000.0  # metres above the sea or below it


def read_raster(order: Import, path: Path | None = None) -> Generator[Progress, Any, Raster]:
    """Read the raster of an import, its tiles as one; yields progress.

    Parameters
    ----------
    path : Path, optional
        Another file, which is read whole, in its place.

    Raises
    ------
    OSError
        One cannot be read.
    SceneError
        One is broken, or lacks a place.
    """
    tiles, paths, code = [], [order.path, *order.tiles] if path is None else [path], order.code
    for path in paths:
        progress = Progress(0.0, f"Reading {path.name}")
        yield progress
        if path.suffix.lower() in ENDINGS:
            raster = yield from steps_in_thread(read_grid(path), progress)
        elif path.suffix.lower() == ".png":
            raster = _png(path)
        else:
            raise SceneError(f"{path.name}: use a GeoTIFF (.tif), an ASCII grid (.asc), or one of {PATTERN}")
        what = f"{path.name}: "
        raster = replace(raster, system=chosen_system(code, raster.system, what))
        raster = raster if code else in_degrees(raster, what)
        raster.values[np.isin(raster.values, _VOIDS)] = np.nan
        if not np.isfinite(raster.values).any():
            raise SceneError(f"{what}none of its cells has a value")
        tiles.append(raster)
        if sum(tile.values.size for tile in tiles) > 2 * MAX_CELLS:
            raise SceneError(
                f"{what}with the {len(tiles) - 1:,} before it, more than {MAX_CELLS:,} cells; import fewer"
            )
    raster = yield from call_in_thread(Progress(0.5, "Joining tiles"), mosaic, tiles, [path.name for path in paths])
    if paths[0] == order.path and (box := order.box(raster.outline, raster.system)) is not None:
        raster = raster.part(raster.cells(box.corners))
        if min(raster.values.shape) < 2 or not np.isfinite(raster.values).any():
            raise order.nothing_left()
    if (order.factor, order.shift) != (1.0, 0.0):
        raster = replace(raster, values=raster.values * np.float32(order.factor) + np.float32(order.shift))
    low, high = (float(f(raster.values[np.isfinite(raster.values)])) for f in (np.min, np.max))
    if not -_MOST < low <= high < _MOST:
        raise SceneError(
            f"{paths[0].name}: its values are from {low:,.0f} to {high:,.0f} m, which nothing on Earth is; it is "
            "damaged, or in another unit: set Meters per Value"
        )
    return raster


def _png(path: Path) -> Raster:
    content = read_whole(path, _MOST_FILE)
    if len(content) < _PNG_HEAD.size or content[:8] != b"\x89PNG\r\n\x1a\n" or content[12:16] != b"IHDR":
        raise SceneError(f"{path.name}: this is no PNG file")
    *_, width, height, bits, colours = _PNG_HEAD.unpack(content[: _PNG_HEAD.size])
    checked_size(width, height, f"{path.name}: ")
    if colours not in (0, 2) or bits not in (8, 16):
        raise SceneError(f"{path.name}: chunk IHDR: it must be gray, of 16 bits, without a palette and alpha")
    at, name = 8, b""
    while name != b"IEND":  # Blender would make flat ground of what is damaged
        size, name = struct.unpack(">I4s", content[at : at + 8].ljust(8, b"\0"))
        end = at + 12 + size
        if end > len(content) or zlib.crc32(content[at + 4 : end - 4]) != int.from_bytes(content[end - 4 : end]):
            raise SceneError(f"{path.name}: byte {at:,}: it is damaged or was not copied whole")
        at = end
    beside = world_file(path)
    if beside is None:
        raise SceneError(f"{path.name}: there is no world file (.pgw) that tells where it lies")
    *place, system, unit = beside
    values = np.rint(_pixels(path, width, height) * np.float32(2**bits - 1))
    return Raster(values.astype(np.float32), *(place if system.code else [unit * v for v in place]), system)


def _pixels(path: Path, width: int, height: int) -> NDArray[np.float32]:
    """First channel of the pixels (h, w) of an image, the uppermost row first; nan stays nan."""
    unreadable = f"{path.name}: Blender cannot read its pixels; it is damaged"
    try:
        image = bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError:
        raise SceneError(unreadable) from None
    try:
        image.colorspace_settings.name = "Non-Color"
        if tuple(image.size) != (width, height) or not image.channels:
            raise SceneError(unreadable)
        pixels = np.zeros(width * height * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        return np.ascontiguousarray(pixels.reshape(height, width, -1)[::-1, :, 0])
    finally:
        bpy.data.images.remove(image)
