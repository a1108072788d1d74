# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Contents of tetrahedra: sub-plants, branches and explicit polygons, with their totals (paper, section 6.5).

Plants are shared among tetrahedra, see `shared_parts`. Polygons come from meshes that were modeled elsewhere; each is
in one tetrahedron. Totals are what decisions need: areas, numbers of polygons, and the width of features.

Polygons of divided tetrahedra are handed on to the children. What lies on one side of a plane goes there whole, what
crosses it is clipped. Nothing smaller than a pixel of the alpha buffer shows in the image: what reaches beyond a plane
by less than such a *slack* does not cross it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Chunks, Floats, Integers, Integers32, Mask, chunks, column, nested
from ..camera.camera import Camera
from ..compiled.flora import Flora, bounds, extents
from ..growth.foliage import are_solids, envelope_reach
from ..growth.growth import fullness
from ..growth.seasons import AREA, PRESENT
from ..growth.seeds import Branches
from ..subplants.pieces import Pieces, leaf_fraction, piece_leaf_integrals, wood_areas
from ..tetrahedra.tree import TetrahedralTree
from .polygons import Polygons, area_fractions

#: Side in pixels from which on a polygon is large: more than facets have, hidden ones included.
LARGE = 2.0
#: Among real leaves, wood counts as so many times as wide: a triangle is thrice as wide at its base as the wood.
TWIGS = 4.0
_NONE = np.zeros(0, np.int32)

Kind = TypeVar("Kind", Branches, Pieces, Polygons)


@dataclass(frozen=True)
class Totals(Arrays):
    """What each thing (sub-plant, piece, polygon) or each tetrahedron holds in total."""

    leaf_area: Floats  # (n,): one-sided area of leaves, m²
    wood_area: Floats  # (n,): surface of branches, m²
    polygons: Floats  # (n,): expected faces if made explicit
    #: (n,): width of the features, meters: that of the leaves, or of the branch where there are none. By tetrahedron:
    #: the mean, weighted by area. Infinite where polygons are drawn as they are whatever is decided; these count for a
    #: tetrahedron that holds nothing else.
    width: Floats

    @property
    def area(self) -> Floats:
        """Leaves and wood together (n,), m²."""
        return self.leaf_area + self.wood_area

    @property
    def optical_area(self) -> Floats:
        """Area (n,) that can block light, m²: leaves, and half of the wood, since closed branches show no more."""
        return self.leaf_area + self.wood_area / 2


def subplant_totals(flora: Flora, subplants: Branches) -> Totals:
    """Compiled means for sub-plants."""
    areas = flora.leaf_areas(subplants), flora.wood_areas(subplants)
    return Totals(*areas, flora.face_counts(subplants), feature_width(flora, subplants))


def feature_width(flora: Flora, subplants: Branches) -> Floats:
    """Width (n,) of the features of sub-plants, meters: that of their leaves, or of their branch without any."""
    row = subplants.row
    width = np.where(flora.leaf_count[row] > 0, flora.leaf_width[row] * subplants.scale, 2.0 * subplants.radius)
    if subplants.year is None:
        return width
    # Without leaves it is twigs that one sees; they count as where they stand among leaves.
    return flora.day.widths(subplants, width, np.minimum(width, TWIGS * flora.day.twig[row] * subplants.scale))


def piece_leaves(flora: Flora, pieces: Pieces) -> tuple[Floats, Floats]:
    """Expected number (n,) of leaves that branches themselves bear on pieces, and their area (n,), m²."""
    branches = pieces.branches
    row, leaf = branches.row, flora.leaf
    size, variation = flora.rows["leaf_size"][row].T
    leaves = flora.rows["leaves"][row, 0] * fullness(flora.rows, branches) * leaf_fraction(flora, pieces)
    area = leaves * (size**2 + variation**2 / 3) * leaf.area[row] * branches.scale**2
    if flora.rows["gradient"].any():
        area = area * piece_leaf_integrals(flora, pieces)[0]
    if branches.year is not None:
        left = flora.day.left(branches, flora.rows["leaf_kind"][row], AREA, PRESENT)
        area, leaves = area * left[0], leaves * left[1]
    return leaves, area


def piece_totals(flora: Flora, pieces: Pieces) -> Totals:
    """Compiled means for pieces: the wood, and the leaves that the branch itself bears there."""
    branches, (leaves, area) = pieces.branches, piece_leaves(flora, pieces)
    row, leaf = branches.row, flora.leaf
    size = flora.rows["leaf_size"][row, 0]
    width = np.where(leaves > 0, leaf.width[row] * size * branches.scale, 2 * branches.radius)
    if branches.year is not None:
        width = flora.day.widths(branches, width, np.minimum(width, TWIGS * 2 * branches.radius))
    return Totals(area, wood_areas(flora, pieces), leaves * leaf.polygons[row] + flora.rows["sides"][row], width)


def polygon_totals(polygons: Polygons, width: Floats | None = None) -> Totals:
    """Totals of explicit polygons, without what is transparent; ``width`` (n,) replaces that of the surfaces."""
    meshes, face = polygons.meshes, polygons.face
    area = polygons.areas() * meshes.coverage[meshes.slot[face]]
    solid = meshes.solid[face]
    if width is None:
        width = meshes.width[face] * meshes.mean_scale[polygons.instance]
    return Totals(np.where(solid, 0.0, area), np.where(solid, area, 0.0), np.ones(len(face)), width)


def sums(totals: Totals, cells: Integers, number: int) -> Totals:
    """Totals of each of a number of cells, from those (n,) of the things in ``cells`` (n,); the width is a mean."""
    area, width, large = totals.area, totals.width, ~np.isfinite(totals.width)
    if large.any():
        area, width = (np.where(large, 0.0, measure) for measure in (area, width))
    total = np.bincount(cells, area, number)
    width = np.bincount(cells, area * width, number) / np.where(total > 0, total, 1)
    only_large = (total == 0) & (np.bincount(cells[large], minlength=number) > 0)
    added = (np.bincount(cells, of, number) for of in (totals.leaf_area, totals.wood_area, totals.polygons))
    return Totals(*added, np.where(only_large, np.inf, width))


@dataclass(frozen=True)
class PlantParts(Arrays):
    """Parts of plants (n): sub-plants, and branches without what grows on them."""

    branches: Branches = nested(Branches)  # of n
    branch_only: Mask = column(dtype=bool)  # (n,): only the branch itself, with the leaves that it bears
    totals: Totals = nested(Totals)  # of n
    extent: Floats  # (n,): longest side, meters

    @classmethod
    def of_subplants(cls, flora: Flora, branches: Branches) -> Self:
        """Whole sub-plants (n,)."""
        bound = extents(flora, branches, farthest=False)
        extent = np.maximum(2.0 * bound[:, 0], bound[:, 2] - bound[:, 1]) * branches.length
        # Leaves of a solid have places of their own, however few of them are asked for.
        return cls(branches, are_solids(flora.rows)[branches.row], subplant_totals(flora, branches), extent)

    @classmethod
    def of_branches(cls, flora: Flora, branches: Branches) -> Self:
        """Branches (n,) without what grows on them."""
        extent = branches.length * np.maximum(1.0, 2.0 * envelope_reach(flora.rows)[branches.row])
        return cls(branches, np.ones(len(branches), bool), piece_totals(flora, as_pieces(branches)), extent)

    def can_open(self, flora: Flora) -> Mask:
        """Parts (n,) on which something else grows."""
        row = self.branches.row
        return ~self.branch_only & ((flora.rows["next"][row] >= 0).any(axis=1) | flora.rows["phantom"][row])


def as_pieces(branches: Branches) -> Pieces:
    """Branches (n,) as one piece each, from base to tip as if they were straight."""
    none = np.zeros(len(branches))
    tip = branches.position + branches.length[:, None] * branches.frame[:, :, 2]
    return Pieces(branches, none, none + 1.0, branches.position, tip)


@dataclass(frozen=True)
class InCells(Arrays, Generic[Kind]):
    """Things of one kind (n), each in one node of the tree."""

    items: Kind  # of n
    cell: Integers32  # (n,): node that holds each
    totals: Totals  # of n

    @classmethod
    def none(cls, kind: type[Kind]) -> "InCells[Kind]":
        """Nothing of a kind."""
        return cls(kind.empty(), _NONE, Totals.empty())


@dataclass(frozen=True)
class Contents:
    """Sub-plants, branches as one piece each, and explicit polygons, in terminal tetrahedra.

    A part of a plant that is shared by several tetrahedra is there once for each, with what that one holds of it.
    """

    subplants: InCells[Branches] = field(default_factory=lambda: InCells.none(Branches))
    pieces: InCells[Pieces] = field(default_factory=lambda: InCells.none(Pieces))
    polygons: InCells[Polygons] = field(default_factory=lambda: InCells.none(Polygons))


def in_the_root(polygons: Polygons, camera: Camera | None = None) -> InCells[Polygons]:
    """Polygons (n,), all in the root; those that are large for a camera stay polygons whatever is decided on cells."""
    totals = polygon_totals(polygons)
    if camera is not None:
        totals = replace(totals, width=np.where(_large_polygons(polygons, camera), np.inf, totals.width))
    return InCells(polygons, np.zeros(len(polygons), np.int32), totals)


class PolygonsByCell(Chunks[InCells[Polygons]]):
    """Polygons in terminal nodes while a tree is divided: only what lies in divided nodes is taken out and copied."""

    def __len__(self) -> int:
        return super().__len__() - self.marked

    @property
    def polygons(self) -> InCells[Polygons]:
        """All together; copies them into one, which is then kept until something changes."""
        return self.joined()

    def totals(self, chosen: Mask) -> list[tuple[Totals, Integers32]]:
        """Totals of polygons in chosen nodes, a mask (nodes,), and their nodes; one pair for each chunk."""
        parts = [chunk.take(chosen[chunk.cell] & present) for chunk, present in self.chunks()]
        return [(part.totals, part.cell) for part in parts]

    def take_within(self, chosen: Mask) -> InCells[Polygons]:
        """Remove and return what lies in chosen nodes; ``chosen`` is (nodes,) bool."""
        within = [chosen[chunk.cell] & present for chunk, present in self.chunks()]
        out = self.take_out(np.flatnonzero(np.concatenate(within)))
        if self.marked > len(self):  # copying what stays each time would cost more than all else that moves
            self.joined()
        return out


def _large_polygons(polygons: Polygons, camera: Camera) -> Mask:
    """Polygons (n,) too large for a facet; leaves never are, since one facet may stand for several."""
    meshes, face = polygons.meshes, polygons.face
    optical = polygons.areas() * np.where(meshes.solid[face], 0.5, 1.0)
    return ~meshes.leaf[face] & (optical >= (LARGE * camera.extent_around(polygons.center)) ** 2)


def bounding_capsules(flora: Flora, subplants: Branches) -> Floats:
    """Bodies that hold all vertices of sub-plants, from the compiled bounds alone.

    Returns
    -------
    (9, n) float64
        A cylinder and a pad about it, meters in world space: center (3), axis (3), radius, half of the height, pad.
    """
    bound, pad = bounds(flora, subplants)
    bound = bound.T
    out = np.empty((9, len(subplants)))
    out[3:6] = subplants.frame[:, :, 2].T
    out[:3] = subplants.position.T + (bound[1] + bound[2]) / 2 * out[3:6]
    out[6], out[7] = bound[0], (bound[2] - bound[1]) / 2
    out[8] = pad
    return out


def bounding_box(flora: Flora, subplants: Branches) -> Floats:
    """Axis-aligned box (2, 3) of all sub-plants' bounds, meters."""
    capsules = bounding_capsules(flora, subplants)
    axis = np.abs(capsules[3:6])
    reach = capsules[7] * axis + capsules[6] * np.sqrt(np.maximum(1 - axis**2, 0)) + capsules[8]
    return np.stack([(capsules[:3] - reach).min(axis=1), (capsules[:3] + reach).max(axis=1)])


#: Meters (n,) at points (n, 3) that make no difference in the image.
Slack = Callable[[Floats], Floats]

#: Triangles of polygons that are lowered at a time; bounds what that takes to some hundred megabytes.
DESCEND_BATCH = 200_000


def _cut(polygons: Polygons, planes: Floats, slack: Floats | float = 0.0) -> tuple[Integers, Integers, Polygons]:
    """Clip polygons (n,) by a plane (n, 4) each: owners, sides (0 where the distance is negative, else 1), fragments.

    Triangles that reach beyond their plane by no more than ``slack`` (n,), in meters, stay whole. One that crosses
    leaves one fragment on one side and two on the other.
    """
    owner, whole = polygons.as_fragments()
    distance = whole.corner_distances(planes[owner])
    low, high = distance.min(axis=1, initial=np.inf), distance.max(axis=1, initial=-np.inf)
    loose = np.broadcast_to(slack, len(polygons))[owner]
    crosses = np.minimum(-low, high) > np.maximum(loose, whole.touching())
    stays, crossing = np.flatnonzero(~crosses), np.flatnonzero(crosses)
    positive = distance[crossing] >= 0
    # The corner that is alone on its side comes first.
    alone = np.where(positive.sum(axis=1) == 1, positive.argmax(axis=1), positive.argmin(axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    w = np.take_along_axis(whole.weights[crossing], turn[:, :, None], axis=1)
    d = np.take_along_axis(distance[crossing], turn, axis=1)
    places = (np.clip(d[:, :1] / (d[:, :1] - d[:, k : k + 1]), 0.0, 1.0) for k in (1, 2))
    first, second = (w[:, 0] + (w[:, k] - w[:, 0]) * place for k, place in enumerate(places, 1))
    fragments = (w[:, 0], first, second), (first, w[:, 1], w[:, 2]), (first, w[:, 2], second)
    weights = np.concatenate([np.stack(corners, axis=1) for corners in fragments])
    sides = (d[:, 0] >= 0).astype(np.int64)
    from_, side = np.tile(crossing, 3), np.concatenate([sides, 1 - sides, 1 - sides])
    kept = np.flatnonzero(area_fractions(weights) > 0)  # a cut through a corner leaves pieces of no size
    weights, from_, side = weights[kept], from_[kept], side[kept]
    new = Polygons.fragments(polygons.meshes, whole.face[from_], whole.instance[from_], whole.triangle[from_], weights)
    larger = (high[stays] >= -low[stays]).astype(np.int64)
    parts = Polygons.concatenate([whole.take(stays), new])
    return np.concatenate([owner[stays], owner[from_]]), np.concatenate([larger, side]), parts


def sort_into_children(tree: TetrahedralTree, held: InCells[Polygons], slack: Slack) -> InCells[Polygons]:
    """Hand polygons of divided nodes on until all lie in terminal ones.

    What reaches no further than ``slack`` beyond a plane stays whole. Nothing is lost or held twice.
    """
    placed = [InCells.none(Polygons)]
    while len(held):
        polygons, cells, crosses = held.items, held.cell.copy(), np.zeros(len(held), bool)
        for run in chunks(polygons.triangle_counts, DESCEND_BATCH):
            cells[run], crosses[run] = _lowered(tree, polygons.take(run), cells[run], slack)
        placed.append(replace(held, cell=cells).take(~crosses))
        polygons, cells, width = polygons.take(crosses), cells[crosses], held.totals.width[crosses]
        owner, side, polygons = _cut(polygons, tree.planes(cells), slack(polygons.center))
        held = InCells(polygons, tree.children[cells[owner], side], polygon_totals(polygons, width[owner]))
    return InCells.concatenate(placed)


def _lowered(tree: TetrahedralTree, polygons: Polygons, cells: NDArray, slack: Slack) -> tuple[Integers32, Mask]:
    """Nodes (n,) that polygons come down to whole, and whether they cross the planes of these."""
    cells, crosses = cells.copy(), np.zeros(len(polygons), bool)
    center, reach, touching = polygons.center, polygons.reach, polygons.touching()
    moving = np.flatnonzero(tree.children[cells, 0] >= 0)
    while len(moving):
        planes = tree.planes(cells[moving])
        distance = np.einsum("ni,ni->n", np.take(center, moving, axis=0), planes[:, :3]) + planes[:, 3]
        whole = np.abs(distance) > np.take(reach, moving)
        # The sphere is a first guess; slack and corners are computed only for what it leaves open.
        unclear = np.flatnonzero(~whole)
        close = moving[unclear]
        loose = np.maximum(touching[close], slack(center[close]))
        whole[unclear] = np.abs(distance[unclear]) > reach[close] - loose
        left = np.flatnonzero(~whole[unclear])
        if len(left):
            low, high = polygons.take(close[left]).distances(planes[unclear[left]])
            whole[unclear[left]] = np.minimum(-low, high) <= loose[left]
            distance[unclear[left]] = high + low  # the larger part says where it goes
        crosses[moving[~whole]] = True
        moving, side = moving[whole], (distance[whole] >= 0).astype(np.int64)
        cells[moving] = nodes = tree.children[cells[moving], side]
        moving = moving[tree.children[nodes, 0] >= 0]
    return cells, crosses
