# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tetrahedra hold: sub-plants and pieces of branches, and how much they are (paper, section 6.5).

A plant is held as a sub-plant while it lies on one side of every plane. Where it crosses one it is opened into the
sub-plants of the next order and the pieces of its own branch, see `descent`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..plants.compiled import Flora
from ..plants.growth import Branches, trunks
from ..plants.pieces import Pieces
from ..plants.seeds import Seeds
from ..plants.sides import bounding_bodies
from .amounts import Amounts, piece_amounts, subplant_amounts, sums


@dataclass(frozen=True)
class Contents:
    """Sub-plants and pieces of branches, each in one terminal tetrahedron.

    Attributes
    ----------
    subplants : Branches of n
    subplant_cell : (n,) int32
        Node of the tree that holds each.
    subplant_amounts : Amounts of n
    pieces : Pieces of m
    piece_cell : (m,) int32
    piece_amounts : Amounts of m
    """

    subplants: Branches
    subplant_cell: NDArray[np.int32]
    subplant_amounts: Amounts
    pieces: Pieces
    piece_cell: NDArray[np.int32]
    piece_amounts: Amounts

    @classmethod
    def of(
        cls, flora: Flora, subplants: Branches, subplant_cell: NDArray, pieces: Pieces, piece_cell: NDArray
    ) -> Contents:
        """Things in cells, with their amounts."""
        amounts = subplant_amounts(flora, subplants), piece_amounts(flora, pieces)
        return cls(subplants, subplant_cell, amounts[0], pieces, piece_cell, amounts[1])

    @classmethod
    def of_plants(cls, flora: Flora, seeds: Seeds) -> Contents:
        """Whole plants, all in the root."""
        none = np.zeros(0, np.int32)
        return cls.of(flora, trunks(flora.rows, seeds), np.zeros(len(seeds), np.int32), Pieces.empty(), none)

    @classmethod
    def empty(cls) -> Contents:
        """Nothing."""
        none = np.zeros(0, np.int32)
        return cls(Branches.empty(), none, Amounts.empty(), Pieces.empty(), none, Amounts.empty())

    def within(self, chosen: NDArray[np.bool_]) -> Contents:
        """The part that lies in chosen nodes; ``chosen`` is (nodes,) bool."""
        return self.take(chosen[self.subplant_cell], chosen[self.piece_cell])

    def take(self, subplants: NDArray[np.bool_], pieces: NDArray[np.bool_]) -> Contents:
        """Selection by masks (n,) and (m,)."""
        s, p = np.flatnonzero(subplants), np.flatnonzero(pieces)
        return Contents(
            self.subplants.take(s),
            self.subplant_cell[s],
            self.subplant_amounts.take(s),
            self.pieces.take(p),
            self.piece_cell[p],
            self.piece_amounts.take(p),
        )

    @classmethod
    def joined(cls, parts: Sequence[Contents]) -> Contents:
        """All of several together."""
        if len(parts) < 2:
            return parts[0] if parts else cls.empty()
        return cls(
            Branches.concatenate([p.subplants for p in parts]),
            np.concatenate([p.subplant_cell for p in parts]),
            Amounts.concatenate([p.subplant_amounts for p in parts]),
            Pieces.concatenate([p.pieces for p in parts]),
            np.concatenate([p.piece_cell for p in parts]),
            Amounts.concatenate([p.piece_amounts for p in parts]),
        )

    def sums(self, nodes: int) -> Amounts:
        """What each of a number of nodes holds."""
        cells = np.concatenate([self.subplant_cell, self.piece_cell])
        return sums(Amounts.concatenate([self.subplant_amounts, self.piece_amounts]), cells, nodes)


class Holdings:
    """Contents of a tree that is being divided: what lies in divided nodes is taken out, the rest is never copied.

    Parameters
    ----------
    contents : Contents
        Of all terminal nodes.
    """

    def __init__(self, contents: Contents) -> None:
        self._parts = [contents]

    @property
    def contents(self) -> Contents:
        """All together; copies them into one, which is then kept until something changes."""
        self._parts = [Contents.joined([_living(p) for p in self._parts])]
        return self._parts[0]

    def put(self, contents: Contents) -> None:
        """Add contents."""
        self._parts.append(contents)

    def take_out(self, chosen: NDArray[np.bool_]) -> Contents:
        """Remove and return what lies in chosen nodes; ``chosen`` is (nodes,) bool."""
        out, kept = [], []
        for part in self._parts:
            masks = [chosen[np.maximum(c, 0)] & (c >= 0) for c in (part.subplant_cell, part.piece_cell)]
            if not (masks[0].any() or masks[1].any()):
                kept.append(part)
                continue
            out.append(part.take(*masks))
            # What is taken is only marked here; copying what stays would cost more than all else that moves.
            cells = [np.where(m, -1, c) for m, c in zip(masks, (part.subplant_cell, part.piece_cell), strict=True)]
            part = _with_cells(part, *cells)
            if 2 * sum((c < 0).sum() for c in cells) > sum(map(len, cells)):
                part = _living(part)
            kept.append(part)
        self._parts = kept
        return Contents.joined(out)


def _with_cells(part: Contents, subplant_cell: NDArray[np.int32], piece_cell: NDArray[np.int32]) -> Contents:
    return Contents(part.subplants, subplant_cell, part.subplant_amounts, part.pieces, piece_cell, part.piece_amounts)


def _living(part: Contents) -> Contents:
    """Without what has been taken out."""
    masks = part.subplant_cell >= 0, part.piece_cell >= 0
    return part if masks[0].all() and masks[1].all() else part.take(*masks)


def bounding_cylinders(flora: Flora, subplants: Branches) -> tuple[NDArray, NDArray, NDArray]:
    """Cylinders about the sub-plants' branches that hold all of their vertices, whatever the seed.

    Returns
    -------
    centre : (n, 3) float64
        Metres, world space.
    radius, half_height : (n,) float64
        Across and along the branch's axis, metres.
    """
    bodies = bounding_bodies(flora, subplants)
    return bodies[:3].T, bodies[6] + bodies[8], bodies[7] + bodies[8]


def bounding_box(flora: Flora, subplants: Branches) -> NDArray[np.float64]:
    """Axis-aligned box (2, 3) of all sub-plants' bounds, metres."""
    bodies = bounding_bodies(flora, subplants)
    axis = np.abs(bodies[3:6])
    reach = bodies[7] * axis + bodies[6] * np.sqrt(np.maximum(1 - axis**2, 0)) + bodies[8]
    return np.stack([(bodies[:3] - reach).min(axis=1), (bodies[:3] + reach).max(axis=1)])
