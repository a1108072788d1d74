# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Crown shapes: how one plant differs from others of its kind, because of how it grew.

A tree of a stand has a narrow crown far up, which leans to where the light is; one that is recorded in an inventory has
the crown that was measured. Such plants have a row of five numbers beside their seed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats

#: Columns: factor on the lengths of limbs; bare fraction of the trunk, 0 as described; by which fraction limbs to the
#: east and to the north are longer, and those opposite shorter; factor on the radius of the trunk.
WIDTH, BASE, EAST, NORTH, THICKNESS = range(5)
#: A plant as its species describes it.
PLAIN = np.array([1.0, 0.0, 0.0, 0.0, 1.0])
#: Limits of each column.
LEAST = np.array([0.2, 0.0, -0.8, -0.8, 0.2])
MOST = np.array([3.0, 0.95, 0.8, 0.8, 5.0])


def farthest(forms: Floats | None) -> Floats | float:
    """How many times as far as described plants (n,) reach at most, by their crown shapes (n, 5)."""
    if forms is None:
        return 1.0
    return np.maximum(forms[:, WIDTH] * (1.0 + np.hypot(forms[:, EAST], forms[:, NORTH])), 1.0)


def crown_shapes(
    number: int,
    width: ArrayLike = 1.0,
    base: ArrayLike = 0.0,
    east: ArrayLike = 0.0,
    north: ArrayLike = 0.0,
    thickness: ArrayLike = 1.0,
) -> Floats:
    """Crown shapes (number, 5) of plants, within the limits; each argument is one number or (number,)."""
    out = np.empty((number, len(PLAIN)))
    for column, value in enumerate((width, base, east, north, thickness)):
        out[:, column] = np.clip(value, LEAST[column], MOST[column])
    return out
