# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tetrahedra hold, and the update step: handing it on to the children of divided ones (paper, section 6.5).

A plant is held as a sub-plant while its bound lies on one side of every plane. Where it straddles one it is opened into
the sub-plants of the next order and the pieces of its own branch; pieces that straddle are clipped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..plants.averages import own_leaf_integrals
from ..plants.compiled import Flora
from ..plants.expansion import open_subplants
from ..plants.growth import Branches, fullness, trunks
from ..plants.pieces import Pieces, clipped, leaf_fraction, outward_ends, wood_areas
from ..plants.seeds import Seeds
from ..tetrahedra.tree import TetrahedralTree

#: Sub-plants that are opened at a time; bounds the memory that opening takes to some hundred megabytes.
OPENED_AT_ONCE = 40_000


@dataclass(frozen=True)
class Contents:
    """Sub-plants and pieces of branches, each in one terminal tetrahedron.

    Attributes
    ----------
    subplants : Branches of n
    subplant_cell : (n,) int32
        Node of the tree that holds each.
    pieces : Pieces of m
    piece_cell : (m,) int32
    """

    subplants: Branches
    subplant_cell: NDArray[np.int32]
    pieces: Pieces
    piece_cell: NDArray[np.int32]

    @classmethod
    def of_plants(cls, flora: Flora, seeds: Seeds) -> Contents:
        """Whole plants, all in the root."""
        none = np.zeros(0, np.int32)
        return cls(trunks(flora.rows, seeds), np.zeros(len(seeds), np.int32), Pieces.empty(), none)

    def within(self, chosen: NDArray[np.bool_]) -> Contents:
        """The part that lies in chosen nodes; ``chosen`` is (nodes,) bool."""
        s, p = chosen[self.subplant_cell], chosen[self.piece_cell]
        return Contents(self.subplants.take(s), self.subplant_cell[s], self.pieces.take(p), self.piece_cell[p])

    @classmethod
    def joined(cls, a: Contents, b: Contents) -> Contents:
        """Both together."""
        return cls(
            Branches.concatenate([a.subplants, b.subplants]),
            np.concatenate([a.subplant_cell, b.subplant_cell]),
            Pieces.concatenate([a.pieces, b.pieces]),
            np.concatenate([a.piece_cell, b.piece_cell]),
        )


def bounding_cylinders(flora: Flora, subplants: Branches) -> tuple[NDArray, NDArray, NDArray]:
    """Cylinders about the sub-plants' branches that hold all of their vertices.

    Returns
    -------
    centre : (n, 3) float64
        Metres, world space.
    radius, half_height : (n,) float64
        Across and along the branch's axis, metres.
    """
    bound = flora.bound[subplants.row] * subplants.length[:, None]
    pad = subplants.radius * flora.widest[subplants.row] + flora.leaf_reach[subplants.row] * subplants.scale
    middle = (bound[:, 1] + bound[:, 2]) / 2
    centre = subplants.position + middle[:, None] * subplants.frame[:, :, 2]
    return centre, bound[:, 0] + pad, (bound[:, 2] - bound[:, 1]) / 2 + pad


def bounding_box(flora: Flora, subplants: Branches) -> NDArray[np.float64]:
    """Axis-aligned box (2, 3) of all sub-plants' bounds, metres."""
    centre, radius, half_height = bounding_cylinders(flora, subplants)
    axis = np.abs(subplants.frame[:, :, 2])
    reach = half_height[:, None] * axis + radius[:, None] * np.sqrt(np.clip(1 - axis**2, 0, 1))
    return np.stack([(centre - reach).min(axis=0), (centre + reach).max(axis=0)])


def push_down(flora: Flora, tree: TetrahedralTree, contents: Contents) -> Contents:
    """Hand contents of divided nodes on until all lie in terminal ones.

    Parameters
    ----------
    flora : Flora
    tree : TetrahedralTree
    contents : Contents
        In any nodes of the tree.

    Returns
    -------
    Contents
        The same plants in terminal nodes; nothing is lost or held twice.
    """
    placed, placed_cells = [Branches.empty()], [np.zeros(0, np.int32)]
    loose, loose_cells = [contents.pieces], [contents.piece_cell]
    subplants, cells = contents.subplants, contents.subplant_cell
    while len(subplants):
        inner = tree.children[cells, 0] >= 0
        placed.append(subplants.take(~inner))
        placed_cells.append(cells[~inner])
        subplants, cells = subplants.take(inner), cells[inner]
        plane = tree.planes(cells)
        centre, radius, half_height = bounding_cylinders(flora, subplants)
        distance = np.einsum("ni,ni->n", plane[:, :3], centre) + plane[:, 3]
        along = np.abs(np.einsum("ni,ni->n", plane[:, :3], subplants.frame[:, :, 2]))
        reach = half_height * along + radius * np.sqrt(np.clip(1 - along**2, 0, 1))
        whole = np.abs(distance) > reach
        side = (distance > 0).astype(np.int64)
        straddling = np.flatnonzero(~whole)
        parts, part_cells = [subplants.take(whole)], [tree.children[cells[whole], side[whole]]]
        for start in range(0, len(straddling), OPENED_AT_ONCE):
            chosen = straddling[start : start + OPENED_AT_ONCE]
            grown, owner, pieces, piece_owner = open_subplants(flora, subplants.take(chosen))
            parts.append(grown)
            part_cells.append(cells[chosen[owner]])
            loose.append(pieces)
            loose_cells.append(cells[chosen[piece_owner]])
        subplants, cells = Branches.concatenate(parts), np.concatenate(part_cells)
    pieces, piece_cells = _push_down_pieces(tree, Pieces.concatenate(loose), np.concatenate(loose_cells))
    return Contents(Branches.concatenate(placed), np.concatenate(placed_cells), pieces, piece_cells)


def _push_down_pieces(tree: TetrahedralTree, pieces: Pieces, cells: NDArray) -> tuple[Pieces, NDArray[np.int32]]:
    placed, placed_cells = [Pieces.empty()], [np.zeros(0, np.int32)]
    while len(pieces):
        inner = tree.children[cells, 0] >= 0
        placed.append(pieces.take(~inner))
        placed_cells.append(cells[~inner])
        pieces, cells = pieces.take(inner), cells[inner]
        plane = tree.planes(cells)
        start, end = (np.einsum("ni,ni->n", plane[:, :3], p) + plane[:, 3] for p in (pieces.start, pieces.end))
        crossing = (start < 0) != (end < 0)
        whole = ~crossing
        children = tree.children[cells]
        lower, upper = clipped(pieces.take(crossing), start[crossing], end[crossing])
        of_crossing, first = children[crossing], (start[crossing] >= 0).astype(np.int64)
        every = np.arange(len(first))
        pieces = Pieces.concatenate([pieces.take(whole), lower, upper])
        cells = np.concatenate(
            [
                children[whole, (start[whole] >= 0).astype(np.int64)],
                of_crossing[every, first],
                of_crossing[every, 1 - first],
            ]
        )
    return Pieces.concatenate(placed), np.concatenate(placed_cells)


@dataclass(frozen=True)
class Amounts:
    """How much each thing (sub-plant or piece) or each node holds, as far as decisions need it.

    Attributes
    ----------
    leaf_area : (n,) float64
        One-sided area of leaves, m².
    wood_area : (n,) float64
        Surface of branches, m².
    polygons : (n,) float64
        Expected faces if made explicit.
    width : (n,) float64
        Width of the features, metres: that of the leaves, or of the branch where there are none. By node: the mean,
        weighted by area.
    """

    leaf_area: NDArray[np.float64]
    wood_area: NDArray[np.float64]
    polygons: NDArray[np.float64]
    width: NDArray[np.float64]


def subplant_amounts(flora: Flora, subplants: Branches) -> Amounts:
    """Compiled means for sub-plants."""
    row = subplants.row
    leafy = flora.leaf_count[row] > 0
    return Amounts(
        flora.leaf_areas(subplants),
        flora.wood_areas(subplants),
        flora.face_counts(subplants),
        np.where(leafy, flora.leaf_width[row] * subplants.scale, 2 * subplants.radius),
    )


def piece_amounts(flora: Flora, pieces: Pieces) -> Amounts:
    """Compiled means for pieces: the wood, and the leaves that the branch itself bears there."""
    branches = pieces.branches
    row, leaf = branches.row, flora.leaf
    size, variation = flora.rows["leaf_size"][row].T
    leaves = flora.rows["leaves"][row, 0] * fullness(flora.rows, branches) * leaf_fraction(flora, pieces)
    return Amounts(
        leaves * (size**2 + variation**2 / 3) * leaf.area[row] * branches.scale**2 * _size_factors(flora, pieces),
        wood_areas(flora, pieces),
        leaves * leaf.polygons[row] + flora.rows["sides"][row],
        np.where(leaves > 0, leaf.width[row] * size * branches.scale, 2 * branches.radius),
    )


def _size_factors(flora: Flora, pieces: Pieces) -> NDArray[np.float64] | float:
    """Mean factor (n,) on the area of leaves of pieces, by how far outside in the crown they sit."""
    if not flora.rows["gradient"].any():
        return 1.0
    low, high = outward_ends(flora, pieces)
    return own_leaf_integrals(flora.rows["leaf_size_tip"][pieces.branches.row], low, high)[0]


def node_amounts(flora: Flora, contents: Contents, nodes: int) -> Amounts:
    """Sums over what each node holds (``nodes`` is their number); the width is an area-weighted mean."""
    cells = np.concatenate([contents.subplant_cell, contents.piece_cell])
    a, b = subplant_amounts(flora, contents.subplants), piece_amounts(flora, contents.pieces)
    leaf, wood, polygons, width = (
        np.concatenate([getattr(a, name), getattr(b, name)]) for name in ("leaf_area", "wood_area", "polygons", "width")
    )
    area = leaf + wood
    total = np.bincount(cells, area, nodes)
    return Amounts(
        np.bincount(cells, leaf, nodes),
        np.bincount(cells, wood, nodes),
        np.bincount(cells, polygons, nodes),
        np.bincount(cells, area * width, nodes) / np.where(total > 0, total, 1),
    )
