# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How wet the ground is, from its shape alone: water runs downhill, gathers in hollows and stays where it is level.

Hollows are filled to where they flow over (Planchon & Darboux, "A fast, simple and versatile algorithm to fill the
depressions of digital elevation models", Catena 46, 2002); what is uphill of a cell follows from flow that spreads over
all lower neighbors (Freeman, "Calculating catchment area with divergent flow based on a regular grid", Computers &
Geosciences 17, 1991); wetness is the topographic index ln(a / tan β) (Beven & Kirkby, "A physically based, variable
contributing area model of basin hydrology", Hydrological Sciences Bulletin 24, 1979).

The ground is a regular grid of heights: what water, light and growth ask of it is asked of neighboring cells.
"""

from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from ..arrays import Floats, Integers, Mask, chunks, spread
from ..errors import SceneError

#: Most cells of a grid, whatever its use.
MOST_CELLS = 16_000_000
_ENTRIES = 1_000_000  # about as many cells are looked at together


@dataclass(frozen=True)
class HeightGrid:
    """Heights at the middles of square cells.

    Cells lie on a lattice through the world's origin, so that they do not move when ground is added beside.
    """

    #: west and south: corner of the first cell, meters in world space.
    west: float
    south: float
    cell: float  # side of a cell, meters
    #: (h, w): of the highest surface, meters; the first row is the southernmost. NaN where there is no ground.
    height: Floats

    def at(self, values: Floats, points: Floats) -> Floats:
        """Values (h, w) of cells at places (n, 2 or more), linear between middles, (n,); NaN where all four are NaN."""
        rows, columns = values.shape
        place = (points[:, :2] - (self.west, self.south)) / self.cell - 0.5
        low = np.floor(place)
        part = np.clip(place - low, 0.0, 1.0)
        low = low.astype(np.int64)
        total, weights = np.zeros(len(points)), np.zeros(len(points))
        for i in (0, 1):
            for j in (0, 1):
                value = values[np.clip(low[:, 1] + j, 0, rows - 1), np.clip(low[:, 0] + i, 0, columns - 1)]
                weight = np.abs(1 - i - part[:, 0]) * np.abs(1 - j - part[:, 1])
                known = ~np.isnan(value)
                total += np.where(known, weight * np.where(known, value, 0.0), 0.0)
                weights += np.where(known, weight, 0.0)
        return np.where(weights > 0.0, total / np.where(weights > 0.0, weights, 1.0), np.nan)


def cell_for(triangles: Floats, finest: float, most: int) -> float:
    """Side of cells, meters: the finest, doubled until the ground (t, 3, 3) has no more than ``most`` of them."""
    span = np.ptp(triangles[..., :2].reshape(-1, 2), axis=0)
    cell = finest
    while (np.floor(span / cell) + 2.0).prod() > most:
        cell *= 2.0
    return cell


def height_grid(triangles: Floats, cell: float) -> HeightGrid:
    """Heights of the highest of all triangles.

    Parameters
    ----------
    triangles : (t, 3, 3) float64
        Corners, meters in world space; walls, which have no area on the map, do not count.
    cell : float
        Meters.

    Raises
    ------
    SceneError
        More than `MOST_CELLS`.
    """
    flat = triangles[..., :2].reshape(-1, 2)
    first = np.floor(flat.min(axis=0) / cell)
    columns, rows = np.maximum(np.ceil(flat.max(axis=0) / cell) - first, 1.0).tolist()
    if rows * columns > MOST_CELLS:
        raise SceneError(
            f"The ground is {rows * columns:,.0f} cells of {cell:g} m large; the limit is {MOST_CELLS:,}. "
            "Use larger cells or less ground"
        )
    rows, columns = int(rows), int(columns)
    west, south = (first * cell).tolist()
    # In cells, so that the middle of column j of row i is (j, i).
    corners = triangles.copy()
    corners[..., :2] = (triangles[..., :2] - (west, south)) / cell - 0.5
    slope, upright = _planes(corners)
    corners, slope = corners[upright], slope[upright]
    top = np.full(rows * columns, -np.inf)
    lowest = np.clip(np.ceil(corners[..., 1].min(axis=1) - _HAIR), 0, rows - 1).astype(np.int64)
    highest = np.clip(np.floor(corners[..., 1].max(axis=1) + _HAIR), -1, rows - 1).astype(np.int64)
    number = np.maximum(highest - lowest + 1, 0)
    for run in chunks(number, _ENTRIES):
        owner, offset = spread(number[run])
        triangle = run.start + owner
        _draw(corners, slope, triangle, lowest[triangle] + offset, columns, top)
    return HeightGrid(west, south, cell, np.where(np.isneginf(top), np.nan, top).reshape(rows, columns))


_HAIR = 1e-9  # of a cell: middles on a border belong to both sides


def _planes(corners: Floats) -> tuple[Floats, Mask]:
    """Rise of triangles along x and y, (t, 2), and which have an area on the map."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    size = np.abs(u[:, :2]).max(axis=1) + np.abs(v[:, :2]).max(axis=1)
    upright = np.abs(area) > 1e-12 * np.maximum(size * size, 1e-12)
    area = np.where(upright, area, 1.0)
    east = (u[:, 2] * v[:, 1] - v[:, 2] * u[:, 1]) / area
    return np.stack([east, (v[:, 2] * u[:, 0] - u[:, 2] * v[:, 0]) / area], axis=1), upright


def _draw(corners: Floats, slope: Floats, triangle: Integers, row: Integers, columns: int, top: Floats) -> None:
    """Raise the cells of rows (k,), each of a ``triangle`` (k,), to that, in ``top`` (cells,)."""
    left, right = np.full(len(triangle), np.inf), np.full(len(triangle), -np.inf)
    for corner in range(3):
        a, b = corners[triangle, corner, :2], corners[triangle, (corner + 1) % 3, :2]
        rise = b[:, 1] - a[:, 1]
        meets = (np.minimum(a[:, 1], b[:, 1]) <= row + _HAIR) & (np.maximum(a[:, 1], b[:, 1]) >= row - _HAIR)
        along = np.clip((row - a[:, 1]) / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)
        x = a[:, 0] + along * (b[:, 0] - a[:, 0])
        # A level edge lies in the row with both of its ends.
        other = np.where(rise == 0.0, b[:, 0], x)
        left = np.where(meets, np.minimum(left, np.minimum(x, other)), left)
        right = np.where(meets, np.maximum(right, np.maximum(x, other)), right)
    met = left <= right
    triangle, row, left, right = triangle[met], row[met], left[met], right[met]
    first = np.clip(np.ceil(left - _HAIR), 0, columns).astype(np.int64)
    number = np.maximum(np.clip(np.floor(right + _HAIR), -1, columns - 1).astype(np.int64) - first + 1, 0)
    for run in chunks(number, _ENTRIES):
        owner, offset = spread(number[run])
        span = run.start + owner
        column, mine = first[span] + offset, triangle[span]
        corner = corners[mine, 0]
        height = corner[:, 2] + slope[mine, 0] * (column - corner[:, 0]) + slope[mine, 1] * (row[span] - corner[:, 1])
        # Planes of slivers are steep, and a hair beside them may be far above.
        height = np.clip(height, corners[mine, :, 2].min(axis=1), corners[mine, :, 2].max(axis=1))
        np.maximum.at(top, row[span] * columns + column, height)


#: The topographic index, a in meters, that counts as dry and as wet: a ridge, and the floor of a valley with a brook.
DRY, WET = 2.0, 12.0
_FINEST, _MOST = 1.0, 1_000_000  # finest cells of the ground that plants ask, meters, and their most
_LEVEL = 0.01  # tan β; less is as level
_DRAIN = 1e-6  # least fall of filled ground toward its outlet
_SPREAD = 1.1  # exponent of the fall (Freeman 1991): flow down a cone is even all around
# Neighbors of a cell: rows and columns away, and how far in cells.
_AROUND = tuple((i, j, float(np.hypot(i, j))) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)


def _filled(height: Floats, cell: float) -> Floats:
    """Ground (h, w) without hollows, meters: each cell falls toward the border or toward NaN, from where water leaves.

    All is flooded, and the flood sinks until each cell is as high as its ground, or a hair above its lowest neighbor.
    Rows are swept to and fro, then columns; the result does not depend on that.
    """
    ground = np.pad(height, 1, constant_values=np.nan)
    missing = np.isnan(ground)
    water = np.full(ground.shape, np.inf)
    for i, j, _ in _AROUND:
        outlet = ~missing[1:-1, 1:-1] & missing[1 + i : 1 + i + height.shape[0], 1 + j : 1 + j + height.shape[1]]
        water[1:-1, 1:-1][outlet] = height[outlet]
    ground = np.where(missing, np.inf, ground)  # what is not there holds no water back, and gives none
    while True:
        before = water.copy()
        for turned in (False, True):
            lines, floor = (water.T, ground.T) if turned else (water, ground)
            lines, floor = np.ascontiguousarray(lines), np.ascontiguousarray(floor)
            _sweep(lines, floor, range(1, len(lines) - 1), -1, cell)
            _sweep(lines, floor, range(len(lines) - 2, 0, -1), 1, cell)
            water = lines.T if turned else lines
        water = np.ascontiguousarray(water)
        if np.array_equal(before, water):
            break
    return np.where(np.isnan(height), np.nan, water[1:-1, 1:-1])


def _sweep(water: Floats, ground: Floats, lines: range, before: int, cell: float) -> None:
    """Let water of each line sink to the ground, or to a hair above that of the line before."""
    straight, oblique = _DRAIN * cell, _DRAIN * cell * np.sqrt(2.0)
    for line in lines:
        other, inner = water[line + before], water[line, 1:-1]
        lowest = np.minimum(np.minimum(other[:-2], other[2:]) + oblique, other[1:-1] + straight)
        np.minimum(inner, np.maximum(lowest, ground[line, 1:-1]), out=inner)


def _catchment(surface: Floats, cell: float) -> Floats:
    """Area that is uphill of each cell of a surface (h, w), with its own, (h, w) in m²; NaN where there is no ground.

    All of it arrives at cells without a lower neighbor. A cell is done when all that flow into it are. What arrives is
    summed in the order of neighbors, so the result is the same anywhere.
    """
    rows, columns = surface.shape
    wide = columns + 2
    level = np.pad(np.where(np.isnan(surface), np.inf, surface), 1, constant_values=np.inf)
    land = np.isfinite(level)
    share = np.zeros((len(_AROUND), level.size))
    inner = (slice(1, -1), slice(1, -1))
    for k, (i, j, away) in enumerate(_AROUND):
        other = level[1 + i : 1 + i + rows, 1 + j : 1 + j + columns]
        with np.errstate(invalid="ignore"):
            fall = np.where(land[inner] & np.isfinite(other), level[inner] - other, 0.0) / (cell * away)
        share[k].reshape(level.shape)[inner] = np.maximum(fall, 0.0) ** _SPREAD
    total = share.sum(axis=0)
    share /= np.where(total > 0.0, total, 1.0)
    steps = np.array([i * wide + j for i, j, _ in _AROUND])
    waits = np.zeros(level.size, np.int64)
    for k, step in enumerate(steps.tolist()):
        waits[np.flatnonzero(share[k] > 0.0) + step] += 1  # each cell once for one direction
    area = np.zeros(level.size)
    ready = np.flatnonzero(land.reshape(-1) & (waits == 0))
    while len(ready):
        came = np.full(len(ready), cell * cell)
        for k, step in enumerate(steps.tolist()):
            came += share[k, ready - step] * area[ready - step]
        area[ready] = came
        gives = share[:, ready] > 0.0
        reached = (ready + steps[:, None])[gives]
        np.subtract.at(waits, reached, 1)
        ready = np.unique(reached[waits[reached] == 0])
    return np.where(np.isnan(surface), np.nan, area.reshape(level.shape)[inner])


def steepness(surface: Floats, cell: float) -> Floats:
    """Tan β of each cell of a surface (h, w), from its neighbors to both sides where it has them; NaN stays."""
    around = np.pad(surface, 1, constant_values=np.nan)
    rises = []
    for line in (around[:, 1:-1], around[1:-1].T):
        below, above = line[1:-1] - line[:-2], line[2:] - line[1:-1]
        below, above = np.where(np.isnan(below), above, below), np.where(np.isnan(above), below, above)
        rises.append(np.nan_to_num(0.5 * (below + above)) / cell)
    return np.where(np.isnan(surface), np.nan, np.hypot(rises[0], rises[1].T))


def topographic_index(height: Floats, cell: float) -> Floats:
    """ln(a / tan β) of each cell, (h, w), a the area uphill for each meter of width; NaN where there is no ground."""
    surfaces = height, _filled(height, cell)  # hollows keep what runs into them, or are full and flow over
    return np.log(np.maximum(*(_catchment(s, cell) / cell / np.maximum(steepness(s, cell), _LEVEL) for s in surfaces)))


def wetness(height: Floats, cell: float) -> Floats:
    """How wet each cell of a grid of heights (h, w) is, 0 for a ridge to 1 for the floor of a valley; NaN stays.

    Limits are fixed (`DRY`, `WET`): what is far away, and not uphill, changes nothing.
    """
    return np.clip((topographic_index(height, cell) - DRY) / (WET - DRY), 0.0, 1.0)


@dataclass(frozen=True)
class WetGround:
    """How wet a ground is."""

    grid: HeightGrid
    wetness: Floats  # (h, w): from 0 to 1, of each cell of the grid

    def at(self, points: Floats) -> Floats:
        """Wetness at places on the map (n, 2 or more), (n,); beyond all cells it is that of level ground."""
        return np.nan_to_num(self.grid.at(self.wetness, points), nan=0.5)


_kept: dict[bytes, WetGround] = {}  # the last one, by content: layers of plants ask for the same ground


def wet_ground(triangles: Floats) -> WetGround:
    """How wet a ground (t, 3, 3) is; that of the last one is kept."""
    key = blake2b(np.ascontiguousarray(triangles).data, digest_size=16).digest()
    wet = _kept.get(key)  # other threads may forget it meanwhile
    if wet is None:
        cell = cell_for(triangles, _FINEST, _MOST)
        grid = height_grid(triangles, cell)
        wet = WetGround(grid, wetness(grid.height, cell))
        _kept.clear()
        _kept[key] = wet
    return wet
