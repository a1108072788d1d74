# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How deep in the shade of others things are: what lies deep owes the image nothing but to keep light out.

Optical depths add up along the light as they do along a view (paper, section 6.3): areas on a grid across the light,
layer by layer, and their cumulative sum.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, in_axes
from ..refinement.lights import Light, frame_toward

#: Cells of the grid across the light along each side, and layers along it, at most.
CELLS, LAYERS = 192, 64
#: Least side of a cell, meters: an even fog of leaves knows nothing of smaller gaps.
LEAST = 1.0
_DOWN = np.array([0.0, 0.0, -1.0])


class Shade:
    """Optical depth between a place and the strongest light.

    Parameters
    ----------
    position : (m, 3) float
        Places that stand for areas (m,), meters.
    area : (m,) float
        One-sided area of sheets, m².
    lights : sequence of Light
        Of several the brightest sun counts; without any, the sky above.
    """

    def __init__(self, position: NDArray[np.floating], area: NDArray[np.floating], lights: Sequence[Light]) -> None:
        suns = [light for light in lights if light.kind == "SUN" and light.shadow]
        direction = max(suns, key=lambda one: float(np.mean(one.color))).direction if suns else _DOWN
        self._frame = frame_toward(direction)
        if not len(position):
            self._table = None
            return
        places = in_axes(np.asarray(position, np.float64), self._frame)
        low, high = places.min(axis=0), places.max(axis=0)
        step = np.maximum((high - low)[:2].max() / CELLS, LEAST)
        self._low, self._high, self._step = low, high, np.array([step, step, max((high - low)[2] / LAYERS, LEAST)])
        self._size = np.floor((high - low) / self._step).astype(np.int64) + 1
        table = np.bincount(self._index(places), np.asarray(area, np.float64), int(self._size.prod()))
        # Randomly turned sheets show half of their area. Light comes from where the third coordinate is largest.
        table = table.reshape(self._size) * (0.5 / step**2)
        self._table = (np.cumsum(table[:, :, ::-1], axis=2)[:, :, ::-1] - 0.5 * table).ravel()

    def _index(self, places: Floats) -> Integers:
        at = np.clip(np.floor((places - self._low) / self._step), 0, self._size - 1).astype(np.int64)
        return (at[:, 0] * self._size[1] + at[:, 1]) * self._size[2] + at[:, 2]

    def depth(self, points: Floats, nearer: Floats | float = 0.0) -> Floats:
        """Optical depth (n,) of all that is between the light and points (n, 3), moved so many meters toward it."""
        if self._table is None:
            return np.zeros(len(points))
        places = in_axes(points, self._frame)
        places[:, 2] += nearer
        return np.take(self._table, self._index(places))
