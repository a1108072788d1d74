# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters from files: their place by the engine's own readers, pixels of images by Blender's.

Blender keeps 32- and 64-bit floats of TIFF files as they are, and divides whole numbers by the largest of their type
(measured with 5.2 and 4.5, both orders of bytes, BigTIFF too), as long as the image's color space is Non-Color.
"""

from __future__ import annotations

import struct
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...jobs import Progress
from ...places.geotiff import read_head
from ...places.projection import System, system_of
from ...places.rasters import Raster, check_regular, checked_size, read_ascii, without_nodata, world_file
from ..worker import steps_in_thread

ASCII, TIFF, PNG = (".asc", ".txt", ".grd"), (".tif", ".tiff"), (".png",)
#: For windows that choose files.
PATTERN = ";".join(f"*{ending}" for ending in (*ASCII, *TIFF, *PNG))
_PNG_HEAD = struct.Struct(">8s4x4sIIBB")  # signature, length and name of the first chunk, size, bits, colours
_MOST_FILE = 4_000_000_000


def read_raster(path: Path, code: int, factor: float, shift: float) -> Generator[Progress, Any, Raster]:
    """Read a raster; yields progress.

    Parameters
    ----------
    code : int
        EPSG code of its coordinates; 0 where the file tells.
    factor, shift : float
        Metres of a value, and what is added.

    Raises
    ------
    SceneError
        It is broken, or lacks a place.
    """
    ending = path.suffix.lower()
    progress = Progress(0.0, f"Reading {path.name}")
    yield progress
    try:
        if ending in ASCII:
            raster = yield from steps_in_thread(read_ascii(path), progress)
        elif ending in TIFF:
            raster = _tiff(path)
        elif ending in PNG:
            raster = _png(path)
        else:
            raise SceneError(f"{path.name}: use an ASCII grid (.asc), a GeoTIFF (.tif) or a PNG with a world file")
    except OSError as error:
        raise SceneError(f"{path.name}: cannot read the file: {error.strerror or error}") from None
    known = code or raster.system.code
    raster = replace(raster, system=system_of(known, f"{path.name}: ") if known else System())
    if not np.isfinite(raster.values).any():
        raise SceneError(f"{path.name}: none of its cells has a value")
    if (factor, shift) != (1.0, 0.0):
        raster = replace(raster, values=raster.values * np.float32(factor) + np.float32(shift))
    return raster


def _tiff(path: Path) -> Raster:
    head = read_head(path)
    corner, along, down, system = head.corner, head.along, head.down, head.system
    if corner is None:
        beside = world_file(path)
        if beside is None:
            raise SceneError(f"{path.name}: tag ModelPixelScale (33550) is missing, and there is no world file (.tfw)")
        corner, along, down, own = beside
        system = system if system.code else own
    values = _pixels(path, head.width, head.height) * np.float32(head.factor)
    if head.factor != 1.0:  # whole numbers, which must equal the one that stands for nothing
        values = np.rint(values)
    return Raster(without_nodata(values, head.nothing), corner, along, down, system)


def _png(path: Path) -> Raster:
    check_regular(path)
    with path.open("rb") as file:
        start = file.read(_PNG_HEAD.size)
    if len(start) < _PNG_HEAD.size or start[:8] != b"\x89PNG\r\n\x1a\n" or start[12:16] != b"IHDR":
        raise SceneError(f"{path.name}: this is no PNG file")
    *_, width, height, bits, colours = _PNG_HEAD.unpack(start)
    checked_size(width, height, f"{path.name}: ")
    if colours not in (0, 2) or bits not in (8, 16):
        raise SceneError(f"{path.name}: chunk IHDR: it must be gray, of 16 bits, without a palette and alpha")
    beside = world_file(path)
    if beside is None:
        raise SceneError(f"{path.name}: there is no world file (.pgw) that tells where it lies")
    corner, along, down, system = beside
    values = np.rint(_pixels(path, width, height) * np.float32(2**bits - 1))
    return Raster(values.astype(np.float32), corner, along, down, system)


def _pixels(path: Path, width: int, height: int) -> NDArray[np.float32]:
    """First channel of the pixels (h, w) of an image, the uppermost row first; nan stays nan."""
    if path.stat().st_size > _MOST_FILE:
        raise SceneError(f"{path.name}: larger than {_MOST_FILE:,} bytes; crop it")
    unreadable = (
        f"{path.name}: Blender cannot read its pixels; it is damaged, or compressed in a way that Blender does not "
        "know: write it anew, for example with gdal_translate -co COMPRESS=DEFLATE"
    )
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
