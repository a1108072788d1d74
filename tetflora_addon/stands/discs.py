# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which columns of a grid a crown covers, seen from above: tables of discs, by their radius and their place in a cell.

Crowns are looked up, not drawn: radius and middle are rounded to a fraction of a cell, so that what a crown covers is
a run of a table.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread

#: Radii for each cell, and places of the middle across a cell.
_RADII, _PLACES = 4, 3
#: Points across a cell that tell how much of it is covered.
_FINE = 12


class Discs(NamedTuple):
    """Tables of discs up to a radius.

    Attributes
    ----------
    first, number : (d,) int64
        Run of each disc, by ``radius × _PLACES² + row of the middle × _PLACES + column``.
    row, column : (m,) int64
        Of the cell, from that of the middle.
    part : (m,) float64
        Fraction of the disc in the cell.
    far : (m,) float64
        Square of the distance from the middle over the radius, mean of what is covered.
    """

    first: NDArray[np.int64]
    number: NDArray[np.int64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    part: NDArray[np.float64]
    far: NDArray[np.float64]


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
    part = covered[rows, columns] / covered.sum()
    return rows - reach, columns - reach, part, mean[rows, columns]


@cache
def _discs(radii: int) -> Discs:
    discs = [_disc(r, i, j) for r in range(radii + 1) for i in range(_PLACES) for j in range(_PLACES)]
    number = np.array([len(disc[0]) for disc in discs])
    return Discs(np.cumsum(number) - number, number, *(np.concatenate(part) for part in zip(*discs, strict=True)))


class CrownCells(NamedTuple):
    """Cells that crowns cover: one row for each crown and cell, those of a crown together.

    Attributes
    ----------
    crown : (m,) int64
    row, column : (m,) int64
        Beyond the grid where a crown is.
    part, far : (m,) float64
        As of `Discs`.
    """

    crown: NDArray[np.int64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    part: NDArray[np.float64]
    far: NDArray[np.float64]


def covered(x: NDArray[np.float64], y: NDArray[np.float64], radius: NDArray[np.float64]) -> CrownCells:
    """Cells that discs (n,) cover; places and radii in cells from the grid's corner.

    What is narrower than a cell is in one alone.
    """
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    size = np.rint(radius * _RADII).astype(np.int64)
    size[radius <= 0.5] = 0
    u = ((x - column) * _PLACES).astype(np.int64)
    v = ((y - row) * _PLACES).astype(np.int64)
    tables = _discs(int(size.max(initial=0)))
    kind = (size * _PLACES + v) * _PLACES + u
    crown, index = spread(tables.number[kind])
    index += tables.first[kind][crown]
    return CrownCells(
        crown, row[crown] + tables.row[index], column[crown] + tables.column[index], tables.part[index],
        tables.far[index],
    )  # fmt: skip
