# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected totals of plants with crown shapes over those of plants as described, in closed form.

A crown's base decides how many limbs there are and which of the crown's lengths these have; for some bases that is
integrated once. In the factor on the lengths of limbs totals are polynomials: numbers of what follows the length are
linear, the surface of wood that does so quadratic. Limbs set out in all directions, so that of the lean to one side
only the mean square counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Mask, Table
from ..growth.branches import Branches
from ..growth.crown_effects import (
    LIGHT,
    are_stools,
    bare_part,
    dead_end,
    lateral_fractions,
    limb_count_factors,
    trunk_length_factors,
)
from ..growth.crown_shapes import BASE, MOST, WIDTH
from ..growth.grown_rows import NOW, fullness_of, living, spread_children
from ..growth.rows import DEAD, FORK, LATERAL, SPUR
from ..species.growing import EVEN
from ..species.species import LEAF_KINDS
from .averages import Averages, children_sums, side_branches

_BASES = np.linspace(0.0, MOST[BASE], 39)
_GAUSS = np.polynomial.legendre.leggauss(5)[0]
_MEANS = np.polynomial.legendre.leggauss(5)[1] / 2
_KINDS = len(LEAF_KINDS)
#: Columns of totals: area and faces of leaves of each kind, faces and surface of branches, and what of that is of short
#: shoots.
_AREA, _LEAF_FACES, _LEAVES = slice(_KINDS), slice(_KINDS, 2 * _KINDS), slice(2 * _KINDS)
_FACES, _WOOD, _SPURS, _TOTALS = range(2 * _KINDS, 2 * _KINDS + 4)
_OF_WOOD = ("fixed_faces", "full_faces", "fixed_wood", "full_wood", "spur_wood")


@dataclass(frozen=True)
class ShapedTotals:
    """Totals of sub-plants that are trunks, or stems of these, for some crown bases."""

    shaped: Mask  # (r,): rows that crown shapes change
    #: (r, b, 3, t): of what follows the power 0, 1 or 2 of the factor on the lengths of limbs, for `_BASES`.
    power: Floats

    def leaves(self, subplants: Branches, faces: bool = False, kinds: bool = False) -> Floats:
        """Area or number of faces (n,) of leaves of sub-plants over that of plants as described; (n, k) by kind."""
        some = _LEAF_FACES if faces else _AREA
        own, plain = (one[:, some] if kinds else one[:, some].sum(axis=1) for one in self._values(subplants))
        return _over(own, plain)

    def faces(self, subplants: Branches) -> Floats:
        """Faces (n,) of branches, likewise."""
        return _over(*(one[:, _FACES] for one in self._values(subplants)))

    def wood(self, subplants: Branches) -> tuple[Floats, Floats]:
        """Surface (n,) over length × radius, and that of short shoots (n,), likewise."""
        own, plain = self._values(subplants)
        return _over(own[:, _WOOD], plain[:, _WOOD]), _over(own[:, _SPURS], plain[:, _SPURS])

    def _values(self, subplants: Branches) -> tuple[Floats, Floats]:
        """Totals (n, t) of sub-plants that are formed, and of the same as described."""
        crown, row = subplants.crown.astype(np.float64), subplants.row
        step = crown[:, BASE] / (_BASES[1] - _BASES[0])
        low = np.minimum(step.astype(np.int64), len(_BASES) - 2)
        part = (step - low)[:, None, None]
        power = (1 - part) * self.power[row, low] + part * self.power[row, low + 1]
        square = 1 + (crown[:, LIGHT][:, :2] ** 2).sum(axis=1) / 2
        width = crown[:, WIDTH]
        factors = np.stack([np.ones(len(row)), width, width**2 * square], axis=1)[:, :, None]
        plain = self.power[row, 0]
        return (factors * power).sum(axis=1), (np.ones((1, 3, 1)) * plain).sum(axis=1)


def _over(own: Floats, plain: Floats) -> Floats:
    return np.where(plain > 0, own / np.where(plain > 0, plain, 1.0), 1.0)


def shaped_totals(rows: Table, totals: Averages, polygons: Floats) -> ShapedTotals:
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
    shaped = (rows["order"] == 0) & bearing & ~solid & ~are_stools(rows, every)
    power = np.zeros((len(rows), len(_BASES), 3, _TOTALS))
    kinds = np.arange(_KINDS) == rows["leaf_kind"][:, None]
    all_leaves = np.concatenate([totals.leaf_area[:, 1] @ kinds, (totals.leaves * polygons) @ kinds], axis=1)
    exact = rows.copy()
    exact["taper"][:, 1] = 0
    for i in np.flatnonzero(shaped)[::-1]:  # stems before what they grow on
        own = power[i]
        own[:, 0, _AREA] += totals.leaf_area[i, 1, i] * kinds[i]
        own[:, 0, _LEAF_FACES] += totals.leaves[i, i] * polygons[i] * kinds[i]
        own[:, 0, _FACES] += totals.fixed_faces[i, i]
        own[:, 0, _WOOD] += totals.fixed_wood[i, i]
        below, above = trunk_length_factors(_BASES, rows["part"][np.argmax(rows["species"] == rows["species"][i]), 1])
        stretch = above if rows["continues"][i] else below
        for sort in np.flatnonzero(rows["next"][i] >= 0):
            j = rows["next"][i, sort]
            leaves = all_leaves[j]
            fixed_faces, full_faces, fixed_wood, full_wood, spurs = (
                getattr(totals, name)[j].sum() for name in _OF_WOOD
            )
            if sort in (FORK, SPUR):
                one = children_sums(exact, i, int(sort))
            if sort == FORK:
                stem = power[j] * one.number
                stem[:, :, _WOOD] = power[j][:, :, _WOOD] * one.wood * (above / stretch)[:, None]
                own += stem
            elif sort == SPUR:
                own[:, 0, _LEAVES] += one.full * leaves
                own[:, 0, _FACES] += one.number * fixed_faces + one.full * full_faces
                own[:, 0, _SPURS] += one.wood * fixed_wood + one.full_wood * full_wood + one.full * spurs
            else:
                weight = rows["count_by_length"][j]
                for b, base in enumerate(_BASES):
                    number, bearing, longer, wood, full, more = _limbs(exact, int(i), int(sort), base)
                    still, grows = (1 - weight) * bearing, weight * longer
                    own[b, 0, _LEAVES] += still * leaves
                    own[b, 1, _LEAVES] += grows * leaves
                    own[b, 0, _FACES] += number * fixed_faces + still * full_faces
                    own[b, 1, _FACES] += grows * full_faces
                    own[b, 1, _WOOD] += (wood * fixed_wood + (1 - weight) * full * full_wood) / stretch[b]
                    own[b, 2, _WOOD] += weight * more * full_wood / stretch[b]
                    own[b, 0, _SPURS] += still * spurs
                    own[b, 1, _SPURS] += grows * spurs
    return ShapedTotals(shaped, power)


def _limbs(rows: Table, i: int, sort: int, base: float) -> tuple[float, ...]:
    """Expected sums over the laterals or dead branches of a row whose crown has a base.

    Their number; the sums of what new ones lack of their numbers, of that × vigor; of length × radius over the
    parent's; and of that × the first and the second.
    """
    at, row = np.array([i]), rows[i]
    number = float(row["count"][sort, 0])
    bare = float(bare_part(rows, at, base)[0])
    among = lateral_fractions(rows, at, base)[0] if sort == LATERAL else row["fraction"][sort]
    weight, fading = 1.0, 1.0
    if row["growing"][sort, NOW] > 0:
        ends, plain = ((bare,), ()) if sort == LATERAL else ((0.0, bare), (0.0, 0.0))
        number *= living(row, sort, *ends) / max(living(row, sort, *plain), 1e-12)
        t, fraction, weight, fading = spread_children(row, sort, bare * (sort == LATERAL), bare * (sort == DEAD), among)
    elif sort == DEAD:
        (start, end), last = row["start"][sort], float(dead_end(rows, at, base)[0])
        number *= (last - start) / (end - start) if end > start else 1.0
        t, fraction = start + (last - start) * EVEN, among[0] + (among[1] - among[0]) * EVEN
    else:
        mean, variation = row["start"][sort]
        starts = mean + variation * _GAUSS
        number *= float(_MEANS @ ((1 - np.maximum(starts, bare)) / np.maximum(1 - starts, 1e-9)))
        start = max(mean, bare)
        t, fraction = start + (1 - start) * EVEN, among[0] + (among[1] - among[0]) * EVEN
    if sort == LATERAL:
        number *= float(limb_count_factors(rows, at, base)[0])
    vigor, _, size = side_branches(rows, i, sort, t, fraction, fading)
    # Numbers of a branch on which nothing follows the length: all but those of new branches.
    plain = rows[[row["next"][sort]]].copy()
    plain["count_by_length"] = 0
    bears = fullness_of(plain, np.zeros(t.shape, np.int64), vigor)
    means = (float((weight * one).mean()) for one in (bears, bears * vigor, size, size * bears, size * bears * vigor))
    return number, *(number * mean for mean in means)
