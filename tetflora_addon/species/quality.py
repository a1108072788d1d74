# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of detail of a species by one factor: the same plant described with fewer or more polygons.

One number, the *detail*, leads from a caricature to a portrait: 1 is the description. What there are many of goes first
and comes first: of a kind with n members (leaves, short shoots, or branches of one order), m (n / m)^detail are left, m
being `_FEW`, so that boughs stay while leaves and twigs thin out. What is left stands for what went: leaves grow so
that their area is kept, branches thicken so that the surface of their order is. Tubes lose sides and segments somewhat
earlier than plants lose members; bends are adjusted so that the tips of branches stay where they were.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..errors import SpeciesError
from ..leaves.models import LeafModel
from ..parameters import altered
from .catalog import MAX_POLYGONS, ORDER_KEYS
from .members import Members, bisected, expected_members, expected_polygons
from .species import QUALITY_LIMITS, Order, Range, Species

_FEW = 12.0  # a kind with no more members than this keeps them all
_SHAPE_PACE = 1.0  # how much sooner than members a trunk's sides and segments go; of twigs, `_TWIG_PACE` more
_TWIG_PACE = 0.5
_MANY = 1000.0  # branches of an order from which on they are twigs in this sense
_ROUNDER = 10.0  # factor on sides and on segments for one unit of detail above the description
_TURN = 40.0  # degrees that one segment may stand for before a bent branch is a different one
_SLOWER = 0.25  # how much slower they grow from `_ROUND` on: nobody sees more sides
_ROUND = 0.6
_LEAF_FRACTION = 0.02, 0.06  # of the plant's reach: leaves that are too short, or long enough, to make its outline
_SHORTEST = 0.5  # of the length of boughs
_SWAY_HIGH = 1.25  # highest factor on the random bend of joints: the bound of a plant grows with it
_BISECTED = 16.0, 36  # detail at most, and steps: to a hundred millionth of a unit


@lru_cache(maxsize=256)
def with_quality(species: Species, quality: float) -> Species:
    """The same species with ``quality`` times the polygons.

    Parameters
    ----------
    species : Species
        As described.
    quality : float
        Within `species.QUALITY_LIMITS`; 1 returns the species itself.

    Returns
    -------
    Species
        Sides, segments, bends, thicknesses, and numbers and sizes of branches and leaves differ, within the limits of
        the schema. Leaf area is kept, and the surface of wood as far as twigs stay thinner than what bears them, and
        with both the mean colors. Where the limits do not let it reach the number, it comes as near as they do:
        below, some 12 branches of each order with 12 leaves in all; above, 10,000 leaves or branches on a branch.

    Raises
    ------
    SpeciesError
        The quality is out of range or not finite, or a plant would have more than `catalog.MAX_POLYGONS` polygons.

    Notes
    -----
    A pure function of its arguments without random numbers; the last few results are kept. A species whose leaf is the
    name of a Blender object is first to be given its mesh, because a leaf counts by its polygons.
    """
    low, high = QUALITY_LIMITS
    if not low <= quality <= high:  # false for NaN as well
        raise SpeciesError(f"{species.identifier}: quality must be from {low:g} to {high:g}, not {quality:g}")
    if quality == 1:
        return species
    target = quality * expected_polygons(species)
    if target > MAX_POLYGONS:
        raise SpeciesError(
            f"{species.identifier}: at quality {quality:g} one plant would have {target:.3g} polygons, "
            f"the limit is {MAX_POLYGONS:.0g}; lower the quality"
        )
    if species.dead is not None and quality < 1:  # too few to be thinned out in the end
        dead = species.dead
        few = {"number": dead.number.scaled(quality), "on_limbs": dead.on_limbs.scaled(quality)}
        species = replace(species, dead=replace(dead, **few))
    members = expected_members(species)  # in which sides and segments have no part

    def thinned(shapes: list[tuple[float, float]], detail: float) -> Species:
        tiers = [altered(o, sides=k, segments=s) for o, (k, s) in zip(_tiers(species), shapes, strict=True)]
        return _thinned(_with_tiers(species, tiers), members, detail)

    # Sides and segments as real numbers make the count continuous; once they are whole, members make up for it.
    detail = bisected(lambda d: expected_polygons(thinned(_shapes(species, members, d), d)), target, *_BISECTED)
    shapes = [(round(k), round(s)) for k, s in _shapes(species, members, detail)]
    detail = bisected(lambda d: expected_polygons(thinned(shapes, d)), target, *_BISECTED)
    return _kept(species, thinned(shapes, detail))


def _tiers(species: Species) -> list[Order]:
    """The orders, and the short shoot at the end of them."""
    return [*species.orders, *([species.spur] if species.spur is not None else [])]


def _with_tiers(species: Species, tiers: list[Order]) -> Species:
    """The species with other orders and short shoot, given as `_tiers` gives them."""
    number = len(species.orders)
    return altered(species, orders=tuple(tiers[:number]), spur=tiers[number] if len(tiers) > number else None)


def _numbers(members: Members, species: Species) -> tuple[list[float], list[float]]:
    """Expected numbers on one plant of the branches of each of `_tiers`, and of their leaves."""
    every = [*members.branches, members.spurs], [*members.leaves, members.spur_leaves]
    return tuple(numbers[: len(_tiers(species))] for numbers in every)


def _shapes(species: Species, members: Members, detail: float) -> list[tuple[float, float]]:
    """Sides and segments of each order, not yet whole numbers."""
    shapes = []
    for order, number in zip(_tiers(species), _numbers(members, species)[0], strict=True):
        if detail >= 1:
            more = detail - 1
            rounder = _ROUNDER ** (min(more, _ROUND) + _SLOWER * max(more - _ROUND, 0.0))
            shape = order.sides * rounder, order.segments * rounder
        else:
            pace = _SHAPE_PACE + _TWIG_PACE * _crowd(number)
            left = max(1 - pace * (1 - detail), 0.0)
            # By so many degrees a branch is meant to turn from base to tip, to either side.
            bend = (abs(order.curvature.mean) + abs(order.curvature_tip)) / 2 + abs(order.attraction.mean)
            bent = min(max(math.ceil(bend / _TURN), 1), order.segments)
            shape = 3 * (order.sides / 3) ** left, bent * (order.segments / bent) ** left
        shapes.append((min(shape[0], ORDER_KEYS["sides"].high), min(shape[1], ORDER_KEYS["segments"].high)))
    return shapes


def _crowd(number: float) -> float:
    """0 for the trunk, 1 for the twigs of a large tree."""
    return min(math.log(max(number, 1.0)) / math.log(_MANY), 1.0)


def _left(number: float, detail: float, pace: float = 1.0) -> float:
    """Factor on the number of a kind that has ``number`` members."""
    return max(number / _FEW, 1.0) ** (detail - 1 if detail < 1 else pace * (detail - 1))


def _thinned(species: Species, members: Members, detail: float) -> Species:
    """The species with other numbers of branches and leaves, and leaves of such a size that their area is kept."""
    branches, tiers = members.branches, _tiers(species)
    foliage = _left(max(sum(_numbers(members, species)[1]), 2 * _FEW), detail)
    spurs = _left(members.spurs, detail, _crowd(members.spurs))
    factor = 1.0  # on the number of branches of this order
    for i, order in enumerate(species.orders):
        count = 1.0
        if i + 1 < len(branches):
            count = _allowed(order, "branches", _left(branches[i + 1], detail, _crowd(branches[i + 1])) / factor)
        fewer = _scaled(order, spurs=spurs / factor, leaves=foliage / factor)
        tiers[i] = altered(fewer, branches=order.branches.scaled(count))
        factor *= count
    if species.spur is not None:
        tiers[-1] = _scaled(species.spur, leaves=foliage / spurs)
    return _with_tiers(species, tiers)


def _allowed(order: Order, name: str, factor: float) -> float:
    """The factor on a range of an order, or the nearest to it that its key allows."""
    return getattr(order, name).allowed(factor, ORDER_KEYS[name])


def _scaled(order: Order, **factors: float) -> Order:
    """An order with some of its ranges times factors, as far as their keys allow."""
    scaled = {name: getattr(order, name).scaled(_allowed(order, name, factors[name])) for name in factors}
    return altered(order, **scaled)


def _kept(described: Species, changed: Species) -> Species:
    """The changed species with leaves, lengths, thicknesses and bends such that it looks like the one described."""
    branches, leaves = _numbers(expected_members(described), described)
    branches_left, leaves_left = _numbers(expected_members(changed), changed)
    widened = described
    if sum(leaves) > 0:
        widened = _widened_forms(described, math.sqrt(sum(leaves) / sum(leaves_left)))
    tiers = _tiers(described)
    sizes = [1.0] * len(tiers)
    for i, order in enumerate(tiers):
        if order.leaves.mean > 0:
            area = _ratio(leaves[i], leaves_left[i]) * _form_area(described, order) / _form_area(widened, order)
            sizes[i] = _allowed(order, "leaf_size", math.sqrt(area))
    shorter = _shortening(described, sizes)
    fewer = [_ratio(n, m) for n, m in zip(branches, branches_left, strict=True)]
    thicker, out = 1.0, []  # factor on the radius of this order
    for i, (old, new) in enumerate(zip(tiers, _tiers(changed), strict=True)):
        spur = i == len(described.orders)
        # Fewer branches show less bark, and a tube of fewer sides is narrower (Cauchy: the mean width of a convex
        # figure is its perimeter by pi). The radius makes up for both, as far as branches stay thinner than parents.
        wanted = fewer[i] * _perimeter(old.sides) / _perimeter(new.sides)
        if i > 0 and not spur and tiers[i - 1].pipe > 0:
            thick = 1.0  # the pipe model divides the parent's radius among fewer by itself
            thicker *= (fewer[i] / fewer[i - 1]) ** (1 / tiers[i - 1].pipe)
        else:
            length = shorter if i > 0 and not spur else 1.0
            thick = _allowed(old, "thickness", wanted / length / (1.0 if spur else thicker))
            thicker *= thick
        same = {"length": old.length.scaled(shorter) if i == 1 and not spur else old.length}
        same |= {"thickness": old.thickness.scaled(thick), "leaf_size": old.leaf_size.scaled(sizes[i])}
        out.append(_bent_alike(old, replace(new, **same)))
    return replace(_with_tiers(changed, out), leaf=widened.leaf, blossom=widened.blossom, quality=1.0)


def _ratio(before: float, after: float) -> float:
    return before / after if after > 0 else 1.0


def _form_area(species: Species, order: Order) -> float:
    """Mean area of the forms of leaf that an order bears, at size 1; a form without its mesh counts as 1."""
    forms = species.forms(order.leaf_kind) or species.leaf
    return sum(form.area if isinstance(form, LeafModel) else 1.0 for form in forms) / len(forms)


def _widened_forms(species: Species, larger: float) -> Species:
    """The species with leaf models for leaves that become larger by a factor on their mean extent."""

    def forms(given: tuple[LeafModel | str, ...]) -> tuple[LeafModel | str, ...]:
        return tuple(_widened(f, _widening(species, f, larger)) if isinstance(f, LeafModel) else f for f in given)

    return replace(species, leaf=forms(species.leaf), blossom=forms(species.blossom))


def _lengths(species: Species) -> list[float]:
    """Mean length of the longest branches of each order, meters."""
    lengths = [o.length.mean for o in species.orders]
    return [math.prod(lengths[: i + 1]) for i in range(len(lengths))]


def _widening(species: Species, form: LeafModel, larger: float) -> float:
    """Factor on the width of a leaf model where leaves become larger by a factor on their mean extent.

    Where the length of the leaves makes the outline of the plant, as in a tuft of grass or the frond of a palm, they
    keep it, and take or give their area in width. Few large leaves become at most half as wide as they are long.
    """
    longest = max(o.leaf_size.mean for o in _tiers(species) if o.leaves.mean > 0)
    fraction = longest / (longest + sum(_lengths(species)))
    outline = min(max((fraction - _LEAF_FRACTION[0]) / (_LEAF_FRACTION[1] - _LEAF_FRACTION[0]), 0.0), 1.0)
    if larger < 1:
        return larger ** (2 * outline)
    return min(max(larger ** (2 * outline), math.sqrt(larger)), max(0.5 / form.width, 1.0))


def _widened(leaf: LeafModel, width: float) -> LeafModel:
    """The leaf model with its width changed; it droops as before, and folds along its midrib in proportion."""
    if width == 1:
        return leaf
    x, y, z = leaf.positions.T
    midrib = np.flatnonzero(np.abs(x) < 1e-6)
    midrib = midrib[np.argsort(y[midrib])]
    droop = np.interp(y, y[midrib], z[midrib]) if len(midrib) else np.zeros_like(z)
    fold = min(width, 1.0)  # wider leaves are not folded deeper
    return replace(leaf, positions=np.stack([x * width, y, droop + (z - droop) * fold], axis=1))


def _shortening(species: Species, sizes: list[float]) -> float:
    """Factor on the length of boughs where large leaves stick out of the crown: of their growth, half goes outwards."""
    tiers = _tiers(species)
    beyond = max(o.leaf_size.mean * (f - 1) for o, f in zip(tiers, sizes, strict=True)) / 2
    crown = sum(_lengths(species)[1:]) + max(o.leaf_size.mean for o in tiers if o.leaves.mean > 0 or beyond <= 0)
    return min(max(1 - beyond / crown, _SHORTEST), 1.0)


def _perimeter(sides: int) -> float:
    return sides * math.sin(math.pi / sides)


def _bent_alike(old: Order, new: Order) -> Order:
    """An order whose tips are where they were with another number of segments.

    Joint j of S turns by curvature / S, and by curvature_tip / S from the middle on, and moves the tip by its turn
    times 1 - j / S of the length (see `growth.axes`). That sums up to less where segments are few, and to nothing for a
    single one, which takes the direction of the chord instead. The random parts of joints are independent, so that
    their squares sum up: without a larger range, more segments would be straighter.
    """
    s, t = old.segments, new.segments
    if s == t:
        return new
    (inner, outer), sway = _sways(s), _random_sway(s)
    moved = inner * old.curvature.mean + outer * old.curvature_tip
    if t == 1:
        high = ORDER_KEYS["angle"].high
        mean, tip = (min(max(a - moved, 0.0), high) for a in (old.angle.mean, old.angle_tip))
        variation = math.hypot(old.angle.variation, sway * old.curvature.variation)
        return replace(new, angle=Range(mean, min(variation, mean, high - mean)), angle_tip=tip)
    high = ORDER_KEYS["curvature"].high
    inner_left, outer_left = _sways(t)
    factor = inner / inner_left if inner > 0 and inner_left > 0 else (inner + outer) / (inner_left + outer_left)
    mean = min(max(old.curvature.mean * factor, -high), high)
    tip = min(max((moved - inner_left * mean) / outer_left, -high), high)
    variation = old.curvature.variation * min(sway / _random_sway(t), _SWAY_HIGH)
    pull = _allowed(old, "attraction", (inner + outer) / (inner_left + outer_left))
    bent = Range(mean, min(variation, high - abs(mean)))
    return replace(new, curvature=bent, curvature_tip=tip, attraction=old.attraction.scaled(pull))


def _sways(segments: int) -> tuple[float, float]:
    """How far the joints of the inner and of the outer half move the tip aside, of the turn over the whole length."""
    moves = [(1 - j / segments) / segments for j in range(1, segments)]
    middle = math.ceil(segments / 2) - 1
    return sum(moves[:middle]), sum(moves[middle:])


def _random_sway(segments: int) -> float:
    """The same for turns that are independent from joint to joint."""
    return math.sqrt(sum((1 - j / segments) ** 2 for j in range(1, segments))) / segments
