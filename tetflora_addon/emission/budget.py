# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A budget of polygons: the best image that fits (beyond the paper, whose only limit is the cutoff).

If the result of refinement does not fit, real leaves go to the tetrahedra that gain most by them for each polygon, best
first, until the budget is spent. All others become proxies, whose facets grow until they fit as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..proxies.facet_sizes import coarseness, piece_facet_sizes, polygon_facet_sizes, subplant_facet_sizes
from ..refinement.decisions import Decision, contributions
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings

#: Approximate bytes of a polygon in Blender (110) and in a renderer (500) together.
BYTES_PER_POLYGON = 610
#: The same for a microsphere in a point cloud.
BYTES_PER_SPHERE = 210
#: Reserved fraction of the budget, since expected numbers are means.
_RESERVE = 0.06
#: Fraction of the budget that facets may use before real leaves get theirs.
_FACETS_FIRST = 0.5
_STEPS = 12  # of bisection on the logarithm of the facets' side, between 1 and:
_LARGEST = 64.0


def polygons_allowed(settings: RefinementSettings) -> float:
    """Polygons that the settings allow, infinite where they set no limit."""
    return min(settings.max_polygons or np.inf, settings.max_memory * 1e9 / BYTES_PER_POLYGON or np.inf)


def afford(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    settings: RefinementSettings,
    faces: float | None = None,
    primitive_bytes: float = BYTES_PER_POLYGON,
) -> tuple[Refinement, float]:
    """Decisions that fit into the budget of the settings.

    Parameters
    ----------
    flora : Flora
    result : Refinement
        Of the loop.
    camera : Camera
    settings : RefinementSettings
    faces : float, optional
        Faces of each proxy tetrahedron; by default proxies are facets or spheres, whose number follows their size.
    primitive_bytes : float
        Memory of one facet or sphere.

    Returns
    -------
    Refinement
        With other decisions, or the same object.
    float
        Side of a facet in pixels.
    """
    side = settings.facet
    # A sphere is a whole polygon for the limit on polygons, but only a part of one for memory: a budget for each.
    memory = replace(settings, max_polygons=0), primitive_bytes / BYTES_PER_POLYGON
    for limits, weight in ((replace(settings, max_memory=0.0), 1.0), memory):
        allowed = (1 - _RESERVE) * polygons_allowed(limits)
        if np.isfinite(allowed):
            result, side = _fitted(flora, result, camera, allowed, side, weight, faces)
    return result, side


def _fitted(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    allowed: float,
    side: float,
    weight: float,
    faces: float | None,
) -> tuple[Refinement, float]:
    """Decisions and a side of facets, at least ``side``; a facet counts as ``weight`` polygons."""
    explicit = result.decision == Decision.EXPLICIT
    polygons = np.where(explicit, result.totals.polygons, 0.0)
    count = _Facets(flora, result, camera) if faces is None else None
    fixed = None if faces is None else faces + _large(result)

    def proxies(factor: float) -> NDArray[np.float64]:
        """Faces (cells,) of all cells as proxies, with facets larger by a factor."""
        return count.by_cell(factor * side, weight) if count else fixed

    as_asked = proxies(1.0)
    if polygons.sum() + as_asked[~explicit].sum() <= allowed:
        return result, side
    factor = _smallest(lambda f: proxies(f).sum() <= _FACETS_FIRST * allowed) if count else 1.0
    cost = polygons - proxies(factor)
    gain = contributions(result.cells, result.transmittance) / np.maximum(cost, 1.0)
    order = np.argsort(np.where(explicit, -gain, np.inf), kind="stable")[: explicit.sum()]
    spent = np.cumsum(np.maximum(cost[order], 0.0)) + proxies(factor).sum()
    kept = np.zeros(len(explicit), bool)
    kept[order[spent <= allowed]] = True
    if count:  # what real leaves leave over makes facets finer again
        left = allowed - polygons[kept].sum()
        factor = _smallest(lambda f: proxies(f)[~kept].sum() <= left)
    decision = np.where(explicit & ~kept, Decision.PROXY, result.decision).astype(np.int8)
    return replace(result, decision=decision), factor * side


def _large(result: Refinement) -> NDArray[np.float64]:
    """Polygons (cells,) that stay polygons although their cell is a proxy."""
    contents = result.contents
    large = np.isinf(contents.polygons.totals.width)
    return np.bincount(contents.polygons.cell[large], minlength=len(result.tree))[result.nodes].astype(np.float64)


class _Facets:
    """Expected facets of the cells of a refinement as proxies."""

    def __init__(self, flora: Flora, result: Refinement, camera: Camera) -> None:
        contents, coarse = result.contents, coarseness(result)
        index = np.zeros(len(result.tree), np.int64)
        index[result.nodes] = np.arange(len(result.nodes))
        self.number = len(result.nodes)
        self.plants = [
            (subplant_facet_sizes(flora, contents, camera, coarse), index[contents.subplants.cell]),
            (piece_facet_sizes(flora, contents, camera, coarse), index[contents.pieces.cell]),
        ]
        self.polygons = polygon_facet_sizes(contents, camera, result.chosen(Decision.HIDDEN))
        self.polygon_cell = index[contents.polygons.cell]

    def by_cell(self, pixels: float, weight: float = 1.0) -> NDArray[np.float64]:
        """Facets (cells,), each counted with a weight, where those that are seen have so many pixels."""
        made = sum(np.bincount(cell, sizes.counts(pixels), self.number) for sizes, cell in self.plants)
        kept, counts = self.polygons.kept(pixels), self.polygons.counts(pixels)
        return weight * made + np.bincount(self.polygon_cell, np.where(kept, 1.0, weight) * counts, self.number)


def _smallest(fits: Callable[[float], bool]) -> float:
    """Minimum factor from 1 on that fits, or the largest where none does."""
    if fits(1.0):
        return 1.0
    low, high = 0.0, np.log(_LARGEST)
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (low, middle) if fits(np.exp(middle)) else (middle, high)
    return float(np.exp(high))
