# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves that have just fallen: patches that are there from the fall of their tree's leaves until they rot in spring.

They are litter with a year of their own. What is on the ground on a day is what is no longer on the trees, leaf by
leaf on average, because leaves of the patch appear as those of the tree fall.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import hypot, pi, sqrt
from typing import Any

from .litter import leaf_area, litter_page
from .species import Species
from .year import DAYS, LeafYear

KIND = "leaves"
"""Ending of the identifier that the fallen leaves of a species have."""
#: Area of the leaves of a patch, m², and how many there are at least and at most.
_AREA, _LEAVES = 0.32, (16, 100)
#: Fraction of its circle that a patch covers, counted singly, arms on which its leaves lie, and its radius at most.
_COVERED, _ARMS, _RADIUS = 0.5, 14, 0.45
#: Days after which a leaf has lost half of its color, in which it loses all of it, and date by which it has rotted.
_FADES, _FADING, _ROTS, _ROT_SPREAD = 20.0, 40.0, 90.0, 13.0
#: Linear RGB of leaves on the ground after that: those of litter.
_BROWN = ([0.145, 0.09, 0.045], [0.175, 0.11, 0.055])
_SHED = 0.9  # of its leaves are shed each year by what counts as deciduous
_THREAD = 0.002  # thickness of arms, which are there only for the leaves to lie on


def shed_share(species: Species) -> float:
    """Fraction of its leaf area in summer that a species lets fall in autumn; 0 of evergreen ones, and without a year.

    What hangs on dry in winter is not part of it.
    """
    leaf = None if species.year is None else species.year.leaf
    if leaf is None or leaf.turnover < _SHED or leaf.fall >= DAYS:
        return 0.0
    return leaf.turnover * (1.0 - leaf.kept)


def leaves_page(species: Species, page: Mapping[str, Any]) -> dict[str, Any] | None:
    """The page of a patch of leaves that fall in autumn; None of a species that sheds none.

    Parameters
    ----------
    species : Species
    page : mapping
        What its species file holds.
    """
    made = litter_page(species, page) if shed_share(species) > 0.0 else None
    if made is None:
        return None
    leaf = species.year.leaf
    middle, around = made["orders"]
    for key in ("blossom", "blossom_transmission", "spur"):
        made.pop(key, None)
    around = {key: value for key, value in around.items() if not key.startswith("spur")}
    area = leaf_area(species)
    number = min(max(_AREA / area, _LEAVES[0]), _LEAVES[1])
    radius = min(max(sqrt(number * area / (_COVERED * pi)), 1.3 * around["leaf_size"][0]), _RADIUS)
    stem = middle["length"][0]
    colour, variation = _autumn(species, leaf)
    around |= {
        "length": [round(radius / stem, 4), round(0.3 * radius / stem, 4)],
        "thickness": _THREAD,
        "sides": 3,
        "leaves": [round(number / _ARMS, 4), round(0.2 * number / _ARMS, 4)],
        "leaf_start": 0.1,
        "leaf_colour": [colour, variation],
        "leaf_colour_tip": colour,
    }
    middle |= {"thickness": _THREAD, "branches": [_ARMS, 0]}
    return made | {
        "name": f"{species.name} fallen leaves"[:1000],
        "description": f"Leaves that {species.name} sheds in autumn, a patch of {200 * radius:.0f} cm"[:1000],
        "orders": [middle, around],
        "year": _year(species, leaf),
    }


def _year(species: Species, leaf: LeafYear) -> dict[str, Any]:
    """The year of leaves on the ground: they appear as those of the tree fall, each by its own chance."""
    spread = round(hypot(leaf.turn_spread, leaf.fall_spread), 2)
    return {
        "latitude": species.year.latitude,
        # These days lie around midwinter: what comes before the middle of their life goes by the autumn of the trees.
        "spring": species.year.autumn,
        "autumn": 3,
        "fallen": True,
        "leaf": {
            "appear": leaf.fall,
            "appear_spread": spread,
            "growth": 0,
            "turn": leaf.fall + _FADES,
            "turn_spread": spread,
            "turning": _FADING,
            "autumn": list(_BROWN),
            "fall": DAYS + _ROTS,
            "fall_spread": _ROT_SPREAD,
        },
    }


def _autumn(species: Species, leaf: LeafYear) -> tuple[list[float], list[float]]:
    """Mean and variation of the autumn colors of a tree's leaves, from the first to the last."""
    if not leaf.autumn:
        bearing = next(order for order in species.orders if order.leaves.mean > 0)
        return [list(one) for one in (bearing.leaf_colour.mean, bearing.leaf_colour.variation)]
    number = len(leaf.autumn)
    # Hue of the plant and tint of the leaf count alike: their mean is distributed as a triangle.
    edges = [2 * x * x if x < 0.5 else 1 - 2 * (1 - x) ** 2 for x in (i / number for i in range(number + 1))]
    shares = [b - a for a, b in pairwise(edges)]
    channels = list(zip(*leaf.autumn, strict=True))
    mean = [round(sum(s * c for s, c in zip(shares, one, strict=True)), 4) for one in channels]
    return mean, [round(min(abs(one[0] - one[-1]) / 2, m), 4) for one, m in zip(channels, mean, strict=True)]
