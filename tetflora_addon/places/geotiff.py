# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The few tags of a GeoTIFF that tell its size, its numbers, and where on Earth it lies.

Pixels are not read here. Tags are those of TIFF 6.0 (Adobe, 1992), its 64-bit kin BigTIFF, and OGC GeoTIFF 1.1 (OGC
19-008r4, 2019); the value that stands for "nothing known" is GDAL's.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, shown
from .projection import System
from .rasters import check_regular, checked_size

#: Tags: names for messages.
_WIDTH, _HEIGHT, _BITS, _BANDS, _FORMAT = 256, 257, 258, 277, 339
_STRIPS, _STRIP_BYTES, _TILES, _TILE_BYTES = 273, 279, 324, 325
_SCALE, _TIEPOINT, _MATRIX, _GEO, _NODATA = 33550, 33922, 34264, 34735, 42113
_NAMES = {
    _WIDTH: "ImageWidth",
    _HEIGHT: "ImageLength",
    _BITS: "BitsPerSample",
    _BANDS: "SamplesPerPixel",
    _FORMAT: "SampleFormat",
    _STRIPS: "StripOffsets",
    _STRIP_BYTES: "StripByteCounts",
    _TILES: "TileOffsets",
    _TILE_BYTES: "TileByteCounts",
    _SCALE: "ModelPixelScale",
    _TIEPOINT: "ModelTiepoint",
    _MATRIX: "ModelTransformation",
    _GEO: "GeoKeyDirectory",
    _NODATA: "GDAL_NODATA",
}
#: Types of values: letter for `struct`; others, such as fractions, occur in none of these tags.
_TYPES = {1: "B", 2: "s", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 11: "f", 12: "d", 16: "Q", 17: "q"}
_MOST_TAGS, _MOST_BYTES = 4096, 64_000_000
#: Keys of the directory of geographic keys: kind of model, whether values belong to points, codes, unit of length.
_MODEL, _RASTER, _GEOGRAPHIC, _PROJECTED, _UNIT = 1024, 1025, 2048, 3072, 3076
_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
_OWN = 32767  # "user-defined"
#: What Blender makes 1 of: largest values of whole numbers by bits and sign.
_LARGEST = {
    (8, 1): 255.0,
    (16, 1): 65535.0,
    (32, 1): 4294967295.0,
    (16, 2): 32767.0,
    (32, 2): 2147483647.0,
    (32, 3): 1.0,
    (64, 3): 1.0,
}


@dataclass(frozen=True)
class Head:
    """What a GeoTIFF says about its pixels.

    Attributes
    ----------
    width, height : int
    factor : float
        By what Blender divides values.
    nothing : float or None
        Value of pixels of which nothing is known.
    corner, along, down : (2,) float64, or None for all
        As of `rasters.Raster`, in metres or degrees.
    system : System
        Only its code: 0 where the file has none or one of its own.
    """

    width: int
    height: int
    factor: float
    nothing: float | None
    corner: NDArray[np.float64] | None
    along: NDArray[np.float64] | None
    down: NDArray[np.float64] | None
    system: System


def read_head(path: Path) -> Head:
    """Read and check the tags of a file.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken, or of a kind that cannot be used; names the tag.
    """
    check_regular(path)
    size = path.stat().st_size
    with path.open("rb") as file:
        tags = _Tags(file, size, path.name)
        return tags.head()


class _Tags:
    """Tags of the first image of a file."""

    def __init__(self, file: Any, size: int, name: str) -> None:
        self.file, self.size, self.name = file, size, name
        start = self._bytes(0, 16 if size >= 16 else 8, "head")
        order = {b"II": "<", b"MM": ">"}.get(start[:2])
        version = struct.unpack(f"{order}H", start[2:4])[0] if order else 0
        if version not in (42, 43) or (version == 43 and start[4:8] != struct.pack(f"{order}HH", 8, 0)):
            raise SceneError(f"{name}: this is no TIFF file")
        self.order, self.big = order, version == 43
        if self.big and len(start) < 16:
            raise SceneError(f"{name}: head: the file ends within it")
        offset = self._unpack("Q", start[8:16]) if self.big else self._unpack("I", start[4:8])
        self.found = self._directory(offset)

    def _bytes(self, offset: int, number: int, what: str) -> bytes:
        if offset + number > self.size or number > _MOST_BYTES:
            raise SceneError(f"{self.name}: {what}: the file ends before it; it is damaged or was not copied whole")
        self.file.seek(offset)
        return self.file.read(number)

    def _unpack(self, letter: str, data: bytes) -> int:
        return struct.unpack(self.order + letter, data)[0]

    def _directory(self, offset: int) -> dict[int, tuple[int, int, bytes]]:
        """Type, number of values, and the bytes that hold them or where they are, of the tags that are known here."""
        count, wide, entry = ("Q", 8, 20) if self.big else ("H", 2, 12)
        number = self._unpack(count, self._bytes(offset, wide, "directory"))
        if not 0 < number <= _MOST_TAGS:
            raise SceneError(f"{self.name}: directory: {number:,} tags; it is damaged")
        data = self._bytes(offset + wide, number * entry, "directory")
        found = {}
        for at in range(0, number * entry, entry):
            tag, kind = struct.unpack(self.order + "HH", data[at : at + 4])
            middle = at + 4 + (8 if self.big else 4)
            if tag in _NAMES:
                many = self._unpack("Q" if self.big else "I", data[at + 4 : middle])
                found[tag] = kind, many, data[middle : at + entry]
        return found

    def values(self, tag: int) -> tuple | bytes | None:
        """Values of a tag, a text as bytes; None where there is no such tag."""
        if tag not in self.found:
            return None
        kind, number, here = self.found[tag]
        if kind not in _TYPES or not number:
            raise self.broken(tag, "has values of a type that it cannot have")
        letter = _TYPES[kind]
        size = number * struct.calcsize(letter)
        if size > len(here):
            here = self._bytes(self._unpack("Q" if self.big else "I", here), size, _NAMES[tag])
        out = struct.unpack(f"{self.order}{number}{letter}", here[:size])
        return out[0] if letter == "s" else out

    def numbers(self, tag: int, least: int) -> tuple | None:
        """Finite values of a tag, at least so many."""
        values = self.values(tag)
        if values is not None and (
            isinstance(values, bytes) or len(values) < least or not all(math.isfinite(v) for v in values)
        ):
            raise self.broken(tag, f"must be {least} finite numbers or more")
        return values

    def broken(self, tag: int, text: str) -> SceneError:
        """The error of a tag."""
        return SceneError(f"{self.name}: tag {_NAMES[tag]} ({tag}) {text}")

    def head(self) -> Head:
        """All that is asked of a file."""
        width, height = (self._one(tag) for tag in (_WIDTH, _HEIGHT))
        checked_size(width, height, f"{self.name}: ")
        bands = self._one(_BANDS, 1)
        if bands != 1:
            raise self.broken(_BANDS, f"is {bands}; write one band only, for example with gdal_translate -b 1")
        bits, form = self._one(_BITS, 1), self._one(_FORMAT, 1)
        if (bits, form) not in _LARGEST:
            raise self.broken(
                _BITS,
                f"is {bits}, of format {form}; write 32-bit floats, for example with gdal_translate -ot Float32",
            )
        self._check_pixels()
        place = self._place()
        geo = self._keys()
        unit = _UNITS.get(geo.get(_UNIT, 9001), 1.0)
        code = geo.get(_GEOGRAPHIC if geo.get(_MODEL) == 2 else _PROJECTED, 0)
        code = 0 if code == _OWN else code
        if place is not None:
            corner, along, down = place
            if geo.get(_RASTER, 1) != 2:  # values belong to areas, whose corner is told
                corner = corner + (along + down) / 2.0
            place = (corner, along, down) if code else tuple(unit * v for v in (corner, along, down))
        return Head(width, height, _LARGEST[bits, form], self._nothing(), *(place or (None, None, None)), System(code))

    def _one(self, tag: int, default: int | None = None) -> int:
        values = self.numbers(tag, 1)
        if values is None:
            if default is None:
                raise SceneError(f"{self.name}: tag {_NAMES[tag]} ({tag}) is missing")
            return default
        if int(values[0]) != values[0] or values[0] < 0:
            raise self.broken(tag, f"is {shown(values[0])}")
        return int(values[0])

    def _check_pixels(self) -> None:
        """All pieces of the image must lie within the file."""
        where, size = (_TILES, _TILE_BYTES) if _TILES in self.found else (_STRIPS, _STRIP_BYTES)
        offsets, sizes = self.numbers(where, 1), self.numbers(size, 1)
        if offsets is None or sizes is None:
            raise SceneError(f"{self.name}: tag {_NAMES[where]} ({where}) is missing")
        if len(offsets) != len(sizes) or any(
            a < 0 or b < 0 or a + b > self.size for a, b in zip(offsets, sizes, strict=True)
        ):
            raise self.broken(where, "leads beyond the end of the file; it is damaged or was not copied whole")

    def _place(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        matrix = self.numbers(_MATRIX, 16)
        if matrix is not None:
            m = np.array(matrix[:16], np.float64).reshape(4, 4)
            place, tag = (m[:2, 3], m[:2, 0], m[:2, 1]), _MATRIX
        else:
            scale, tie, tag = self.numbers(_SCALE, 2), self.numbers(_TIEPOINT, 6), _SCALE
            if scale is None or tie is None:
                return None
            along, down = np.array([scale[0], 0.0]), np.array([0.0, -scale[1]])
            place = np.array(tie[3:5]) - tie[0] * along - tie[1] * down, along, down
        if not np.abs(np.concatenate(place)).max() < 1e10 or not abs(np.linalg.det(np.stack(place[1:]))) > 0.0:
            raise self.broken(tag, "gives cells without a size or a place")
        return place

    def _keys(self) -> dict[int, int]:
        """Geographic keys whose values are in the directory itself."""
        values = self.numbers(_GEO, 4)
        if values is None:
            return {}
        if len(values) < 4 + 4 * int(values[3]):
            raise self.broken(_GEO, f"tells of {values[3]} keys and is too short for them")
        keys = np.array(values[4 : 4 + 4 * int(values[3])], np.int64).reshape(-1, 4)
        return {int(key): int(value) for key, place, _, value in keys if place == 0}

    def _nothing(self) -> float | None:
        text = self.values(_NODATA)
        if text is None:
            return None
        try:
            return float(text.split(b"\0")[0])
        except (ValueError, AttributeError):
            raise self.broken(_NODATA, f"is {shown(text)}, which is not a number") from None
