# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of branches: straight parts of an axis with the leaves on them; branches are clipped to them (paper, 6.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import Flora, tube_perimeter
from .growth import Axes, Branches, spread
from .vectors import gathered


@dataclass(frozen=True)
class Pieces:
    """Parts of branches, each within one straight segment.

    Attributes
    ----------
    branches : Branches of n
        The whole branch that each piece is part of; enough to make its wood and leaves.
    t0, t1 : (n,) float64
        The part's ends as fractions of the branch's axis.
    start, end : (n, 3) float64
        The same ends in space, metres.
    """

    branches: Branches
    t0: NDArray[np.float64]
    t1: NDArray[np.float64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.t0)

    def take(self, index: NDArray | slice) -> Pieces:
        """Selection by indices, mask or slice; by a mask that leaves nothing out, the pieces themselves."""
        if not isinstance(index, slice) and index.dtype == bool:
            if index.all():
                return self
            index = np.flatnonzero(index)  # once, not for each field
        ends = gathered(self.start, index), gathered(self.end, index)
        return Pieces(self.branches.take(index), self.t0[index], self.t1[index], *ends)

    @classmethod
    def concatenate(cls, parts: Sequence[Pieces]) -> Pieces:
        """All pieces of several in one."""
        rest = (np.concatenate([getattr(p, name) for p in parts]) for name in ("t0", "t1", "start", "end"))
        return cls(Branches.concatenate([p.branches for p in parts]), *rest)

    @classmethod
    def empty(cls) -> Pieces:
        """No pieces."""
        return cls(Branches.empty(), np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))

    def runs(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First and last piece (k,), (k,) of each longest row of pieces that follow one another on a branch."""
        key, plant = self.branches.key, self.branches.plant
        apart = (key[1:] != key[:-1]) | (plant[1:] != plant[:-1]) | (self.t0[1:] != self.t1[:-1])
        inner = np.flatnonzero(apart)
        edge = np.zeros(min(len(self), 1), np.int64)
        return np.concatenate([edge, inner + 1]), np.concatenate([inner, edge + len(self) - 1])


def along_branches(pieces: Pieces) -> Pieces:
    """The same pieces, those of each branch together and from base to tip; whole branches keep their place.

    No two may overlap. What comes from `whole_pieces` is in order already and costs nothing.
    """
    first, last = pieces.runs()
    # A branch that is whole in one run has no pieces elsewhere.
    parts = (pieces.t0[first] > 0) | (pieces.t1[last] < 1)
    if not parts.any():
        return pieces
    of_part = np.repeat(parts, last - first + 1)
    rest = np.flatnonzero(of_part)
    # The plant belongs to the order: plants of one seed (copies in the scene) have the same keys at different places.
    key, plant = (np.take(a, rest) for a in (pieces.branches.key, pieces.branches.plant))
    rest = rest[np.lexsort([np.take(pieces.t0, rest), key, plant])]
    return pieces.take(np.concatenate([np.flatnonzero(~of_part), rest]))


def whole_pieces(branches: Branches, lines: Axes) -> tuple[Pieces, NDArray[np.int64]]:
    """All segments of branches as pieces, and the index of the branch of each."""
    owner, segment = spread(lines.segments)
    number = lines.segments[owner]
    pieces = Pieces(
        branches.take(owner),
        segment / number,
        (segment + 1) / number,
        lines.knot(owner, segment),
        lines.knot(owner, segment + 1),
    )
    return pieces, owner


def clipped(
    pieces: Pieces, distance_start: NDArray[np.float64], distance_end: NDArray[np.float64]
) -> tuple[Pieces, Pieces]:
    """Cut pieces that cross a plane.

    Parameters
    ----------
    pieces : Pieces of n
    distance_start, distance_end : (n,) float64
        Signed distances of the ends from the plane, of opposite sign.

    Returns
    -------
    tuple of Pieces
        The halves at the start and at the end, n each.
    """
    share = distance_start / (distance_start - distance_end)
    t = pieces.t0 + share * (pieces.t1 - pieces.t0)
    middle = pieces.start + share[:, None] * (pieces.end - pieces.start)
    return (
        Pieces(pieces.branches, pieces.t0, t, pieces.start, middle),
        Pieces(pieces.branches, t, pieces.t1, middle, pieces.end),
    )


def leaf_fraction(flora: Flora, pieces: Pieces) -> NDArray[np.float64]:
    """Expected share (n,) of a branch's own leaves that sit on each piece."""
    start = flora.rows["leaf_start"][pieces.branches.row]
    return np.clip(np.maximum(pieces.t1, start) - np.maximum(pieces.t0, start), 0, None) / (1 - start)


def wood_areas(flora: Flora, pieces: Pieces) -> NDArray[np.float64]:
    """Surface (n,) of the wood of each piece, m²: perimeter × length at the mean radius."""
    row = pieces.branches.row
    middle = 1 - (1 - flora.rows["taper"][row]) * (pieces.t0 + pieces.t1) / 2
    perimeter = tube_perimeter(flora.rows["sides"][row]) * pieces.branches.radius * middle
    return perimeter * pieces.branches.length * (pieces.t1 - pieces.t0)
