# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Features of maps, as GeoJSON has them: from GeoJSON of all kinds, shapefiles and GeoPackages.

Formats are those of RFC 7946 and 8142, the ESRI Shapefile Technical Description (1998), dBASE III, and OGC GeoPackage
1.3 (OGC 12-128r17) with the well-known binary of OGC 06-103r4.
"""

import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, suppress
from io import BytesIO
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError, quoted
from ..files import is_regular, parse_json, read_whole
from .projection import LONGITUDE_LATITUDE, System, chosen_system, code_in, known_systems, may_be_degrees, system_in
from .rasters import beside, system_beside

MAX_BYTES, MAX_ROWS = 200_000_000, 2_000_000
#: Endings of files that `read_features` reads.
ENDINGS = (".geojson", ".json", ".geojsonl", ".geojsons", ".ndjson", ".shp", ".gpkg")
#: On features: the layer that they come from.
LAYER = "layer"
_SINGLE = ("Point", "LineString", "Polygon")
_GEOMETRIES = {*_SINGLE, *(f"Multi{kind}" for kind in _SINGLE), "GeometryCollection"}
_DEEPEST = 32  # collections within each other
_Feature = dict[str, Any]


def read_features(path: Path, chosen: int = 0) -> tuple[list[_Feature], System]:
    """Features of a file, of which each is an object with a geometry, and their system.

    Parameters
    ----------
    chosen : int
        As of `chosen_system`.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken; names the feature.
    """
    name = path.name
    if path.suffix.lower() in (".shp", ".gpkg"):
        try:
            features, system = _shapes(path) if path.suffix.lower() == ".shp" else _package(path)
        except (struct.error, ValueError, IndexError, KeyError, TypeError, OverflowError, RecursionError, MemoryError):
            raise SceneError(f"{name}: it is damaged or was not copied whole; get it again") from None
        geometries = (feature["geometry"] or {} for feature in features)
        points = (point for geometry in geometries for point in _positions(geometry.get("coordinates", ())))
        if not chosen and system == System() and may_be_degrees(list(points)):
            raise SceneError(
                f"{name}: no file tells its coordinate system (.prj); set Coordinate System to 4326 for longitude and "
                "latitude, or turn on Plain Meters"
            )
        return features, chosen_system(chosen, system, f"{name}: ")
    try:
        data = _json(read_whole(path, MAX_BYTES))
    except ValueError as error:
        raise SceneError(f"{name}: {error}") from None
    kind = data.get("type") if isinstance(data, dict) else None
    if isinstance(kind, str) and kind in _GEOMETRIES:
        data = {"features": [{"geometry": data, "properties": {}}], "crs": data.get("crs")}
    elif kind == "Feature":
        data = {"features": [data]}
    elif kind != "FeatureCollection":
        raise SceneError(f'{name}: "type" is {quoted(kind)}; a GeoJSON file is a FeatureCollection; export it again')
    features = data.get("features")
    if not isinstance(features, list) or len(features) > MAX_ROWS:
        raise SceneError(f'{name}: "features" must be a list of at most {MAX_ROWS:,}')
    for number, feature in enumerate(features, 1):
        geometry = feature.get("geometry", ...) if isinstance(feature, dict) else ...
        properties = feature.get("properties") if isinstance(feature, dict) else None
        if not isinstance(geometry, dict | None) or not isinstance(properties, dict | None):
            problem = "it has no geometry, or properties that are no object"
            raise SceneError(f"{name}: feature {number:,}: {problem}; correct it")
        if geometry is not None and not isinstance(geometry.get("type"), str):
            raise SceneError(f"{name}: feature {number:,}: its geometry has no type; correct it")
    return features, chosen_system(chosen or _code(data.get("crs"), name), System(), f"{name}: ")


def parts_of(geometry: _Feature | None, where: str) -> Iterator[tuple[str, Any]]:
    """Points, lines and areas of a geometry: type and coordinates of each, as GeoJSON has them.

    Raises
    ------
    SceneError
        It is no geometry of GeoJSON; ``where`` begins the message.
    """
    kind = geometry["type"] if geometry else "Point"
    parts = [geometry] if geometry else []
    if kind == "GeometryCollection":
        parts = geometry.get("geometries")
        if not isinstance(parts, list) or not all(
            isinstance(p, dict) and isinstance(p.get("type"), str) and p["type"] != kind for p in parts
        ):
            raise SceneError(f"{where}: its geometries are no list of geometries; correct them")
    for part in parts:
        kind, values = part["type"], part.get("coordinates")
        if kind not in _GEOMETRIES:
            raise SceneError(f"{where}: {quoted(kind)} is no geometry of GeoJSON; export it again")
        many = kind.startswith("Multi")
        yield from ((kind.removeprefix("Multi"), each) for each in (list_of(values, where) if many else [values]))


def list_of(value: Any, where: str) -> list[Any]:
    """Coordinates that are a list.

    Raises
    ------
    SceneError
        They are none; ``where`` begins the message.
    """
    if not isinstance(value, list):
        raise SceneError(f"{where}: its coordinates are {quoted(value)}, not a list; correct them")
    return value


def _json(content: bytes) -> Any:
    """One JSON text, or a feature on each line, which may begin with a record separator."""
    try:
        return parse_json(content)
    except ValueError:
        lines = [line.strip(b"\x1e \t\r") for line in content.split(b"\n")]
        lines = [line for line in lines if line]
        if len(lines) < 2 or not (lines[0].startswith(b"{") and lines[0].endswith(b"}")):
            raise
    features = []
    for number, line in enumerate(lines, 1):
        try:
            part = parse_json(line)
        except ValueError as error:
            raise ValueError(f"feature {number:,} {error}") from None
        bare = isinstance(part, dict) and str(part.get("type")) in _GEOMETRIES
        features.append({"geometry": part, "properties": {}} if bare else part)
    return {"type": "FeatureCollection", "features": features}


def _code(crs: Any, name: str) -> int:
    """EPSG code of the member ``crs`` that GeoJSON of before 2016 has, and GDAL still writes."""
    if crs is None:
        return LONGITUDE_LATITUDE
    properties = crs.get("properties") if isinstance(crs, dict) else None
    properties = properties if isinstance(properties, dict) else {}
    text = next((v for v in map(properties.get, ("name", "href")) if isinstance(v, str)), None)
    text = text or f"EPSG:{properties.get('code')}"
    if (code := code_in(text)) is not None:
        return code
    raise SceneError(
        f'{name}: "crs" is {quoted(text)}, which is no EPSG code; set Coordinate System to the code, or write the file '
        "with -t_srs EPSG:4326"
    )


def _positions(values: Any) -> Iterator[list[float]]:
    """Positions within nested lists of coordinates."""
    if values and isinstance(values[0], int | float):
        yield values[:2]
    else:
        for part in values:
            yield from _positions(part)


def _shapes(path: Path) -> tuple[list[_Feature], System]:
    """Features of a shapefile, with the table and the system beside it."""
    content = read_whole(path, MAX_BYTES)
    if content[:4] != b"\0\0\x27\x0a":
        raise SceneError(f"{path.name}: this is no shapefile; choose another one")
    rows = _dbase(path)
    features, byte = [], 100
    while byte + 12 <= len(content):
        size = 2 * int.from_bytes(content[byte + 4 : byte + 8])
        record = content[byte + 8 : byte + 8 + size]
        if len(record) < size or size < 4:
            raise ValueError
        number = len(features)
        properties = rows[number] if rows is not None and number < len(rows) else {}
        geometry = None if properties is None else _shape(record)  # it is deleted
        features.append({"geometry": geometry, "properties": properties or {}, LAYER: path.stem})
        byte += 8 + size
        if len(features) > MAX_ROWS:
            raise SceneError(f"{path.name}: more than {MAX_ROWS:,} features; cut it")
    return features, system_beside(path)


def _shape(record: bytes) -> _Feature | None:
    """Geometry of a record; heights and measures do not count."""
    kind = int.from_bytes(record[:4], "little") % 10
    if kind == 1:
        return {"type": "Point", "coordinates": list(struct.unpack_from("<2d", record, 4))}
    if kind == 8:
        (number,) = struct.unpack_from("<i", record, 36)
        return {"type": "MultiPoint", "coordinates": _points(record, 40, number).tolist()}
    if kind not in (3, 5):
        return None
    parts, number = struct.unpack_from("<2i", record, 36)
    if not 0 <= parts <= number <= len(record) // 16:
        raise ValueError
    starts = [*struct.unpack_from(f"<{parts}i", record, 44), number]
    points = _points(record, 44 + 4 * parts, number)
    rings = [points[a:b] for a, b in pairwise(starts)]
    if kind == 3:
        return {"type": "MultiLineString", "coordinates": [ring.tolist() for ring in rings]}
    areas: list[list[Floats]] = [[ring] for ring in rings if _turn(ring) <= 0.0]
    for hole in (ring for ring in rings if _turn(ring) > 0.0):
        outer = next((area for area in areas if _inside(hole[0], area[0])), None)
        if outer is None:
            areas.append([hole])
        else:
            outer.append(hole)
    return {"type": "MultiPolygon", "coordinates": [[ring.tolist() for ring in area] for area in areas]}


def _points(data: bytes, byte: int, number: int) -> Floats:
    """Points (n, 2) that begin at some byte."""
    return np.frombuffer(data, "<f8", 2 * number, byte).reshape(-1, 2)


def _turn(ring: Floats) -> float:
    """Twice the area of a ring, positive counter-clockwise."""
    x, y = (ring - ring[:1]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _inside(point: Floats, ring: Floats) -> bool:
    """Whether a point lies within a ring (n, 2)."""
    (x, y), (x1, y1), (x2, y2) = point, ring.T, np.roll(ring, -1, axis=0).T
    crossed = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        return bool((crossed & (x < x1 + (y - y1) * (x2 - x1) / (y2 - y1))).sum() % 2)


def _dbase(path: Path) -> list[dict[str, Any] | None] | None:
    """Rows of the table beside a shapefile, those that are deleted as None; None without a table."""
    table, pages = beside(path, ".dbf"), beside(path, ".cpg")
    if table is None:
        return None
    content = read_whole(table, MAX_BYTES)
    told = read_whole(pages, 4096).decode("latin-1").strip().lower() if pages else ""

    def text(value: bytes) -> str:
        if told in ("", "utf-8", "utf8", "65001"):
            with suppress(UnicodeDecodeError):
                return value.decode()
        return value.decode("cp1252", "replace")

    number, start, size = struct.unpack_from("<IHH", content, 4)
    fields = (content[byte : byte + 32] for byte in range(32, start - 31, 32))
    fields = list(takewhile(lambda field: field[0] != 0x0D, fields))
    if number > MAX_ROWS or not size or start + number * size > len(content) + 1:
        raise ValueError
    row = struct.Struct("c" + "".join(f"{field[16]}s" for field in fields))
    titles = [text(field[:11].split(b"\0")[0]) for field in fields]
    rows: list[dict[str, Any] | None] = []
    for byte in range(start, start + number * size, size):
        mark, *values = row.unpack(content[byte : byte + row.size].ljust(row.size))
        values = [text(value.strip(b"\0 ")) for value in values]
        rows.append(None if mark == b"*" else dict(zip(titles, values, strict=True)))
    return rows


def _package(path: Path) -> tuple[list[_Feature], System]:
    """Features of all layers of a GeoPackage, in the system of the first."""
    if not is_regular(path):
        read_whole(path, MAX_BYTES)  # which says what it is
    features: list[_Feature] = []
    first: System | None = None
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            base.text_factory = lambda data: data.decode("utf-8", "replace")
            layers = base.execute(
                "SELECT g.table_name, g.column_name, s.organization, s.organization_coordsys_id, s.definition "
                "FROM gpkg_geometry_columns g LEFT JOIN gpkg_spatial_ref_sys s ON g.srs_id = s.srs_id"
            ).fetchall()
            for table, column, by, code, text in layers:
                known = str(by).upper() == "EPSG" and code in known_systems()
                system = System(int(code)) if known else system_in(str(text))
                first = first or system
                if system != first:
                    raise SceneError(
                        f"{path.name}: its layers have several coordinate systems; write one of them, for example with "
                        f"ogr2ogr {table}.gpkg {path.name} {table}"
                    )
                rows = base.execute(f'SELECT * FROM "{str(table).replace(chr(34), 2 * chr(34))}"')
                titles = [title for title, *_ in rows.description]
                for row in rows:
                    properties = dict(zip(titles, row, strict=True))
                    geometry = _geometry(properties.pop(column))
                    properties = {k: v for k, v in properties.items() if isinstance(v, str | int | float)}
                    features.append({"geometry": geometry, "properties": properties, LAYER: str(table)})
                    if len(features) > MAX_ROWS:
                        raise SceneError(f"{path.name}: more than {MAX_ROWS:,} features; cut it")
    except sqlite3.Error as error:
        raise SceneError(f"{path.name}: this is no GeoPackage, or damaged: {error}; export it again") from None
    return features, first or System()


def _geometry(blob: Any) -> _Feature | None:
    """Geometry of a GeoPackage: a head, then well-known binary."""
    if blob is None:
        return None
    if not isinstance(blob, bytes) or blob[:2] != b"GP":
        raise ValueError
    envelope = (0, 32, 48, 48, 64)[blob[3] >> 1 & 7]
    return None if blob[3] & 16 else _binary(BytesIO(blob[8 + envelope :]))


def _binary(file: BytesIO, depth: int = 0) -> _Feature | None:
    """The next geometry of well-known binary."""
    order = "<" if file.read(1)[0] else ">"

    def number() -> int:
        return struct.unpack(f"{order}I", file.read(4))[0]

    code = number()
    heights, kind = divmod(code & 0xFFFFFFF, 1000)
    size = 2 + (code >> 31) + (code >> 30 & 1) + (0, 1, 1, 2)[heights]

    def points(many: int) -> list[list[float]]:
        return np.frombuffer(file.read(8 * size * many), f"{order}f8").reshape(many, size)[:, :2].tolist()

    if kind == 1:
        (point,) = points(1)
        return {"type": "Point", "coordinates": point} if np.isfinite(point).all() else None
    many = number()
    if kind == 2:
        return {"type": "LineString", "coordinates": points(many)}
    if kind == 3:
        return {"type": "Polygon", "coordinates": [points(number()) for _ in range(many)]}
    if kind not in (4, 5, 6, 7) or depth > _DEEPEST:
        raise ValueError
    parts = [part for _ in range(many) if (part := _binary(file, depth + 1))]
    if kind == 7:
        return {"type": "GeometryCollection", "geometries": parts}
    return {"type": f"Multi{_SINGLE[kind - 4]}", "coordinates": [part["coordinates"] for part in parts]}
