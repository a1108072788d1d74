# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small files of real places in all formats that can be imported, made here, and ways to break them."""

from __future__ import annotations

import json
import random
import sqlite3
import struct
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TYPES = {2: (1, "s"), 3: (2, "H"), 4: (4, "I"), 12: (8, "d"), 16: (8, "Q")}
EAST, NORTH, CODE = 500_000.0, 5_316_000.0, 25832
#: What stands in place of numbers in texts.
_NUMBERS = ("1e308", "-1", "nan", "", "0", "-1e400", "99999999999", "1,5", "x", "1e-320", "\u2460", "true", "[]", "{")


def tiff(
    values: NDArray,
    extra: dict[int, tuple[int, list[Any] | bytes]] | None = None,
    order: str = "<",
    big: bool = False,
    packed: tuple[int, Callable[[bytes], bytes]] = (1, bytes),
    predictor: int = 1,
) -> bytes:
    """A TIFF file of one strip.

    Parameters
    ----------
    values : (h, w) float32, float64, uint16, int16 or uint8
    extra : dict
        Type and values of further tags, or of others in place of the usual ones; None leaves a tag out.
    order : {'<', '>'}
    big : bool
        BigTIFF.
    packed : tuple
        Number of a compression, and what compresses.
    predictor : {1, 2, 3}
    """
    h, w = values.shape
    form = {"f": 3, "u": 1, "i": 2}[values.dtype.kind]
    data = packed[1](_predicted(values, order, predictor))
    tags: dict[int, Any] = {
        256: (4, [w]),
        257: (4, [h]),
        258: (3, [8 * values.dtype.itemsize]),
        259: (3, [packed[0]]),
        317: (3, [predictor]) if predictor > 1 else None,
        262: (3, [1]),
        273: (4, [0]),
        277: (3, [1]),
        278: (4, [h]),
        279: (4, [len(data)]),
        339: (3, [form]),
    } | (extra or {})
    tags = {tag: tags[tag] for tag in sorted(tags) if tags[tag] is not None}
    head, wide, entry = (16, 8, 20) if big else (8, 2, 12)
    room, start = entry - (12 if big else 8), head + wide + entry * len(tags) + (8 if big else 4)

    def packed(tag: int) -> bytes:
        kind, own = tags[tag]
        return own if isinstance(own, bytes) else struct.pack(f"{order}{len(own)}{_TYPES[kind][1]}", *own)

    outside = sum(len(packed(tag)) for tag in tags if len(packed(tag)) > room)
    if 273 in tags and tags[273][1] == [0]:
        tags[273] = (4, [start + outside])
    entries, blob = b"", b""
    for tag, (kind, _) in tags.items():
        raw = packed(tag)
        entries += struct.pack(order + ("HHQ" if big else "HHI"), tag, kind, len(raw) // _TYPES[kind][0])
        if len(raw) > room:
            entries += struct.pack(order + ("Q" if big else "I"), start + len(blob))
            blob += raw
        else:
            entries += raw.ljust(room, b"\0")
    mark = b"II" if order == "<" else b"MM"
    first = struct.pack(order + ("HHHQ" if big else "HI"), *((43, 8, 0, 16) if big else (42, 8)))
    count = struct.pack(order + ("Q" if big else "H"), len(tags))
    return mark + first + count + entries + (b"\0" * (8 if big else 4)) + blob + data


def _predicted(values: NDArray, order: str, predictor: int) -> bytes:
    """Bytes of values, or of differences along rows."""
    size = values.dtype.itemsize
    if predictor == 2:
        whole = values.view(f"u{size}").copy()
        whole[:, 1:] -= whole[:, :-1].copy()
        values = whole
    if predictor == 3:
        rows = np.ascontiguousarray(values.astype(values.dtype.newbyteorder(">"))).view(np.uint8)
        rows = rows.reshape(*values.shape, size).transpose(0, 2, 1).reshape(len(values), -1).copy()
        rows[:, 1:] -= rows[:, :-1].copy()
        return rows.tobytes()
    return np.ascontiguousarray(values.astype(values.dtype.newbyteorder(order))).tobytes()


def lzw(data: bytes) -> bytes:
    """Compress as TIFF 6.0 says."""
    bits, table, width, found = [f"{256:09b}"], {bytes([i]): i for i in range(256)}, 9, b""
    number = 258
    for byte in data:
        longer = found + bytes([byte])
        if longer in table:
            found = longer
            continue
        bits.append(f"{table[found]:0{width}b}")
        table[longer], number, found = number, number + 1, bytes([byte])
        width = 9 + (number > 511) + (number > 1023) + (number > 2047)
        if number == 4095:
            bits.append(f"{256:012b}")
            table, width, number = {bytes([i]): i for i in range(256)}, 9, 258
    bits.append(f"{table[found]:0{width}b}")
    number += 1
    text = "".join(bits) + f"{257:0{9 + (number > 511) + (number > 1023) + (number > 2047)}b}"
    return int(text.ljust(-(-len(text) // 8) * 8, "0"), 2).to_bytes(-(-len(text) // 8))


def packbits(data: bytes) -> bytes:
    """Compress as TIFF 6.0 says, by pieces of two kinds in turn."""
    out = b""
    for at in range(0, len(data), 100):
        part = data[at : at + 100]
        same = len(set(part)) == 1 and len(part) > 1
        out += bytes([257 - len(part), part[0]]) if same else bytes([len(part) - 1]) + part
    return out


def geotiff(
    values: NDArray,
    cell: float = 1.0,
    west: float = EAST,
    north: float = NORTH,
    epsg: int = CODE,
    nothing: bytes | None = b"-9999\0",
    **options: Any,
) -> bytes:
    """A GeoTIFF with square cells, whose first one has its upper left corner at a place."""
    model = 2 if epsg == 4326 else 1
    keys = [1, 1, 0, 3, 1024, 0, 1, model, 1025, 0, 1, 1, 2048 if model == 2 else 3072, 0, 1, epsg]
    extra = {
        33550: (12, [cell, cell, 0.0]),
        33922: (12, [0.0, 0.0, 0.0, west, north, 0.0]),
        34735: (3, keys),
        42113: None if nothing is None else (2, nothing),
    }
    return tiff(values, {**extra, **options.pop("extra", {})}, **options)


def png(values: NDArray[np.uint16]) -> bytes:
    """A gray PNG of 16 bits."""
    h, w = values.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in values)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", w, h, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def ascii_grid(values: NDArray, cell: float = 1.0, west: float = EAST, south: float = NORTH) -> str:
    """An ASCII grid; nan is written as -9999."""
    h, w = values.shape
    head = f"ncols {w}\nnrows {h}\nxllcorner {west}\nyllcorner {south}\ncellsize {cell}\nNODATA_value -9999\n"
    return head + "\n".join(" ".join(f"{v:.2f}" for v in row) for row in np.nan_to_num(values, nan=-9999.0)) + "\n"


def hills(number: int = 24) -> NDArray[np.float32]:
    """Heights (number, number) between some 380 and 420 m."""
    y, x = np.mgrid[0:number, 0:number] / number
    return (400.0 + 12.0 * np.sin(7.0 * x) + 8.0 * np.cos(5.0 * y)).astype(np.float32)


def crowns(number: int = 24) -> NDArray[np.float32]:
    """Canopy heights (number, number) of some round crowns."""
    y, x = np.mgrid[0:number, 0:number].astype(np.float64)
    out = np.zeros((number, number))
    for j in range(4, number, 8):
        for i in range(4, number, 8):
            top = 14.0 + (i + j) % 5
            out = np.maximum(out, top - 0.4 * ((x - i) ** 2 + (y - j) ** 2))
    return np.where(out > 3.0, out, 0.0).astype(np.float32)


def xyz(values: NDArray) -> str:
    """A list of places and heights, from the south."""
    return "".join(f"{EAST + i} {NORTH + j} {v:.2f}\n" for j, row in enumerate(values) for i, v in enumerate(row))


def usgs(values: NDArray, north: float = 10.0) -> bytes:
    """An elevation model of the USGS in a zone of UTM, cells of 10 m from west to east, and of so many to the north."""
    h, w = values.shape
    head = bytearray(b" " * 1024)
    for at, text in ((144, f"{1:6}{1:6}{1:6}{17:6}"), (528, f"{2:6}{2:6}{4:6}"), (852, f"{1:6}{w:6}")):
        head[at : at + len(text)] = text.encode()
    head[816:852] = b"".join(f"{v:12.5E}".encode() for v in (10.0, north, 1.0))
    out = bytes(head)
    for i in range(w):
        column = np.rint(values[::-1, i]).astype(int)
        start = f"{1:6}{i + 1:6}{h:6}{1:6}" + "".join(f"{v:24.15E}" for v in (EAST + 10.0 * i, NORTH, 0.0, 0.0, 0.0))
        out += (start + "".join(f"{v:6}" for v in column)).ljust(1024).encode()
    return out


def shapefile(*areas: Any) -> bytes:
    """Areas, each a list of rings of places, the first clockwise."""
    records = b""
    for number, rings in enumerate(areas, 1):
        points = [p for ring in rings for p in ring]
        starts = np.cumsum([0, *map(len, rings[:-1])]).tolist()
        box = (*np.min(points, axis=0), *np.max(points, axis=0))
        body = struct.pack(f"<i4d2i{len(rings)}i", 5, *box, len(rings), len(points), *starts)
        body += struct.pack(f"<{2 * len(points)}d", *(v for p in points for v in p))
        records += struct.pack(">2i", number, len(body) // 2) + body
    return (
        struct.pack(">7i", 9994, 0, 0, 0, 0, 0, 50 + len(records) // 2)
        + struct.pack("<2i8d", 1000, 5, *[0.0] * 8)
        + records
    )


def dbase(**columns: list[str]) -> bytes:
    """A table of texts of twenty letters."""
    number = len(next(iter(columns.values())))
    fields = b"".join(name.encode().ljust(11, b"\0") + b"C" + bytes(4) + bytes([20]) + bytes(15) for name in columns)
    head = struct.pack("<4BIHH20x", 3, 120, 1, 1, number, 33 + len(fields), 1 + 20 * len(columns))
    rows = b"".join(b" " + b"".join(str(c[i]).encode().ljust(20) for c in columns.values()) for i in range(number))
    return head + fields + b"\r" + rows + b"\x1a"


def geopackage(table: str, *rows: tuple[bytes, dict[str, str]], epsg: int = CODE) -> bytes:
    """A GeoPackage with a layer of geometries in well-known binary, and a text of each under some names."""
    names = list(rows[0][1])
    with closing(sqlite3.connect(":memory:")) as base:
        base.execute(
            "CREATE TABLE gpkg_spatial_ref_sys (srs_name, srs_id, organization, organization_coordsys_id, definition)"
        )
        base.execute("INSERT INTO gpkg_spatial_ref_sys VALUES ('x', 7, 'EPSG', ?, '')", (epsg,))
        base.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, geometry_type_name, srs_id, z, m)")
        base.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', 'GEOMETRY', 7, 0, 0)", (table,))
        base.execute(f'CREATE TABLE "{table}" (fid, geom, {", ".join(names)})')
        for number, (shape, tags) in enumerate(rows):
            blob = b"GP\0\1" + struct.pack("<i", 7) + shape
            base.execute(
                f'INSERT INTO "{table}" VALUES ({", ".join("?" * (2 + len(names)))})', (number, blob, *tags.values())
            )
        base.commit()
        return base.serialize()


def binary_area(*rings: Any) -> bytes:
    """An area as well-known binary."""
    out = struct.pack("<BII", 1, 3, len(rings))
    return out + b"".join(struct.pack(f"<I{2 * len(r)}d", len(r), *(v for p in r for v in p)) for r in rings)


def _in_meters(size: float, east: float = 0.0) -> list[list[float]]:
    """A square, clockwise."""
    ring = [[0.0, 0.0], [0.0, size], [size, size], [size, 0.0], [0.0, 0.0]]
    return [[EAST + east + x, NORTH + y] for x, y in ring]


INVENTORY = (
    "id;Baumart;Höhe (m);Stammumfang [cm];Kronendurchmesser;Alter;X;Y\n"
    "1;Stiel-Eiche;14,5;210;11,0;90;500010,5;5316010,0\n"
    "2;Tilia cordata 'Greenspire';9;;6;;500020;5316011\n"
    "3;Foo bar;;88;;;500030;5316012,25\n"
    '4;"Picea abies; Fichte";22;130;5,5;70;500015;5316018\n'
)


def feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    """A feature of GeoJSON."""
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def collection(*features: dict[str, Any]) -> str:
    """GeoJSON of features."""
    return json.dumps({"type": "FeatureCollection", "features": features})


def _square(x: float, y: float, size: float) -> list[list[float]]:
    return [[x, y], [x + size, y], [x + size, y + size], [x, y + size], [x, y]]


OUTLINES = (
    feature("Polygon", [_square(9.0, 48.0, 0.002), _square(9.0005, 48.0005, 0.0005)], landuse="forest", name="Wald"),
    feature("LineString", [[9.0, 48.0], [9.001, 48.0004], [9.002, 48.0]], highway="track", width="3 m"),
    feature("MultiPolygon", [[_square(9.0021, 48.0, 0.0002)], [_square(9.0024, 48.0, 0.0001)]], building="yes"),
    feature("Polygon", [_square(9.0, 48.0021, 0.0005)], natural="water"),
)
TREES = tuple(
    feature("Point", [9.0001 + 0.0001 * n, 48.0001], species=name, height=8.0 + n, circumference=0.6 + 0.1 * n)
    for n, name in enumerate(("Quercus robur", "Fagus sylvatica", "Betula pendula", None))
)
#: Operator, name and content of each kind of file.
FILES: dict[str, tuple[str, str, bytes]] = {
    "grid": ("import_terrain", "grid.asc", ascii_grid(hills()).encode()),
    "tiff": ("import_terrain", "float.tif", geotiff(hills(), 5.0)),
    "tiff_16": ("import_terrain", "whole.tif", geotiff(np.rint(hills()).astype(np.uint16), 5.0, order=">")),
    "big_tiff": ("import_canopy", "big.tif", geotiff(crowns(), big=True)),
    "lzw": ("import_terrain", "lzw.tif", geotiff(hills(), 5.0, packed=(5, lzw), predictor=3)),
    "deflate": ("import_terrain", "deflate.tif", geotiff(hills(), 5.0, packed=(8, zlib.compress), predictor=2)),
    "packbits": (
        "import_terrain",
        "bits.tif",
        geotiff(np.rint(hills()).astype(np.int16), 5.0, packed=(32773, packbits)),
    ),
    "hgt": ("import_terrain", "N48E009.hgt", np.rint(hills(12)).astype(">i2").tobytes()),
    "xyz": ("import_terrain", "list.xyz", xyz(hills(12)).encode()),
    "usgs": ("import_terrain", "usgs.dem", usgs(hills(8))),
    "png": ("import_terrain", "gray.png", png(np.rint(hills()).astype(np.uint16))),
    "csv": ("import_inventory", "trees.csv", INVENTORY.encode()),
    "points": ("import_inventory", "trees.geojson", collection(*TREES).encode()),
    "lines": ("import_outlines", "map.geojsonl", b"\n".join(json.dumps(f).encode() for f in OUTLINES)),
    "shape": ("import_outlines", "shape.shp", shapefile([_in_meters(50.0)], [_in_meters(9.0, 80.0)])),
    "dbase": ("import_outlines", "dbase.dbf", dbase(fclass=["forest", "building"], height=["", "9.5"])),
    "geopackage": (
        "import_outlines",
        "map.gpkg",
        geopackage(
            "areas",
            (binary_area(_in_meters(50.0)), {"kind": "Wald"}),
            (binary_area(_in_meters(9.0, 80.0)), {"kind": "Haus"}),
        ),
    ),
    "outlines": ("import_outlines", "map.geojson", collection(*OUTLINES).encode()),
}
#: The world file of images that have none within.
WORLD = b"5.0\n0.0\n0.0\n-5.0\n500000.0\n5316000.0\n"


def mutated(rng: random.Random, content: bytes) -> bytes:
    """The content of a file with one to four things wrong."""
    if content.startswith(b"{") and b"}\n{" not in content and rng.random() < 0.7:
        data = json.loads(content)
        for _ in range(rng.randint(1, 3)):
            data = _replaced(rng, data)
        return json.dumps(data).encode()
    data = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        at, way = rng.randrange(len(data) + 1), rng.randrange(8)
        if way == 0:
            data = data[:at]
        elif way == 1:
            data[at : at + rng.choice((1, 2, 4, 8))] = rng.randbytes(rng.choice((1, 2, 4, 8)))
        elif way == 2:
            del data[at : at + rng.randint(1, 200)]
        elif way == 3:
            data[at:at] = data[at : at + rng.randint(1, 200)] * rng.choice((1, 2, 100))
        elif way == 4 and len(data) >= 4:  # the heads of binary files are at their beginning
            at = rng.randrange(0, max(min(len(data), 300) - 4, 1))
            data[at : at + 4] = rng.choice((b"\xff\xff\xff\xff", b"\0\0\0\0", b"\0\0\xff\x7f", rng.randbytes(4)))
        elif way == 5:
            data[at : at + 1] = rng.choice((b",", b";", b"\n", b'"', b"{", b"]", b"\0", b"\xff", b"\r"))
        else:
            _renumber(rng, data)
    return bytes(data)


def _replaced(rng: random.Random, value: Any) -> Any:
    """A value of JSON with something else somewhere within."""
    if not value or not isinstance(value, dict | list) or rng.random() < 0.1:
        return rng.choice((None, True, -1, 1e308, 10**400, "x", "12 m", "", [], {}, [[]], [None], [[1e9, 1e9]] * 3))
    key = rng.choice(list(value) if isinstance(value, dict) else range(len(value)))
    if rng.random() < 0.1:
        del value[key]
    else:
        value[key] = _replaced(rng, value[key])
    return value


def _renumber(rng: random.Random, data: bytearray) -> None:
    """Put something else in place of a number of a text, or of a few letters."""
    start = rng.randrange(len(data) + 1)
    digits = b"0123456789.-"
    while start < len(data) and data[start] not in digits:
        start += 1
    end = start
    while end < len(data) and data[end] in digits:
        end += 1
    data[start:end] = rng.choice(_NUMBERS).encode()


def write(folder: Path, kind: str, content: bytes | None = None) -> tuple[str, Path]:
    """Write a file of a kind, of other content if given; the operator that imports it, and its path."""
    operator, name, usual = FILES[kind]
    path = folder / name
    path.write_bytes(usual if content is None else content)
    if path.suffix == ".png":
        path.with_suffix(".pgw").write_bytes(WORLD)
    if path.suffix in (".shp", ".dbf"):
        path.with_suffix(".prj").write_text("EPSG:25832")
        other = "dbase" if path.suffix == ".shp" else "shape"
        path.with_suffix(Path(FILES[other][1]).suffix).write_bytes(FILES[other][2])
    return operator, path.with_suffix(".shp") if path.suffix == ".dbf" else path
