# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many polygons and facets instances of assets would be drawn with, at any detail."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..growth.hashing import uniform
from ..proxies.facet_sizes import FacetPixels, FacetSizes
from .asset_plan import Keeping, real_fractions, sizes_of
from .asset_sight import AssetPortions, AssetSight

#: What a face of a mesh in one more place counts for.
SHARED = 0.003
#: Clusters, seen and not, that tell about all at a detail that is tried; and the draw of which.
TELLING, _CHOSEN = 40_000, 256


class AssetExpected:
    """Expected polygons and facets of instances; those that are always the originals cost nothing.

    Parameters
    ----------
    sight : AssetSight
    keeping : Keeping
    """

    def __init__(self, sight: AssetSight, keeping: Keeping) -> None:
        self.sight, self.keeping, portions = sight, keeping, sight.portions()
        if len(portions):
            portions = portions.take(~keeping.always[sight.placed.instances.asset[portions.parts.instance]])
        seen = portions.visibility > 0.0
        self.portions, self.sizes, self.times = self._telling(portions.take(np.flatnonzero(seen)))
        self.leaves = sight.placed.assets.clusters.leaves[self.portions.parts.cluster]
        _, *self.hidden_sizes = self._telling(portions.take(np.flatnonzero(~seen)))

    def _telling(self, portions: AssetPortions) -> tuple[AssetPortions, FacetSizes, NDArray[np.float64]]:
        """As many portions (n,) as tell about all, the sizes of their facets, and for how many each of them speaks."""
        sizes = sizes_of(self.sight, portions)
        if len(portions) <= TELLING:
            return portions, sizes, np.ones(len(portions))
        many = sizes.counts(FacetPixels(1.0)) + portions.parts.totals.polygons**0.5
        likely = np.minimum(TELLING * many / float(many.sum()), 1.0)
        chosen = np.flatnonzero(uniform(self.sight.placed.keys(portions.parts), _CHOSEN) < likely)
        return portions.take(chosen), sizes.take(chosen), 1.0 / likely[chosen]

    def seen(self, pixels: float, limit: float, weight: float, memory: bool = False) -> float:
        """Polygons, and facets counted with a weight, of what is seen.

        memory: with meshes that the renderer keeps once and shows in many places; else only the image counts.
        """
        some, full = real_fractions(self.sight, self.portions, limit, self.keeping.kites)
        facets = weight * self.sizes.counts(FacetPixels(pixels))
        faces = full * self.portions.parts.totals.polygons, (some - full) * self.leaves
        return self._meshes(*(self.times * one for one in faces), memory) + float(self.times @ ((1.0 - some) * facets))

    def _meshes(self, faces: NDArray[np.float64], kites: NDArray[np.float64], memory: bool) -> float:
        """What faces and kites (n,) of all places count for."""
        if not self.keeping.shared:
            return float((faces + kites).sum())
        every, asset = self.sight.placed.assets.every, self.sight.placed.instances.asset
        own = asset[self.portions.parts.instance]
        there = np.array([[a.faces, len(a.leaves)] for a in every], np.float64).reshape(-1, 2).T
        placed = np.stack([np.bincount(own, number, len(every)) for number in (faces, kites)])
        return float(SHARED * placed.sum() + (np.minimum(placed, there).sum() if memory else 0.0))

    def unseen(self, pixels: FacetPixels) -> float:
        """Facets of what is not seen."""
        sizes, times = self.hidden_sizes
        return float(times @ sizes.counts(pixels))
