# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids of heights of other kinds: tiles of the Shuttle mission, lists of places, models of the USGS; tiles as one."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..files import read_whole
from ..jobs import Job, Progress
from .geotiff import read_tiff
from .projection import LONGITUDE_LATITUDE, System
from .rasters import MAX_TEXT, Raster, checked_size, numbers_in, read_ascii, system_beside, upright, without_nodata

#: Endings of files whose values the engine reads itself.
ENDINGS = (".asc", ".txt", ".grd", ".agr", ".dem", ".hgt", ".xyz", ".csv", ".tif", ".tiff")
_VOID = -32768.0  # of tiles of the Shuttle mission
_EVEN = 0.05  # of a step, by which places of a list may be off
_RECORD, _FIRST, _LATER, _VALUE = 1024, 146, 170, 6  # of a USGS model: bytes, values in records, bytes of a value


def read_grid(path: Path) -> Job[Raster]:
    """Read a raster of any of `ENDINGS` by what it holds; yields progress.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken; names the line or tag.
    """
    ending = path.suffix.lower()
    if ending in (".tif", ".tiff"):
        return (yield from read_tiff(path))
    if ending == ".hgt":
        return _hgt(path)
    with path.open("rb") as file:
        start = file.read(_RECORD)
    if re.match(rb"\s*[a-z]+\s+[-+\d.]+\s", start, re.IGNORECASE) and not re.match(rb"\s*x\s", start, re.IGNORECASE):
        return (yield from read_ascii(path))
    if ending == ".dem":
        return _usgs(path)
    if ending in (".xyz", ".csv", ".txt") and re.match(
        rb"[^\n]*[\d.][ \t,;]+[-+\d.][^\n]*\n|[\"\w]*[xelXEL]\w*\W", start
    ):
        return (yield from _xyz(path))
    return (yield from read_ascii(path))


def _hgt(path: Path) -> Raster:
    """A tile of a degree; its name tells its south-western corner."""
    name, match = path.name, re.match(r"([NS])(\d{1,2})([EW])(\d{1,3})", path.stem, re.IGNORECASE)
    if not match:
        raise SceneError(f"{name}: a .hgt file has its place in its name, such as N48E009.hgt; name it so")
    content = read_whole(path, 4 * 10**8)
    side = round((len(content) / 2) ** 0.5)
    if side < 2 or 2 * side * side != len(content):
        raise SceneError(f"{name}: {len(content):,} bytes are no square of 16-bit values; it is damaged; get it again")
    checked_size(side, side, f"{name}: ")
    south, west = (int(match[k + 1]) * (-1 if match[k].upper() in "SW" else 1) for k in (1, 3))
    values = np.frombuffer(content, ">i2").reshape(side, side).astype(np.float32)
    step = 1.0 / (side - 1)
    corner = np.array([west, south + 1.0])
    return Raster(without_nodata(values, _VOID), corner, *upright(step, step), System(LONGITUDE_LATITUDE))


def _xyz(path: Path) -> Job[Raster]:
    """Lines of x, y and height, in any order."""
    name, content = path.name, read_whole(path, MAX_TEXT)
    head = content[: content.find(b"\n") + 1 or len(content)]
    line = 1
    if re.search(rb"[a-df-z]", head, re.IGNORECASE):
        content, line = content[len(head) :], 2
        head = content[: content.find(b"\n") + 1 or len(content)]
    if head.count(b";") >= 2:
        content, head = content.replace(b",", b"."), head.replace(b",", b".")
    yield Progress(0.1, f"Reading {name}")
    numbers = numbers_in(content.translate(bytes.maketrans(b",;\t", b"   ")), name, line)
    columns = len(head.translate(bytes.maketrans(b",;", b"  ")).split())
    if columns < 3 or len(numbers) % columns or len(numbers) < 4 * columns:
        raise SceneError(f"{name}: line {line}: each line must have x, y and height; correct it")
    yield Progress(0.5, f"Reading {name}")
    places = numbers.reshape(-1, columns)[:, :3]
    steps = _step(places[:, 0], name, "x"), _step(places[:, 1], name, "y")
    return _gridded(places, steps, name, system_beside(path), nothing=-9999.0)


def _step(values: Floats, name: str, what: str) -> float:
    """The step of evenly spaced places."""
    places = np.unique(values)
    gaps = np.diff(places)
    gaps = gaps[gaps > 1e-3 * gaps.max(initial=0.0)]
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()])) if len(gaps) else 0.0
    number = np.rint((places - places[0]) / step) if step > 0.0 else np.full(len(places), np.inf)
    if not number.max() < 1e6 or np.abs((places - places[0]) / step - number).max() > max(_EVEN, 1e-4 * number.max()):
        raise SceneError(
            f"{name}: its values of {what} are not evenly spaced; these are points and no grid. Make one of them, for "
            "example with gdal_grid"
        )
    return step


def _gridded(
    places: Floats, steps: Sequence[float], name: str, system: System, scale: float = 1.0, nothing: float | None = None
) -> Raster:
    """A raster of heights at places (n, 3), of which each step is so many units of the system."""
    low = places[:, :2].min(axis=0)
    number = np.rint((places[:, :2] - low) / steps)
    width, height = (int(min(most, 1e9)) + 1 for most in number.max(axis=0).tolist())
    checked_size(width, height, f"{name}: ")
    column, row = number.astype(np.int64).T
    values = np.full((height, width), np.nan, np.float32)
    values[height - 1 - row, column] = places[:, 2]
    corner = scale * (low + [0.0, steps[1] * (height - 1)])
    return Raster(without_nodata(values, nothing), corner, *upright(scale * steps[0], scale * steps[1]), system)


def _usgs(path: Path) -> Raster:
    """An elevation model of the USGS: records of 1,024 letters, a profile from south to north in each few of them."""
    name = path.name
    content = read_whole(path, MAX_TEXT).replace(b"\r", b"").replace(b"\n", b"")

    def real(start: int, end: int) -> float:
        return float(content[start:end].replace(b"D", b"E").replace(b"d", b"e"))

    try:
        plane, zone, units, heights = (int(content[a : a + 6]) for a in (156, 162, 528, 534))
        dx, dy, dz = (real(a, a + 12) for a in (816, 828, 840))
        profiles = int(content[858:864])
        per = {1: 0.3048, 2: 1.0}[heights] * dz
        scale = 1.0 / 3600.0 if units == 3 else {1: 0.3048, 2: 1.0}[units]
        if not (plane in (0, 1) and dx > 0.0 < dy and 1 < profiles < 20_000):
            raise ValueError
        byte, points = _RECORD, []
        for _ in range(profiles):
            number = int(content[byte + 12 : byte + 18])
            x, y, base = (real(byte + a, byte + a + 24) for a in (24, 48, 72))
            records = 1 + -(-max(number - _FIRST, 0) // _LATER)
            complete = byte + (records - 1) * _RECORD < len(content)
            if not (0 < number < 70_000 and np.isfinite((x, y, base)).all() and complete):
                raise ValueError
            block = content[byte : byte + records * _RECORD].ljust(records * _RECORD)
            text = block[144 : 144 + _FIRST * _VALUE]
            text += b"".join(block[k * _RECORD : k * _RECORD + _LATER * _VALUE] for k in range(1, records))
            numbers = np.frombuffer(text, f"S{_VALUE}", number).astype(np.float64)
            z = np.where(numbers <= -32767, np.nan, numbers * per + base)
            points.append(np.stack([np.full(number, x), y + dy * np.arange(number), z], axis=1))
            byte += records * _RECORD
    except (ValueError, KeyError, IndexError, OverflowError):
        raise SceneError(
            f"{name}: neither an ASCII grid nor an elevation model of the USGS, or damaged; export it as GeoTIFF"
        ) from None
    system = System(4267) if plane == 0 else System(26700 + zone) if 1 <= zone <= 22 else System()
    return _gridded(np.concatenate(points), (dx, dy), name, system, scale)


def mosaic(tiles: Sequence[Raster], names: Sequence[str]) -> Raster:
    """Several tiles as one raster; where they overlap, the last that has a value counts.

    Raises
    ------
    SceneError
        They are no tiles of one grid; names the first that is not.
    """
    first = tiles[0]
    if len(tiles) == 1:
        return first
    steps = np.stack([first.along, first.down])
    low, high, places = np.zeros(2, np.int64), np.zeros(2, np.int64), []
    for tile, name in zip(tiles, names, strict=True):
        if (
            tile.system != first.system
            or np.abs(np.stack([tile.along, tile.down]) - steps).max() > 1e-3 * np.abs(steps).max()
        ):
            raise SceneError(
                f"{name}: its coordinate system or cells are not those of {names[0]}; import it by itself, or make one "
                "raster of all, for example with gdalwarp"
            )
        off = first.cells(tile.corner[None])[0]
        if not np.abs(off).max() < 1e6:
            raise SceneError(f"{name}: it lies too far from {names[0]}; import it by itself")
        places.append(np.rint(off).astype(np.int64))
        low, high = np.minimum(low, places[-1]), np.maximum(high, places[-1] + tile.values.shape[::-1])
    width, height = (high - low).tolist()
    checked_size(width, height, f"{names[0]} and {len(tiles) - 1} others: ")
    values = np.full((height, width), np.nan, np.float32)
    for tile, place in zip(tiles, places, strict=True):
        i, j = place - low
        part = values[j : j + tile.values.shape[0], i : i + tile.values.shape[1]]
        np.copyto(part, tile.values, where=np.isfinite(tile.values))
    corner = first.corner + low @ steps
    notes = tuple(dict.fromkeys(note for tile in tiles for note in tile.notes))
    return replace(first, values=values, corner=corner, notes=notes)
