# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected totals of sub-plants in closed form, from the highest order down to the trunk (paper, section 5).

Every total is kept by the row that contributes it, so that colors and fractions follow by a product. What depends on
how far outside in the crown a sub-plant sits is known at three places, `NODES`, and quadratic between them.

Factors on them are by crown shape, and by kind of leaf on a day of the year. A crown's base decides how many limbs
there are and which of the crown's lengths these have; for some bases that is integrated once. In the factor on the
lengths of limbs totals are polynomials: numbers of what follows the length are linear, the surface of wood that does so
quadratic. Limbs set out in all directions, so that of the lean to one side only the mean square counts.

On a day of the year there are totals in summer by kind of leaf, times what the day leaves of them. Tables of days are
those of `growth.seasons`; nothing is measured anew for a day.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, Table, gathered
from ..growth import crown_effects, seasons
from ..growth.axes import profile
from ..growth.foliage import YOUTH
from ..growth.rows import DEAD, FORK, LATERAL, NOW, SPUR, fullness_of, lengths, living, spread_children
from ..growth.seeds import BASE, LEAVES, MOST, WIDTH, Branches
from ..leaves.levels import hidden_gloss
from ..leaves.models import Forms, LeafModel
from ..species.members import dead_vigor, expected_forks
from ..species.species import EVEN, LEAF_KINDS, Range, Species

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


def row_leaves(rows: Table, forms: Sequence[Forms], transmission: NDArray) -> RowLeaves:
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
        return sum([low ** (power - i) * high**i for i in range(power + 1)]) / (power + 1)

    first = 1 + 2 * k * moment(1) + k * k * moment(2)
    second = moment(1) + 2 * k * moment(2) + k * k * moment(3)
    if along is None:
        return first, second, np.zeros_like(first)
    # With young leaves, polynomials of degree 14 at most: eight nodes of Gauss integrate them exactly.
    o, q = (ends[0][..., None] + (ends[1] - ends[0])[..., None] * _GAUSS for ends in (outward, along))
    young = q**YOUTH
    area = ((1 + k[:, None] * o) * (1 + (size_young - 1)[:, None] * young)) ** 2
    alike = size_young == 1
    first, second = np.where(alike, first, _integral(area)), np.where(alike, second, _integral(area * o))
    return first, second, _integral(area * young)


def _integral(values: Floats) -> Floats:
    """Integral (n,) of values (n, nodes) over the interval: no product of matrices, as its last bit varies with n."""
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
        mean = area[:, None] * inside + area_outward[:, None] * (tip - inside) + area_young[:, None] * (young - inside)
        leaf_color[:, n] = one_area[:, None] * mean
    whole = profile(exact, every, no_key, np.ones(r), summed=True)
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
            sums[i, sort] = one = _children_sums(exact, i, int(sort))
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
    of_wood = fixed_wood, full_wood, spur_wood, fixed_faces, full_faces
    return Averages(leaves, leaf_area, leaf_color, *of_wood, length, radius)


@dataclass(frozen=True)
class _Sums:
    """Expected sums over the children of one sort of a branch of vigor 1."""

    number: float
    full: float  # of the factors on their own numbers (`growth.fullness`)
    #: wood and full_wood: of length × radius relative to the parent's (short shoots: m²), without and with that factor.
    wood: float
    full_wood: float
    nodes: Floats  # (3, 3): what their totals at `NODES` add to the parent's
    #: length and radius: typical ones relative to the parent's.
    length: float
    radius: float


def _children_sums(rows: Table, i: int, sort: int) -> _Sums:
    """Sums over the children of a sort of a mean branch of row ``i``."""
    if sort == FORK:
        return _fork_sums(rows, i)
    row, child = rows[i], rows[rows["next"][i, sort]]
    number, thickness = float(row["count"][sort, 0]), child["thickness"][0]
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
        vigor, thick, size = _side_branches(rows, i, sort, t, fraction, fading)
        radius = float((weight * thick).mean() * thickness)
    full = weight * fullness_of(rows, np.full(t.shape, row["next"][sort]), vigor)
    nodes = number * full.mean() * np.eye(3)
    if row["order"] == 1:
        outward = row["part"][0] + (row["part"][1] - row["part"][0]) * t
        nodes = np.tile(number * (full[:, None] * quadratic(outward)).mean(axis=0), (3, 1))
    length = float(row["nominal"] * child["length"][0] * (weight * vigor).mean())
    means = (float(number * m.mean()) for m in (full, weight * size, size * full))
    return _Sums(number, *means, nodes, length, radius)


def _side_branches(
    rows: Table, i: int, sort: int, t: NDArray, fraction: NDArray, fading: NDArray | float
) -> tuple[Floats, Floats, Floats]:
    """Laterals or dead branches (k,) of a row: vigors, what radii are in proportion to, and lengths × radii.

    Relative to their parent's, at fractions t (k,) of it and of its children; laterals are shorter by ``fading`` (k,).
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
    length, radius = float(child["length"][0]), float(tip * number ** (-1 / row["fork_power"]))
    wood = float(summed * tip * length)
    return _Sums(number, number, wood, wood, number * np.eye(3), length, radius)


_BASES = np.linspace(0.0, MOST[BASE], 39)
_ABSCISSAS, _MEANS = np.polynomial.legendre.leggauss(5) / np.array([[1], [2]])
KINDS = len(LEAF_KINDS)
#: Columns of totals: area and faces of leaves of each kind, faces and surface of branches, and of short shoots alone.
_AREA, _LEAF_FACES, _LEAVES = slice(KINDS), slice(KINDS, 2 * KINDS), slice(2 * KINDS)
_FACES, _WOOD, _SPURS, _TOTALS = range(2 * KINDS, 2 * KINDS + 4)
_OF_WOOD = ("fixed_faces", "full_faces", "fixed_wood", "full_wood", "spur_wood")


@dataclass(frozen=True)
class ShapedTotals:
    """Totals of sub-plants that are trunks, or stems of these, for some crown bases."""

    shaped: Mask  # (r,): rows that crown shapes change
    #: (r, b, 3, t): of what follows the power 0, 1 or 2 of the factor on the lengths of limbs, for `_BASES`.
    power: Floats
    borne: Floats  # (r, b, 3, t): what of that limbs bear

    @classmethod
    def of(cls, rows: Table, totals: Averages, polygons: Floats) -> Self:
        """Totals of all rows.

        Parameters
        ----------
        rows : (r,) parameter table
        totals : Averages
            Of plants as described.
        polygons : (r,) float64
            Faces of a leaf of each row.
        """
        every = np.arange(len(rows))
        bearing = (rows["next"][:, (LATERAL, DEAD, FORK)] >= 0).any(axis=1)
        solid = rows["phantom"] | rows["drawn"] | (rows["envelope"] > 0)
        shaped = (rows["order"] == 0) & bearing & ~solid & ~crown_effects.are_stools(rows, every)
        power, borne = np.zeros((2, len(rows), len(_BASES), 3, _TOTALS))
        kinds = np.arange(KINDS) == rows["leaf_kind"][:, None]
        all_leaves = np.concatenate([totals.leaf_area[:, 1] @ kinds, (totals.leaves * polygons) @ kinds], axis=1)
        exact = rows.copy()
        exact["taper"][:, 1] = 0
        for i in np.flatnonzero(shaped)[::-1]:  # stems before what they grow on
            sums, on_limbs = power[i], borne[i]
            sums[:, 0, _AREA] += totals.leaf_area[i, 1, i] * kinds[i]
            sums[:, 0, _LEAF_FACES] += totals.leaves[i, i] * polygons[i] * kinds[i]
            sums[:, 0, _FACES] += totals.fixed_faces[i, i]
            sums[:, 0, _WOOD] += totals.fixed_wood[i, i]
            trunk = np.argmax(rows["species"] == rows["species"][i])
            below, above = crown_effects.trunk_ratios(_BASES, rows["part"][trunk, 1])
            stretch = above if rows["continues"][i] else below
            for sort in np.flatnonzero(rows["next"][i] >= 0):
                j = rows["next"][i, sort]
                leaves = all_leaves[j]
                of_wood = (getattr(totals, name)[j].sum() for name in _OF_WOOD)
                fixed_faces, full_faces, fixed_wood, full_wood, spurs = of_wood
                if sort in (FORK, SPUR):
                    one = _children_sums(exact, i, int(sort))
                if sort == FORK:
                    for whole, its in ((sums, power[j]), (on_limbs, borne[j])):
                        stem = its * one.number
                        stem[:, :, _WOOD] = its[:, :, _WOOD] * one.wood * (above / stretch)[:, None]
                        whole += stem
                elif sort == SPUR:
                    sums[:, 0, _LEAVES] += one.full * leaves
                    sums[:, 0, _FACES] += one.number * fixed_faces + one.full * full_faces
                    sums[:, 0, _SPURS] += one.wood * fixed_wood + one.full_wood * full_wood + one.full * spurs
                else:
                    weight = rows["count_by_length"][j]
                    for b, base in enumerate(_BASES):
                        number, bearing, longer, wood, full, more = _limbs(exact, int(i), int(sort), base)
                        still, grows = (1 - weight) * bearing, weight * longer
                        sums[b, 0, _FACES] += number * fixed_faces
                        sums[b, 1, _WOOD] += wood * fixed_wood / stretch[b]
                        bears = np.zeros_like(sums[b])
                        bears[0, _LEAVES], bears[1, _LEAVES] = still * leaves, grows * leaves
                        bears[:2, _FACES] = still * full_faces, grows * full_faces
                        bears[1:, _WOOD] = np.array([(1 - weight) * full, weight * more]) * full_wood / stretch[b]
                        bears[:2, _SPURS] = still * spurs, grows * spurs
                        sums[b] += bears
                        if sort == LATERAL:
                            on_limbs[b] += bears
        return cls(shaped, power, borne)

    def leaves(self, subplants: Branches, faces: bool = False, kinds: bool = False) -> Floats:
        """Area or number of faces (n,) of leaves of sub-plants over that of plants as described; (n, k) by kind."""
        columns = _LEAF_FACES if faces else _AREA
        shaped, plain = (one[:, columns] if kinds else one[:, columns].sum(axis=1) for one in self._values(subplants))
        return _over(shaped, plain)

    def faces(self, subplants: Branches) -> Floats:
        """Faces (n,) of branches, likewise."""
        return _over(*(one[:, _FACES] for one in self._values(subplants)))

    def wood(self, subplants: Branches) -> tuple[Floats, Floats]:
        """Surface (n,) over length × radius, and that of short shoots (n,), likewise."""
        shaped, plain = self._values(subplants)
        return _over(shaped[:, _WOOD], plain[:, _WOOD]), _over(shaped[:, _SPURS], plain[:, _SPURS])

    def _values(self, subplants: Branches) -> tuple[Floats, Floats]:
        """Totals (n, t) of sub-plants that are formed, and of the same as described."""
        crown, row = subplants.crown.astype(np.float64), subplants.row
        step = crown[:, BASE] / (_BASES[1] - _BASES[0])
        low = np.minimum(step.astype(np.int64), len(_BASES) - 2)
        part, fewer = (step - low)[:, None, None], np.tile(1.0 - crown[:, LEAVES, None, None], (1, 1, _TOTALS))
        fewer[:, :, 2 * KINDS :] = 1.0 - np.sqrt(crown[:, LEAVES, None, None])
        power, borne = ((1 - part) * all_[row, low] + part * all_[row, low + 1] for all_ in (self.power, self.borne))
        power = power - fewer * borne
        square = 1 + (crown[:, crown_effects.LIGHT][:, :2] ** 2).sum(axis=1) / 2
        width = crown[:, WIDTH]
        factors = np.stack([np.ones(len(row)), width, width**2 * square], axis=1)[:, :, None]
        return (factors * power).sum(axis=1), (np.ones((1, 3, 1)) * self.power[row, 0]).sum(axis=1)


def _over(shaped: Floats, plain: Floats) -> Floats:
    return np.where(plain > 0, shaped / np.where(plain > 0, plain, 1.0), 1.0)


def _limbs(rows: Table, i: int, sort: int, base: float) -> tuple[float, ...]:
    """Expected sums over the laterals or dead branches of a row whose crown has a base.

    Their number; the sums of what new ones lack of their numbers, of that × vigor; of length × radius over the
    parent's; and of that × the first and the second.
    """
    index, row = np.array([i]), rows[i]
    number = float(row["count"][sort, 0])
    bare = float(crown_effects.bare_part(rows, index, base)[0])
    among = crown_effects.lateral_fractions(rows, index, base)[0] if sort == LATERAL else row["fraction"][sort]
    weight, fading = 1.0, 1.0
    if row["growing"][sort, NOW] > 0:
        ends, plain = ((bare,), ()) if sort == LATERAL else ((0.0, bare), (0.0, 0.0))
        number *= living(row, sort, *ends) / max(living(row, sort, *plain), 1e-12)
        t, fraction, weight, fading = spread_children(row, sort, bare * (sort == LATERAL), bare * (sort == DEAD), among)
    elif sort == DEAD:
        (start, end), last = row["start"][sort], float(crown_effects.dead_end(rows, index, base)[0])
        number *= (last - start) / (end - start) if end > start else 1.0
        t, fraction = start + (last - start) * EVEN, among[0] + (among[1] - among[0]) * EVEN
    else:
        mean, variation = row["start"][sort]
        starts = mean + variation * _ABSCISSAS
        number *= float(_MEANS @ ((1 - np.maximum(starts, bare)) / np.maximum(1 - starts, 1e-9)))
        start = max(mean, bare)
        t, fraction = start + (1 - start) * EVEN, among[0] + (among[1] - among[0]) * EVEN
    if sort == LATERAL:
        number *= float(crown_effects.limb_count_factors(rows, index, base)[0])
    vigor, _, size = _side_branches(rows, i, sort, t, fraction, fading)
    # Numbers of a branch on which nothing follows the length: all but those of new branches.
    plain = rows[[row["next"][sort]]].copy()
    plain["count_by_length"] = 0
    bears = fullness_of(plain, np.zeros(t.shape, np.int64), vigor)
    means = (float((weight * one).mean()) for one in (bears, bears * vigor, size, size * bears, size * bears * vigor))
    return number, *(number * mean for mean in means)


_SEEN = (seasons.AREA, seasons.FRESH, seasons.AUTUMN, seasons.DRY)


@dataclass(frozen=True, eq=False)
class DayTotals:
    """Totals of sub-plants by row (r) and kind of leaf (k) in summer, and what a day leaves of each."""

    years: Table  # (r, k) array of the column ``year``: of the species of each row
    table: Integers  # (r, k): index into ``tables``
    tables: Floats  # (t, 6, d): see `growth.seasons.leaf_table`
    origin: Floats  # (t,): days on which these begin
    area: Floats  # (r, 3, k): expected one-sided area of leaves at `averages.NODES`, m² at plant scale 1
    color: Floats  # (r, 3, k, 3): area times mean color in summer at the same places
    #: count and faces, (r, k): expected numbers of leaves and of their faces.
    count: Floats
    faces: Floats
    #: (r,): mean width of what bears sub-plants' leaves, meters at plant scale 1; without leaves that of the branch.
    twig: Floats

    @property
    def kinds(self) -> Integers:
        """Kinds of leaves that any plants bear."""
        return np.flatnonzero(self.count.any(axis=0))

    def left(self, branches: Branches, kind: int | Integers, *columns: int) -> list[Floats]:
        """What is left of leaves of a kind, or of kinds (n,), on the days of branches (n): some columns (n,)."""
        return seasons.expected(self.tables, self.origin, self.table[branches.row, kind], branches.year[:, 0], columns)

    def _summed(self, subplants: Branches, each: Floats, column: int, kind: int | None = None) -> Floats:
        """Sum (n,) over kinds of leaves, or of one, of what they have in summer (n, k) and the day leaves."""
        return sum(each[:, k] * self.left(subplants, k, column)[0] for k in (self.kinds if kind is None else (kind,)))

    def leaf_areas(self, subplants: Branches, shaped: Floats | float = 1.0, kind: int | None = None) -> Floats:
        """Area (n,) of leaves, or of one kind, at plant scale 1, without the fullness of sub-plants.

        ``shaped`` (n, k) are factors by kind of leaf, because of crown shapes.
        """
        area = np.einsum("nj,njk->nk", quadratic(subplants.outward), self.area[subplants.row])
        return self._summed(subplants, area * shaped, seasons.AREA, kind)

    def leaf_counts(self, subplants: Branches, kind: int | None = None) -> Floats:
        """Number (n,) of leaves, likewise."""
        return self._summed(subplants, self.count[subplants.row], seasons.PRESENT, kind)

    def leaf_faces(self, subplants: Branches, shaped: Floats | float = 1.0) -> Floats:
        """Number (n,) of faces of leaves, likewise."""
        return self._summed(subplants, self.faces[subplants.row] * shaped, seasons.PRESENT)

    def leaf_colors(self, subplants: Branches) -> Floats:
        """Mean colors (n, 3) of leaves, weighted by area; black where there are none."""
        weights = quadratic(subplants.outward)
        area = np.einsum("nj,njk->nk", weights, self.area[subplants.row])
        summer = np.einsum("nj,njkc->nkc", weights, self.color[subplants.row])
        total, out = np.zeros(len(subplants)), np.zeros((len(subplants), 3))
        for kind in self.kinds:
            year, left = self.years[subplants.row, kind], self.left(subplants, kind, *_SEEN)
            out += _mixed(summer[:, kind], area[:, kind], left, year, subplants.year[:, 1])
            total += area[:, kind] * left[0]
        return out / np.maximum(total, 1e-300)[:, None]

    def own_colors(self, branches: Branches, kind: Integers, summer: Floats, owner: Integers | None = None) -> Floats:
        """Mean colors (n, 3) of leaves of one kind (n,), of which those in summer are known (n, 3).

        ``owner`` (n,) are their branches, if not one for each.
        """
        out = summer.copy()
        for one in self.kinds:
            left, none = self.left(branches, int(one), *_SEEN), np.zeros((len(branches), 3))
            added = _mixed(none, np.ones(len(branches)), left, self.years[branches.row, one], branches.year[:, 1])
            every = np.where(left[0] > 0, left[0], 1.0)
            factor = np.where(left[0] > 0, (left[0] - left[1] - left[2] - left[3]) / every, 1.0)
            added = added / every[:, None]
            if owner is not None and (kind == one).all():
                return gathered(factor, owner)[:, None] * summer + gathered(added, owner)
            leaves = np.flatnonzero(kind == one)
            which = leaves if owner is None else owner[leaves]
            out[leaves] = factor[which, None] * summer[leaves] + added[which]
        return out

    def widths(self, subplants: Branches, leaf: Floats, bare: Floats) -> Floats:
        """Widths (n,) between those of leaves in summer (n,) and of what bears them (n,), by number and by growth."""
        count = self.count[subplants.row]
        every, left = count.sum(axis=1), self._summed(subplants, count, seasons.PRESENT)
        size = self._summed(subplants, count, seasons.SIZE) / np.maximum(left, 1e-300)
        share = left / np.maximum(every, 1e-300)
        return np.where(every > 0, bare + share * (leaf * size - bare), leaf)

    def share_range(self, rows: Table, species: int) -> tuple[float, float]:
        """Least and greatest `leaf_share` of plants of a species on the day of rows (r,)."""
        trunk = np.flatnonzero(rows["species"] == species)[0]
        days = _days_of_plants(rows[trunk])
        area = self.area[trunk].mean(axis=0)
        every = (np.full(len(days), table) for table in self.table[trunk].tolist())
        left = [seasons.expected(self.tables, self.origin, which, days, [seasons.AREA])[0] for which in every]
        share = area @ np.array(left) / area.sum() if area.sum() > 0 else np.ones(1)
        return float(share.min()), float(share.max())

    def leaf_share(self, subplants: Branches) -> Floats:
        """Area (n,) of leaves over that in summer, 1 where there are never any."""
        area = self.area[subplants.row].mean(axis=1)
        all_year = area.sum(axis=1)
        left = self._summed(subplants, area, seasons.AREA)
        return np.where(all_year > 0, left / np.where(all_year > 0, all_year, 1.0), 1.0)


def _mixed(summer: Floats, area: Floats, left: list[Floats], year: Table, hue: Floats) -> Floats:
    """Area times color (n, 3) of leaves on a day, from those in summer (n, 3) of areas (n,), by columns of `_SEEN`."""
    every, *others = left
    out = (every - sum(others))[:, None] * summer
    for part, color in zip(others, (year["fresh"], seasons.mean_autumn_colors(year, hue), year["dry"]), strict=True):
        out += (area * part)[:, None] * color
    return out


def totals_of_day(
    rows: Table, species: Sequence[Species], season: seasons.Season, totals: Averages, leaf: RowLeaves
) -> tuple[Table, DayTotals] | None:
    """Rows on a day, and totals of their sub-plants; None where no plant is other than in summer.

    Parameters
    ----------
    rows : (r,) parameter table
    totals : Averages
        Of the same rows.
    leaf : RowLeaves
        Likewise.
    """
    if all(one.year is None for one in species):
        return None
    rows = seasons.seasonal_rows(rows, species, season)
    local_years = [one.year and one.year.at_latitude(abs(season.latitude)) for one in species]
    kinds = [[None if year is None else year.of_kind(k) for k in range(KINDS)] for year in local_years]
    every = list(dict.fromkeys(leaf for leaves in kinds for leaf in leaves))
    tables = np.stack([seasons.leaf_table(one) for one in every])
    origin = np.array([0.0 if one is None else one.origin for one in every])
    of_species = np.array([[every.index(one) for one in leaves] for leaves in kinds])
    years = np.zeros((len(species), KINDS), rows.dtype["year"])
    for number in range(len(species)):
        for kind in range(KINDS):
            bearing = (rows["species"] == number) & (rows["leaf_kind"] == kind)
            if bearing.any():
                years[number, kind] = rows["year"][bearing][0]
    number = rows["species"]
    count = totals.leaves.sum(axis=1)
    twig = np.where(count > 0, totals.leaves @ totals.radius / np.maximum(count, 1e-300), totals.radius)
    day_totals = DayTotals(years[number], of_species[number], tables, origin, *_by_kind(rows, totals, leaf), 2.0 * twig)
    return (rows, day_totals) if _differs(rows, day_totals, of_species) else None


def _by_kind(rows: Table, totals: Averages, leaf: RowLeaves) -> tuple[Floats, ...]:
    """``area``, ``color``, ``count`` and ``faces`` of `DayTotals`."""
    kinds = np.arange(KINDS) == rows["leaf_kind"][:, None]  # (r, k), which kind each contributing row bears
    area = totals.leaf_area @ kinds
    color = np.zeros((*area.shape, 3))
    used = [kind for kind in range(KINDS) if area[..., kind].any()]
    for kind in used[:-1]:
        kind_rows = rows.copy()
        kind_rows["leaves"] *= kinds[:, kind, None]
        color[:, :, kind] = average(kind_rows, leaf).leaf_color
    if used:  # the last has what is left
        color[:, :, used[-1]] = np.maximum(totals.leaf_color - color.sum(axis=2), 0.0)
    return area, color, totals.leaves @ kinds, (totals.leaves * leaf.polygons) @ kinds


def _days_of_plants(trunk: np.void) -> Floats:
    """Days (n,) that it may be for plants of a species, by the row of its trunk."""
    return seasons.plant_days(trunk["day"], max(trunk["spring"], trunk["autumn"]))


def _differs(rows: Table, day_totals: DayTotals, of_species: Integers) -> bool:
    """Whether any plant may have other leaves than in summer."""
    summer = np.array([[1.0], [1.0], [1.0], [0.0], [0.0], [0.0]])
    trunk = np.unique(rows["species"], return_index=True)[1]
    for row, which in zip(rows[trunk], of_species, strict=True):
        days = _days_of_plants(row)
        for table in which.tolist():
            left = seasons.expected(day_totals.tables, day_totals.origin, np.full(len(days), table), days)
            if np.abs(np.array(left) - summer).max() > 1e-9:
                return True
    return False
