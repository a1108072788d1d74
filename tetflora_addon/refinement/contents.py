# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tetrahedra hold, and the update step: handing it on to the children of divided ones (paper, section 6.5).

A plant is held as a sub-plant while it lies on one side of every plane. Where it crosses one it is opened into the
sub-plants of the next order and the pieces of its own branch; pieces that cross are clipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..plants.averages import own_leaf_integrals
from ..plants.compiled import Flora
from ..plants.expansion import open_subplants
from ..plants.growth import Branches, fullness, trunks
from ..plants.pieces import Pieces, clipped, leaf_fraction, outward_ends, wood_areas
from ..plants.seeds import Seeds
from ..plants.sides import body_distances, bounding_bodies, crossing
from ..plants.vectors import gathered
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
        cells, opened = _lowered(flora, tree, subplants, cells)
        placed.append(subplants.take(~opened))
        placed_cells.append(cells[~opened])
        parts, part_cells = [Branches.empty()], [np.zeros(0, np.int32)]
        for chosen in _alike(flora, subplants, np.flatnonzero(opened)):
            grown, owner, pieces, piece_owner = open_subplants(flora, subplants.take(chosen))
            parts.append(grown)
            part_cells.append(cells[chosen[owner]])
            loose.append(pieces)
            loose_cells.append(cells[chosen[piece_owner]])
        subplants, cells = Branches.concatenate(parts), np.concatenate(part_cells)
    pieces, piece_cells = _push_down_pieces(tree, Pieces.concatenate(loose), np.concatenate(loose_cells))
    return Contents(Branches.concatenate(placed), np.concatenate(placed_cells), pieces, piece_cells)


def _lowered(
    flora: Flora, tree: TetrahedralTree, subplants: Branches, cells: NDArray
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Nodes (n,) that sub-plants come down to whole, and whether they cross the planes of these."""
    cells, crosses = cells.copy(), np.zeros(len(subplants), bool)
    bodies = bounding_bodies(flora, subplants)
    moving = np.argsort(subplants.row, kind="stable")  # all of a row together, as they are looked at
    while True:
        moving = moving[tree.children[cells[moving], 0] >= 0]
        if len(moving) == 0:
            return cells, crosses
        planes = tree.planes(cells[moving])
        distance, reach = body_distances(np.take(bodies, moving, axis=1), planes)
        side = (distance > 0).astype(np.int64)
        straddling = np.flatnonzero(np.abs(distance) <= reach)
        found, side[straddling] = crossing(flora, subplants.take(moving[straddling]), planes[straddling])
        whole = np.ones(len(moving), bool)
        whole[straddling[found]] = False
        crosses[moving[~whole]] = True
        moving, side = moving[whole], side[whole]
        cells[moving] = tree.children[cells[moving], side]


def _alike(flora: Flora, subplants: Branches, chosen: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Runs of sub-plants whose branches have as many segments: bending takes as long for all as for the most."""
    segments = flora.rows["segments"][subplants.row[chosen]]
    for number in np.unique(segments):
        some = chosen[segments == number]
        yield from np.split(some, np.arange(OPENED_AT_ONCE, len(some), OPENED_AT_ONCE))


def _push_down_pieces(tree: TetrahedralTree, pieces: Pieces, cells: NDArray) -> tuple[Pieces, NDArray[np.int32]]:
    placed, placed_cells = [Pieces.empty()], [np.zeros(0, np.int32)]
    while len(pieces):
        cells, cut = cells.copy(), np.zeros(len(pieces), bool)
        from_start, from_end = np.zeros((2, len(pieces)))
        moving = np.arange(len(pieces))
        while True:
            moving = moving[tree.children[cells[moving], 0] >= 0]
            if len(moving) == 0:
                break
            plane = tree.planes(cells[moving])
            start, end = (
                np.einsum("ni,ni->n", plane[:, :3], gathered(p, moving)) + plane[:, 3]
                for p in (pieces.start, pieces.end)
            )
            whole = (start < 0) == (end < 0)
            crossing_ones = moving[~whole]
            cut[crossing_ones] = True
            from_start[crossing_ones], from_end[crossing_ones] = start[~whole], end[~whole]
            moving, side = moving[whole], (start[whole] >= 0).astype(np.int64)
            cells[moving] = tree.children[cells[moving], side]
        placed.append(pieces.take(~cut))
        placed_cells.append(cells[~cut])
        children = tree.children[cells[cut]]
        lower, upper = clipped(pieces.take(cut), from_start[cut], from_end[cut])
        first, every = (from_start[cut] >= 0).astype(np.int64), np.arange(len(children))
        pieces = Pieces.concatenate([lower, upper])
        cells = np.concatenate([children[every, first], children[every, 1 - first]])
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
