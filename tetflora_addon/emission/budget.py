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
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..proxies.facet_sizes import FacetPixels
from ..refinement.decisions import Decision, contributions
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings
from .asset_expected import AssetExpected
from .asset_plan import Keeping
from .asset_sight import AssetSight
from .expected import Expected
from .leaf_detail import TOLERANCE
from .portions import Sight

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
#: Reserved fraction of a budget that somebody has set: of what was drawn to find out, and more of what was not, since
#: that is expected by a mean; of what none was drawn of; and how many deviations of a number that is drawn at random,
#: which is most for small budgets.
_RESERVE, _OF_THE_REST, _UNKNOWN, _DEVIATIONS = 0.012, 0.075, 0.06, 2.0
#: How far the logarithm of a factor may be from where parts were drawn to find it: where only the image is the limit,
#: and where one that must hold is near; and how often they are drawn.
_STRAYS, _DRAWS = (0.1, 0.03), 3
#: Factors are found as closely as this, on their logarithm, from 1 to the largest.
_CLOSE, _LARGEST = 0.0015, 256.0
#: A number that stands for none where it is divided by, or its logarithm is taken.
_NOTHING = 1e-9
#: Fraction of a limit up to which what is expected certainly fits.
_SURE = 0.6
#: Largest factor on hidden facets that the image alone may ask for.
_LARGEST_HIDDEN = 96.0
#: Polygons of finer levels of near leaves that come on top of what an image can show: needles have several a pixel.
_ON_TOP = 1_500_000.0
#: Fraction of what is allowed that finer levels of near leaves may always have, and tolerances that are tried.
_FINE, _TOLERANCES = 0.25, (*(TOLERANCE * 2.0**k for k in range(9)), np.inf)

#: What is allowed, the weight of a facet, and whether other meshes count out of sight as well.
_Limit = tuple[float, float, bool]


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
    sight : Sight or None
        What is seen of plants with these decisions, where facets take their place.
    """

    refinement: Refinement
    pixels: FacetPixels
    leaf_limit: float
    tolerance: float = TOLERANCE
    sight: Sight | None = field(default=None, compare=False)


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
    assets: tuple[AssetSight, Keeping] | None = None,
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
    assets : AssetSight, Keeping, optional
        What is seen of instances of assets, and which of them are always drawn as the originals.
    """
    detail = Detail(result, FacetPixels(settings.facet), settings.leaf_limit)
    memory = settings.max_memory * 1e9 / BYTES_PER_POLYGON or np.inf
    most = settings.max_polygons or np.inf
    if faces is not None:
        allowed = _unreserved(min(memory, most))
        if not np.isfinite(allowed):
            return detail
        return replace(detail, refinement=_fitted_shells(result, allowed, faces), tolerance=np.inf)
    count = Expected(flora, result, camera, AssetExpected(*assets) if assets else None)
    on_top = min(count.finer(settings.leaf_limit), _ON_TOP)

    def limits() -> list[_Limit]:
        # A sphere is a whole polygon for the limit on polygons, but only a part of one for memory: a budget for each.
        # What other meshes have out of sight takes from what somebody allows, not from what the image shows.
        reserve = _RESERVE + _OF_THE_REST * count.undrawn if count.undrawn < 1.0 and not assets else _UNKNOWN
        each = primitive_bytes / BYTES_PER_POLYGON
        held = ((_unreserved(most, reserve), 1.0, True), (_unreserved(memory, reserve), each, True))
        return [(enough(camera) + on_top, 1.0, False), *held]

    hard = _unreserved(min(memory, most))
    count.tolerance = _tolerance(count, settings, limits())
    if np.isfinite(hard) and count.finer(settings.leaf_limit) > _UNKNOWN * hard:
        # A limit that somebody has set holds, however roughly near leaves can be counted.
        count.calibrate(FacetPixels(settings.facet), settings.leaf_limit, True)
        count.tolerance = _tolerance(count, settings, limits())
    factor, hidden = _affordable(count, settings, limits())
    near = np.isfinite(hard) and count.together(settings) > _SURE * hard
    tried: list[tuple[float, float]] = []  # logarithms of factors of which parts were drawn, and what they led to
    while len(tried) < _DRAWS and (factor > 1.0 or hidden > 1.0 or near):
        # What is expected of parts that will be opened is rough; some of them tell by how much.
        at = float(np.log(factor))
        count.calibrate(FacetPixels(_side(factor, settings), hidden), _limit(factor, settings), near)
        factor, coarser = _affordable(count, settings, limits())
        tried.append((at, float(np.log(factor))))
        strays, hidden = max(abs(tried[-1][1] - at), abs(np.log(coarser / hidden))), coarser
        if strays <= _STRAYS[int(near)]:
            break
        factor = float(np.exp(_meeting(tried, len(tried) == _DRAWS)))
    limit = _limit(factor, settings)
    small, sight = count.too_small(limit) if factor > 1.0 else np.zeros(0, bool), count.sight
    if small.any():
        sight = None
        result = replace(result, decision=np.where(small, Decision.PROXY, result.decision).astype(np.int8))
    return Detail(result, FacetPixels(_side(factor, settings), hidden), limit, count.tolerance, sight)


def _unreserved(budget: float, reserve: float = _UNKNOWN) -> float:
    """What may be expected where no more than a budget may be made."""
    return max((1 - reserve) * budget - _DEVIATIONS * budget**0.5, 0.0) if np.isfinite(budget) else budget


def _meeting(tried: list[tuple[float, float]], last: bool) -> float:
    """Where what parts are drawn at is what they lead to: on the line through the last two; in the end not before."""
    at, led = tried[-1]
    if last:
        return max(at, 2.0 * led - at)
    if len(tried) == 1:
        return led
    slope = (led - tried[-2][1]) / (at - tried[-2][0] or _NOTHING)
    return max(at + (led - at) / max(1.0 - slope, 0.5), 0.0)


def _tolerance(count: Expected, settings: RefinementSettings, limits: list[_Limit]) -> float:
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


def _affordable(count: Expected, settings: RefinementSettings, limits: list[_Limit]) -> tuple[float, float]:
    """Factors on all facets and on hidden ones with which none of the limits is passed."""
    factor = hidden = 1.0
    for allowed, weight, every in limits:
        if np.isfinite(allowed):
            coarser, fewer = _factors(count, settings, allowed, weight, every, hidden)
            factor, hidden = max(factor, coarser), max(hidden, fewer)
    return factor, hidden


def _factors(
    count: Expected, settings: RefinementSettings, allowed: float, weight: float, every: bool, hidden: float
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

    def load(factor: float) -> float:
        for_hidden = min(unseen(factor, hidden), reserved)
        if every:  # hidden facets do not grow for ever; what they need then is taken from those that are seen
            for_hidden = max(for_hidden, unseen(factor, max(hidden, largest)))
        return (seen(factor) + for_hidden) / max(allowed, _NOTHING)

    factor = _smallest(load)
    for_hidden = min(reserved, max(seen(factor), few))
    if every:  # what is seen has all that the settings ask for
        for_hidden = max(for_hidden, allowed - seen(factor))
    return factor, _smallest(lambda by: unseen(factor, by) / max(for_hidden, _NOTHING), largest)


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


def _smallest(load: Callable[[float], float], largest: float = _LARGEST) -> float:
    """Minimum factor from 1 on with which a load, which falls with it, is at most 1; the largest where it never is.

    Numbers of facets are nearly powers of their sides, so that lines between logarithms lead there at once.
    """

    def excess(at: float) -> float:
        return float(np.log(max(load(float(np.exp(at))), _NOTHING)))

    low, high, above, below = 0.0, float(np.log(largest)), excess(0.0), None
    if above <= 0.0:
        return 1.0
    steps = 0
    while high - low > _CLOSE:
        steps += 1
        if steps % 3 == 0:  # where lines lead astray
            guess = (low + high) / 2
        elif below is None:
            guess = low + above / 2
        else:
            guess = low + (high - low) * above / (above - below)
        # Beyond where it should be, so that what is left of the interval lies on the near side.
        guess += _CLOSE / 3 if guess - low < high - guess else -_CLOSE / 3
        guess = min(max(guess, low + _CLOSE / 3), high - _CLOSE / 3)
        found = excess(guess)
        if found <= 0.0:
            high, below = guess, found
        else:
            low, above = guess, found
    return float(np.exp(high))
