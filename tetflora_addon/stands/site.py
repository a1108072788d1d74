# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a stand grows from: ground, soil and climate on a grid, how well a species does there, and species as numbers.

Plants of a basal diameter are as large as the row of their species says. The *basal diameter* of a plant is the
diameter of its trunk near the ground: what it is at 1.3 m, and a little more, so that seedlings have one too. Results
of exponentials are rounded once, here: all that follows is plain arithmetic, which is the same on every machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Integers, Mask, bilinear
from ..errors import TetFloraError
from ..species.ages import ages_of
from ..species.ecology import ecology_of
from ..species.species import Ecology, Species

#: Kelvin by which it is colder for each meter of altitude, and degree days that a kelvin is worth: days of the season.
_LAPSE, _DAYS = 0.006, 165.0
#: Degree days, beyond those that a species needs at least, that let it grow at two thirds of its rate.
_WARM = 300.0
#: Moisture at which species of drought tolerance 0 and 5 begin to grow, and from there to full growth; wetness at
#: which those of waterlogging tolerance 0 and 5 cease to.
_DRY, _DRY_WIDTH = (0.42, 0.02), 0.25
_WET, _WET_WIDTH = (0.72, 1.25), 0.25
_DIGITS = 4  # digits that are kept, so that results are the same with every library of mathematics


@dataclass(frozen=True)
class StandSite:
    """Ground on a grid of square cells; rows from the south, columns from the west."""

    #: west and south: corner of the grid in the world, meters.
    west: float
    south: float
    cell: float  # side of a cell, meters
    height: NDArray  # (h, w): altitude, meters
    #: plantable, moisture and fertility, (h, w) or one number for all: fraction of the ground where plants can be, 0 to
    #: 1; from 0, dry, to 1, wet; and from 0, poor, to 1, rich.
    plantable: NDArray | float = 1.0
    moisture: NDArray | float = 0.5
    fertility: NDArray | float = 0.7
    #: Sum of daily mean temperatures over 5 °C in a year (growing degree days), at height 0; 0.6 K colder each 100 m.
    degree_days: float = 1700.0
    coldest_month: float = -1.0  # mean temperature of the coldest month there, °C

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
            value = np.asarray(getattr(self, name), np.float64)
            value = value if value.ndim else np.full(np.shape(self.height), value)
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
        return float(self.plantable.sum()) * self.cell**2

    def cells(self, x: NDArray, y: NDArray) -> Integers:
        """Index (n,) of the cell, row by row, at places (n,) in meters from the corner; the nearest of those beyond."""
        rows, columns = self.height.shape
        column = np.clip((np.asarray(x) / self.cell).astype(np.intp), 0, columns - 1)
        return np.clip((np.asarray(y) / self.cell).astype(np.intp), 0, rows - 1) * columns + column

    def holds(self, x: NDArray, y: NDArray) -> Mask:
        """Whether plants can be (n,) at places (n,) in meters from the corner."""
        inside = (x >= 0.0) & (y >= 0.0) & (x < self.size[0]) & (y < self.size[1])
        return inside & (self.plantable.ravel()[self.cells(x, y)] > 0.0)

    def ground(self, x: NDArray, y: NDArray) -> Floats:
        """Altitude (n,) at places (n,) in meters from the corner, bilinear between the middles of cells."""
        return bilinear(self.height, np.stack([x, y], axis=1) / self.cell - 0.5)

    def suitability(self, ecology: Ecology) -> Floats:
        """How well a species grows in each cell, over how it does where nothing is wanting: (h w,), 0 to 1."""
        colder = _LAPSE * self.height.ravel()
        warm = self.degree_days - _DAYS * colder - ecology.degree_days
        degree_days = np.where(warm > 0, -np.expm1(-np.maximum(warm, 0.0) / _WARM), 0.0)
        degree_days = np.where(self.coldest_month - colder < ecology.coldest_month, 0.0, degree_days)
        moisture, food = self.moisture.ravel(), self.fertility.ravel()
        dry = np.interp(ecology.drought, (0.0, 5.0), _DRY)
        wet = np.interp(ecology.waterlogging, (0.0, 5.0), _WET)
        water = _ramp((moisture - dry) / _DRY_WIDTH) * _ramp((wet - moisture) / _WET_WIDTH)
        fed = _ramp(0.3 + 0.7 * (1.0 - np.maximum(ecology.fertility - food, 0.0) / max(ecology.fertility, 1e-9)))
        return np.round(degree_days * water * fed, _DIGITS)

    def slope(self) -> tuple[Floats, Floats]:
        """Rise of the ground to the east and to the north in each cell: (h w,) each, tangents."""
        north, east = (
            np.gradient(self.height, self.cell, axis=axis) if self.height.shape[axis] > 1 else 0.0 * self.height
            for axis in (0, 1)
        )
        return east.ravel(), north.ravel()


def _ramp(value: ArrayLike) -> Floats:
    return np.clip(value, 0.0, 1.0)


BREAST_HEIGHT = 1.3
_HEIGHTS, _UPTO = 1000, 1.6  # heights in a table, up to so many of the largest diameter
#: Girth that trunks have at breast height, meters, at least and at most; and that of which its slope is taken.
_LEAST, _MOST, _SLOPE = 0.004, 0.03, 0.01
_TRAIT_DIGITS = 5


@dataclass(frozen=True)
class StandSpecies:
    """One species in a stand."""

    species: Species
    planted: float = 1.0  # share of what is planted, over those of the others
    #: Seeds that come from outside, over those where a tenth of the ground beyond is below its crowns.
    incoming_seeds: float = 1.0


class StandTraits:
    """Numbers of all species; each of `Ecology` is an array (g,) or (g, 2) here."""

    def __init__(self, species: Sequence[StandSpecies]) -> None:
        if not species:
            raise TetFloraError("A stand needs at least one species; add one to the list")
        if not all(
            np.isfinite(one.planted) and np.isfinite(one.incoming_seeds) and min(one.planted, one.incoming_seeds) >= 0
            for one in species
        ):
            raise TetFloraError("Shares of species must be 0 or greater")
        self.needs = [ecology_of(one.species) for one in species]
        for name in (one for one in Ecology.__dataclass_fields__ if one != "source"):
            setattr(self, name, np.array([getattr(one, name) for one in self.needs]))
        self.planted = np.array([one.planted for one in species])
        self.incoming_seeds = np.array([one.incoming_seeds for one in species])
        ages = [ages_of(one.species) for one in species]
        #: lifespan and mature, (g,): years.
        self.lifespan = np.array([one.lifespan for one in ages])
        self.mature = np.array([min(one.flowers, 0.5 * one.lifespan) for one in ages])
        #: (g,): height at which trunks are measured, meters: 1.3 m, or a quarter of what they can reach.
        self.breast = np.minimum(BREAST_HEIGHT, 0.25 * self.height)
        rate, power = self.height_curve.T
        self.cost = 0.35 * self.light_compensation
        #: (g,): light that a free crown takes beyond what its leaves cost, for each square meter below it.
        taken = -np.expm1(-self.extinction * self.leaves)
        self.free = np.round(taken - self.cost * self.extinction * self.leaves, _TRAIT_DIGITS)
        # As slender below breast height as just above it.
        near = np.minimum(_SLOPE, 0.05 * self.diameter)
        slope = (self.height - self.breast) * (-np.expm1(-rate * near)) ** power / near
        #: (g,): girth at which trunks are as high as that, meters.
        self.first = np.round(np.clip(self.breast / slope, np.minimum(_LEAST, near), _MOST), 2 * _TRAIT_DIGITS)
        self._step = _UPTO * self.diameter / _HEIGHTS
        basal = self._step[:, None] * np.arange(_HEIGHTS + 1)
        dbh = np.maximum(basal - self.first[:, None], 0.0)
        part = (-np.expm1(-rate[:, None] * dbh)) ** power[:, None]
        grown = self.breast[:, None] + (self.height - self.breast)[:, None] * part
        self._heights = np.round(grown, _TRAIT_DIGITS)
        # Dry mass is this × basal² × height.
        self.mass_factor = np.round(self.form_factor * self.wood_density * np.pi / 4, _TRAIT_DIGITS)

    def heights(self, species: NDArray, basal: NDArray) -> Floats:
        """Heights (n,) in a closed stand, meters."""
        first = np.take(self.first, species)
        place = np.minimum(basal / np.take(self._step, species), _HEIGHTS - 0.001)
        index = place.astype(np.int64)
        flat, start = self._heights.ravel(), species * (_HEIGHTS + 1) + index
        low = np.take(flat, start)
        tall = low + (np.take(flat, start + 1) - low) * (place - index)
        return np.where(basal < first, np.take(self.breast, species) * basal / first, tall)

    def radii(self, species: NDArray, basal: NDArray) -> Floats:
        """Radii (n,) of crowns that stand free, meters."""
        first = np.take(self.first, species)
        at_first, slope = np.take(self.crown_width[:, 0], species), np.take(self.crown_width[:, 1], species)
        return 0.5 * np.where(basal < first, at_first * basal / first, at_first + slope * (basal - first))

    def diameters(self, species: NDArray, basal: NDArray) -> Floats:
        """Diameters (n,) of trunks at breast height, meters."""
        return np.maximum(basal - np.take(self.first, species), 0.0)
