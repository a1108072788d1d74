# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GeoTIFF: what its values are, and where on Earth they lie.

Tags are those of TIFF 6.0 (Adobe, 1992), its 64-bit kin BigTIFF, and OGC GeoTIFF 1.1 (OGC 19-008r4, 2019); what stands
for "nothing known", scale and offset are GDAL's. Compressions are those of TIFF, and Adobe's and libtiff's (LZMA,
Zstandard). Blender's own reader makes flat ground or noise of what it cannot decode; here damage is an error.
"""

import lzma
import math
import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, spread, top
from ..errors import SceneError, quoted
from ..jobs import Job, Progress
from . import table
from .projection import Definition, Ellipsoid, System, described, known_systems, system_in, utm_zone
from .rasters import Raster, check_regular, checked_size, system_beside, without_nodata, world_file

_CLEAR, _END, _ZSTANDARD = 256, 257, 50000
_PROGRESS = 64  # pieces between two signs of life
#: What is known of tags and keys, and names of tags by their numbers.
_TABLES = table("geotiff")
_TAGS = {int(number): name for number, name in _TABLES["tags"].items()}
_NUMBERS = {name: number for number, name in _TAGS.items()}
#: Types of values: letter for `struct`; others, such as fractions, occur in none of these tags.
_TYPES = {1: "B", 2: "s", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 11: "f", 12: "d", 16: "Q", 17: "q"}
_MOST_TAGS, _MOST_BYTES, _MOST_IMAGES = 4096, 64_000_000, 64
#: Types of pixels: letter for `numpy.dtype` and bits, by format.
_FORMATS = {1: ("u", (8, 16, 32, 64)), 2: ("i", (8, 16, 32, 64)), 3: ("f", (16, 32, 64))}
_LARGEST_PIECE, _MOST_PIECE = 65_536, 50_000_000  # pixels of a side, and of a strip or tile
_DAMAGED = "it is damaged or was not copied whole; get it again"
_KEYS = {int(number): name for number, name in _TABLES["keys"].items()}
_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
_OWN, _UTM_ZONES = 32767, 16000  # "user-defined"; and 16100 in the south
_PALETTE = 3


def read_tiff(path: Path) -> Job[Raster]:
    """Read a GeoTIFF, or a TIFF with a world file; yields progress.

    Raises
    ------
    OSError, SceneError
        It cannot be read, is broken, or of a kind that cannot be used; names the tag.
    """
    check_regular(path)
    with path.open("rb") as file:
        tags = _Tags(file, path.name)
        # Refuse what has several values in a pixel; a second one may be what counts.
        bands = tags.one("SamplesPerPixel", 1)
        if bands != 1 and not (bands == 2 and tags.numbers("ExtraSamples")[:1] in ((1,), (2,))):
            raise tags.broken("SamplesPerPixel", f"is {bands}; write one band, for example with gdal_translate -b 1")
        (place, system), notes = _place(path, tags), []
        values, absent = yield from tags.pixels()
        absent |= ~(yield from tags.mask(values.shape))
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

    Errors are those of `read_tiff`.
    """
    check_regular(path)
    if path.suffix.lower() not in (".tif", ".tiff"):
        place, system = _place(path)
    else:
        with path.open("rb") as file:
            place, system = _place(path, _Tags(file, path.name))
    return Raster(np.zeros((1, 1), np.float32), *place, system)


def _place(path: Path, tags: "_Tags | None" = None) -> tuple[list[Floats], System]:
    """Middle of the first pixel, steps along and down, and the system, by tags or else by files beside the image."""
    place, system = (tags.place(), tags.system()) if tags is not None else (None, System())
    return world_file(path) if place is None else place, system_beside(path) if system == System() else system


class _Tags:
    """Tags of an image of a file, of the first at the beginning; errors name the tag."""

    def __init__(self, file: Any, name: str) -> None:
        self.file, self.name, self.size, self.next = file, name, file.seek(0, 2), 0
        start = self._bytes(0, 8, "head")
        form = {b"II*\0": "<I", b"MM\0*": ">I", b"II+\0": "<Q", b"MM\0+": ">Q"}.get(start[:4], "")
        self.order, self.letter = form[:1], form[1:]  # of bytes, and of offsets
        if not form or (self.letter == "Q" and start[4:] != struct.pack(f"{self.order}HH", 8, 0)):
            raise SceneError(f"{name}: this is no TIFF file; export it as GeoTIFF")
        self.entries = self._directory(self._number(self.letter, struct.calcsize(self.letter), "head"))

    def _bytes(self, offset: int, number: int, what: str) -> bytes:
        """A part of the file; what it is begins the message if it is not there."""
        if offset + number > self.size or number > _MOST_BYTES:
            raise SceneError(f"{self.name}: {what}: the file ends before it; {_DAMAGED}")
        self.file.seek(offset)
        return self.file.read(number)

    def _number(self, letter: str, offset: int, what: str) -> int:
        return struct.unpack(self.order + letter, self._bytes(offset, struct.calcsize(letter), what))[0]

    def _directory(self, offset: int) -> dict[str, tuple[int, int, bytes]]:
        """Type, number of values, and the bytes that hold them or where they are, of the tags that are known here."""
        count, wide = ("Q", 8) if self.letter == "Q" else ("H", 4)
        entry = f"{self.order}HH{self.letter}{wide}s"
        number = self._number(count, offset, "directory")
        if not 0 < number <= _MOST_TAGS:
            raise SceneError(f"{self.name}: directory: {number:,} tags; it is damaged; get it again")
        offset += struct.calcsize(count)
        data = self._bytes(offset, number * struct.calcsize(entry), "directory")
        after = offset + len(data)
        self.next = self._number(self.letter, after, "directory") if after + wide <= self.size else 0
        return {_TAGS[tag]: tuple(told) for tag, *told in struct.iter_unpack(entry, data) if tag in _TAGS}

    def _values(self, tag: str) -> tuple | bytes:
        """Values of a tag, a text as bytes; none where there is no such tag."""
        if tag not in self.entries:
            return ()
        kind, number, here = self.entries[tag]
        if kind not in _TYPES or not number:
            raise self.broken(tag, "has values of a type that it cannot have")
        size = number * struct.calcsize(_TYPES[kind])
        if size > len(here):
            here = self._bytes(struct.unpack(self.order + self.letter, here)[0], size, tag)
        out = struct.unpack(f"{self.order}{number}{_TYPES[kind]}", here[:size])
        return out[0] if kind == 2 else out

    def text(self, tag: str) -> str:
        """The text of a tag; empty where there is no such tag."""
        values = self._values(tag)
        return values.decode("latin-1") if isinstance(values, bytes) else str(values or "")

    def numbers(self, tag: str, least: int = 1) -> tuple:
        """Finite values of a tag, at least so many, or none."""
        values = self._values(tag)
        if values and (isinstance(values, bytes) or len(values) < least or not all(map(math.isfinite, values))):
            raise self.broken(tag, f"must be {least} finite numbers or more")
        return values

    def one(self, tag: str, default: int | None = None) -> int:
        """The first value of a tag."""
        value = next(iter(self.numbers(tag)), default)
        if value is None:
            raise SceneError(f"{self.name}: tag {tag} ({_NUMBERS[tag]}) is missing; export the file again")
        if int(value) != value or value < 0:
            raise self.broken(tag, f"is {quoted(value)}")
        return int(value)

    def broken(self, tag: str, text: str) -> SceneError:
        """The error of a tag."""
        return SceneError(f"{self.name}: tag {tag} ({_NUMBERS[tag]}) {text}")

    def pixels(self) -> Job[tuple[NDArray[Any], Mask]]:
        """Values (h, w) of the first sample, and which pixels are not in the file, (h, w); yields progress."""
        width, height = self.one("ImageWidth"), self.one("ImageLength")
        checked_size(width, height, f"{self.name}: ")
        tiled, dtype = "TileOffsets" in self.entries, self._dtype()
        kind = "tile" if tiled else "strip"
        across = self.one("TileWidth") if tiled else width
        down = self.one("TileLength") if tiled else min(self.one("RowsPerStrip", height), height)
        if not (0 < across <= _LARGEST_PIECE and 0 < down <= _LARGEST_PIECE and across * down <= _MOST_PIECE):
            tag = "TileWidth" if tiled else "RowsPerStrip"
            raise self.broken(tag, f"gives pieces of {across:,} by {down:,} pixels")
        where = f"{kind.title()}Offsets"
        self.one(where)  # it is there
        offsets, sizes = self.numbers(where), self.numbers(f"{kind.title()}ByteCounts")
        complete = all(a >= 0 and b >= 0 and a + b <= self.size for a, b in zip(offsets, sizes, strict=False))
        if len(offsets) != len(sizes) or not complete:
            raise self.broken(where, f"leads beyond the end of the file; {_DAMAGED}")
        samples = 1 if self.one("PlanarConfiguration", 1) == 2 else self.one("SamplesPerPixel", 1)
        predictor, compression, order = (self.one(tag, 1) for tag in ("Predictor", "Compression", "FillOrder"))
        if compression not in _READERS:
            how = _TABLES["compressions"].get(str(compression), f"a way without a name ({compression})")
            raise SceneError(
                f"{self.name}: tag Compression (259): it is compressed with {how}, which TetFlora does not read; write "
                "it anew, for example with gdal_translate -co COMPRESS=DEFLATE"
            )
        columns, rows = -(-width // across), -(-height // down)
        if len(offsets) < columns * rows or predictor not in (1, 2, 3) or (predictor == 3 and dtype.kind != "f"):
            raise SceneError(
                f"{self.name}: {len(offsets):,} of {columns * rows:,} {kind}s, or an unknown predictor; damaged: get "
                "it again"
            )
        values, absent = np.zeros((height, width), dtype.newbyteorder("=")), np.zeros((height, width), bool)
        row = (across * samples * (1 if dtype.kind == "b" else 8 * dtype.itemsize) + 7) // 8
        for number in range(columns * rows):
            if number % _PROGRESS == 0:
                yield Progress(0.9 * number / (columns * rows), f"Reading {self.name}")
            top, left = number // columns * down, number % columns * across
            place = np.s_[top : min(top + down, height), left : min(left + across, width)]
            if not sizes[number]:
                absent[place] = True
                continue
            high = down if tiled else values[place].shape[0]  # tiles at the border are whole, strips end there
            self.file.seek(offsets[number])
            what = f"{self.name}: {kind} {number + 1:,} of {columns * rows:,}"
            try:
                data = self.file.read(sizes[number])
                data = _READERS[compression](data.translate(_TURNED) if order == 2 else data, high * row)
            except (zlib.error, lzma.LZMAError, EOFError, ValueError, IndexError) as error:
                raise SceneError(f"{what} is damaged: {error}; get it again") from None
            if len(data) < high * row:
                raise SceneError(f"{what} ends too early; get it again")
            piece = _decoded(np.frombuffer(data, np.uint8, high * row).reshape(high, row), dtype, samples, predictor)
            values[place] = piece[: values[place].shape[0], : values[place].shape[1]]
        return values, absent

    def _dtype(self) -> np.dtype[Any]:
        """Of values, in the file's order of bytes; bool for bits."""
        bits, form = self.one("BitsPerSample", 1), self.one("SampleFormat", 1)
        letter, sizes = _FORMATS.get(1 if form == 4 else form, ("", ()))
        if bits == 1 and self.one("NewSubfileType", 0) & 4:
            return np.dtype(bool)
        if bits not in sizes:
            remedy = "write 32-bit floats, for example with gdal_translate -ot Float32"
            raise self.broken("BitsPerSample", f"is {bits}, of format {form}; {remedy}")
        return np.dtype(f"{self.order}{letter}{bits // 8}")

    def mask(self, shape: tuple[int, int]) -> Job[Mask]:
        """Which pixels count, (h, w), by a mask that is another image of the file; yields progress."""
        directory, seen = self.entries, set()
        try:
            while self.next and self.next not in seen and len(seen) < _MOST_IMAGES:
                seen.add(self.next)
                self.entries = self._directory(self.next)
                if self.one("NewSubfileType", 0) & 4 and (self.one("ImageLength"), self.one("ImageWidth")) == shape:
                    values, absent = yield from self.pixels()
                    return (values != 0) & ~absent
        finally:
            self.entries = directory
        return np.ones(shape, bool)

    def scale(self) -> tuple[np.float32, np.float32]:
        """Factor and summand of values, as GDAL's metadata have them."""
        text, out = self.text("GDAL_METADATA"), []
        for role, usual in (("scale", 1.0), ("offset", 0.0)):
            match = re.search(rf'<Item[^>]*\brole="{role}"[^>]*>([^<]*)<', text)
            try:
                value = float(match[1]) if match else usual
            except ValueError:
                value = math.nan
            if not abs(value) < 1e6:
                raise self.broken("GDAL_METADATA", f"has a {role} of {quoted(match[1])}")
            out.append(np.float32(value))
        return out[0], out[1]

    def system(self) -> System:
        """The system that its keys tell."""
        geo, known = self.keys(), known_systems()
        for key in ("ProjectedCitation", "GTCitation", "GeodeticCitation"):
            text = re.search(r"(?:PROJCS|GEOGCS)\s*\[.*", str(geo.get(key, "")), re.DOTALL)
            if text and (cited := system_in(text[0])).epsg:
                return cited
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
            return System(-2, custom=datum)
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

    def place(self) -> list[Floats] | None:
        """Middle of the first pixel, and steps along and down, in the units of the file."""
        matrix = self.numbers("ModelTransformation", 16)
        if matrix:
            m = np.array(matrix[:16], np.float64).reshape(4, 4)
            place, tag = (m[:2, 3], m[:2, 0], m[:2, 1]), "ModelTransformation"
        else:
            scale, tie, tag = self.numbers("ModelPixelScale", 2), self.numbers("ModelTiepoint", 6), "ModelPixelScale"
            if not scale or not tie:
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
        if not values:
            return {}
        if len(values) < 4 + 4 * int(values[3]):
            raise self.broken("GeoKeyDirectory", f"tells of {values[3]} keys and is too short for them")
        doubles, texts = self.numbers("GeoDoubleParams"), self.text("GeoAsciiParams")
        out: dict[str, Any] = {}
        for key, place, number, entry in np.array(values[4 : 4 + 4 * int(values[3])], np.int64).reshape(-1, 4).tolist():
            if place == 0:
                out[_KEYS.get(key, "")] = entry
            elif _TAGS.get(place) == "GeoDoubleParams" and 0 <= entry < len(doubles):
                out[_KEYS.get(key, "")] = doubles[entry] if number == 1 else doubles[entry : entry + number]
            elif _TAGS.get(place) == "GeoAsciiParams":
                out[_KEYS.get(key, "")] = texts[entry : entry + number]
        return out

    def nothing(self) -> float | None:
        """Value of pixels of which nothing is known."""
        text = self.text("GDAL_NODATA")
        try:
            return float(text.split("\0")[0]) if text.strip("\0 ") else None
        except ValueError:
            raise self.broken("GDAL_NODATA", f"is {quoted(text)}, which is not a number; correct it") from None


def _decoded(rows: NDArray[np.uint8], dtype: np.dtype[Any], samples: int, predictor: int) -> NDArray[Any]:
    """First sample of the pixels of a piece, from the bytes (h, n) of its rows; sums wrap around beyond the largest."""
    if dtype.kind == "b":
        return np.unpackbits(rows, axis=1)[:, ::samples]
    size, native = dtype.itemsize, dtype.newbyteorder("=")
    if predictor == 3:  # bytes apart by their weight, the highest first, each as the difference from the one before
        rows = rows.reshape(len(rows), -1, samples).cumsum(axis=1, dtype=rows.dtype).reshape(len(rows), size, -1)
        return np.ascontiguousarray(rows.transpose(0, 2, 1)).view(dtype.newbyteorder(">"))[:, ::samples, 0]
    if predictor == 2:
        whole = rows.view(f"{dtype.byteorder}u{size}" if size > 1 else np.uint8).astype(f"u{size}")
        return whole.reshape(len(rows), -1, samples).cumsum(axis=1, dtype=whole.dtype).view(native)[:, :, 0]
    return rows.view(dtype)[:, ::samples]


#: Bytes by those with the lowest bit first.
_TURNED = bytes(int(f"{n:08b}"[::-1], 2) for n in range(256))


#: Widths of codes, and how many of each there are until the table is full: it grows one code early.
_WIDTHS = ((9, 254), (10, 512), (11, 1024), (12, 2310))


def _lzw(data: bytes, most: int) -> bytes:
    """Lempel, Ziv and Welch: codes of 9 to 12 bits, the highest bit first.

    What a code stands for is a part of what came before, from where the one that made it began: so lengths follow from
    codes by jumping along chains, and then bytes, each round twice as far.
    """
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    out, bit, size, ended = [], 0, 0, False
    while size < most and not ended:
        runs: list[Integers] = []
        for width, number in _WIDTHS:
            whole = min(number, (len(bits) - bit) // width)
            codes = bits[bit : bit + whole * width].reshape(whole, width) @ _PLACES[12 - width :]
            marks = np.flatnonzero((codes == _CLEAR) | (codes == _END))
            stop = int(marks[0]) if len(marks) else whole
            runs.append(codes[:stop])
            bit += (stop + 1) * width
            if len(marks) or whole < number:
                ended = not len(marks) or codes[stop] == _END
                break
            bit -= width
        else:
            raise ValueError("its table of codes overflows")
        part, broken = _strings(np.concatenate(runs))
        out.append(part)
        size, ended = size + len(part), ended or broken
    return b"".join(out)[:most]


_PLACES = 1 << np.arange(11, -1, -1, dtype=np.int64)


def _strings(codes: Integers) -> tuple[bytes, bool]:
    """Bytes that codes (n,) after a cleared table stand for, up to one that cannot be, and whether there is such."""
    index = np.arange(len(codes))
    bad = np.flatnonzero(codes - _END > index)
    codes, index = (codes[: bad[0]], index[: bad[0]]) if len(bad) else (codes, index)
    if not len(codes):
        return b"", bool(len(bad))
    literal = codes < _CLEAR
    maker = np.where(literal, index, codes - _END - 1)
    steps, root = (~literal).astype(np.int64), maker
    while (root[root] != root).any():
        steps, root = steps + steps[root], root[root]
    length = steps + 1
    start = np.cumsum(length) - length
    code, offset = spread(length)
    return codes[code[top(start[maker[code]] + offset)]].astype(np.uint8).tobytes(), bool(len(bad))


def _packed(data: bytes, most: int) -> bytes:
    """PackBits: pieces to take as they are, and bytes to repeat."""
    out, byte, size = [], 0, 0
    while size < most and byte < len(data):
        head, rest = data[byte], data[byte + 1 : byte + 129]
        part = rest[: head + 1] if head < 128 else rest[:1] * (257 - head) * (head != 128)
        byte += 2 + head if head < 128 else 1 if head == 128 else 2
        out.append(part)
        size += len(part)
    return b"".join(out)[:most]


def _inflated(data: bytes, most: int) -> bytes:
    return zlib.decompressobj().decompress(data, most + 1)  # one more, so that the sum at the end is checked


_READERS: dict[int, Callable[[bytes, int], bytes]] = {
    1: lambda data, _most: data,
    5: _lzw,
    **dict.fromkeys((8, 32946), _inflated),
    32773: _packed,
    34925: lambda data, most: lzma.LZMADecompressor().decompress(data, most + 1),
}


def use_zstandard(module: Any) -> None:
    """Read what is compressed with Zstandard by the module of that name, which Blender has and Python lacks."""

    def read(data: bytes, most: int) -> bytes:
        try:
            return module.ZstdDecompressor().stream_reader(data).read(most + 1)
        except module.ZstdError as error:
            raise ValueError(str(error)) from None

    _READERS[_ZSTANDARD] = read
