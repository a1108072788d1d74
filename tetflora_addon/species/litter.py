# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies under a species: patches of its fallen leaves, its broken branches and its logs, as species of their own.

Each is a page of a species file, made from that of the living plant: the same leaf, bark and way of branching. Stems
are a centimeter or two high, so that what grows on them sideways lies on the ground.

Leaves that have just fallen are litter with a year of their own, from the fall of their tree's leaves until they rot in
spring. On the ground is what is no longer on the trees: leaves of the patch appear as those of the tree fall.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from itertools import pairwise
from math import cos, hypot, pi, sin, sqrt
from typing import Any

from ..files import beside
from ..formats import FORMATS
from ..leaves.models import LeafModel
from ..leaves.outlines import Blade
from ..leaves.schema import MAX_FORMS
from ..leaves.surfaces import Needles
from .species import DAYS, LEAF_KINDS, LeafYear, Species

#: Leaves without outline that let less light through than this are needles and scales, whose plants bear cones.
NEEDLES = 0.2
#: Leaves of a patch, and what fraction of its circle they cover, counted singly.
_LEAVES, _COVERED = (16, 44), 0.62
_RADIUS = (0.12, 0.45)  # meters, of a patch
#: Linear RGB of dead leaves and needles, mean and variation, and of wood without bark.
_BROWN = ((0.16, 0.1, 0.05), (0.1, 0.062, 0.031))
_NEEDLE_BROWN = ((0.135, 0.068, 0.031), (0.06, 0.032, 0.014))
_WEATHERED = (0.088, 0.074, 0.058)
_STEM = 0.03  # meters, of the stem in the middle of a patch
_TREE = 3.0  # meters: what is lower has no branches that are dead wood
_KEPT = {
    *("length", "thickness", "taper", "sides", "angle", "angle_tip", "branches", "branch_start"),
    *("crown", "whorl", "count_by_length", "branch_color"),
}
#: Meters across which a handful of needles is strewn, their number, and the width of each.
_STREWN, _HANDFUL, _NEEDLE = 0.13, 22, 0.0018
_BURIED = 0.12  # meters, of the lower end of a log
_CONES = 0.45  # of a patch, on average


#: What is the same below all species: parts of orders, how blades bend as they dry, a cone, the round end of a log.
_parts = partial(beside, __file__, "litter.json")


def bears_needles(species: Species) -> bool:
    """Whether leaves are needles or scales: by their outline, without one by how little light they let through."""
    outlines = [form.shape for form in species.leaf if isinstance(form, LeafModel) and form.shape is not None]
    if outlines:
        return any(isinstance(outline, Needles) for outline in outlines)
    return species.leaf_transmission < NEEDLES


def leaf_area(species: Species) -> float:
    """Area of one leaf of a patch of litter, m², of a species that has leaves."""
    bearing = [order for order in species.orders if order.leaves.mean > 0 and order.leaf_kind == LEAF_KINDS[0]]
    size = max(order.leaf_size.mean for order in bearing)
    if bears_needles(species):
        return _HANDFUL * _needle(size) * _NEEDLE
    areas = [form.area for form in species.leaf if isinstance(form, LeafModel)]
    return size**2 * (sum(areas) / len(areas) if areas else 0.4)


def _needle(size: float) -> float:
    """Length of needles on the ground: shoots fall apart, so single ones lie there, a handful to a leaf."""
    return min(max(0.12 * size, 0.016), 0.045)


def litter_page(species: Species, page: Mapping[str, Any]) -> dict[str, Any] | None:
    """The page of a patch of fallen leaves, or of needles, twigs and cones; None of a species without leaves."""
    bearing = [order for order in species.orders if order.leaves.mean > 0 and order.leaf_kind == LEAF_KINDS[0]]
    if not bearing:
        return None
    size, needles = max(order.leaf_size.mean for order in bearing), bears_needles(species)
    area, needle = leaf_area(species), _needle(size)
    if needles:
        size = _STREWN
    number = min(max(_COVERED * pi * _RADIUS[1] ** 2 / area, _LEAVES[0]), _LEAVES[1])
    radius = min(max(sqrt(number * area / (_COVERED * pi)), _RADIUS[0], 1.3 * size), _RADIUS[1])
    if needles:
        number, radius = _LEAVES[1], 0.3
    twigs = 6 if needles else 7
    color, variation = _NEEDLE_BROWN if needles else _BROWN
    parts = _parts()
    around = parts["around"] | {
        "length": _pair(radius / _STEM, 0.3 * radius / _STEM),
        "leaves": _pair(number / twigs, 0.3 * number / twigs),
        "leaf_size": _pair(0.95 * size, 0.15 * size),
        "leaf_color": [list(color), list(variation)],
        "leaf_color_tip": [round(1.12 * c, 3) for c in color],
    }
    middle = parts["middle"] | {"branches": [twigs, 1]}
    if needles:
        around["leaf_light"], middle["thickness"] = [0.97, 0.03], [0.05, 0.004]
    own_forms = page["leaf"] if isinstance(page["leaf"], list) else [page["leaf"]]
    dried = [one for form, entry in zip(species.leaf, own_forms, strict=True) for one in _dried(form, entry)]
    what = f"Fallen {'needles, twigs and cones' if needles else 'leaves'} of {species.name}, a patch of "
    new_page = _page(species, "litter", f"{what}{200 * radius:.0f} cm", [middle, around])
    new_page |= {"leaf": _strewn(needle) if needles else dried[:MAX_FORMS]}
    new_page |= {"leaf_transmission": round(0.4 * species.leaf_transmission, 3)}
    if needles:
        new_page |= {"blossom": parts["cone"], "blossom_transmission": 0, "spur": parts["spur"]}
        around["spurs"], around["spur_start"] = _pair(_CONES / twigs, _CONES / twigs), 0.3
    return new_page


def branch_page(species: Species, page: Mapping[str, Any]) -> dict[str, Any] | None:
    """The page of a broken branch that lies on the ground; None of a species that is too low to have any."""
    if species.orders[0].length.mean < _TREE or len(species.orders) < 3:
        return None
    length = min(max(0.22 * species.orders[0].length.mean * min(species.orders[1].length.mean, 1.0), 0.7), 2.2)
    # Without leaves, short shoots, forks and whatever else grows on them but branches.
    orders = [{key: value for key, value in order.items() if key in _KEPT} for order in page["orders"][1:4]]
    for order in orders:
        # Twigs of a branch that fell spread over the ground, and many are gone.
        order |= _parts()["twig"]
        order["branches"] = _pair(*_fewer(order.get("branches", 0), 6))
        order["branch_color"] = _weathered(order.get("branch_color"), 0.4)
    orders[-1]["branches"] = 0
    orders[0] |= _parts()["bough"] | {"length": _pair(length, 0.4 * length)}
    orders[0].pop("angle_tip", None)
    new_page = _page(species, "branch", f"A fallen branch of {species.name}, about {length:.1f} m long", orders)
    return new_page | {"leaf": page["leaf"]}


def log_page(species: Species, page: Mapping[str, Any]) -> dict[str, Any] | None:
    """The page of a log with stubs of branches, half sunk into the ground; None of a species that is too low."""
    trunk = species.orders[0]
    if trunk.length.mean < _TREE or len(species.orders) < 2:
        return None
    length = min(max(0.25 * trunk.length.mean, 1.2), 1.84)
    radius = min(max(0.8 * trunk.length.mean * trunk.thickness.mean, 0.04), _BURIED)
    color = page["orders"][0].get("branch_color")
    parts = _parts()
    log = parts["log"] | {
        "length": _pair(length / _BURIED, 0.3 * length / _BURIED),
        "thickness": _pair(radius / _BURIED, 0),
        "leaf_size": _pair(2.04 * parts["log"]["taper"] * radius, 0),
    }
    # The stem leads down, so that the log begins in the ground and comes out of it on its way.
    orders = [parts["stem"], log, parts["stub"]]
    for order, how in zip(orders, (0.65, 0.65, 0.7), strict=True):
        order["branch_color"] = _weathered(color, how)
    new_page = _page(species, "log", f"A fallen log of {species.name}, about {length:.1f} m long", orders)
    return new_page | {"leaf": page["leaf"], "blossom": parts["cut"], "blossom_transmission": 0}


#: Pages by the ending of the identifier that the fallen parts of a species have.
FALLEN: dict[str, Callable[[Species, Mapping[str, Any]], dict[str, Any] | None]] = {
    "litter": litter_page,
    "branch": branch_page,
    "log": log_page,
}


def _dried(form: LeafModel | str, entry: dict[str, Any]) -> list[dict[str, Any]]:
    """A leaf as it dries: flat, cupped and rolled back, where its blade is known; else as the page has it."""
    if not isinstance(form, LeafModel) or not isinstance(form.shape, Blade):
        return [entry]
    blade = {f.name: getattr(form.shape, f.name) for f in fields(Blade) if getattr(form.shape, f.name) != f.default}
    return [{"outline": {"kind": "blade", **blade, **bent}} for bent in _parts()["bent"]]


def _page(species: Species, kind: str, description: str, orders: list[dict[str, Any]]) -> dict[str, Any]:
    name, transmission = f"{species.name} {kind}"[:1000], species.leaf_transmission
    page = {"format": FORMATS["species"], "name": name, "description": description[:1000], "bark": species.bark}
    return page | {"leaf": [], "leaf_transmission": transmission, "orders": orders}


def _fewer(value: Any, most: float) -> tuple[float, float]:
    mean, variation = value if isinstance(value, list) else (value, 0.0)
    factor = min(most / mean, 1.0) if mean > 0 else 1.0
    return mean * factor, min(variation * factor + 1.0, mean * factor)


def _weathered(color: Any, how: float) -> list[list[float]]:
    """A color of bark and its variation, turned to that of dead wood as far as asked."""
    mean, variation = color or [[0.16, 0.11, 0.07], [0.04, 0.03, 0.02]]
    return [[round((1 - how) * c + how * w, 4) for c, w in zip(mean, _WEATHERED, strict=True)], variation]


def _pair(mean: float, variation: float) -> list[float]:
    return [round(mean, 4), round(min(variation, mean), 4)]


def _strewn(needle: float) -> dict[str, Any]:
    """A handful of needles of a length in meters, strewn by the golden angle, each turned otherwise."""
    vertices, faces = [], []
    length, half = needle / _STREWN, 0.5 * _NEEDLE / _STREWN
    for k in range(_HANDFUL):
        away, turn, along = 0.5 * sqrt((k + 0.5) / _HANDFUL), 2.39996 * k, 5.1 * k + 0.7 * k * k
        x, y, z = away * cos(turn), 0.5 + away * sin(turn), 0.01 * (k % 5)
        ax, ay = cos(along) * length / 2, sin(along) * length / 2
        bx, by = -sin(along) * half, cos(along) * half
        ends = ((-ax - bx, -ay - by), (ax - bx, ay - by), (ax + bx, ay + by), (-ax + bx, -ay + by))
        vertices += [[round(x + u, 4), round(y + v, 4), round(z, 3)] for u, v in ends]
        faces.append([4 * k + i for i in range(4)])
    return {"vertices": vertices, "faces": faces}


KIND = "leaves"
"""Ending of the identifier that the fallen leaves of a species have."""
#: Area of the leaves of a patch, m², and how many there are at least and at most.
_SHED_AREA, _SHED_LEAVES = 0.32, (16, 100)
#: Fraction of its circle that a patch covers, counted singly, arms on which its leaves lie, and its radius at most.
_SHED_COVERED, _ARMS, _SHED_RADIUS = 0.5, 14, 0.45
#: Days after which a leaf has lost half of its color, in which it loses all of it, and date by which it has rotted.
_FADES, _FADING, _ROTS, _ROT_SPREAD = 20.0, 40.0, 90.0, 13.0
#: Linear RGB of leaves on the ground after that: those of litter.
_FALLEN_BROWN = ([0.145, 0.09, 0.045], [0.175, 0.11, 0.055])
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
    """The page of a patch of leaves that fall in autumn; None of a species that sheds none."""
    litter = litter_page(species, page) if shed_share(species) > 0.0 else None
    if litter is None:
        return None
    leaf = species.year.leaf
    middle, around = litter["orders"]
    for key in ("blossom", "blossom_transmission", "spur"):
        litter.pop(key, None)
    around = {key: value for key, value in around.items() if not key.startswith("spur")}
    area = leaf_area(species)
    number = min(max(_SHED_AREA / area, _SHED_LEAVES[0]), _SHED_LEAVES[1])
    radius = min(max(sqrt(number * area / (_SHED_COVERED * pi)), 1.3 * around["leaf_size"][0]), _SHED_RADIUS)
    stem = middle["length"][0]
    color, variation = _autumn(species, leaf)
    around |= {
        "length": _pair(radius / stem, 0.3 * radius / stem),
        "thickness": _THREAD,
        "sides": 3,
        "leaves": _pair(number / _ARMS, 0.2 * number / _ARMS),
        "leaf_start": 0.1,
        "leaf_color": [color, variation],
        "leaf_color_tip": color,
    }
    middle |= {"thickness": _THREAD, "branches": [_ARMS, 0]}
    return litter | {
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
            "autumn": list(_FALLEN_BROWN),
            "fall": DAYS + _ROTS,
            "fall_spread": _ROT_SPREAD,
        },
    }


def _autumn(species: Species, leaf: LeafYear) -> tuple[list[float], list[float]]:
    """Mean and variation of the autumn colors of a tree's leaves, from the first to the last."""
    if not leaf.autumn:
        bearing = next(order for order in species.orders if order.leaves.mean > 0)
        return [list(one) for one in (bearing.leaf_color.mean, bearing.leaf_color.variation)]
    number = len(leaf.autumn)
    # Hue of the plant and tint of the leaf count alike: their mean is distributed as a triangle.
    edges = [2 * x * x if x < 0.5 else 1 - 2 * (1 - x) ** 2 for x in (i / number for i in range(number + 1))]
    shares = [b - a for a, b in pairwise(edges)]
    channels = list(zip(*leaf.autumn, strict=True))
    mean = [round(sum(s * c for s, c in zip(shares, one, strict=True)), 4) for one in channels]
    return mean, [round(min(abs(one[0] - one[-1]) / 2, m), 4) for one, m in zip(channels, mean, strict=True)]
