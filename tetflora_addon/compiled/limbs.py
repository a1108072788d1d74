# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which limbs samples of trunks are on, so that they can be moved as the crown form of a plant moves its limbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, column
from ..growth.branches import Branches
from ..growth.rows import DEAD, LATERAL

#: Classes of samples: on the trunk itself, on stems beyond forks, on limbs of the one and of the others.
TRUNK, STEM, LIMB, STEM_LIMB = range(4)


@dataclass(frozen=True)
class Limbs(Arrays):
    """The limbs that samples (k) are on.

    Attributes
    ----------
    root : (k, 3) float32
        Where the limb leaves the trunk, in the axes and units of samples; 0 where there is none.
    kind : (k,) int8
        Class of the sample; `TRUNK` on all that is not a trunk.
    follows : (k,) float32
        Fraction of what is there that follows the limb's length.
    """

    root: NDArray[np.float32] = field(metadata=column(3, dtype=np.float32))
    kind: NDArray[np.int8] = field(metadata=column(dtype=np.int8))
    follows: NDArray[np.float32] = field(metadata=column(dtype=np.float32))


@dataclass(frozen=True)
class Shares:
    """What samples of each row stand for.

    Attributes
    ----------
    kinds : (r, 4) float64
        Fractions of each class.
    follows : (r,) float64
        Mean over those on limbs.
    """

    kinds: NDArray[np.float64]
    follows: NDArray[np.float64]

    @classmethod
    def of(cls, limbs: Limbs, row: NDArray[np.integer], rows: int) -> Shares:
        """Of samples (k,) of rows (k,), of which there are so many."""
        on = limbs.kind >= LIMB
        kinds = np.bincount(row.astype(np.int64) * 4 + limbs.kind, minlength=4 * rows).reshape(rows, 4)
        follows = np.bincount(row[on], limbs.follows[on], rows) / np.maximum(np.bincount(row[on], minlength=rows), 1)
        return cls(kinds / np.maximum(kinds.sum(axis=1, keepdims=True), 1), follows)


def limbs_of(
    rows: NDArray[np.void],
    first: int,
    i: int,
    number: NDArray[np.integer],
    branches: Sequence[Branches],
    row: NDArray[np.integer],
    base: Branches,
) -> Limbs:
    """The limbs of samples of one row.

    Parameters
    ----------
    rows : parameter table
    first, i : int
        First row of the species, and the row that is sampled, counted from there.
    number : (k, s) int
        Numbers of the branches that samples are on, of each row of the species that these may be of.
    branches : sequence of Branches
        By row of the species.
    row : (k,) int
        Row that describes each sample.
    base : Branches of k
        Branches of the row that is sampled on which samples are.
    """
    species, k = rows[first : first + number.shape[1]], len(row)
    out = Limbs(np.zeros((k, 3), np.float32), np.zeros(k, np.int8), np.zeros(k, np.float32))
    trunks = np.flatnonzero((species["order"] == 0) & ~species["drawn"] & ~species["phantom"])
    if i not in trunks:
        return out
    within = (number >= 0) & (number < [len(some) for some in branches])
    out.kind[within[:, trunks[trunks > i]].any(axis=1)] = STEM
    for limb in np.unique(species["next"][trunks][:, (LATERAL, DEAD)]) - first:
        # What is on a dead branch of a limb is on that limb: rows of living branches come first.
        some = np.flatnonzero(within[:, limb] & (out.kind < LIMB)) if limb >= 0 else np.zeros(0, np.intp)
        if len(some):
            own = branches[limb].take(number[some, limb])
            way = own.position - base.position[some]
            out.root[some] = np.einsum("nji,nj->ni", base.frame[some], way) / base.length[some, None]
            out.kind[some] += LIMB
            weight = rows["count_by_length"][own.row]
            longer = weight * own.vigour
            follows = longer / np.maximum(1 - weight + longer, 1e-12)
            out.follows[some] = np.where(row[some] == own.row, 0.0, follows)
    return out
