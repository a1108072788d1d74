# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many polygons and facets instances of assets would be drawn with, at any detail."""

from __future__ import annotations

import numpy as np

from ..proxies.facet_sizes import FacetPixels
from .asset_plan import Keeping, real_fractions, sizes_of
from .asset_sight import AssetSight


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
        self.portions, hidden = portions.take(np.flatnonzero(seen)), portions.take(np.flatnonzero(~seen))
        self.leaves = sight.placed.assets.clusters.leaves[self.portions.parts.cluster]
        self.sizes, self.hidden_sizes = sizes_of(sight, self.portions), sizes_of(sight, hidden)

    def seen(self, pixels: float, limit: float, weight: float) -> float:
        """Polygons, and facets counted with a weight, of what is seen."""
        some, full = real_fractions(self.sight, self.portions, limit)
        facets = weight * self.sizes.counts(FacetPixels(pixels))
        faces = full * self.portions.parts.totals.polygons + (some - full) * self.leaves
        return float((self.keeping.polygon * faces + (1.0 - some) * facets).sum())

    def unseen(self, pixels: FacetPixels) -> float:
        """Facets of what is not seen."""
        return float(self.hidden_sizes.counts(pixels).sum())
