# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a stand grows: ground, soil and climate on a grid, and how well a species does there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Integers, bilinear
from ..errors import TetFloraError
from ..species.species import Ecology

#: Kelvin by which it is colder for each meter of altitude, and degree days that a kelvin is worth: days of the season.
_LAPSE, _DAYS = 0.006, 165.0
#: Degree days, beyond those that a species needs at least, that let it grow at two thirds of its rate.
_WARM = 300.0
#: Moisture at which species of drought tolerance 0 and 5 begin to grow, and from there to full growth; wetness at
#: which those of waterlogging tolerance 0 and 5 cease to.
_DRY, _DRY_WIDTH = (0.42, 0.02), 0.25
_WET, _WET_WIDTH = (0.72, 1.25), 0.25
#: Digits that are kept, so that results are the same with every library of mathematics.
_DIGITS = 4


@dataclass(frozen=True)
class StandSite:
    """Ground on a grid of square cells; rows from the south, columns from the west."""

    #: west and south: corner of the grid in the world, meters.
    west: float
    south: float
    cell: float  # side of a cell, meters
    height: NDArray  # (h, w): altitude, meters
    #: (h, w): fraction of the ground where plants can be, 0 to 1; everywhere where it is None.
    plantable: NDArray | None = None
    moisture: NDArray | None = None  # (h, w): 0 dry to 1 wet; 0.5, fresh, where it is None
    fertility: NDArray | None = None  # (h, w): 0 poor to 1 rich; 0.7 where it is None
    #: Sum of daily mean temperatures over 5 °C in a year (growing degree days), at the altitude ``altitude``.
    degree_days: float = 1700.0
    coldest_month: float = -1.0  # mean temperature of the coldest month there, °C
    #: Meters at which degree days and the coldest month are known; colder above by 0.6 K for 100 m.
    altitude: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no site.

        Raises
        ------
        TetFloraError
            Names what is wrong.
        """
        if not self.cell > 0.0:
            raise TetFloraError(f"The cells of a site must be larger than 0 m, not {self.cell:g} m")
        if np.ndim(self.height) != 2 or not np.size(self.height):
            raise TetFloraError("The ground of a site must have rows and columns; choose a ground with some area")
        for name in ("height", "plantable", "moisture", "fertility"):
            value = getattr(self, name)
            if value is None:
                continue
            value = np.asarray(value, np.float64)
            if value.shape != np.shape(self.height):
                raise TetFloraError(f"A site's {name} has {value.shape} cells, its height {np.shape(self.height)}")
            if not np.isfinite(value).all():
                raise TetFloraError(f"A site's {name} is not a number in some cells")
            object.__setattr__(self, name, value if name == "height" else np.clip(value, 0.0, 1.0))
        for name, low, high in (("degree_days", 0.0, 12000.0), ("coldest_month", -80.0, 40.0)):
            if not low <= getattr(self, name) <= high:
                raise TetFloraError(f"A site's {name} must be from {low:g} to {high:g}, not {getattr(self, name):g}")

    @property
    def size(self) -> tuple[float, float]:
        """Meters from west to east, and from south to north."""
        rows, columns = self.height.shape
        return columns * self.cell, rows * self.cell

    @property
    def area(self) -> float:
        """Square meters where plants can be."""
        here = self.height.size if self.plantable is None else float(self.plantable.sum())
        return here * self.cell**2

    def cells(self, x: NDArray, y: NDArray) -> Integers:
        """Index (n,) of the cell, row by row, at places (n,) in meters from the corner; the nearest of those beyond."""
        rows, columns = self.height.shape
        column = np.clip((np.asarray(x) / self.cell).astype(np.intp), 0, columns - 1)
        row = np.clip((np.asarray(y) / self.cell).astype(np.intp), 0, rows - 1)
        return row * columns + column

    def ground(self, x: NDArray, y: NDArray) -> Floats:
        """Altitude (n,) at places (n,) in meters from the corner, bilinear between the middles of cells."""
        return bilinear(self.height, np.stack([x, y], axis=1) / self.cell - 0.5)

    def suitability(self, ecology: Ecology) -> Floats:
        """How well a species grows in each cell, over how it does where nothing is wanting: (h w,), 0 to 1."""
        colder = _LAPSE * (self.height.ravel() - self.altitude)
        warm = self.degree_days - _DAYS * colder - ecology.degree_days
        degree_days = np.where(warm > 0, -np.expm1(-np.maximum(warm, 0.0) / _WARM), 0.0)
        degree_days = np.where(self.coldest_month - colder < ecology.coldest_month, 0.0, degree_days)
        moisture = _of(self.moisture, 0.5, warm)
        dry = np.interp(ecology.drought, (0.0, 5.0), _DRY)
        wet = np.interp(ecology.waterlogging, (0.0, 5.0), _WET)
        water = _ramp((moisture - dry) / _DRY_WIDTH) * _ramp((wet - moisture) / _WET_WIDTH)
        food = _of(self.fertility, 0.7, warm)
        fed = _ramp(0.3 + 0.7 * (1.0 - np.maximum(ecology.fertility - food, 0.0) / max(ecology.fertility, 1e-9)))
        return np.round(degree_days * water * fed, _DIGITS)

    def slope(self) -> tuple[Floats, Floats]:
        """Rise of the ground to the east and to the north in each cell: (h w,) each, tangents."""
        north, east = (
            np.gradient(self.height, self.cell, axis=axis) if self.height.shape[axis] > 1 else 0.0 * self.height
            for axis in (0, 1)
        )
        return east.ravel(), north.ravel()


def _of(values: NDArray | None, default: float, like: NDArray) -> Floats:
    return np.full(like.shape, default) if values is None else values.ravel()


def _ramp(value: ArrayLike) -> Floats:
    return np.clip(value, 0.0, 1.0)
