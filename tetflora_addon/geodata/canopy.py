# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees from a canopy height model: tops are highest in a window as wide as their crown; crowns rise toward a top.

Windows follow S. C. Popescu and R. H. Wynne, "Seeing the Trees in the Forest", Photogrammetric Engineering & Remote
Sensing 70 (5), 2004: crown width over height of mixed stands. Crowns are watersheds: from each cell one climbs to its
highest neighbor, and from a summit that is no top to the top that hides it. Nothing loops over cells or trees.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Mask
from ..arrays import top as top_of
from ..errors import SceneError
from ..jobs import Job, Progress
from .projection import between
from .rasters import Raster

#: Crown width in meters: the first, and the second for each square meter of height (Popescu and Wynne, mixed stands).
WINDOW = (2.51503, 0.00901)
#: A crown's edge is at least so high, over its top; and at most so far from it, in windows.
_EDGE, _REACH = 0.3, 2.5
_MOST_WINDOW = 20.0  # meters from a top within which others are looked for
_LEAN = 0.6  # at most, how far the middle of a crown is from its top, in radii
#: Meters: what no ground is that trees are measured from, what no tree is, and what is seldom the lowest of a canopy.
_GROUND, _TALLEST, _NEAR = 60.0, 130.0, 8.0
_ROWS = 256  # of a surface at a time
_AROUND = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0))


@dataclass(frozen=True)
class Trees:
    """Trees that were found."""

    #: column and row, (n,): places of the tops in cells.
    column: Floats
    row: Floats
    #: height and width, (n,): meters; the width is that of a circle of the crown's area.
    height: Floats
    width: Floats
    offset: Floats  # (n, 2): from the top to the middle of the crown, in radii, along rows and down columns


def heights_above(surface: Raster, ground: Raster, what: str) -> Raster:
    """Heights of a surface above the ground, where both are known: a canopy of two elevation models.

    Raises
    ------
    SceneError
        Nobody can tell where one lies on the other; ``what`` begins the message.
    """
    if (surface.system.epsg == 0) != (ground.system.epsg == 0):
        raise SceneError(f"{what}the coordinate system of one of the two rasters is not known; set Coordinate System")
    h, w = surface.values.shape
    out = np.empty((h, w), np.float32)
    for top in range(0, h, _ROWS):
        row = np.arange(top, min(top + _ROWS, h))
        places = surface.places(np.tile(np.arange(w), len(row)), np.repeat(row, w))
        cells = ground.cells(between(places, surface.system, ground.system))
        inside = ((cells >= -0.5) & (cells <= np.array(ground.values.shape[::-1]) - 0.5)).all(axis=1)
        below = np.where(inside, ground.at(*np.nan_to_num(cells).T), np.nan)
        out[row] = surface.values[row] - below.reshape(len(row), w)
    if not np.isfinite(out).any():
        raise SceneError(f"{what}the two rasters have no place in common; choose another Ground Below")
    return replace(surface, values=out)


def checked_canopy(values: Floats32, what: str) -> tuple[Floats32, list[str]]:
    """Canopy heights without what no tree can be, and what is to be told of them.

    Raises
    ------
    SceneError
        They are elevations, or in another unit; ``what`` begins the message.
    """
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, (1.0, 99.0)).tolist()
    if low > _GROUND:
        raise SceneError(
            f"{what}its values are from {known.min():,.0f} to {known.max():,.0f} m: elevations above the sea, and not "
            "heights above the ground. Choose the elevations of the ground as Ground Below, or import it as terrain"
        )
    if high > _TALLEST:
        raise SceneError(
            f"{what}its values are up to {known.max():,.0f} m, higher than any tree; if they are in centimeters, set "
            "Meters per Value to 0.01; if they are elevations above the sea, choose those of the ground as Ground Below"
        )
    notes = []
    if low > _NEAR:
        notes.append(f"its lowest cells are {low:,.0f} m high; check that these are heights above the ground")
    tall = values > _TALLEST
    if tall.any():
        notes.append(f"{int(tall.sum()):,} cells higher than {_TALLEST:g} m left out")
    return np.where(tall, np.float32(np.nan), values), notes


def without_areas(raster: Raster, areas: Sequence[Floats]) -> tuple[Raster, int]:
    """A raster with nothing known within areas (k, 2) in its own coordinates, and how many cells that are."""
    h, w = raster.values.shape
    inside = np.zeros((h, w), bool)
    for area in areas:
        ring = raster.cells(area)
        (x1, y1), (x2, y2) = ring.T, np.roll(ring, -1, axis=0).T
        rows = np.arange(max(int(np.ceil(y1.min())), 0), min(int(np.floor(y1.max())) + 1, h))
        line, edge = np.nonzero((y1 > rows[:, None]) != (y2 > rows[:, None]))
        crossed = x1[edge] + (rows[line] - y1[edge]) * (x2 - x1)[edge] / (y2 - y1)[edge]
        turned = np.zeros((len(rows), w + 1), bool)  # from each border on, the other side
        np.logical_xor.at(turned, (line, np.clip(np.ceil(crossed), 0, w).astype(np.int64)), True)
        inside[rows] |= np.logical_xor.accumulate(turned, axis=1)[:, :-1]
    values = np.where(inside, np.float32(np.nan), raster.values)
    return replace(raster, values=values), int((inside & np.isfinite(raster.values)).sum())


def find_trees(values: Floats32, cell: float, least: float) -> Job[Trees]:
    """Find trees; yields progress.

    Parameters
    ----------
    values : (h, w) float32
        Heights above the ground, meters; nan where nothing is known.
    cell : float
        Side of a cell, meters.
    least : float
        Height of the smallest tree, meters.
    """
    width = values.shape[1]
    yield Progress(0.1, "Looking for treetops")
    # A border of nothing, so that all cells have neighbors.
    flat = np.pad(np.nan_to_num(values, nan=0.0), 1).ravel()
    stride = width + 2
    parent = np.arange(len(flat))
    inside = np.flatnonzero(flat >= least)
    best, target = flat[inside], inside
    for i, j in _AROUND:
        other = inside + i * stride + j
        higher = _before(flat[other], other, best, target)
        best, target = np.where(higher, flat[other], best), np.where(higher, other, target)
    parent[inside] = target
    summits = inside[target == inside]
    yield Progress(0.3, "Looking for treetops")
    parent[summits] = yield from _hidden_by(flat, summits, stride, cell)
    yield Progress(0.7, "Measuring crowns")
    parent = top_of(parent)
    tops = summits[parent[summits] == summits]
    number = np.full(len(flat), -1)
    number[tops] = np.arange(len(tops))
    tree = number[parent[inside]]
    across, down = inside % stride - tops[tree] % stride, inside // stride - tops[tree] // stride
    top = flat[tops].astype(np.float64)
    reach = _REACH * _window(top) / cell
    crown = (flat[inside] >= _EDGE * top[tree]) & (across**2 + down**2 <= reach[tree] ** 2)
    tree, across, down = tree[crown], across[crown], down[crown]
    cells = np.bincount(tree, minlength=len(tops))
    radius = np.sqrt(cells / np.pi)
    middle = np.stack([np.bincount(tree, part, len(tops)) / np.maximum(cells, 1) for part in (across, down)], axis=1)
    offset = np.clip(middle / np.maximum(radius, 1.0)[:, None], -_LEAN, _LEAN)
    column, row = (tops % stride - 1).astype(np.float64), (tops // stride - 1).astype(np.float64)
    return Trees(column, row, top, 2.0 * cell * radius, offset)


def _window(height: NDArray[np.floating]) -> NDArray[np.floating]:
    """Radius of windows around tops of some height, meters."""
    return np.minimum((WINDOW[0] + WINDOW[1] * height**2) / 2.0, _MOST_WINDOW)


def _hidden_by(flat: Floats32, summits: Integers, stride: int, cell: float) -> Job[Integers]:
    """For each summit the cell that is highest in its window: itself if it is a top."""
    radius = _window(flat[summits].astype(np.float64)) / cell
    order = np.argsort(-radius, kind="stable")
    best, target = flat[summits], summits.copy()
    most = int(radius.max(initial=0.0))
    rows = len(flat) // stride
    for i in range(-most, most + 1):
        yield Progress(0.3 + 0.4 * (i + most) / max(2 * most, 1), "Looking for treetops")
        for j in range(-most, most + 1):
            reach = np.hypot(i, j)
            wide = order[: np.searchsorted(-radius[order], -reach, side="right")]  # those with windows as wide
            if reach == 0.0 or not len(wide):
                continue
            row, column = summits[wide] // stride + i, summits[wide] % stride + j
            within = (row >= 0) & (row < rows) & (column >= 0) & (column < stride)
            wide, other = wide[within], (row * stride + column)[within]
            higher = _before(flat[other], other, best[wide], target[wide])
            best[wide[higher]], target[wide[higher]] = flat[other[higher]], other[higher]
    return target


def _before(value: Floats32, cell: Integers, other: Floats32, than: Integers) -> Mask:
    """Whether cells are higher than others; of equal ones the first is."""
    return (value > other) | ((value == other) & (cell < than))
