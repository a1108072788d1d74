# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much there is of things and in tetrahedra, as far as decisions need it: areas, polygons, size of features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays
from ..plants.averages import own_leaf_integrals
from ..plants.branches import Branches
from ..plants.compiled import Flora
from ..plants.growth import fullness
from ..plants.pieces import Pieces, leaf_fraction, outward_ends, wood_areas
from .polygons import Polygons


@dataclass(frozen=True)
class Amounts(Arrays):
    """How much each thing (sub-plant or piece) or each tetrahedron holds.

    Attributes
    ----------
    leaf_area : (n,) float64
        One-sided area of leaves, m².
    wood_area : (n,) float64
        Surface of branches, m².
    polygons : (n,) float64
        Expected faces if made explicit.
    width : (n,) float64
        Width of the features, metres: that of the leaves, or of the branch where there are none. By tetrahedron: the
        mean, weighted by area. Infinite where polygons are drawn as they are whatever is decided; these count for a
        tetrahedron that holds nothing else.
    """

    leaf_area: NDArray[np.float64]
    wood_area: NDArray[np.float64]
    polygons: NDArray[np.float64]
    width: NDArray[np.float64]

    @property
    def area(self) -> NDArray[np.float64]:
        """Leaves and wood together (n,), m²."""
        return self.leaf_area + self.wood_area

    @property
    def optical_area(self) -> NDArray[np.float64]:
        """What can hold up light (n,), m²: leaves, and half of the wood, as closed branches show no more than that."""
        return self.leaf_area + self.wood_area / 2


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


def polygon_amounts(polygons: Polygons, width: NDArray[np.float64] | None = None) -> Amounts:
    """What explicit polygons are, as far as they are not transparent; ``width`` (n,) in place of the surfaces' own."""
    meshes, face = polygons.meshes, polygons.face
    area = polygons.areas() * meshes.coverage[meshes.slot[face]]
    solid = meshes.solid[face]
    if width is None:
        width = meshes.width[face] * meshes.mean_scale[polygons.instance]
    return Amounts(np.where(solid, 0.0, area), np.where(solid, area, 0.0), np.ones(len(face)), width)


def _size_factors(flora: Flora, pieces: Pieces) -> NDArray[np.float64] | float:
    """Mean factor (n,) on the area of leaves of pieces, by how far outside in the crown they sit."""
    if not flora.rows["gradient"].any():
        return 1.0
    low, high = outward_ends(flora, pieces)
    return own_leaf_integrals(flora.rows["leaf_size_tip"][pieces.branches.row], low, high)[0]


def sums(amounts: Amounts, cells: NDArray[np.integer], number: int) -> Amounts:
    """Sums over the things (n,) in each of a number of cells, given by ``cells`` (n,); the width is a mean."""
    area, fine = amounts.area, np.isfinite(amounts.width)
    small = np.where(fine, area, 0.0)
    total = np.bincount(cells, small, number)
    width = np.bincount(cells, small * np.where(fine, amounts.width, 0.0), number) / np.where(total > 0, total, 1)
    only_large = (total == 0) & (np.bincount(cells, ~fine, number) > 0)
    return Amounts(
        np.bincount(cells, amounts.leaf_area, number),
        np.bincount(cells, amounts.wood_area, number),
        np.bincount(cells, amounts.polygons, number),
        np.where(only_large, np.inf, width),
    )
