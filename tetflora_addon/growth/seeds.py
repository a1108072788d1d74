# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds: all that is stored of a plant before it is needed (paper, section 5)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays


@dataclass(frozen=True)
class Seeds(Arrays):
    """Plants at places: those of a scene, of a field, or of single objects.

    Attributes
    ----------
    identifiers : tuple of str
        Species that ``species`` counts through, as in the catalogue; in a scene, kinds of plants.
    species : (n,) int32
        Index into ``identifiers``.
    seed : (n,) int64
        Random seed of each plant; any value.
    position : (n, 3) float64
        Where the trunk leaves the ground, metres.
    frame : (n, 3, 3) float64
        Rotation of each plant; its columns are the plant's axes in world space, +z along the upright trunk.
    scale : (n,) float64
        Uniform scale, greater than zero.
    crown : (n, 5) float64 or None
        Crown forms, see `crown_forms`; None where all plants are as described.
    motion : (n, 6) float64 or None
        How plants move as a whole: metres a second, then the rotation vector about their foot, radians a second. None
        where all stand still.
    """

    identifiers: tuple[str, ...]
    species: NDArray[np.int32]
    seed: NDArray[np.int64]
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    scale: NDArray[np.float64]
    crown: NDArray[np.float64] | None = None
    motion: NDArray[np.float64] | None = None

    def counted_from(self, origin: NDArray[np.float64]) -> Seeds:
        """The same plants in coordinates that begin at a place (3,) of the present ones."""
        return replace(self, position=self.position - origin) if origin.any() else self
