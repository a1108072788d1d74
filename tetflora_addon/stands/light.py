# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light in a stand: leaves of all crowns on a grid of columns and layers, and what each crown takes of it.

Each layer takes its part of the light (Beer and Lambert; Monsi and Saeki, "Über den Lichtfaktor in den
Pflanzengesellschaften", 1953), and what is left goes on downwards and a little to all sides, because the sky is not
only overhead. A crown adds four numbers to each column that it covers, whatever it is long: differences along the
column, summed from above. What it takes is a difference of two sums of light along the column. So the cost goes with
the number of plants and the area, and no light is taken twice.

Leaves are whole numbers of a small unit, so that sums do not depend on their order.

Which columns of a grid a crown covers, seen from above: tables of discs, by their radius and their place in a cell.

Crowns are looked up, not drawn: radius and middle are rounded to a part of a cell, so a crown covers a run of a table.
"""

from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Integers32, spread
from ..errors import TetFloraError
from ..parallel import blocks, each_on_all_cores, on_all_cores

_RADII, _PLACES = 4, 3  # radii for each cell, and places of the middle across a cell
_FINE = 12  # points across a cell that tell how much of it is covered


class Discs(NamedTuple):
    """Tables of discs up to a radius."""

    #: first and number, (d,): run of each disc, by ``radius × _PLACES² + row of the middle × _PLACES + column``.
    first: Integers
    number: Integers
    #: row and column, (m,): of the cell, from that of the middle.
    row: Integers
    column: Integers
    part: Floats  # (m,): fraction of the disc in the cell
    far: Floats  # (m,): square of the distance from the middle over the radius, mean of what is covered


@cache
def _disc(radius: int, row: int, column: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    size = max(radius / _RADII, 0.5 / _FINE)
    reach = int(np.ceil(size + 0.5))
    place = (np.arange((2 * reach + 1) * _FINE) + 0.5) / _FINE - reach
    y, x = place - (row + 0.5) / _PLACES, place - (column + 0.5) / _PLACES
    far = (y[:, None] ** 2 + x[None, :] ** 2) / size**2
    inside = far <= 1.0
    cells = 2 * reach + 1

    def by_cell(values: NDArray) -> NDArray:
        return values.reshape(cells, _FINE, cells, _FINE).sum(axis=(1, 3))

    covered = by_cell(inside.astype(np.float64))
    if not covered.any():
        covered[reach, reach] = 1.0
    mean = by_cell(np.where(inside, far, 0.0)) / np.maximum(covered, 1.0)
    rows, columns = np.nonzero(covered)
    return rows - reach, columns - reach, covered[rows, columns] / covered.sum(), mean[rows, columns]


@cache
def _discs(radii: int) -> Discs:
    discs = [_disc(r, i, j) for r in range(radii + 1) for i in range(_PLACES) for j in range(_PLACES)]
    number = np.array([len(disc[0]) for disc in discs])
    return Discs(np.cumsum(number) - number, number, *(np.concatenate(part) for part in zip(*discs, strict=True)))


class CrownCells(NamedTuple):
    """Cells that crowns cover: one row for each crown and cell, those of a crown together."""

    crown: Integers  # (m,)
    #: row and column, (m,): beyond the grid where a crown is.
    row: Integers
    column: Integers
    #: part and far, (m,): as of `Discs`.
    part: Floats
    far: Floats


def covered(x: Floats, y: Floats, radius: Floats) -> CrownCells:
    """Cells that discs (n,) cover; places and radii in cells from the grid's corner.

    What is narrower than a cell is in one alone.
    """
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    size = np.rint(radius * _RADII).astype(np.int64)
    size[radius <= 0.5] = 0
    u, v = (((place - cell) * _PLACES).astype(np.int64) for place, cell in ((x, column), (y, row)))
    tables = _discs(int(size.max(initial=0)))
    kind = (size * _PLACES + v) * _PLACES + u
    crown, index = spread(tables.number[kind])
    index += tables.first[kind][crown]
    cells = row[crown] + tables.row[index], column[crown] + tables.column[index]
    return CrownCells(crown, *cells, tables.part[index], tables.far[index])


#: Layers: the n-th begins at first × n + second × n² meters, finer near the ground, where small plants are.
_LAYERS = (0.5, 0.025)
#: Leaves on the grid are whole numbers of this part of a square meter for each square meter and meter of height.
_UNIT = 1.0 / 65536.0
#: Rows of a strip at least, and cells about; strips do not depend on anything but the grid.
_STRIP_ROWS, _STRIP_CELLS = 16, 1 << 15
_BAND_CELLS = 1 << 17  # cells that light passes together; nothing depends on it
#: Most numbers of the grid at once, 4 bytes each and twice.
MOST_VOXELS = 400_000_000
#: Square meters of sideways variance that light gains for a meter downwards, and the most of it that goes to each of
#: four sides at once.
_SIDEWAYS, _MOST_SIDE = 1.0, 0.15
#: Meters by which the ground below a crown counts at most as higher or lower than at its trunk.
_STEEP = 6.0
_THIN = 0.15  # thinnest crown in a column, over its length


def layer_edge(number: NDArray | int) -> Floats:
    """Height at which layers begin, meters."""
    return _LAYERS[0] * number + _LAYERS[1] * np.square(number)


def layer_of(height: Floats) -> tuple[Integers, Floats]:
    """Layer (n,) of heights (n,), and which part of it is below them."""
    a, b = _LAYERS
    height = np.maximum(height, 0.0)
    layer = ((np.sqrt(a * a + 4.0 * b * height) - a) / (2.0 * b)).astype(np.int64)
    return layer, np.clip((height - layer_edge(layer)) / (a + b * (2 * layer + 1)), 0.0, 1.0)


@dataclass
class Crowns:
    """What of plants takes light; arrays (n,) of meters from the corner of the grid, and m²."""

    #: x, y and radius, (n,): of the crown, not of the trunk.
    x: Floats
    y: Floats
    radius: Floats
    base: Floats  # (n,)
    height: Floats  # (n,)
    leaves: Floats  # (n,): leaf area × extinction, m²
    top: Floats  # (n,): 0 a dome, 1 a cone


class _Columns(NamedTuple):
    """Columns (m,) of the crowns of a strip: of which, places of foot and top in the grid of light, and leaves."""

    number: int
    crown: Integers32
    foot: Integers32
    head: Integers32
    under: Floats32
    over: Floats32
    density: Floats32


@dataclass
class LightGrid:
    """Columns of a ground; light that leaves it on one side enters on the other."""

    rows: int
    columns: int
    cell: float  # meters
    margin: float = 0.0  # meters of open ground around that of the plants
    ground: Floats | None = None  # (rows × columns,): altitudes; level where it is None
    #: (layers + 1, rows × columns): light summed from above down to where each layer begins, meters of full light.
    light: Floats32 = field(init=False)

    def __post_init__(self) -> None:
        self.strip = max(_STRIP_ROWS, _STRIP_CELLS // self.columns)

    @property
    def strips(self) -> list[slice]:
        """Rows that are looked at together."""
        return blocks(self.rows, self.strip)

    def fill(self, crowns: Crowns) -> list[Integers]:
        """Put the leaves of crowns (n,) on the grid and let light through; returns the crowns of each strip."""
        tallest = float(crowns.height.max(initial=0.5)) + (0.0 if self.ground is None else _STEEP)
        layers = int(layer_of(np.array([tallest + 0.01]))[0][0]) + 1
        if (layers + 1) * self.rows * self.columns > MOST_VOXELS:
            raise TetFloraError("The ground is too large for columns this narrow; raise Cell, or use a smaller ground")
        strip = np.clip(((crowns.y + self.margin) / self.cell).astype(np.int64), 0, self.rows - 1) // self.strip
        order = np.argsort(strip, kind="stable")
        ends = np.searchsorted(strip[order], np.arange(len(self.strips) + 1))
        of_strip = [order[ends[i] : ends[i + 1]] for i in range(len(self.strips))]
        leaves = np.zeros((layers, self.rows, self.columns), np.int32)
        self._columns: list[_Columns] = []
        jobs = list(zip(self.strips, of_strip, strict=True))
        for columns, rows, part in on_all_cores(lambda job: self._leaves(crowns, *job, layers), jobs):
            self._columns.append(columns)
            # Twice where the strip reaches around the whole grid: never add with repeated rows at once.
            for start in range(0, len(rows), self.rows):
                leaves[:, rows[start : start + self.rows]] += part[:, start : start + self.rows]
        self._shine(leaves)
        return of_strip

    def _leaves(
        self, crowns: Crowns, strip: slice, index: NDArray, layers: int
    ) -> tuple[_Columns, NDArray, Integers32]:
        """Columns of some crowns, and differences of their leaves along these: rows (r,), (layers, r, columns)."""
        size = self.cell
        x, y = ((values[index] + self.margin) / size for values in (crowns.x, crowns.y))
        squares = covered(x, y, crowns.radius[index] / size)
        low, high = int(squares.row.min(initial=strip.start)), int(squares.row.max(initial=strip.start)) + 1
        base, height, top = (values[index] for values in (crowns.base, crowns.height, crowns.top))
        length = np.take(height - base, squares.crown)
        # A cone loses its height with the distance from the middle, a dome half of it with the square of that.
        cone = np.take(top, squares.crown)
        length *= 1.0 - np.minimum(cone * np.sqrt(squares.far) + (1.0 - cone) * 0.6 * squares.far, 1.0 - _THIN)
        leaves = np.take(crowns.leaves[index] / (size**2 * _UNIT), squares.crown) * squares.part
        density = np.rint(leaves / np.maximum(length, 1e-3))
        column, area = squares.column % self.columns, (high - low) * self.columns
        place = (squares.row - low) * self.columns + column
        cells, of_layer = (squares.row % self.rows) * self.columns + column, self.rows * self.columns
        length += np.take(base, squares.crown)
        if self.ground is None:
            foot, under = (np.take(values, squares.crown) for values in layer_of(base))
        else:
            elevation = np.take(self._ground(crowns.x[index], crowns.y[index]), squares.crown)
            higher = np.clip(elevation - np.take(self.ground, cells), -_STEEP, _STEEP)
            higher[(squares.row != cells // self.columns) | (squares.column != column)] = 0.0  # around the edge
            foot, under = layer_of(np.take(base, squares.crown) + higher)
            length += higher
        head, over = layer_of(length)
        total = np.zeros(layers * area)
        for sign, layer, part in ((1.0, head, over), (-1.0, foot, under)):
            upper = np.rint(density * part) * sign
            index_in = layer * area + place
            total += np.bincount(index_in, upper, len(total))
            below = np.flatnonzero(layer > 0)
            total += np.bincount(index_in[below] - area, (sign * density - upper)[below], len(total))
        places = (of.astype(np.int32) for of in (squares.crown, foot * of_layer + cells, head * of_layer + cells))
        columns = _Columns(len(index), *places, *(of.astype(np.float32) for of in (under, over, density)))
        rows = np.arange(low, high) % self.rows
        return columns, rows, total.astype(np.int32).reshape(layers, high - low, self.columns)

    def _shine(self, leaves: Integers32) -> None:
        layers, rows, columns = leaves.shape
        if getattr(self, "light", np.zeros((0, 0))).shape != (layers + 1, rows * columns):
            self.light = np.zeros((layers + 1, rows * columns), np.float32)
        self.light[layers] = 0.0
        summed = self.light.reshape(layers + 1, rows, columns)
        now, after = (np.ones((rows, columns), np.float32) for _ in range(2))
        density = np.zeros((rows, columns), np.int32)
        edges = layer_edge(np.arange(layers + 1))
        bands = blocks(rows, max(_BAND_CELLS // columns, 1))
        for layer in range(layers - 1, -1, -1):
            thick = float(edges[layer + 1] - edges[layer])
            step = max(1, round(np.sqrt(_SIDEWAYS * thick / (2.0 * _MOST_SIDE)) / self.cell))
            side = np.float32(min(_SIDEWAYS * thick / (2.0 * (step * self.cell) ** 2), _MOST_SIDE))
            wide, high = (min(step, size - 1) for size in (columns, rows))
            args = (leaves[layer], density, now, after, summed[layer + 1], summed[layer], np.float32(thick), side)

            def part(block: slice, args: tuple = args, wide: int = wide, high: int = high) -> None:
                _through(block, wide, high, *args)

            each_on_all_cores(part, bands)
            now, after = after, now

    def at(self, x: NDArray, y: NDArray, height: NDArray, of: tuple[NDArray, NDArray] | None = None) -> Floats:
        """Light (n,) at places (n,), mean of the layer there, over that in the open.

        Heights are above the ground there, or above that of other places, x and y (n,).
        """
        row, column = (np.floor((values + self.margin) / self.cell).astype(np.int64) for values in (y, x))
        cell = self._cell(row, column)
        if self.ground is not None and of is not None:
            inside = (row == cell // self.columns) & (column == cell % self.columns)
            higher = np.clip(self._ground(*of) - np.take(self.ground, cell), -_STEEP, _STEEP)
            height = height + np.where(inside, higher, 0.0)
        layer = np.minimum(layer_of(height)[0], len(self.light) - 2)
        place = layer * (self.rows * self.columns) + cell
        flat = self.light.ravel()
        thick = _LAYERS[0] + _LAYERS[1] * (2 * layer + 1)
        return (np.take(flat, place) - np.take(flat, place + self.rows * self.columns)) / thick

    def _ground(self, x: NDArray, y: NDArray) -> Floats:
        """Altitude (n,) of the columns at places (n,)."""
        row, column = (np.floor((values + self.margin) / self.cell).astype(np.int64) for values in (y, x))
        return np.take(self.ground, self._cell(row, column))

    def taken(self, strip: int) -> Floats:
        """Light that the crowns (k,) of a strip take, m² of full light; all together no more than there is."""
        columns = self._columns[strip]
        light = self._summed(columns.foot, columns.under)
        light -= self._summed(columns.head, columns.over)
        light *= columns.density
        return np.bincount(columns.crown, light, columns.number) * (_UNIT * self.cell**2)

    def _cell(self, row: NDArray, column: NDArray) -> Integers:
        return (row % self.rows) * self.columns + column % self.columns

    def _summed(self, place: Integers32, part: Floats32) -> Floats32:
        flat = self.light.ravel()
        low, high = np.take(flat, place), np.take(flat, place + np.int32(self.rows * self.columns))
        high -= low
        high *= part
        high += low
        return high


def _through(
    block: slice, wide: int, high: int, leaves: NDArray, density: NDArray, now: NDArray, after: NDArray,
    above: NDArray, summed: NDArray, thick: np.float32, side: np.float32
) -> None:  # fmt: skip
    """Let light through some rows of one layer; writes ``after`` and ``summed`` and brings ``density`` up to date."""
    rows = np.arange(block.start, block.stop)
    light = now[block]
    near = now[(rows - high) % len(now)] + now[(rows + high) % len(now)]
    near += np.roll(light, wide, axis=1)
    near += np.roll(light, -wide, axis=1)
    mixed = (np.float32(1.0) - 4 * side) * light + side * near
    block_density = density[block]
    block_density += leaves[block]
    # exp(−x) as one over the fourth power of three terms of exp(x / 4): within a hundredth up to x = 2.5, never 0, and
    # the same on every machine; and (1 − exp(−x)) / x of the same numbers.
    y = block_density * np.float32(0.25 * _UNIT * thick)
    r = np.float32(1.0) + y * (np.float32(0.5) + y * np.float32(1.0 / 6.0))
    q = y * r
    mixed /= np.square(np.square(np.float32(1.0) + q))
    after[block] = mixed
    q *= np.float32(1.5) + q * (np.float32(1.0) + np.float32(0.25) * q)
    q += np.float32(1.0)
    q *= r
    q *= mixed
    q *= thick
    summed[block] = above[block] + q
