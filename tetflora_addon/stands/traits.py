# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species of a stand as numbers: how large plants of a basal diameter are, one row for each species.

The *basal diameter* of a plant is the diameter of its trunk near the ground: what it is at 1.3 m, and a little more, so
that seedlings have one too. Results of exponentials are rounded once, here: all that follows is plain arithmetic, which
is the same on every machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import TetFloraError
from ..species.ages import ages_of
from ..species.ecology import ecology_of
from ..species.species import Ecology, Species

BREAST_HEIGHT = 1.3
#: Heights in a table, up to so many of the largest diameter.
_HEIGHTS, _UPTO = 1000, 1.6
#: Girth that trunks have at breast height, meters, at least and at most; and that of which its slope is taken.
_LEAST, _MOST, _SLOPE = 0.004, 0.03, 0.01
_DIGITS = 5


@dataclass(frozen=True)
class StandSpecies:
    """One species in a stand."""

    species: Species
    planted: float = 1.0  # share of what is planted, over those of the others
    #: Seeds that come from outside, over those where a tenth of the ground beyond is below its crowns.
    incoming_seeds: float = 1.0
    ecology: Ecology | None = None  # in place of that of the species

    @property
    def needs(self) -> Ecology:
        """Its ecology."""
        return ecology_of(self.species) if self.ecology is None else self.ecology


class StandTraits:
    """Numbers of all species; each of `Ecology` is an array (g,) or (g, 2) here.

    Attributes
    ----------
    first : (g,) float64
        Girth at which a trunk is 1.3 m high, meters, or a quarter of the height that it can reach.
    breast : (g,) float64
        Height of that.
    free : (g,) float64
        Light that a free crown takes beyond what its leaves cost, for each square meter below it.
    lifespan, mature : (g,) float64
        Years.
    """

    def __init__(self, species: Sequence[StandSpecies]) -> None:
        if not species:
            raise TetFloraError("A stand needs at least one species; add one to the list")
        if not all(
            np.isfinite(one.planted) and np.isfinite(one.incoming_seeds) and min(one.planted, one.incoming_seeds) >= 0
            for one in species
        ):
            raise TetFloraError("Shares of species must be 0 or greater")
        self.needs = [one.needs for one in species]
        for name in (one for one in Ecology.__dataclass_fields__ if one != "source"):
            setattr(self, name, np.array([getattr(one, name) for one in self.needs]))
        self.planted = np.array([one.planted for one in species])
        self.incoming_seeds = np.array([one.incoming_seeds for one in species])
        ages = [ages_of(one.species) for one in species]
        self.lifespan = np.array([one.lifespan for one in ages])
        self.mature = np.array([min(one.flowers, 0.5 * one.lifespan) for one in ages])
        self.breast = np.minimum(BREAST_HEIGHT, 0.25 * self.height)
        rate, power = self.height_curve.T
        self.cost = 0.35 * self.light_compensation
        self.free = np.round(
            -np.expm1(-self.extinction * self.leaves) - self.cost * self.extinction * self.leaves, _DIGITS
        )
        # As slender below breast height as just above it.
        near = np.minimum(_SLOPE, 0.05 * self.diameter)
        slope = (self.height - self.breast) * (-np.expm1(-rate * near)) ** power / near
        self.first = np.round(np.clip(self.breast / slope, np.minimum(_LEAST, near), _MOST), 2 * _DIGITS)
        self._step = _UPTO * self.diameter / _HEIGHTS
        basal = self._step[:, None] * np.arange(_HEIGHTS + 1)
        dbh = np.maximum(basal - self.first[:, None], 0.0)
        grown = (
            self.breast[:, None]
            + (self.height - self.breast)[:, None] * (-np.expm1(-rate[:, None] * dbh)) ** power[:, None]
        )
        self._heights = np.round(grown, _DIGITS)
        # Dry mass is this × basal² × height.
        self.mass_factor = np.round(self.form_factor * self.wood_density * np.pi / 4, _DIGITS)

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
