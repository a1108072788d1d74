# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of each cluster of the instances of assets, as `portions` tells of parts of plants."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import nested
from ..camera.camera import Camera
from ..proxies.thrown_shadows import ThrownShadows
from ..refinement.asset_parts import AssetParts
from ..refinement.loop import Refinement
from ..refinement.shared_parts import SharePoints, lowered
from .seen import CLOSE, Seen, SeenNodes

#: Points on a cluster that tell where it is seen, once it is opened.
POINTS = 12


@dataclass(frozen=True)
class AssetPortions(Seen):
    """Clusters of instances (n), and what is seen of them.

    Attributes
    ----------
    parts : AssetParts of n
    """

    parts: AssetParts = field(metadata=nested(AssetParts))


class AssetSight:
    """What the loop has found for clusters of instances.

    Parameters
    ----------
    result : Refinement
    camera : Camera
    facets : bool
        Whether proxies are facets or spheres.
    """

    def __init__(self, result: Refinement, camera: Camera, facets: bool = True) -> None:
        self.camera, self.tree, self.assets = camera, result.tree, result.assets
        self.placed = result.assets.placed
        self.nodes, self._facets = SeenNodes(result, facets), facets
        lowest = result.assets.parts.centre[:, 2].min(initial=np.inf)
        self.shadows = ThrownShadows(camera, result.lights, float(lowest))
        self._every: AssetPortions | None = None

    def portions(self) -> AssetPortions:
        """All clusters, front to back."""
        if self._every is None:
            made = self._portions(self.assets.parts, self.assets.points)
            # Ties are broken by the instances themselves, so that their order in the scene does not matter.
            self._every = made.take(np.lexsort([self.placed.keys(made.parts), made.rank]))
        return self._every

    def _portions(self, parts: AssetParts, points: SharePoints) -> AssetPortions:
        at = np.flatnonzero(self.nodes.close[points.cell])
        width = parts.totals.width[points.part[at]]
        close = at[width >= CLOSE * self.camera.extent_around(points.position[at].astype(np.float64))]
        made = AssetPortions(*vars(self.nodes.of(points, len(parts), close)).values(), parts)
        if self._facets:
            self._let_in(made)
        return made

    def _let_in(self, portions: AssetPortions) -> None:
        """Have drawn, in place, what is seen at none of its points, reaches into the view and is large there."""
        at = np.flatnonzero(portions.visibility <= 0.0)
        parts = portions.parts.take(at)
        slope = 0.0 if self.camera.kind == "ORTHO" else self.camera.pixel_size
        nearest = self.camera.extent_around(parts.centre) - slope * parts.reach
        inside = self.camera.clearance(parts.centre) < parts.reach
        at = at[inside & (parts.totals.width >= CLOSE * nearest)]
        portions.visibility[at] = portions.best[at] = CLOSE**-2.0
        portions.real[at] = portions.mixed[at] = True
        portions.beside[at] = False

    def opened(self, portions: AssetPortions) -> tuple[AssetPortions, NDArray[np.int64]]:
        """Children of clusters (n,), and whose each is (m,); what is seen of them where that differs is found anew."""
        parts, owner = [AssetParts.empty()], [np.zeros(0, np.int64)]
        for new, of, _ in self.assets.opened(portions.parts):
            parts.append(new)
            owner.append(of)
        every, of = AssetParts.concatenate(parts), np.concatenate(owner)
        seen = portions.take(of)
        made = AssetPortions(*(getattr(seen, name) for name in _INHERITED), every)
        unclear = np.flatnonzero(seen.mixed)
        if not len(unclear):
            return made, of
        some = every.take(unclear)
        points = self.assets.points_on(some, None, POINTS)
        points = SharePoints(points.part, lowered(self.tree, points), points.position, points.leaf, points.wood)
        known = self._portions(some, points)
        columns = []
        for name in _INHERITED:
            column_ = getattr(made, name).copy()
            column_[unclear] = getattr(known, name)
            columns.append(column_)
        return AssetPortions(*columns, every), of

    def pixels(self, portions: AssetPortions) -> NDArray[np.float64]:
        """Extent (n,) of clusters in the image."""
        return portions.parts.extent / self.camera.extent_around(portions.parts.centre)


_INHERITED = tuple(vars(Seen.empty()))
