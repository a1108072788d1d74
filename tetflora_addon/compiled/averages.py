# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected totals of sub-plants in closed form, from the highest order down to the trunk (paper, section 5).

Every total is kept by the row that contributes it, so that colors and fractions follow by a product. What depends on
how far outside in the crown a sub-plant sits is known at three places, `NODES`, and quadratic between them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Table
from ..growth.axes import profile, profile_integral
from ..growth.foliage import YOUTH
from ..growth.grown_rows import NOW, fullness_of, lengths, spread_children
from ..growth.rows import DEAD, FORK, LATERAL, SPUR
from ..leaves.levels import hidden_gloss
from ..leaves.models import LeafModel
from ..species.growing import EVEN
from ..species.members import dead_vigor, expected_forks
from ..species.species import Range

NODES = np.array([0.0, 0.5, 1.0])
_GAUSS, _WEIGHTS = (part / 2 for part in np.polynomial.legendre.leggauss(8))
_GAUSS = _GAUSS + 0.5


@dataclass(frozen=True)
class RowLeaves:
    """Means over the forms of the leaf that each row bears; arrays (r,)."""

    area: Floats  # (r,): one-sided, of a leaf of size 1
    #: polygons, width and reach, (r,): faces, width and farthest vertex of such a leaf; of the reach the greatest.
    polygons: Floats
    width: Floats
    reach: Floats
    transmission: Floats  # (r,)
    dull: Floats  # (r,): part of their gloss that leaves for which such a leaf stands hide from each other


@dataclass(frozen=True)
class Averages:
    """Expected totals of the sub-plant of each row, by contributing row."""

    leaves: Floats  # (r, r): number of leaves
    leaf_area: Floats  # (r, 3, r): one-sided area at `NODES`, m² at plant scale 1
    leaf_color: Floats  # (r, 3, 3): area times linear RGB at `NODES`
    #: fixed_wood and full_wood, (r, r): surface over length × radius of the own branch: what every sub-plant has, and
    #: what follows its fullness.
    fixed_wood: Floats
    full_wood: Floats
    spur_wood: Floats  # (r, r): surface of short shoots and what they bear, m² at plant scale 1; follows the fullness
    #: fixed_faces and full_faces, (r, r): faces of branches, likewise.
    fixed_faces: Floats
    full_faces: Floats
    #: length and radius, (r,): typical size of a branch of the row at plant scale 1, meters.
    length: Floats
    radius: Floats


def quadratic(outward: Floats) -> Floats:
    """Weights (n, 3) of the values at `NODES` for values at places (n,) between 0 and 1 (Lagrange)."""
    o = np.asarray(outward)
    return np.stack([2 * (o - 0.5) * (o - 1), 4 * o * (1 - o), 2 * o * (o - 0.5)], axis=-1)


def tube_perimeter(sides: Integers) -> Floats:
    """Perimeter (n,) of branches' cross-sections, regular polygons of ``sides`` (n,), divided by their radius."""
    return 2 * sides * np.sin(np.pi / sides)


def row_leaves(rows: Table, forms: Sequence[Sequence[Sequence[LeafModel]]], transmission: NDArray) -> RowLeaves:
    """Means over the forms of leaves of species and kinds; ``transmission`` is (species, kinds)."""
    kind = rows["species"], rows["leaf_kind"]

    def by_row(value: Callable[[LeafModel], float], function: Callable = np.mean) -> Floats:
        table = [[function(list(map(value, kinds))) if kinds else 0.0 for kinds in one] for one in forms]
        return np.array(table, dtype=np.float64)[kind]

    means = map(by_row, map(attrgetter, ("shown_area", "polygons", "width")))
    return RowLeaves(*means, by_row(attrgetter("reach"), np.max), transmission[kind], by_row(hidden_gloss))


def own_leaf_integrals(
    size_tip: Floats, size_young: Floats, outward: tuple[Floats, Floats], along: tuple[Floats, Floats] | None
) -> tuple[Floats, Floats, Floats]:
    """Means over leaves that sit evenly between two places.

    Parameters
    ----------
    size_tip, size_young : (n,) float64
        Factors on the size of leaves outside, and of young ones.
    outward : pair of (n,) float64
        Where the two places lie between inside and outside of the crown,
    along : pair of (n,) float64, optional
        and along the branch of the order; None where no leaves are young.

    Returns
    -------
    (n,) float64, three times
        Means of (size)² / (size of old leaves inside)²; of that times the place between inside and outside; and of that
        times the youth of leaves (`growth.foliage.youth`).
    """
    low, high = outward
    k = size_tip - 1

    def moment(power: int) -> Floats:  # mean of o^power over the interval, exact where it is a point
        terms = [low ** (power - i) * high**i for i in range(power + 1)]
        return sum(terms) / (power + 1)

    first = 1 + 2 * k * moment(1) + k * k * moment(2)
    second = moment(1) + 2 * k * moment(2) + k * k * moment(3)
    if along is None:
        return first, second, np.zeros_like(first)
    # With young leaves, polynomials of degree 14 at most: eight nodes of Gauss integrate them exactly.
    o, q = (ends[0][..., None] + (ends[1] - ends[0])[..., None] * _GAUSS for ends in (outward, along))
    young = q**YOUTH
    area = ((1 + k[:, None] * o) * (1 + (size_young - 1)[:, None] * young)) ** 2
    alike = size_young == 1
    return (
        np.where(alike, first, _integral(area)),
        np.where(alike, second, _integral(area * o)),
        _integral(area * young),
    )


def _integral(values: Floats) -> Floats:
    """Integral (n,) of values (n, nodes) over the interval.

    Not a product of matrices: the last bit of those depends on which rows there are beside.
    """
    return sum(values[:, node] * weight for node, weight in enumerate(_WEIGHTS))


def average(rows: Table, leaf: RowLeaves) -> Averages:
    """Expected totals of every row (r,)."""
    r = len(rows)
    exact = rows.copy()  # means of what is linear in its ranges
    exact["taper"][:, 1] = 0
    every, no_key = np.arange(r), np.zeros(r, np.uint64)
    eye = np.eye(r)
    number, size = rows["leaves"][:, 0], rows["leaf_size"]
    one_area = number * (size[:, 0] ** 2 + size[:, 1] ** 2 / 3) * leaf.area  # E[s²] of a uniform range
    leaves, leaf_area, leaf_color = eye * number, np.zeros((r, 3, r)), np.zeros((r, 3, 3))
    start, (first, last) = rows["leaf_start"][:, 0], rows["part"].T
    for n, place in enumerate(NODES):
        low = np.where(rows["outward"], first + (last - first) * start, place)
        high = np.where(rows["outward"], last, place)
        sizes = rows["leaf_size_tip"], rows["leaf_size_young"]
        area, area_outward, area_young = own_leaf_integrals(*sizes, (low, high), (first + (last - first) * start, last))
        leaf_area[every, n, every] = one_area * area
        inside, tip, young = rows["leaf_color"][:, 0], rows["leaf_color_tip"], rows["leaf_color_young"]
        leaf_color[:, n] = one_area[:, None] * (
            area[:, None] * inside + area_outward[:, None] * (tip - inside) + area_young[:, None] * (young - inside)
        )
    whole = profile_integral(exact, every, no_key, np.ones(r))
    real = ~rows["phantom"]
    fixed_wood = eye * (tube_perimeter(np.maximum(rows["sides"], 3)) * whole * real)
    fixed_faces = eye * (rows["sides"] * (rows["segments"] + rows["rings"]) * real)
    full_wood, spur_wood, full_faces = np.zeros((3, r, r))
    length, radius = np.zeros((2, r))
    sums = {}
    for i in range(r):
        if rows["order"][i] == 0 and not rows["continues"][i]:
            length[i] = rows["length"][i, 0]
            radius[i] = length[i] * rows["thickness"][i, 0]
        if rows["drawn"][i]:
            length[i], radius[i] = rows["size"][i, :2]
        for sort in np.flatnonzero(rows["next"][i] >= 0):
            sums[i, sort] = one = children_sums(exact, i, int(sort))
            j = rows["next"][i, sort]
            if sort == SPUR:
                length[j], radius[j] = rows["length"][j, 0], rows["length"][j, 0] * rows["thickness"][j, 0]
            else:
                length[j], radius[j] = length[i] * one.length, radius[i] * one.radius
    for i in range(r - 1, -1, -1):
        for sort in np.flatnonzero(rows["next"][i] >= 0):
            one, j = sums[i, sort], rows["next"][i, sort]
            leaves[i] += one.full * leaves[j]
            leaf_area[i] += np.tensordot(one.nodes, leaf_area[j], 1)
            leaf_color[i] += one.nodes @ leaf_color[j]
            if sort == FORK:
                fixed_wood[i] += one.wood * fixed_wood[j]
                full_wood[i] += one.wood * full_wood[j]
                fixed_faces[i] += one.number * fixed_faces[j]
                full_faces[i] += one.number * full_faces[j]
            else:
                wood = one.wood * fixed_wood[j] + one.full_wood * full_wood[j]
                if sort == SPUR:
                    spur_wood[i] += wood
                else:
                    full_wood[i] += wood
                full_faces[i] += one.number * fixed_faces[j] + one.full * full_faces[j]
            spur_wood[i] += one.full * spur_wood[j]
        for j in range(*rows["drawn_rows"][i]):
            # Each drawn branch is there once, of a known size and fullness.
            vigor, outward = rows["size"][j, 2:]
            full = 1 - rows["count_by_length"][j] * (1 - vigor)
            node = quadratic(np.array(outward))
            relative = length[j] * radius[j] / (length[i] * radius[i])
            leaves[i] += full * leaves[j]
            leaf_area[i] += full * (node @ leaf_area[j].reshape(3, -1))
            leaf_color[i] += full * (node @ leaf_color[j])
            fixed_wood[i] += relative * (fixed_wood[j] + full * full_wood[j])
            fixed_faces[i] += fixed_faces[j] + full * full_faces[j]
            spur_wood[i] += full * spur_wood[j]
    return Averages(
        leaves, leaf_area, leaf_color, fixed_wood, full_wood, spur_wood, fixed_faces, full_faces, length, radius
    )


@dataclass(frozen=True)
class _Sums:
    """Expected sums over the children of one sort of a branch of vigor 1.

    ``number`` of them; ``full``, the sum of the factors on their own numbers (`growth.fullness`); ``wood`` and
    ``full_wood``, the sums of length × radius relative to the parent's (of short shoots in m²), without and with that
    factor; ``nodes`` (3, 3), what their totals at `NODES` add to the parent's; ``length`` and ``radius``, typical ones
    relative to the parent's.
    """

    number: float
    full: float
    wood: float
    full_wood: float
    nodes: Floats
    length: float
    radius: float


def children_sums(rows: Table, i: int, sort: int) -> _Sums:
    """Sums over the children of a sort of a mean branch of row ``i``."""
    row, child = rows[i], rows[rows["next"][i, sort]]
    number, thickness = float(row["count"][sort, 0]), child["thickness"][0]
    if sort == FORK:
        return _fork_sums(rows, i)
    start, (low, high) = row["start"][sort, 0], row["fraction"][sort]
    end = row["start"][sort, 1] if sort == DEAD else 1.0
    t, fraction = start + (end - start) * EVEN, low + (high - low) * EVEN
    weight, fading = 1.0, 1.0
    if row["growing"][sort, NOW] > 0:
        t, fraction, weight, fading = spread_children(row, sort)
    if sort == SPUR:
        mean, variation = child["length"]
        vigor, size, radius = np.ones_like(t), np.full(t.shape, (mean**2 + variation**2 / 3) * thickness), thickness
    else:
        vigor, thick, size = side_branches(rows, i, sort, t, fraction, fading)
        radius = float((weight * thick).mean() * thickness)
    full = weight * fullness_of(rows, np.full(t.shape, row["next"][sort]), vigor)
    nodes = number * full.mean() * np.eye(3)
    if row["order"] == 1:
        outward = row["part"][0] + (row["part"][1] - row["part"][0]) * t
        nodes = np.tile(number * (full[:, None] * quadratic(outward)).mean(axis=0), (3, 1))
    length = float(row["nominal"] * child["length"][0] * (weight * vigor).mean())
    means = (float(number * m.mean()) for m in (full, weight * size, size * full))
    return _Sums(number, *means, nodes, length, radius)


def side_branches(
    rows: Table, i: int, sort: int, t: NDArray, fraction: NDArray, fading: NDArray | float
) -> tuple[Floats, Floats, Floats]:
    """Laterals or dead branches (k,) of a row: vigors, what radii are in proportion to, and lengths × radii.

    All relative to their parent's. They are at fractions t (k,) of it and (k,) of its children; laterals are shorter by
    factors ``fading`` (k,).
    """
    row, here = rows[i], np.full(t.shape, i)
    child = rows[row["next"][sort]]
    vigor = lengths(rows, here, fraction) * fading if sort == LATERAL else dead_vigor(fraction)
    piped = sort == LATERAL and row["pipe"] > 0
    thick = row["pipe_radius"] * vigor if piped else profile(rows, here, np.zeros(len(t), np.uint64), t)
    return vigor, thick, vigor * row["nominal"] * child["length"][0] * thick * child["thickness"][0]


def _fork_sums(rows: Table, i: int) -> _Sums:
    row, child = rows[i], rows[rows["next"][i, FORK]]
    forks, power = Range(*row["count"][FORK]), 1 - 1 / row["fork_power"]
    summed, number = expected_forks(forks, power), expected_forks(forks)
    tip = profile(rows, np.array([i]), np.zeros(1, np.uint64), np.ones(1))[0]
    length = float(child["length"][0])
    wood = float(summed * tip * length)
    return _Sums(
        number, number, wood, wood, number * np.eye(3), length, float(tip * number ** (-1 / row["fork_power"]))
    )
