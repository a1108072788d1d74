# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A budget of polygons: the finest image that fits (beyond the paper, whose only limit is the cutoff).

How many polygons and facets an image has follows from the pixels that plants cover: parts are drawn until these are
full. Where facets are larger, there are fewer, as their area is. Where there are few, they may be finer than they have
to be. Shells have one size; there, real leaves go to the tetrahedra that gain most by them for each polygon.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Camera
from ..proxies.facet_sizes import FacetPixels
from ..refinement.decisions import Decision, contributions
from ..refinement.estimate import FINEST, NEVER_TOO_MANY
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings
from .asset_expected import AssetExpected
from .asset_plan import Keeping
from .asset_sight import AssetSight
from .drawing import HIDDEN_A_PIXEL, OUTSIDE_A_PIXEL
from .leaf_detail import TOLERANCE

#: Approximate bytes of a polygon in Blender (110) and in a renderer (500) together.
BYTES_PER_POLYGON = 610
#: The same for a microsphere in a point cloud.
BYTES_PER_SPHERE = 210
#: Polygons and facets for each pixel that plants cover, about, with facets of a pixel.
A_PIXEL = 6.0
#: What an expected number may be off by, and how often a detail is made coarser until it fits.
RESERVE, _TRIES = 0.15, 24
#: Facets of what is instanced are so many times finer than those of plants: its originals are at hand.
ASSETS_FINER = 3.6


@dataclass(frozen=True)
class Detail:
    """How finely a refined scene is drawn.

    Attributes
    ----------
    refinement : Refinement
        Decisions that fit into the budget.
    pixels : FacetPixels
        Sides of facets.
    leaf_limit : float
        Width in pixels up to which leaves are facets.
    tolerance : float
        Pixels by which the margins of near leaves may be off; infinite where only their models are drawn.
    most : float
        Polygons and facets of plants that there may be.
    asked : float
        Side of facets that is asked for, pixels.
    """

    refinement: Refinement
    pixels: FacetPixels
    leaf_limit: float
    tolerance: float = TOLERANCE
    most: float = np.inf
    asked: float = 1.0

    @property
    def of_assets(self) -> FacetPixels:
        """Sides of facets of instances and of your own meshes, which are no finer where there are few plants."""
        return FacetPixels(self.asked * max(self.pixels.hidden, 1.0) / ASSETS_FINER, max(self.pixels.hidden, 1.0))

    @property
    def asset_limit(self) -> float:
        """`leaf_limit` of instances."""
        return self.leaf_limit * max(1.0 / self.pixels.hidden, 1.0) / ASSETS_FINER


def enough(camera: Camera, facet: float = 1.0) -> float:
    """Polygons and facets that an image shows, about."""
    return max(A_PIXEL * camera.width * camera.height / facet**2, NEVER_TOO_MANY)


def afford(
    result: Refinement,
    camera: Camera,
    settings: RefinementSettings,
    faces: float | None = None,
    primitive_bytes: float = BYTES_PER_POLYGON,
    assets: tuple[AssetSight, Keeping] | None = None,
) -> Detail:
    """Detail that fits into the budget of the settings.

    Parameters
    ----------
    result : Refinement
        Of the loop.
    camera : Camera
    settings : RefinementSettings
    faces : float, optional
        Faces of each proxy tetrahedron; by default proxies are facets or spheres, whose number follows their size.
    primitive_bytes : float
        Memory of one facet or sphere.
    assets : AssetSight, Keeping, optional
        What is seen of instances of assets, and which of them are always drawn as the originals.
    """
    memory = settings.max_memory * 1e9 / BYTES_PER_POLYGON if settings.max_memory else np.inf
    most = (1.0 - RESERVE) * min(memory, settings.max_polygons or np.inf)
    detail = Detail(result, FacetPixels(settings.facet), settings.leaf_limit, asked=settings.facet)
    if faces is not None:
        if not np.isfinite(most):
            return detail
        return replace(detail, refinement=_fitted_shells(result, most, faces), tolerance=np.inf)
    polygons = float(len(result.holdings.polygons))
    placed = AssetExpected(*assets) if assets else None
    number = primitives(result, camera, settings.facet)
    coarser = float(np.clip(np.sqrt(number / NEVER_TOO_MANY), 1.0 / FINEST, 1.0))
    left = max(most - polygons, 0.01 * most) if np.isfinite(most) else most
    for _ in range(_TRIES):
        fewer = replace(
            detail,
            pixels=FacetPixels(coarser * settings.facet, coarser),
            leaf_limit=coarser * settings.leaf_limit,
            tolerance=TOLERANCE * max(coarser, 1.0) ** 2,
            most=left,
        )
        every = number / coarser**2
        if placed is not None:
            pixels, limit = fewer.of_assets, fewer.asset_limit
            every += placed.seen(pixels.seen, limit, 1.0, True) + placed.unseen(pixels)
        if every <= left:
            break
        coarser *= max(min(np.sqrt(every / max(left, 1.0)), 2.0), 1.02)
    return fewer


def primitives(result: Refinement, camera: Camera, facet: float) -> float:
    """Polygons and facets (expected) of plants with facets of so many pixels, by the pixels that their cells cover."""
    if not len(result.plants.parts):
        return 0.0
    covered = float(contributions(result.cells, result.transmittance)[result.in_view[result.nodes]].sum())
    return A_PIXEL * covered / facet**2 + (HIDDEN_A_PIXEL + OUTSIDE_A_PIXEL) * camera.width * camera.height


def _fitted_shells(result: Refinement, allowed: float, faces: float) -> Refinement:
    """Decisions that fit where each proxy has so many faces."""
    explicit = result.decision == Decision.EXPLICIT
    polygons, fixed = np.where(explicit, result.totals.polygons, 0.0), faces + _large(result)
    if polygons.sum() + fixed[~explicit].sum() <= allowed:
        return result
    cost = polygons - fixed
    gain = contributions(result.cells, result.transmittance) / np.maximum(cost, 1.0)
    order = np.argsort(np.where(explicit, -gain, np.inf), kind="stable")[: explicit.sum()]
    spent = np.cumsum(np.maximum(cost[order], 0.0)) + fixed.sum()
    kept = np.zeros(len(explicit), bool)
    kept[order[spent <= allowed]] = True
    decision = np.where(explicit & ~kept, Decision.PROXY, result.decision).astype(np.int8)
    return replace(result, decision=decision)


def _large(result: Refinement) -> NDArray[np.float64]:
    """Polygons (cells,) that stay polygons although their cell is a proxy."""
    held = result.holdings.polygons
    large = np.isinf(held.totals.width)
    return np.bincount(held.cell[large], minlength=len(result.tree))[result.nodes].astype(np.float64)
