# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A budget of polygons: the best image that fits (beyond the paper, whose only limit is the cutoff).

A picture shows no more than about one facet for each pixel and layer of what is seen. If the result of refinement has
more, the widths below which leaves become facets and the facets themselves grow by one factor until it fits. What is
hidden or beside the view only casts shadows and sends light back: its facets get a part of the budget of their own,
and never more than what is seen. Before any of that, near leaves have coarser margins, until what makes them finer is
a small part. Shells have one size; there, real leaves go to the tetrahedra that gain most by them
for each polygon.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.hashing import uniform
from ..parallel import blocks, on_all_cores
from ..proxies.facet_sizes import FacetPixels, polygon_facet_sizes
from ..proxies.facet_weights import facet_weights
from ..proxies.microsurfaces import Facets
from ..refinement.contents import LARGE
from ..refinement.decisions import Decision, contributions
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings
from ..subplants.wood_detail import finer
from .facets import portion_facets, sizes_of
from .leaf_detail import TOLERANCE, LeafDetail
from .plants import Block, Transition, portion_blocks
from .portions import Portions, Sight

#: Approximate bytes of a polygon in Blender (110) and in a renderer (500) together.
BYTES_PER_POLYGON = 610
#: The same for a microsphere in a point cloud.
BYTES_PER_SPHERE = 210
#: Polygons and facets for each pixel of the image that are enough, and the number that is never too many.
ENOUGH_A_PIXEL, NEVER_TOO_MANY = 1.95, 1_500_000.0
#: Fraction of them that may be hidden, and how many hidden ones are never too many.
_HIDDEN, _FEW_HIDDEN = 0.3, 300_000.0
#: Facets grow to so many times their size before real leaves become fewer.
FACETS_FIRST = 6.0
#: Reserved fraction of a budget that somebody has set, since expected numbers are means; and how many deviations of a
#: number that is drawn at random, which is most for small budgets.
_RESERVE, _DEVIATIONS = 0.06, 2.0
#: Fraction of the faces of twigs that are made where leaves are real.
_TWIGS = 0.15
#: Parts of plants that are drawn to find out what to expect: where only the image limits them, and where a limit that
#: must hold is near; polygons that are too few to tell; and how far expectations may be corrected.
_DRAWN, _SOME, _ROUGH = (800, 3000), 300.0, (0.4, 2.5)
#: Draw of this module: which parts. That of the transition would choose those whose wood is real.
_SAMPLE = 224
_STEPS = 10  # of bisection on the logarithm of factors, between 1 and:
_LARGEST = 256.0
#: Parts that are looked at together; sums of these are summed up in their order.
_TOGETHER = 50_000
#: Fraction of a limit up to which what is expected certainly fits.
_SURE = 0.6
#: Largest factor on hidden facets that the image alone may ask for.
_LARGEST_HIDDEN = 96.0
#: Polygons of finer levels of near leaves that come on top of what an image can show: needles have several a pixel.
_ON_TOP = 1_500_000.0
#: Fraction of what is allowed that finer levels of near leaves may always have, and tolerances that are tried.
_FINE, _TOLERANCES = 0.25, (*(TOLERANCE * 2.0**k for k in range(9)), np.inf)


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
    """

    refinement: Refinement
    pixels: FacetPixels
    leaf_limit: float
    tolerance: float = TOLERANCE


def enough(camera: Camera) -> float:
    """Polygons and facets that an image can show."""
    return max(ENOUGH_A_PIXEL * camera.width * camera.height, NEVER_TOO_MANY)


def afford(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    settings: RefinementSettings,
    faces: float | None = None,
    primitive_bytes: float = BYTES_PER_POLYGON,
) -> Detail:
    """Detail that fits into the budget of the settings.

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
    """
    detail = Detail(result, FacetPixels(settings.facet), settings.leaf_limit)
    memory = settings.max_memory * 1e9 / BYTES_PER_POLYGON or np.inf
    most = settings.max_polygons or np.inf
    if faces is not None:
        allowed = _unreserved(min(memory, most))
        if not np.isfinite(allowed):
            return detail
        return replace(detail, refinement=_fitted_shells(result, allowed, faces), tolerance=np.inf)
    count = _Facets(flora, result, camera)
    # A sphere is a whole polygon for the limit on polygons, but only a part of one for memory: a budget for each.
    # What other meshes have out of sight takes from what somebody allows, not from what the image shows.
    on_top = min(count.finer(settings.leaf_limit), _ON_TOP)
    limits = [(enough(camera) + on_top, 1.0, False), (_unreserved(most), 1.0, True)]
    limits += [(_unreserved(memory), primitive_bytes / BYTES_PER_POLYGON, True)]
    count.tolerance = _tolerance(count, settings, limits)
    hard = min(allowed for allowed, _, every in limits if every)
    if np.isfinite(hard) and count.finer(settings.leaf_limit) > _RESERVE * hard:
        # A limit that somebody has set holds, however roughly near leaves can be counted.
        count.calibrate(FacetPixels(settings.facet), settings.leaf_limit, True)
        count.tolerance = _tolerance(count, settings, limits)
    factor, hidden = _affordable(count, settings, limits)
    near = np.isfinite(hard) and count.together(settings) > _SURE * hard
    if factor > 1.0 or hidden > 1.0 or near:
        # What is expected of parts that will be opened is rough; some of them tell by how much.
        count.calibrate(FacetPixels(_side(factor, settings), hidden), _limit(factor, settings), near)
        factor, hidden = _affordable(count, settings, limits)
    limit = _limit(factor, settings)
    small = count.too_small(limit) if factor > 1.0 else np.zeros(0, bool)
    if small.any():
        result = replace(result, decision=np.where(small, Decision.PROXY, result.decision).astype(np.int8))
    return Detail(result, FacetPixels(_side(factor, settings), hidden), limit, count.tolerance)


def _unreserved(budget: float) -> float:
    """What may be expected where no more than a budget may be made."""
    return max((1 - _RESERVE) * budget - _DEVIATIONS * budget**0.5, 0.0) if np.isfinite(budget) else budget


def _tolerance(count: _Facets, settings: RefinementSettings, limits: list[tuple[float, float, bool]]) -> float:
    """The smallest tolerance with which nothing else has to grow, or finer leaves are a small part of what is allowed.

    How wide leaves are that are real is that of a budget that suffices.
    """
    allowed = min(_FINE * limit if every else max(_FINE * limit, _ON_TOP) for limit, _, every in limits)
    for tolerance in _TOLERANCES:
        count.tolerance = tolerance
        more = count.finer(_limit(1.0, settings))
        if more <= 0.0 or more <= allowed or _affordable(count, settings, limits)[0] <= 1.0:
            break
    return tolerance


def _affordable(
    count: _Facets, settings: RefinementSettings, limits: list[tuple[float, float, bool]]
) -> tuple[float, float]:
    """Factors on all facets and on hidden ones with which none of the limits is passed: what is allowed, the weight of
    a facet, and whether other meshes count out of sight as well.
    """
    factor = hidden = 1.0
    for allowed, weight, every in limits:
        if np.isfinite(allowed):
            coarser, fewer = _factors(count, settings, allowed, weight, every, hidden)
            factor, hidden = max(factor, coarser), max(hidden, fewer)
    return factor, hidden


def _factors(
    count: _Facets, settings: RefinementSettings, allowed: float, weight: float, every: bool, hidden: float
) -> tuple[float, float]:
    """Factors on all facets and on hidden ones, beside ``hidden``, with which no more is made than allowed."""

    def seen(factor: float) -> float:
        pixels, limit = _side(factor, settings), _limit(factor, settings)
        return count.seen(pixels, limit, weight, every) + count.polygons(pixels, limit, weight, every)

    def unseen(factor: float, by: float) -> float:
        return weight * count.unseen(FacetPixels(_side(factor, settings), by), every)

    # Where only the picture asks for less, shadows and light of what is hidden are kept.
    largest = _LARGEST if every else _LARGEST_HIDDEN
    few = min(_FEW_HIDDEN, allowed / 2)
    reserved = max(_HIDDEN * allowed, few)

    def fits(factor: float) -> bool:
        for_hidden = min(unseen(factor, hidden), reserved)
        if every:  # hidden facets do not grow for ever; what they need then is taken from those that are seen
            for_hidden = max(for_hidden, unseen(factor, max(hidden, largest)))
        return seen(factor) + for_hidden <= allowed

    factor = _smallest(fits)
    for_hidden = min(reserved, max(seen(factor), few))
    return factor, _smallest(lambda by: unseen(factor, by) <= for_hidden, largest)


def _side(factor: float, settings: RefinementSettings) -> float:
    """Side of facets in pixels, where leaves become facets at a width larger by a factor.

    Real leaves are where the plants have them, facets are not: facets give way first.
    """
    return max(min(factor**3, FACETS_FIRST), factor) * settings.facet


def _limit(factor: float, settings: RefinementSettings) -> float:
    """Width in pixels up to which leaves are facets."""
    return factor * settings.leaf_limit


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


class _Facets:
    """Expected polygons and facets of a refinement."""

    def __init__(self, flora: Flora, result: Refinement, camera: Camera) -> None:
        self.sight = Sight(flora, result, camera)
        self.every = portions = self.sight.portions()
        self.found = np.ones(2)  # of polygons and of facets, what was found over what was expected
        some = portions.visibility > 0
        self.flora, self.camera, self.portions = flora, camera, portions.take(np.flatnonzero(some))
        self.sizes = sizes_of(flora, self.portions, self.sight.shadows)
        self.faces_coarse = _real_faces(flora, self.portions, Transition(flora, camera, 1.0, np.inf))
        self.tolerance = TOLERANCE
        unseen = sizes_of(flora, portions.take(np.flatnonzero(~some)), self.sight.shadows)
        self.unseen_sizes = [unseen.take(block) for block in blocks(len(unseen), _TOGETHER)]
        self.result, held, hidden = result, result.holdings.polygons, result.chosen(Decision.HIDDEN)
        self.cell = held.cell
        self.hidden = hidden[held.cell] | ~result.in_view[held.cell]
        self.faces = polygon_facet_sizes(held, camera, hidden)

    @property
    def tolerance(self) -> float:
        """Pixels by which the margins of near leaves may be off."""
        return self._tolerance

    @tolerance.setter
    def tolerance(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self.faces_finer = LeafDetail(self.flora, self.camera, tolerance).more(
            self.portions.parts, self.portions.visibility
        )

    def finer(self, limit: float) -> float:
        """Polygons of near leaves beyond those of their models."""
        branches = self.portions.parts.branches
        fraction = Transition(self.flora, self.camera, limit).of_branches(branches, self.portions.visibility)
        return float((np.where(self.portions.real, fraction, 0.0) * self.portions.within * self.faces_finer).sum())

    def seen(self, pixels: float, limit: float, weight: float, safe: bool = False) -> float:
        """Polygons, and facets counted with a weight, of all plants that are seen.

        safe: never fewer than were expected before `calibrate`; some plants do not tell exactly about all.
        """
        transition = Transition(self.flora, self.camera, limit)
        branches = self.portions.parts.branches
        real = np.where(self.portions.real, transition.of_branches(branches, self.portions.visibility), 0.0)
        found = np.maximum(self.found, float(safe))
        facets = found[1] * weight * self.sizes.counts(FacetPixels(pixels))
        faces = found[0] * (self.faces_coarse + self.faces_finer)
        tubes = found[0] * float(_tubes(self.flora, self.portions, transition, real).sum())
        return float((self.portions.within * (real * faces + (1.0 - real) * facets)).sum()) + tubes

    def unseen(self, pixels: FacetPixels, safe: bool = False) -> float:
        """Facets of all plants that are not seen; safe as for `seen`."""
        found = on_all_cores(lambda sizes: float(sizes.counts(pixels).sum()), self.unseen_sizes)
        return float(max(self.found[1], float(safe))) * sum(found)

    def together(self, settings: RefinementSettings) -> float:
        """Expected polygons and facets of all, seen or not, at the details of the settings."""
        pixels, limit = settings.facet, settings.leaf_limit
        of_meshes = self.polygons(pixels, limit, 1.0, True)
        return self.seen(pixels, limit, 1.0, True) + of_meshes + self.unseen(FacetPixels(pixels), True)

    def calibrate(self, pixels: FacetPixels, limit: float, exactly: bool) -> None:
        """Draw some of the plants, or more of them, and expect of all what was found of these."""
        share = _DRAWN[int(exactly)] / max(len(self.every), 1)
        chosen = uniform(self.every.parts.branches.key, _SAMPLE) < min(share, 1.0)
        some = self.every.take(np.flatnonzero(chosen))
        transition = Transition(self.flora, self.camera, limit, self.tolerance)
        weights = facet_weights(self.flora, ())
        real = sum(portion_blocks(self.sight, some, transition, form=_cost))
        facets = sum(made for _, made, _ in portion_facets(self.sight, some, weights, pixels, transition, _count))
        sizes, fraction = sizes_of(self.flora, some, self.sight.shadows), np.where(some.real, 1.0, 0.0)
        fraction *= np.where(some.visibility > 0, transition.of_branches(some.parts.branches, some.visibility), 0.0)
        faces = _real_faces(self.flora, some, transition) + transition.detail.more(some.parts, some.visibility)
        expected = (some.within * fraction * faces).sum() + _tubes(self.flora, some, transition, fraction).sum()
        left = (some.within * (1.0 - fraction) * sizes.counts(pixels)).sum()
        self.found = np.clip((np.array([real, facets]) + _SOME) / (np.array([expected, left]) + _SOME), *_ROUGH)

    def polygons(self, pixels: float, limit: float, weight: float, every: bool) -> float:
        """Polygons of other meshes, and facets in their place; of what is seen, or of all."""
        explicit = np.zeros(len(self.result.tree), bool)
        explicit[self.result.nodes] = (self.result.decision == Decision.EXPLICIT) & ~self.too_small(limit)
        kept = explicit[self.cell] | self.faces.kept(pixels)
        counts = np.where(kept, 1.0, weight * self.faces.counts(pixels))
        return float(counts[every | ~self.hidden].sum())

    def too_small(self, limit: float) -> NDArray[np.bool_]:
        """Explicit tetrahedra (cells,) with polygons of other meshes that are proxies under a larger limit."""
        cells, held = self.result.cells, np.zeros(len(self.result.tree), bool)
        held[self.cell] = True
        # What is large there stays as it is as long as facets are smaller.
        feature = np.where(np.isinf(cells.feature), LARGE, cells.feature)
        return held[cells.nodes] & (self.result.decision == Decision.EXPLICIT) & (feature < limit)


def _cost(block: Block) -> float:
    """Polygons of a block; those of more than two triangles count by these."""
    return float(np.maximum((np.diff(block.buffers.face_offsets) - 2) / 2.0, 1.0).sum())


def _count(facets: Facets, _seen: bool) -> int:
    return len(facets)


def _tubes(flora: Flora, portions: Portions, transition: Transition, real: NDArray[np.float64]) -> NDArray[np.float64]:
    """Expected polygons (n,) of thick wood of portions of whose leaves a fraction (n,) is real."""
    branches, rows = portions.parts.branches, flora.rows[portions.parts.branches.row]
    own = rows["sides"] * (rows["segments"] + rows["rings"]).astype(np.float64)
    return transition.of_thickness(branches, portions.best) * own * ~rows["phantom"] * (1.0 - real)


def _real_faces(flora: Flora, portions: Portions, transition: Transition) -> NDArray[np.float64]:
    """Expected polygons (n,) of portions, were all of their leaves real; large faces count by their triangles."""
    parts, row = portions.parts, portions.parts.branches.row
    leafy = flora.leaf_count[row] > 0
    each = np.where(leafy, flora.leaf_faces[row] / np.maximum(flora.leaf_count[row], 1e-300), 0.0)
    leaves = np.where(leafy, parts.totals.leaf_area / np.maximum(flora.one_leaf_area(parts.branches), 1e-300), 0.0)
    wood = np.maximum(parts.totals.polygons - leaves * each, 0.0)
    if (pixels := transition.detail.wood) is not None:
        wood = wood * finer(flora, parts.branches, parts.alone, pixels)
    kites = transition.of_kites(parts.branches, portions.visibility)
    full = each * _weights(flora)[flora.rows["species"][row]]
    # Among real leaves, hardly any twig is wide enough to be real.
    return leaves * (full + kites * (1.0 - full)) + np.where(leafy & ~parts.alone, _TWIGS, 1.0) * wood


def _weights(flora: Flora) -> NDArray[np.float64]:
    """Triangles (species,) of a face of leaves over those of a quad: a spray of needles may be one face of many."""
    forms = [[form for kind in kinds for form in kind] for kinds in flora.forms]
    triangles = [sum(len(form.corner_verts) - 2 * form.polygons for form in own) for own in forms]
    faces = [sum(form.polygons for form in own) for own in forms]
    return np.maximum(np.array(triangles) / (2.0 * np.maximum(faces, 1)), 1.0)


def _smallest(fits: Callable[[float], bool], largest: float = _LARGEST) -> float:
    """Minimum factor from 1 on that fits, or the largest where none does."""
    if fits(1.0):
        return 1.0
    low, high = 0.0, np.log(largest)
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (low, middle) if fits(np.exp(middle)) else (middle, high)
    return float(np.exp(high))
