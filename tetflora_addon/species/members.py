# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many branches, leaves and short shoots one plant has on average, from its description alone.

The same numbers as a compiled species holds, for readers of files and levels of detail, before anything is compiled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..arrays import Floats
from ..leaves.models import LeafModel
from .species import EVEN, Dead, Order, Range, Species, crown_ratio, faded, fork_cuts, shortened, some_nodes, whole_cuts

#: By crown, the least length ratio, and those of laterals that stand evenly along a branch.
_least = lru_cache(lambda crown: float(crown_ratio(crown, np.linspace(0, 1, 65)).min()))
_evenly = lru_cache(lambda crown: crown_ratio(crown, 1 - EVEN))
_ONE, _DEAD_EVENLY = np.ones(1), crown_ratio("tapered", EVEN)


@dataclass(frozen=True)
class Members:
    """Expected numbers on one plant, by order."""

    branches: list[float]  # a branch that divides counts once
    segments: list[float]  # straight pieces of all branches of the order
    leaves: list[float]
    #: spurs and spur_leaves: short shoots of all orders, and their leaves.
    spurs: float
    spur_leaves: float
    dead: tuple[float, float] = (0.0, 0.0)  # dead branches by their order


def expected_members(species: Species) -> Members:
    """Expected numbers; linear in the numbers that each order asks for."""
    branches, segments, leaves, spurs, dead = [], [], [], 0.0, np.zeros(2)
    number = full = 1.0  # branches of the order, and the sum of the factors on what they bear
    for i, order in enumerate(species.orders):
        cuts = fork_cuts(order)
        fold = _ONE if len(cuts) == 2 else expected_forks(order.forks) ** np.arange(len(cuts) - 1)  # stems side by side
        branches.append(number)
        segments.append(number * float(fold @ part_segments(order)))
        leaves.append(full * order.leaves.mean * _fold(cuts, fold, order.leaf_start))
        spurs += full * order.spurs.mean * _fold(cuts, fold, order.spur_start)
        if species.dead is not None and species.skeleton is None and i <= 1:
            dead += full * _dead_on(species.dead, order, i, cuts, fold)
        if i + 1 < len(species.orders):
            place, vigor, weight = _laterals(order)
            stems_there = weight * _stems(cuts, fold, place)
            follow = 1 - species.orders[i + 1].count_by_length * (1 - vigor)
            if order.growing is not None:
                follow = follow * np.minimum(vigor / least_length(order), 1)
            number = full * order.branches.mean * float(np.mean(stems_there))
            full = full * order.branches.mean * float((stems_there * follow).mean())
    on_spur = species.spur.leaves.mean if species.spur is not None else 0.0
    return Members(branches, segments, leaves, spurs, spurs * on_spur, tuple(dead))


def bisected(count: Callable[[float], float], target: float, most: float, steps: int) -> float:
    """Number up to ``most`` at which a count that grows with it reaches the target, or an end of the interval."""
    low, high = 0.0, most
    for _ in range(steps):
        middle = (low + high) / 2
        low, high = (middle, high) if count(middle) < target else (low, middle)
    return (low + high) / 2


def expected_leaf_area(species: Species) -> float:
    """Expected area of the leaves of a plant, but those of short shoots, in that of a leaf of unit length."""
    leaves = expected_members(species).leaves
    return sum(n * order.leaf_size.mean**2 for n, order in zip(leaves, species.orders, strict=True))


def _laterals(order: Order) -> tuple[Floats, Floats, Floats | float]:
    """Places (n,) of laterals on a branch of an order, length ratios (n,), and how many each stands for (n,)."""
    start, part = order.branch_start.mean, order.growing
    if part is None or order.branches.mean <= 0:
        return start + (1 - start) * EVEN, _evenly(order.crown), 1.0
    nodes = part.laterals
    law = nodes.law(order.branches.mean)
    _, fresh, end = ends = nodes.ends(law, start, part.now)
    place, weight, extra = some_nodes(law, ends, nodes.extra)
    short, place = faded(place, fresh, end - fresh, extra), np.clip(place / part.now, 0, 1)
    fraction = (place - start) / max(nodes.until - start, 1e-9)
    return place, short * shortened(fraction, *part.ramps) * crown_ratio(order.crown, 1 - fraction), weight


def least_length(order: Order) -> float:
    """Shortest length ratio of laterals of an order that is still growing, but for new ones; 0 if it is full-grown."""
    return 0.0 if order.growing is None else _least(order.crown)


@lru_cache(maxsize=256)
def expected_forks(forks: Range, power: float = 1.0) -> float:
    """Mean of n^power, for the n stems into which a branch divides (`growth.branch_counts`)."""
    wanted = forks.mean + forks.variation * (2 * EVEN - 1)
    below = np.floor(wanted)
    more = wanted - below  # how likely one more is
    return float(((1 - more) * np.maximum(below, 1) ** power + more * np.maximum(below + 1, 1) ** power).mean())


def part_segments(order: Order) -> np.ndarray:
    """Straight pieces of each part of a branch between its forks."""
    if order.forks.high <= 0:
        return np.array([max(float(round(order.segments)), 1.0)])
    return np.maximum(np.rint(order.segments * np.diff(whole_cuts(order))), 1)


def _stems(cuts: list[float], fold: np.ndarray, place: Floats) -> Floats | float:
    """Stems side by side at places (n,)."""
    return fold[np.searchsorted(cuts[1:-1], place, side="right")] if len(cuts) > 2 else 1.0


def _fold(cuts: list[float], fold: np.ndarray, start: Range) -> float:
    """How many times as many things a branch bears because it divides; they are spread evenly from ``start`` on."""
    return (
        1.0
        if len(cuts) == 2
        else float(fold @ np.diff(np.clip((np.array(cuts) - start.mean) / (1 - start.mean), 0, 1)))
    )


def expected_polygons(species: Species) -> float:
    """Mean number of polygons of one plant, leaves and branches.

    Notes
    -----
    The rings of a flared base are left out; a leaf that is still the name of a Blender object counts as one polygon.
    """
    members = expected_members(species)
    polygons = sum(n * o.sides for n, o in zip(members.segments, species.orders, strict=True))
    bearers = list(zip(species.orders, members.leaves, strict=True))
    if species.spur is not None:
        polygons += members.spurs * species.spur.sides * species.spur.segments
        bearers.append((species.spur, members.spur_leaves))
    if species.dead is not None:
        for order, number in zip(species.dead.orders, members.dead, strict=False):
            polygons += number * order.sides * order.segments
    return polygons + sum(number * leaf_polygons(species, order) for order, number in bearers)


def _dead_on(dead: Dead, order: Order, i: int, cuts: list[float], fold: np.ndarray) -> np.ndarray:
    """Expected dead branches (2,) by their order on one trunk, or on one limb."""
    low, high = dead.part(order.branch_start.mean)
    wanted = (dead.on_limbs if i else dead.number).mean
    stems = _stems(cuts, fold, low + (high - low) * EVEN)
    full = 1 - dead.orders[0].count_by_length * (1 - _DEAD_EVENLY)
    return wanted * np.array([np.mean(stems), dead.orders[0].branches.mean * (full * stems).mean()])


def dead_vigor(fraction: Floats) -> Floats:
    """Length ratio (n,) of dead branches from the lowest, of which half is left, to the highest."""
    return crown_ratio("tapered", fraction)


def leaf_polygons(species: Species, order: Order) -> float:
    """Mean polygons of the leaves that branches of an order bear."""
    forms = species.forms(order.leaf_kind) or species.leaf
    return sum(form.polygons if isinstance(form, LeafModel) else 1 for form in forms) / len(forms)
