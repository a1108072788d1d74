# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters of heights: where their cells lie, ASCII grids, world files, and values between cells."""

import re
import warnings
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32
from ..errors import SceneError, quoted
from ..files import is_regular, read_whole
from ..jobs import Job, Progress
from .projection import LONGITUDE_LATITUDE, System, may_be_degrees, system_in

#: Most cells of a raster, and bytes of a text file of them.
MAX_CELLS, MAX_TEXT = 40_000_000, 1_000_000_000
#: Most cells along one side; Blender's own images end there too.
MAX_SIDE = 65_000
_HEADER = {"ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "dx", "dy", "nodata_value"}
_BEYOND = 3.4e38  # fits into single precision, as numbers that stand for nothing do
_HEAD = 4096  # bytes
_PIECE = 4_000_000  # bytes of text between two signs of life
_LIMIT = 1e7  # meters: what is higher, or has larger coordinates than a thousand times so much, is no place
_SMALL = 4096  # bytes of world files and files with the name of a coordinate system


@dataclass(frozen=True)
class Raster:
    """Cells with one value each."""

    #: (h, w): meters, the first row is the file's first (the northernmost, if ``down`` is); nan where none is known.
    values: Floats32
    corner: Floats  # (2,): coordinates of the middle of the first cell of the first row
    #: along and down, (2,): steps from a cell to the next of its row, and to the next row.
    along: Floats
    down: Floats
    system: System
    notes: tuple[str, ...] = ()  # what was taken from the file beside its values

    def places(self, column: NDArray[np.floating], row: NDArray[np.floating]) -> Floats:
        """Coordinates (n, 2) of places given in cells; 0, 0 is the middle of the first cell."""
        return self.corner + np.outer(column, self.along) + np.outer(row, self.down)

    def cells(self, points: Floats) -> Floats:
        """Column and row, (n, 2), of places given by their coordinates."""
        return np.linalg.solve(np.stack([self.along, self.down]).T, (points - self.corner).T).T

    def part(self, cells: Floats) -> Self:
        """The part that holds some cells (n, 2), by column and row, as far as they are there."""
        most = self.values.shape[::-1]
        low = np.clip(np.floor(cells.min(axis=0)), 0, most).astype(np.int64)
        high = np.clip(np.ceil(cells.max(axis=0)) + 1, 0, most).astype(np.int64)
        values = self.values[low[1] : high[1], low[0] : high[0]]
        return replace(self, values=values, corner=self.places(low[:1], low[1:])[0])

    @property
    def outline(self) -> Floats:
        """Coordinates of the four corners, (4, 2)."""
        h, w = self.values.shape
        return self.places(np.array([-0.5, w - 0.5, w - 0.5, -0.5]), np.array([-0.5, -0.5, h - 0.5, h - 0.5]))

    def at(self, column: NDArray[np.floating], row: NDArray[np.floating]) -> Floats:
        """Values between cells, (n,), linear; those of the border beyond it, nan where a cell that counts is."""
        h, w = self.values.shape
        column, row = np.clip(column, 0.0, w - 1.0), np.clip(row, 0.0, h - 1.0)
        i, j = (np.minimum(np.floor(c), max(n - 2, 0)).astype(np.int64) for c, n in ((column, w), (row, h)))
        out = np.zeros(len(i))
        for y, x in ((j, i), (j, i + 1), (j + 1, i), (j + 1, i + 1)):
            weight = (1.0 - np.abs(column - x)) * (1.0 - np.abs(row - y))
            # What does not count may be nan, and lies beyond a raster of one cell.
            out += np.where(weight > 0.0, weight * self.values[np.minimum(y, h - 1), np.minimum(x, w - 1)], 0.0)
        return out

    def coarser(self, most: int) -> Self:
        """The same with means of whole blocks of cells, so that there are at most so many; itself if there are."""
        h, w = self.values.shape
        step = int(np.ceil(np.sqrt(h * w / max(most, 1))))
        if step < 2:
            return self
        rows, columns = np.arange(0, h, step), np.arange(0, w, step)

        def sums(values: Floats) -> Floats:
            return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)

        known = np.isfinite(self.values)
        count = sums(known.astype(np.float64))
        total = sums(np.where(known, self.values, 0.0).astype(np.float64))
        with np.errstate(invalid="ignore"):
            values = np.where(count > 0, total / count, np.nan).astype(np.float32)
        # The last blocks may be smaller: whoever needs places of their middles moves by less than half a block.
        corner = self.places(np.array([(step - 1) / 2]), np.array([(step - 1) / 2]))[0]
        return replace(self, values=values, corner=corner, along=step * self.along, down=step * self.down)


def upright(dx: float, dy: float) -> tuple[Floats, Floats]:
    """Steps along rows to the east, and down to the south."""
    return np.array([dx, 0.0]), np.array([0.0, -dy])


def check_regular(path: Path) -> None:
    """Refuse folders, links, pipes and devices.

    Raises
    ------
    OSError
        There is nothing, or it cannot be looked at.
    SceneError
        It is one of these.
    """
    if not is_regular(path):
        with suppress(ValueError):  # a zero in its name
            path.lstat()
        raise SceneError(f"{path.name}: it is not a regular file; choose another one")


def in_degrees(raster: Raster, what: str) -> Raster:
    """A raster of which no file tells the system; its cells may be so small that they are degrees.

    Raises
    ------
    SceneError
        Nobody can tell; ``what`` begins the message.
    """
    if raster.system != System() or not may_be_degrees(raster.outline):
        return raster
    cell = max(np.abs(raster.along).max(), np.abs(raster.down).max())
    if cell < _DEGREES:
        return replace(raster, system=System(LONGITUDE_LATITUDE), notes=(*raster.notes, "coordinates read as degrees"))
    if cell < _UNCLEAR:
        raise SceneError(
            f"{what}its cells are {cell:g} wide, which may be degrees or meters; set Coordinate System to 4326, or "
            "turn on Plain Meters"
        )
    return raster


_DEGREES, _UNCLEAR = 0.003, 0.1  # cells: no ground is as fine in meters, or as coarse in degrees


def checked_size(width: int, height: int, what: str) -> None:
    """Refuse rasters that are too large, or have no cells.

    Raises
    ------
    SceneError
        ``what`` begins the message.
    """
    if min(width, height) < 2 or max(width, height) > MAX_SIDE or width * height > MAX_CELLS:
        raise SceneError(
            f"{what}{width:,} by {height:,} cells; from 2 by 2 to {MAX_CELLS:,} in all can be read. Crop it, or "
            "make it coarser, for example with gdal_translate -outsize 25% 25%"
        )


def read_ascii(path: Path) -> Job[Raster]:
    """Read an ASCII grid (Esri); yields progress. A file ``.prj`` beside it may name its coordinate system.

    Raises
    ------
    OSError, SceneError
        It cannot be read, or is broken; names the line.
    """
    content = read_whole(path, MAX_TEXT)
    name, header, start = path.name, {}, 0
    for line, text in enumerate(content[:_HEAD].split(b"\n"), 1):
        words = text[:200].decode("latin-1").split()
        key = words[0].lower() if words else ""
        if words and (not re.match(r"[A-Za-z_]", key) or key in ("nan", "inf")):
            break
        if words:
            if key not in _HEADER or len(words) != 2:
                told = quoted(" ".join(words))
                raise SceneError(f"{name}: line {line}: {told} is no header line of an ASCII grid; correct it")
            header[key] = _number(words[1], f"{name}: line {line}: {key}")
        start += len(text) + 1
    width, height, corner, dx, dy = _ascii_head(header, name)
    # Each value is at least one digit and a space: a small file is no large grid, whatever its head says.
    if len(content) - start + 1 < 2 * width * height:
        told = f"{width:,} by {height:,} values"
        raise SceneError(f"{name}: its head tells of {told}, more than the file can hold; get it again")
    values = np.empty(width * height, np.float32)
    done = 0
    while start < len(content):
        yield Progress(0.9 * start / len(content), f"Reading {name}")
        end = content.find(b"\n", start + _PIECE)
        end = len(content) if end < 0 else end + 1
        piece = content[start:end]
        numbers = numbers_in(piece, name, line)
        if done + len(numbers) > len(values):
            raise SceneError(f"{name}: more than the {len(values):,} values that its head tells of; get it again")
        values[done : done + len(numbers)] = np.clip(numbers, -_BEYOND, _BEYOND)
        done, start, line = done + len(numbers), end, line + piece.count(b"\n")
    if done < len(values):
        raise SceneError(f"{name}: line {line}: it ends after {done:,} of {len(values):,} values; get it again")
    values = without_nodata(values.reshape(height, width), header.get("nodata_value", -9999.0))
    return Raster(values, np.array([corner[0], corner[1] + (height - 1) * dy]), *upright(dx, dy), system_beside(path))


def _ascii_head(header: dict[str, float], name: str) -> tuple[int, int, tuple[float, float], float, float]:
    """Width, height, middle of the lower left cell, and size of cells."""
    missing = [key for key in ("ncols", "nrows") if key not in header]
    missing += ["cellsize"] * ("cellsize" not in header and not {"dx", "dy"} <= header.keys())
    missing += [f"{a}llcorner" for a in "xy" if not header.keys() & {f"{a}llcorner", f"{a}llcenter"}]
    if missing:
        raise SceneError(f"{name}: no ASCII grid: {', '.join(missing)} is missing in its head; export it as GeoTIFF")
    dx, dy = header.get("dx", header.get("cellsize")), header.get("dy", header.get("cellsize"))
    width, height = header["ncols"], header["nrows"]
    if width != int(width) or height != int(height):
        raise SceneError(f"{name}: ncols and nrows must be whole numbers; correct them")
    checked_size(int(width), int(height), f"{name}: ")
    if not (0.0 < dx < _LIMIT and 0.0 < dy < _LIMIT):
        raise SceneError(f"{name}: cellsize must be greater than 0; correct it")
    corner = tuple(
        header[f"{a}llcenter"] if f"{a}llcenter" in header else header[f"{a}llcorner"] + d / 2
        for a, d in (("x", dx), ("y", dy))
    )
    return int(width), int(height), corner, dx, dy


def numbers_in(piece: bytes, name: str, line: int) -> Floats:
    """All numbers of some lines; a broken one is told by its line."""
    numbers = _split(piece)
    if numbers is not None:
        return numbers
    for number, text in enumerate(piece.split(b"\n")):
        if text.strip() and _split(text) is None:
            words = text.decode("latin-1").split()
            bad = next((w for w in words if _split(w.encode()) is None), words[0])
            raise SceneError(f"{name}: line {line + number}: {quoted(bad)} is not a number; correct it")
    raise SceneError(f"{name}: line {line}: not a list of numbers; correct it")


def _split(text: bytes) -> Floats | None:
    """Numbers (n,) of a text; None if one of them is none."""
    if not text.strip():  # of which NumPy makes -1
        return np.empty(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text.decode("ascii"), sep=" ")
        except (ValueError, DeprecationWarning):
            return None


def _number(text: str, what: str) -> float:
    """A number of a head; what it is begins the message."""
    try:
        value = float(text)
    except ValueError:
        raise SceneError(f"{what} is {quoted(text)}, which is not a number; correct it") from None
    if not abs(value) < 1000 * _LIMIT and "nodata" not in what:
        raise SceneError(f"{what} is {quoted(text)}, which is too large; correct it")
    return value


def without_nodata(values: NDArray[np.floating], nothing: float | None) -> Floats32:
    """Values with nan where nothing is known, or what stands there is no height."""
    values = np.asarray(values, np.float32)
    bad = ~(np.abs(values) < _LIMIT)
    if nothing is not None:
        bad |= values == np.float32(np.clip(nothing, -_BEYOND, _BEYOND))
    return np.where(bad, np.float32(np.nan), values)


def beside(path: Path, *endings: str) -> Path | None:
    """The first file with the name of another and one of some endings, in small or large letters."""
    paths = (path.with_suffix(ending) for small in endings for ending in (small, small.upper()))
    return next((file for file in paths if file.exists()), None)


def system_beside(path: Path) -> System:
    """The system in a file ``.prj`` beside another."""
    file = beside(path, ".prj")
    return system_in(read_whole(file, 16 * _SMALL).decode("latin-1")) if file else System()


def world_file(path: Path) -> list[Floats]:
    """Middle of the first cell, and steps along and down, of the world file of an image.

    Raises
    ------
    OSError
        It cannot be read.
    SceneError
        There is none, or it is broken; names the line.
    """
    ending = path.suffix.lower()
    endings = f"{ending[:2]}{ending[-1:]}w", f"{ending}w", ".wld"
    file = beside(path, *endings)
    if file is None:
        raise SceneError(
            f"{path.name}: nothing tells where it lies, neither tags nor a world file ({', '.join(endings)}); export "
            "it as GeoTIFF"
        )
    lines = read_whole(file, _SMALL).decode("latin-1").split()
    if len(lines) != 6:
        raise SceneError(f"{file.name}: {len(lines)} numbers; a world file has six, one on each line; correct it")
    numbered = enumerate(lines, 1)
    a, d, b, e, x, y = (_number(text.replace(",", "."), f"{file.name}: line {number}") for number, text in numbered)
    if not abs(a * e - b * d) > 0.0:
        raise SceneError(f"{file.name}: line 1: its cells have no size; correct it")
    return [np.array([x, y]), np.array([a, d]), np.array([b, e])]
