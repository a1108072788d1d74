# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where leaves are neither all real nor all facets: a band of sizes in which a number of each leaf's own decides.

A leaf whose width in pixels is below the limit is a facet, one that is wider by `BAND` is real, and in between a share
of them is real that grows with the width. Real leaves and facets are thinned out by hashes of their own keys: what has
become real stays real as the camera comes closer, nothing pops, and the area is the same on average.

Wood goes by its own width or that of the leaves on it, whichever is larger: a trunk is a tube even among leaves that
are too small to be seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..plants.branches import Branches
from ..plants.compiled import Flora
from ..plants.hashing import Draw, uniform
from ..plants.pieces import Pieces
from .camera import Camera

#: Width of the leaves that are all real over that of the leaves of which none is.
BAND = 2.5


@dataclass(frozen=True)
class Transition:
    """Shares of leaves and wood that are real.

    Attributes
    ----------
    flora : Flora
    camera : Camera
    limit : float
        Width in pixels up to which leaves are facets.
    """

    flora: Flora
    camera: Camera
    limit: float

    def share(self, width: NDArray[np.float64], position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share (n,) of things of so many metres (n,) at places (n, 3) that is real: a smooth step in the logarithm."""
        pixels = width / np.maximum(self.camera.extent_around(position), 1e-300)
        place = np.log(np.maximum(pixels, 1e-300) / self.limit) / np.log(BAND)
        place = np.clip(place, 0.0, 1.0)
        return place * place * (3.0 - 2.0 * place)

    def of_branches(self, branches: Branches) -> NDArray[np.float64]:
        """Share (n,) of the leaves of sub-plants, and of their wood; of leafless ones by the base of their branch."""
        return self.share(self._width(branches), branches.position)

    def of_wood(self, pieces: Pieces, among_leaves: bool = True) -> NDArray[np.bool_]:
        """Pieces (n,) whose wood is real; with or without regard to the leaves that grow on their branch."""
        return self._kept(pieces.branches, (pieces.start + pieces.end) / 2.0, among_leaves)

    def of_twigs(self, branches: Branches) -> NDArray[np.bool_]:
        """Whole branches (n,) whose wood is real."""
        return self._kept(branches, branches.position, among_leaves=True)

    def _kept(self, branches: Branches, position: NDArray[np.float64], among_leaves: bool) -> NDArray[np.bool_]:
        own = 2.0 * branches.radius
        width = np.maximum(own, self._width(branches)) if among_leaves else own
        return uniform(branches.key, Draw.TRANSITION) < self.share(width, position)

    def _width(self, branches: Branches) -> NDArray[np.float64]:
        row = branches.row
        leafy = self.flora.leaf_count[row] > 0
        return np.where(leafy, self.flora.leaf_width[row] * branches.scale, 2.0 * branches.radius)
