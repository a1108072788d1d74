# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of all species and orders as one table: the same array operations grow branches of every kind.

Row ``species * MAX_ORDERS + order`` holds the ranges of one order of one species, angles in radians.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .crown_shapes import CROWN_SHAPES
from .hashing import signed
from .species import MAX_ORDERS, Species

_RANGES = (
    "length", "thickness", "curvature", "angle", "azimuth", "branches",
    "leaves", "leaf_size", "leaf_angle", "leaf_azimuth",
)  # fmt: skip
_DEGREES = {"curvature", "curvature_tip", "angle", "angle_tip", "azimuth", "leaf_angle", "leaf_azimuth"}
_NUMBERS = ("taper", "curvature_tip", "count_by_length", "angle_tip", "branch_start", "leaf_start", "leaf_light")

ROW_DTYPE = np.dtype(
    [(name, np.float64, (2,)) for name in _RANGES]
    + [(name, np.float64) for name in _NUMBERS]
    + [(name, np.float64, (2, 3)) for name in ("branch_colour", "leaf_colour")]
    + [("segments", np.int64), ("sides", np.int64), ("whorl", np.int64), ("crown", np.int64), ("used", np.bool_)]
)
"""One order of one species; ranges are (mean, variation), colours ((r, g, b), variation of each)."""


def build_rows(species: Sequence[Species]) -> NDArray[np.void]:
    """Table of parameters.

    Returns
    -------
    (len(species) * MAX_ORDERS,) array of `ROW_DTYPE`
        Rows of orders that a species does not have are zero with ``used`` false.
    """
    rows = np.zeros(len(species) * MAX_ORDERS, dtype=ROW_DTYPE)
    for s, one in enumerate(species):
        for o, order in enumerate(one.orders):
            row = rows[s * MAX_ORDERS + o]
            for name in (*_RANGES, *_NUMBERS):
                value = np.asarray(getattr(order, name), dtype=np.float64)
                row[name] = np.radians(value) if name in _DEGREES else value
            row["branch_colour"], row["leaf_colour"] = order.branch_colour, order.leaf_colour
            row["segments"], row["sides"], row["whorl"] = order.segments, order.sides, order.whorl
            row["crown"] = CROWN_SHAPES.index(order.crown)
            row["used"] = True
    return rows


def ranged(rows: NDArray[np.void], name: str, row: NDArray[np.integer], key: NDArray[np.uint64], draw: int) -> NDArray:
    """Value of one parameter for each branch: mean + variation × a signed random number of its key.

    Parameters
    ----------
    rows : table of `build_rows`
    name : str
        A range of `ROW_DTYPE`.
    row : (n,) int
    key : (n,) uint64
    draw : int
        See `hashing.Draw`.

    Returns
    -------
    (n,) float64
    """
    values = rows[name][row]
    return values[..., 0] + values[..., 1] * signed(key, draw)
