# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GeoTIFF: what its values are, and where on Earth they lie.

Tags are those of TIFF 6.0 (Adobe, 1992), its 64-bit kin BigTIFF, and OGC GeoTIFF 1.1 (OGC 19-008r4, 2019); what stands
for "nothing known", scale and offset are GDAL's.
"""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, shown
from ..jobs import Progress
from .methods import Definition, Ellipsoid
from .pixels import Layout, read_pixels
from .prj import described, system_in, utm_zone
from .projection import System, known_systems
from .rasters import Raster, check_regular, checked_size, system_beside, without_nodata, world_file

_TABLES: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_name("geotiff.json").read_text(encoding="utf-8"))
#: Names of tags and of geographic keys by their numbers, and numbers of tags by their names.
_TAGS, _KEYS = ({int(number): name for number, name in _TABLES[kind].items()} for kind in ("tags", "keys"))
_NUMBERS = {name: number for number, name in _TAGS.items()}
#: Types of values: letter for `struct`; others, such as fractions, occur in none of these tags.
_TYPES = {1: "B", 2: "s", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 11: "f", 12: "d", 16: "Q", 17: "q"}
_MOST_TAGS, _MOST_BYTES = 4096, 64_000_000
_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
_OWN, _UTM_ZONES = 32767, 16000  # "user-defined"; and 16100 in the south
#: Types of values: letter for `numpy.dtype` by format.
_LETTERS = {1: "u", 2: "i", 3: "f"}
_SIZES = {1: (8, 16, 32, 64), 2: (8, 16, 32, 64), 3: (16, 32, 64)}
_MOST_IMAGES, _PALETTE = 64, 3
_LARGEST_PIECE, _MOST_PIECE = 65_536, 50_000_000  # pixels of a side, and of a strip or tile


def read_tiff(path: Path) -> Generator[Progress, object, Raster]:
    """Read a GeoTIFF, or a TIFF with a world file; yields progress.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        It is broken, or of a kind that cannot be used; names the tag.
    """
    check_regular(path)
    with path.open("rb") as file:
        tags = _Tags(file, path.stat().st_size, path.name)
        tags.check_kind()
        (place, system), notes = _place(path, tags), []
        values, absent = yield from tags.pixels()
        mask = yield from tags.mask(values.shape)
        if mask is not None:
            absent |= ~mask
        if (nothing := tags.nothing()) is not None:
            absent |= values == nothing
        values = without_nodata(values.astype(np.float32), nothing if values.dtype.kind == "f" else None)
        values[absent] = np.nan
        scale, offset = tags.scale()
        height = _UNITS.get(tags.keys().get("VerticalUnits", 9001), 1.0)
        if (scale, offset, height) != (1.0, 0.0, 1.0):
            values = without_nodata((values * scale + offset) * np.float32(height), None)
            notes += ["scale and offset of the file used"] * ((scale, offset) != (1.0, 0.0))
            notes += ["heights in feet read as such"] * (height != 1.0)
        if tags.one("PhotometricInterpretation", 1) == _PALETTE:
            notes.append("its values are numbers of colors in a palette; check that they are heights")
        return Raster(values, *place, system, tuple(notes))


def place_of_image(path: Path) -> Raster:
    """Where the pixels of an image lie, as a raster of one value: a TIFF by its tags, others by world files.

    Raises
    ------
    OSError, SceneError
        As `read_tiff`.
    """
    check_regular(path)
    if path.suffix.lower() not in (".tif", ".tiff"):
        place, system = _place(path)
    else:
        with path.open("rb") as file:
            place, system = _place(path, _Tags(file, path.stat().st_size, path.name))
    return Raster(np.zeros((1, 1), np.float32), *place, system)


def _place(path: Path, tags: _Tags | None = None) -> tuple[list[NDArray[np.float64]], System]:
    """Middle of the first pixel, steps along and down, and the system, by tags or else by files beside the image."""
    place, system = (tags.place(), tags.system()) if tags is not None else (None, System())
    return world_file(path) if place is None else place, system_beside(path) if system == System() else system


class _Tags:
    """Tags of the first image of a file."""

    def __init__(self, file: Any, size: int, name: str) -> None:
        self.file, self.size, self.name = file, size, name
        start = self._bytes(0, 16 if size >= 16 else 8, "head")
        order = {b"II": "<", b"MM": ">"}.get(start[:2])
        version = struct.unpack(f"{order}H", start[2:4])[0] if order else 0
        if version not in (42, 43) or (version == 43 and start[4:8] != struct.pack(f"{order}HH", 8, 0)):
            raise SceneError(f"{name}: this is no TIFF file; export it as GeoTIFF")
        if version == 43 and len(start) < 16:
            raise SceneError(f"{name}: head: the file ends within it; get it again")
        # Letter and bytes of offsets.
        self.order, self.letter, self.wide, self.next = order, *(("Q", 8, 0) if version == 43 else ("I", 4, 0))
        self.found = self._directory(self._unpack(self.letter, start[self.wide : 2 * self.wide]))

    def _bytes(self, offset: int, number: int, what: str) -> bytes:
        """A part of the file; what it is begins the message if it is not there."""
        if offset + number > self.size or number > _MOST_BYTES:
            raise SceneError(
                f"{self.name}: {what}: the file ends before it; it is damaged or was not copied whole; get it again"
            )
        self.file.seek(offset)
        return self.file.read(number)

    def _unpack(self, letter: str, data: bytes) -> int:
        """A number in the order of bytes that the file has."""
        return struct.unpack(self.order + letter, data)[0]

    def _directory(self, offset: int) -> dict[int, tuple[int, int, bytes]]:
        """Type, number of values, and the bytes that hold them or where they are, of the tags that are known here."""
        count, size = ("Q", 8) if self.wide == 8 else ("H", 2)
        entry = 4 + 2 * self.wide
        number = self._unpack(count, self._bytes(offset, size, "directory"))
        if not 0 < number <= _MOST_TAGS:
            raise SceneError(f"{self.name}: directory: {number:,} tags; it is damaged; get it again")
        data = self._bytes(offset + size, number * entry, "directory")
        after = offset + size + number * entry
        there = after + self.wide <= self.size
        self.next = self._unpack(self.letter, self._bytes(after, self.wide, "directory")) if there else 0
        found = {}
        for at in range(0, number * entry, entry):
            tag, kind = struct.unpack(self.order + "HH", data[at : at + 4])
            middle = at + 4 + self.wide
            if tag in _TAGS:
                many = self._unpack(self.letter, data[at + 4 : middle])
                found[_TAGS[tag]] = kind, many, data[middle : at + entry]
        return found

    def values(self, tag: str) -> tuple | bytes | None:
        """Values of a tag, a text as bytes; None where there is no such tag."""
        if tag not in self.found:
            return None
        kind, number, here = self.found[tag]
        if kind not in _TYPES or not number:
            raise self.broken(tag, "has values of a type that it cannot have")
        letter = _TYPES[kind]
        size = number * struct.calcsize(letter)
        if size > len(here):
            here = self._bytes(self._unpack(self.letter, here[: self.wide]), size, tag)
        out = struct.unpack(f"{self.order}{number}{letter}", here[:size])
        return out[0] if letter == "s" else out

    def numbers(self, tag: str, least: int) -> tuple | None:
        """Finite values of a tag, at least so many."""
        values = self.values(tag)
        if values is not None and (
            isinstance(values, bytes) or len(values) < least or not all(math.isfinite(v) for v in values)
        ):
            raise self.broken(tag, f"must be {least} finite numbers or more")
        return values

    def broken(self, tag: str, text: str) -> SceneError:
        """The error of a tag."""
        return SceneError(f"{self.name}: tag {tag} ({_NUMBERS[tag]}) {text}")

    def check_kind(self) -> None:
        """Refuse what has no values that can be heights."""
        bands = self.one("SamplesPerPixel", 1)
        extra = self.numbers("ExtraSamples", 1) or ()
        if bands != 1 and not (bands == 2 and extra and extra[0] in (1, 2)):
            raise self.broken(
                "SamplesPerPixel", f"is {bands}; write one band only, for example with gdal_translate -b 1"
            )
        self._layout()

    def _layout(self) -> Layout:
        """How the pixels lie in the file."""
        width, height = self.one("ImageWidth"), self.one("ImageLength")
        checked_size(width, height, f"{self.name}: ")
        bits, form = self.one("BitsPerSample", 1), self.one("SampleFormat", 1)
        form = 1 if form == 4 else form
        if bits not in _SIZES.get(form, ()) and not (bits == 1 and self.one("NewSubfileType", 0) & 4):
            raise self.broken(
                "BitsPerSample",
                f"is {bits}, of format {form}; write 32-bit floats, for example with gdal_translate -ot Float32",
            )
        tiled = "TileOffsets" in self.found
        across = self.one("TileWidth") if tiled else width
        down = self.one("TileLength") if tiled else min(self.one("RowsPerStrip", height), height)
        if not (0 < across <= _LARGEST_PIECE and 0 < down <= _LARGEST_PIECE and across * down <= _MOST_PIECE):
            raise self.broken(
                "TileWidth" if tiled else "RowsPerStrip", f"gives pieces of {across:,} by {down:,} pixels"
            )
        samples = 1 if self.one("PlanarConfiguration", 1) == 2 else self.one("SamplesPerPixel", 1)
        dtype = np.dtype(f"{self.order}{_LETTERS[form]}{max(bits // 8, 1)}")
        return Layout(
            width, height, across, down, tiled, bits, samples, dtype,
            self.one("Compression", 1), self.one("Predictor", 1), self.one("FillOrder", 1) == 2,
        )  # fmt: skip

    def pixels(self) -> Generator[Progress, object, tuple[NDArray[Any], NDArray[np.bool_]]]:
        """As `read_pixels`."""
        kind = "Tile" if "TileOffsets" in self.found else "Strip"
        where = f"{kind}Offsets"
        offsets, sizes = self.numbers(where, 1), self.numbers(f"{kind}ByteCounts", 1)
        if offsets is None or sizes is None:
            raise SceneError(f"{self.name}: tag {where} ({_NUMBERS[where]}) is missing; export the file again")
        if len(offsets) != len(sizes) or any(
            a < 0 or b < 0 or a + b > self.size for a, b in zip(offsets, sizes, strict=True)
        ):
            raise self.broken(
                where, "leads beyond the end of the file; it is damaged or was not copied whole; get it again"
            )
        return (yield from read_pixels(self.file, self._layout(), offsets, sizes, self.name))

    def mask(self, shape: tuple[int, int]) -> Generator[Progress, object, NDArray[np.bool_] | None]:
        """Which pixels count, (h, w), by a mask that is another image of the file; None without one."""
        own, seen = self.found, set()
        try:
            while self.next and self.next not in seen and len(seen) < _MOST_IMAGES:
                seen.add(self.next)
                self.found = self._directory(self.next)
                if self.one("NewSubfileType", 0) & 4 and (self.one("ImageLength"), self.one("ImageWidth")) == shape:
                    values, absent = yield from self.pixels()
                    return (values != 0) & ~absent
        finally:
            self.found = own
        return None

    def scale(self) -> tuple[np.float32, np.float32]:
        """Factor and summand of values, as GDAL's metadata have them."""
        text = self.values("GDAL_METADATA")
        text = text.decode("utf-8", "replace") if isinstance(text, bytes) else ""
        out = []
        for role, usual in (("scale", 1.0), ("offset", 0.0)):
            found = re.search(rf'<Item[^>]*\brole="{role}"[^>]*>([^<]*)<', text)
            try:
                value = float(found[1]) if found else usual
            except ValueError:
                value = math.nan
            if not abs(value) < 1e6:
                raise self.broken("GDAL_METADATA", f"has a {role} of {shown(found[1])}")
            out.append(np.float32(value))
        return out[0], out[1]

    def system(self) -> System:
        """The system that its keys tell."""
        geo, known = self.keys(), known_systems()
        for key in ("ProjectedCitation", "GTCitation", "GeodeticCitation"):
            text = re.search(r"(?:PROJCS|GEOGCS)\s*\[.*", str(geo.get(key, "")), re.DOTALL)
            if text and (found := system_in(text[0])).code:
                return found
        flat, degrees = geo.get("GeodeticCRS", 0), geo.get("GTModelType") == 2
        code = flat if degrees else geo.get("ProjectedCRS", 0)
        unit = float(geo.get("ProjLinearUnitSize", 0.0) or _UNITS.get(geo.get("ProjLinearUnits", 9001), 1.0))
        if code not in (0, _OWN):
            return System(int(code))
        datum = known.get(flat, known[4326])
        axis, flattening = geo.get("EllipsoidSemiMajorAxis", 0.0), geo.get("EllipsoidInvFlattening", 0.0)
        if flat not in known and 6.2e6 < axis < 6.5e6 and flattening > 100.0:
            shift = geo.get("GeogTOWGS84", ())
            shift = shift if isinstance(shift, tuple) and len(shift) in (3, 7) else ()
            datum = Definition("geo", Ellipsoid(axis, flattening), (*shift, *[0.0] * (7 - len(shift))))
        if degrees:
            return System(-2, own=datum)
        south, zone = divmod(int(geo.get("Projection", 0)) - _UTM_ZONES, 100)
        if south in (0, 1) and 1 <= zone <= 60:
            return described("transverse mercator", utm_zone(zone, south == 1), datum)
        numbers = {key: value for key, value in geo.items() if isinstance(value, int | float)}
        given = {name: float(numbers[key]) for key, name in _TABLES["figures"].items() if key in numbers}
        given |= {name: unit * given[name] for name in ("east", "north") if name in given}
        try:
            return described(_TABLES["methods"].get(str(geo.get("ProjMethod")), ""), given, replace(datum, unit=unit))
        except (ValueError, ZeroDivisionError, OverflowError):
            return System(unit=unit)

    def one(self, tag: str, default: int | None = None) -> int:
        """The first value of a tag."""
        values = self.numbers(tag, 1)
        if values is None:
            if default is None:
                raise SceneError(f"{self.name}: tag {tag} ({_NUMBERS[tag]}) is missing; export the file again")
            return default
        if int(values[0]) != values[0] or values[0] < 0:
            raise self.broken(tag, f"is {shown(values[0])}")
        return int(values[0])

    def place(self) -> list[NDArray[np.float64]] | None:
        """Middle of the first pixel, and steps along and down, in the units of the file."""
        matrix = self.numbers("ModelTransformation", 16)
        if matrix is not None:
            m = np.array(matrix[:16], np.float64).reshape(4, 4)
            place, tag = (m[:2, 3], m[:2, 0], m[:2, 1]), "ModelTransformation"
        else:
            scale, tie, tag = self.numbers("ModelPixelScale", 2), self.numbers("ModelTiepoint", 6), "ModelPixelScale"
            if scale is None or tie is None:
                return None
            along, down = np.array([scale[0], 0.0]), np.array([0.0, -scale[1]])
            place = np.array(tie[3:5]) - tie[0] * along - tie[1] * down, along, down
        place = [*place]
        if self.keys().get("GTRasterType", 1) != 2:  # values belong to areas, whose corner is told
            place[0] = place[0] + (place[1] + place[2]) / 2.0
        if not np.abs(np.concatenate(place)).max() < 1e10 or not abs(np.linalg.det(np.stack(place[1:]))) > 0.0:
            raise self.broken(tag, "gives cells without a size or a place")
        return place

    def keys(self) -> dict[str, Any]:
        """Geographic keys that are known here: whole numbers, numbers, tuples of numbers, and texts."""
        values = self.numbers("GeoKeyDirectory", 4)
        if values is None:
            return {}
        if len(values) < 4 + 4 * int(values[3]):
            raise self.broken("GeoKeyDirectory", f"tells of {values[3]} keys and is too short for them")
        doubles, texts = self.numbers("GeoDoubleParams", 1) or (), self.values("GeoAsciiParams")
        out: dict[str, Any] = {}
        for key, place, number, at in np.array(values[4 : 4 + 4 * int(values[3])], np.int64).reshape(-1, 4).tolist():
            if place == 0:
                out[_KEYS.get(key, "")] = at
            elif _TAGS.get(place) == "GeoDoubleParams" and 0 <= at < len(doubles):
                out[_KEYS.get(key, "")] = doubles[at] if number == 1 else doubles[at : at + number]
            elif _TAGS.get(place) == "GeoAsciiParams" and isinstance(texts, bytes):
                out[_KEYS.get(key, "")] = texts[at : at + number].decode("latin-1")
        return out

    def nothing(self) -> float | None:
        """Value of pixels of which nothing is known."""
        text = self.values("GDAL_NODATA")
        if text is None or (isinstance(text, bytes) and not text.strip(b"\0 ")):
            return None
        try:
            return float(text.split(b"\0")[0])
        except (ValueError, AttributeError):
            raise self.broken("GDAL_NODATA", f"is {shown(text)}, which is not a number; correct it") from None
