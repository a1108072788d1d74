# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeds: all that is stored of a plant before it is needed (paper, section 5)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Arrays, Floats, Integers, Integers32


@dataclass(frozen=True)
class Seeds(Arrays):
    """Plants at places: those of a scene, of a field, or of single objects."""

    #: Species that ``species`` counts through, as in the catalog; in a scene, kinds of plants.
    identifiers: tuple[str, ...]
    species: Integers32  # (n,): index into ``identifiers``
    seed: Integers  # (n,): random seed of each plant; any value
    position: Floats  # (n, 3): where the trunk leaves the ground, meters
    #: (n, 3, 3): rotation of each plant; its columns are the plant's axes in world space, +z along the upright trunk.
    frame: Floats
    scale: Floats  # (n,): uniform scale, greater than zero
    crown: Floats | None = None  # (n, 5): crown shapes, see `crown_shapes`; None where all plants are as described
    #: (n, 6): how plants move as a whole: meters a second, then the rotation vector about their foot, radians a second.
    #: None where all stand still.
    motion: Floats | None = None

    @classmethod
    def upright(cls, number: int, species: int = 0) -> Seeds:
        """So many plants of a species at the origin, of scale 1, with seeds from 0 on."""
        frame, kind = np.tile(np.eye(3), (number, 1, 1)), np.full(number, species, np.int32)
        return cls(("",), kind, np.arange(number), np.zeros((number, 3)), frame, np.ones(number))

    def counted_from(self, origin: Floats) -> Seeds:
        """The same plants in coordinates that begin at a place (3,) of the present ones."""
        return replace(self, position=self.position - origin) if origin.any() else self
