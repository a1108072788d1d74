# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A budget of polygons: the finest image that fits (beyond the paper, whose only limit is the cutoff).

How many polygons and facets an image has follows from the pixels that plants cover: parts are drawn until these are
full. Where facets are larger, there are fewer, as their area is. Where there are few, they may be finer than they have
to be. Shells have one size; there, real leaves go to the tetrahedra that gain most by them for each polygon.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..camera.camera import Camera
from ..refinement.decisions import Decision, contributions
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings
from .drawing import HIDDEN_A_PIXEL, OUTSIDE_A_PIXEL
from .plants import TOLERANCE

#: Approximate bytes of a polygon in Blender (110) and in a renderer (500) together.
BYTES_PER_POLYGON = 610
#: The same of a triangle of expanded plants, whose leaves have many corners: 310 to 380 in Blender and Cycles together.
BYTES_PER_TRIANGLE = 380
#: Polygons and facets for each pixel that plants cover, about, with facets of a pixel.
A_PIXEL = 12.0
#: Polygons and facets that are never too many with the facets of *Final*, see `relative_side`; and how many times finer
#: facets are at most.
NEVER_TOO_MANY, FINEST = 2_400_000.0, 3.0
#: What an expected number may be off by.
RESERVE = 0.15
#: Leaves of what is instanced are real from widths so many times smaller on than those of plants.
ASSETS_FINER = 3.6
#: Least side of facets of instances over that which is asked for. In a wood of 100 trees from the middle distance of
#: ``benchmarks assets``, of which no original fits into memory, FLIP is .168 with .33, .168 with .67, .175 with 1.
ASSETS_FINEST = 0.67


@dataclass(frozen=True)
class Detail:
    """How finely a refined scene is drawn."""

    refinement: Refinement  # decisions that fit into the budget
    facet: float  # side of facets, pixels
    leaf_limit: float  # width in pixels up to which leaves are facets
    coarser: float = 1.0  # sides over those that are asked for
    #: Pixels by which the margins of near leaves may be off; infinite where only their models are drawn.
    tolerance: float = TOLERANCE
    most: float = np.inf  # polygons and facets that there may be

    @property
    def asset_limit(self) -> float:
        """`leaf_limit` of instances, whose originals are at hand, and of your own meshes."""
        return self.leaf_limit * max(1.0 / self.coarser, 1.0) / ASSETS_FINER

    @property
    def asset_larger(self) -> float:
        """Sides of facets of instances over those of plants, which alone gain by being much finer than asked for."""
        return max(ASSETS_FINEST / self.coarser, 1.0)


def fit_to_budget(
    result: Refinement,
    camera: Camera,
    settings: RefinementSettings,
    faces: float | None = None,
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
    """
    memory = settings.max_memory * 1e9 / BYTES_PER_POLYGON if settings.max_memory else np.inf
    most = (1.0 - RESERVE) * min(memory, settings.max_polygons or np.inf)
    detail = Detail(result, settings.facet, settings.leaf_limit)
    if faces is not None:
        if not np.isfinite(most):
            return detail
        return replace(detail, refinement=_fitted_shells(result, most, faces), tolerance=np.inf)
    polygons = float(len(result.cell_polygons.polygons))
    number = primitives(result, camera, settings.facet)
    coarser = relative_side(number, settings.facet)
    left = max(most - polygons, 0.01 * most) if np.isfinite(most) else most
    coarser = max(coarser, float(np.sqrt(number / left)))
    return replace(
        detail,
        facet=coarser * settings.facet,
        leaf_limit=coarser * settings.leaf_limit,
        coarser=coarser,
        tolerance=TOLERANCE * max(coarser, 1.0) ** 2,
        most=left,
    )


def relative_side(number: float, facet: float) -> float:
    """Side of facets over that which is asked for, where there would be so many primitives: 1, or less if few.

    What is asked to be coarser than *Final* is so in small images as well: they would take as long otherwise.

    Parameters
    ----------
    number : float
        Polygons and facets with the side that is asked for.
    facet : float
        That side, pixels.
    """
    few = NEVER_TOO_MANY / max(facet / RefinementSettings().facet, 1.0) ** 2
    return float(np.clip(np.sqrt(number / few), 1.0 / FINEST, 1.0))


def primitives(result: Refinement, camera: Camera, facet: float) -> float:
    """Polygons and facets (expected) with facets of so many pixels, by the pixels that cells cover."""
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


def _large(result: Refinement) -> Floats:
    """Polygons (cells,) that stay polygons although their cell is a proxy."""
    held = result.cell_polygons.polygons
    large = np.isinf(held.totals.width)
    return np.bincount(held.cell[large], minlength=len(result.tree))[result.nodes].astype(np.float64)
