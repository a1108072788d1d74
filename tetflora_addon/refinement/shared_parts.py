# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of what is refined, shared among tetrahedra by points on them: what plants and assets have in common.

A part that crosses planes stays whole. Points on it, which stand for equal fractions of its area, go down the tree,
and each tetrahedron holds the fraction whose points it holds. Only where a tetrahedron is divided that is not much
larger than a part is the part opened. Instances of assets are clusters, opened as sub-plants are (section 6.5).

The paper opens a sub-plant as soon as a plane crosses it (section 6.5). Most of what is so opened is never seen: a
plane of the first tetrahedra runs through the crowns of a whole forest. Here it is opened late: into the
branch itself and the sub-plants of the next order, with points of their own. The number of points follows the size in
the image, so that the work is bounded by what the image shows.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Chunks, Floats, Floats32, Growing, Integers, Integers32, Keys, Mask, column, nested, spread
from ..assets.asset import AssetTable, Instances
from ..camera.camera import Camera
from ..compiled.flora import Flora, placed_samples
from ..compiled.samples import Points
from ..growth.axes import Axes, axes
from ..growth.foliage import are_solids, leaf_keys, leaf_sites, leaf_start
from ..growth.growth import open_branches, radius_at, trunks
from ..growth.hashing import child_key, uniform
from ..growth.seeds import Branches, Seeds
from ..parallel import blocks, each_on_all_cores
from ..subplants.pieces import Pieces
from ..tetrahedra.tree import TetrahedralTree
from .contents import InCells, PlantParts, Totals, as_pieces, sums

#: Parts larger than this many times the longest edge of a tetrahedron that is divided are opened.
LARGE = 1.6
#: Points that are lowered at a time; bounds what that takes.
DESCEND_BATCH = 200_000
#: Parts that have been opened are dropped once they are more than one in so many.
_OPENED = 3

Parts = TypeVar("Parts", bound=Arrays)


@dataclass(frozen=True)
class SharePoints(Arrays):
    """Points (m) on parts of plants; each stands for a fraction of its part's area."""

    part: Integers32 = column(dtype=np.int32)  # (m,)
    cell: Integers32 = column(dtype=np.int32)  # (m,): node of the tree that the point is in
    position: Floats32 = column(3, dtype=np.float32)  # (m, 3): meters, world space
    #: leaf and wood, (m,): area that it stands for, m²; one of the two is 0.
    leaf: Floats32 = column(dtype=np.float32)
    wood: Floats32 = column(dtype=np.float32)

    @property
    def optical_area(self) -> Floats32:
        """Area (m,) that can block light, m²."""
        return self.leaf + self.wood / 2


def _descend(tree: TetrahedralTree, points: SharePoints, wanted: Integers | None = None) -> Integers32:
    """Terminal nodes (m,) that points, or only some (k,) of them, are in below those that they are known to be in."""
    cell, children = points.cell if wanted is None else points.cell[wanted], tree.children.reshape(-1)
    every = np.flatnonzero(np.take(children, 2 * cell) >= 0)
    cell = cell.copy()

    def lower(block: slice) -> None:
        moving = every[block]
        place = np.take(points.position, moving if wanted is None else wanted[moving], axis=0).astype(np.float64)
        while len(moving):
            nodes = np.take(cell, moving)
            plane = tree.planes(nodes)
            side = plane[:, 3] + np.einsum("ni,ni->n", plane[:, :3], place) >= 0.0
            nodes = np.take(children, 2 * nodes + side)
            cell[moving] = nodes
            left = np.flatnonzero(np.take(children, 2 * nodes) >= 0)
            if len(left) < len(moving):
                moving, place = moving[left], np.take(place, left, axis=0)

    each_on_all_cores(lower, blocks(len(every), DESCEND_BATCH))
    return cell


@dataclass(frozen=True)
class _Figures(Arrays):
    """What a pass asks of all parts (n): the extent of those that can be opened (meters, else 0), their totals."""

    reach: Floats
    area: Floats
    polygons: Floats
    width: Floats


class SharedParts(Generic[Parts]):
    """All parts of one kind, and the points on them; changes as the tree is divided.

    A pass costs what it changes. Parts that it opens are only marked, and new ones stay in chunks of their own, until
    somebody asks for `parts` or `points`; new points take the places of those on opened parts.

    Parts are `Arrays` with the columns ``totals`` and ``extent``, meters. Subclasses say what opens and its points.

    Parameters
    ----------
    filled : bool
        Whether proxies fill their tetrahedra, so that small ones without points would be holes.
    """

    def __init__(self, camera: Camera, filled: bool) -> None:
        self.camera, self._times = camera, FILLED if filled else 1

    def can_open(self, parts: Parts) -> Mask:
        """Parts (n,) that consist of others."""
        raise NotImplementedError

    def opened(self, parts: Parts) -> Iterator[tuple[Parts, Integers, Any]]:
        """New parts, some at a time, with those (m,) that they come from, and what `points_on` wants to know."""
        raise NotImplementedError

    def points_on(self, parts: Parts, known: Any) -> SharePoints:
        """Points on parts (n,), all in the root; ``known`` is of `opened`, None at first."""
        raise NotImplementedError

    def branch_only(self, parts: Parts) -> Mask:
        """Parts (n,) that count apart from others, as branches without what grows on them."""
        return np.zeros(len(parts), bool)

    def hold(self, parts: Parts, points: SharePoints) -> None:
        """Begin with parts and the points on them."""
        self._parts, self._figures = Chunks(parts), Growing(self._figures_of(parts))
        self._points, self._alone = Growing(points), int(self.branch_only(parts).sum())

    def _figures_of(self, parts: Parts) -> _Figures:
        reach, totals = np.where(self.can_open(parts), parts.extent, 0.0), parts.totals
        return _Figures(reach, totals.area, totals.polygons, totals.width)

    @property
    def parts(self) -> Parts:
        """All parts, in one piece: asking costs a copy of them where a pass has opened some, and changes no result."""
        return self._drop_opened()

    @property
    def points(self) -> SharePoints:
        """All points, of `parts`; valid until the next pass."""
        self._drop_opened()
        return self._points.rows

    @property
    def numbers(self) -> tuple[int, int]:
        """How many parts there are that do not, and that do count apart."""
        return len(self._parts) - self._parts.marked - self._alone, self._alone

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays, with what waits to be dropped and room to spare."""
        return self._parts.nbytes + self._figures.nbytes + self._points.nbytes

    def update(self, tree: TetrahedralTree, dividing: Mask, edge: Floats) -> NDArray:
        """Hand points in divided nodes on, and open what is large there.

        Parameters
        ----------
        dividing : (nodes,) bool
            Nodes that have been divided.
        edge : (nodes,) float64
            Their longest edge, meters.

        Returns
        -------
        (nodes,) bool
            Nodes whose contents have changed.
        """
        points = self._points.rows
        changed = dividing.copy()
        inside = np.flatnonzero(dividing[points.cell])
        part = np.take(points.part, inside)
        large = np.take(self._figures.rows.reach, part) > LARGE * np.take(edge, np.take(points.cell, inside))
        # Handed on in place: millions of points that stay where they are are not looked at.
        points.cell[inside] = cell = _descend(tree, points, inside)
        changed[cell] = True
        if large.any():
            opening = np.zeros(len(self._parts), bool)
            opening[part[large]] = True
            changed[self.open(opening, tree)] = True
        return changed

    def open(self, opening: Mask, tree: TetrahedralTree | None) -> Integers32:
        """Open parts (n,); returns nodes (k,) of points that leave or come. Without a tree these stay in the root."""
        gone = np.flatnonzero(opening[self._points.rows.part])
        count, parts, points = len(self._parts), [], []
        for new, _, known in self.opened(self._parts.take_out(np.flatnonzero(opening))):
            batch = self.points_on(new, known)
            points.append(replace(batch, part=batch.part + np.int32(count)))
            parts.append(new)
            count += len(new)
        new_parts, new_points = self._parts.kind.concatenate(parts), SharePoints.concatenate(points)
        if tree is not None:
            new_points = replace(new_points, cell=_descend(tree, new_points))
        left = np.take(self._points.rows.cell, gone)
        self._points.exchange(gone, new_points)
        self._parts.append(new_parts)
        self._figures.append(self._figures_of(new_parts))
        self._alone += int(self.branch_only(new_parts).sum())
        if _OPENED * self._parts.marked > len(self._parts):
            self._drop_opened()
        return np.concatenate([left, new_points.cell])

    def _drop_opened(self) -> Parts:
        """All parts, after those that have been opened are dropped and the others numbered anew."""
        if self._parts.marked:
            present = self._parts.unmarked
            part = self._points.rows.part
            part[:] = (np.cumsum(present) - 1).astype(np.int32)[part]
            self._figures = Growing(self._figures.rows.take(present))
        return self._parts.joined()

    def held(self, nodes: int) -> InCells[Parts]:
        """Parts, once for each node that holds some of them, with the totals of that."""
        parts, points = self.parts, self.points
        pair, row = np.unique(points.part.astype(np.int64) * nodes + points.cell, return_inverse=True)
        totals, _ = self.totals(np.ones(nodes, bool))
        return InCells(parts.take(pair // nodes), (pair % nodes).astype(np.int32), sums(totals, row, len(pair)))

    def totals(self, chosen: Mask) -> tuple[Totals, Integers32]:
        """Totals (k,) of points in chosen nodes, a mask (nodes,), and their nodes (k,)."""
        points, figures = self._points.rows, self._figures.rows
        cell, part, leaf, wood = points.cell, points.part, points.leaf, points.wood
        if not chosen.all():
            inside = np.flatnonzero(chosen[cell])
            cell, part, leaf, wood = (np.take(array, inside) for array in (cell, part, leaf, wood))
        fraction = (leaf + wood) / np.maximum(np.take(figures.area, part), 1e-300)
        return Totals(leaf, wood, np.take(figures.polygons, part) * fraction, np.take(figures.width, part)), cell


#: Pixels along a part for each of its points on leaves; fewest and most of these; points on wood for each of them.
PIXELS_A_POINT, FEWEST, MOST, WOOD = 6.0, 4, 64, 0.25
#: The same of leaves that fill a solid, which cannot be opened: there is a point in each square of so many pixels.
PIXELS_IN_SOLID, FEWEST_IN_SOLID, MOST_IN_SOLID = 3.0, 16, 2048
#: Points beyond the fewest that all parts of a refinement get together: many thousands may lie in front of each other.
MOST_BEYOND = 1_000_000
#: Wood that is wider in the view than this part of the image is looked for where it is, whatever share of its plant it
#: has: such sub-plants are opened at once, and their branches have points so many widths apart, at most so many.
THICK, APART, MOST_ALONG = 0.08, 1.0, 96
#: Places on a branch at which it is asked how wide it is.
_PLACES = np.linspace(0.0, 1.0, 9)
#: How many times as many points there are where proxies fill their tetrahedra.
FILLED = 4
#: Sub-plants that are opened at a time; bounds what that takes to some hundred megabytes.
OPEN_BATCH = 40_000
#: Draws of this module: where a part's run of samples starts, of plants and of assets.
_START, _ASSET_START = 221, 251


def _share_points(
    flora: Flora,
    parts: PlantParts,
    pixels: Floats,
    lines: Axes | None = None,
    times: int = 1,
    along: Integers | int = 0,
    room: int = MOST_BEYOND,
) -> SharePoints:
    """Points on sub-plants that so many pixels (n,) show, or with ``lines`` on branches alone; all in the root.

    They are so many times as many as usual, on wood of branches alone at least as many as ``along`` (n,), and on leaves
    of all at most as many as there is ``room`` for beyond the fewest.
    """
    solid = are_solids(flora.rows)[parts.branches.row]
    squares = np.clip((pixels / PIXELS_IN_SOLID) ** 2, FEWEST_IN_SOLID, MOST_IN_SOLID)
    # Cells that are filled are smaller than what cannot be opened: too few points make holes and lumps of it.
    times_each, least = np.where(solid, times**2, times), np.where(solid, FEWEST_IN_SOLID, FEWEST)
    number = np.where(solid, squares, np.clip(pixels / PIXELS_A_POINT, FEWEST, MOST))
    beyond = times_each * (np.ceil(number).astype(np.int64) - least)
    part = min(room / max(beyond[parts.totals.leaf_area > 0].sum(), 1), 1.0)
    number = times_each * least + (beyond * part).astype(np.int64)
    wood = np.maximum(np.ceil(WOOD * number).astype(np.int64), along)
    groups = []
    for leafy in (True, False):
        area = parts.totals.leaf_area if leafy else parts.totals.wood_area
        count = np.where(area > 0, number if leafy else wood, 0)
        owner, index = spread(count)
        even = (area / np.maximum(count, 1))[owner]
        if lines is not None:
            t = (index + 0.5) / count[owner]
            if leafy:
                position = _on_leaves(flora, parts.branches, lines, owner, index, t)
            else:  # thicker parts have more of the wood
                thick = radius_at(flora.rows, parts.branches.take(owner), t)
                mean = np.bincount(owner, thick, len(parts)) / np.maximum(count, 1)
                even = even * thick / np.maximum(mean, 1e-300)[owner]
                position = lines.at(owner, t)[0]
        else:
            points = flora.samples.leaves if leafy else flora.samples.wood
            position, share = _sampled(flora, points, parts.branches, owner, index)
            even = even if share is None else even * share
            in_solid = np.flatnonzero(solid[owner])
            if leafy and len(in_solid):  # more places than samples
                given = owner[in_solid], index[in_solid], (index[in_solid] + 0.5) / count[owner[in_solid]]
                position[in_solid] = _on_leaves(flora, parts.branches, axes(flora.rows, parts.branches), *given)
        none = np.zeros(len(owner), np.float32)
        areas = (even.astype(np.float32), none) if leafy else (none, even.astype(np.float32))
        groups.append(SharePoints(owner.astype(np.int32), none.astype(np.int32), position.astype(np.float32), *areas))
    return SharePoints.concatenate(groups)


def _on_leaves(flora: Flora, branches: Branches, lines: Axes, owner: Integers, index: Integers, part: Floats) -> Floats:
    """Places (m, 3) of leaves on branches, after parts (m,) of them; ``index`` (m,) numbers those of a branch."""
    start = leaf_start(flora.rows, branches)[owner]
    t, key = start + (1.0 - start) * part, leaf_keys(branches, owner, index)
    return leaf_sites(flora.rows, branches, lines, branches.row[owner], owner, key, t)[0]


def _sampled(
    flora: Flora, points: Points, branches: Branches, owner: Integers, index: Integers
) -> tuple[Floats, Floats | None]:
    """Places (m, 3) of samples of sub-plants, and what they stand for; runs of samples are spread over them."""
    first, number = points.runs(branches)
    start = (uniform(branches.key, _START) * number).astype(np.int64)
    pick = first[owner] + (start[owner] + index) % np.maximum(number[owner], 1)
    local, share = placed_samples(flora, points, branches, owner, pick)
    local = local.astype(np.float32) * branches.length[owner, None].astype(np.float32)
    frame, columns = branches.frame.astype(np.float32), np.ascontiguousarray(local.T)
    out = np.empty((len(owner), 3))
    for axis in range(3):
        place = np.take(branches.position[:, axis], owner)
        for column_ in range(3):
            place += np.take(frame[:, axis, column_], owner) * columns[column_]
        out[:, axis] = place
    return out, share


def opened(flora: Flora, parts: PlantParts) -> Iterator[tuple[PlantParts, Integers, Axes | None]]:
    """Open sub-plants into branches alone and the sub-plants of the next order.

    Yields
    ------
    PlantParts of m, (m,) int64, Axes or None
        Some of the new parts, of one of the two kinds, the part that each comes from, and the axes of branches alone.
    """
    segments = flora.rows["segments"][parts.branches.row]
    for number in np.flatnonzero(np.bincount(segments)):  # bending takes as long for all as for the most
        alike = np.flatnonzero(segments == number)
        for chosen in np.split(alike, np.arange(OPEN_BATCH, len(alike), OPEN_BATCH)):
            whole, body, grown, parent = open_branches(flora.rows, parts.branches.take(chosen))
            yield PlantParts.of_branches(flora, whole.branches), chosen[body], whole.lines
            if len(grown):
                yield PlantParts.of_subplants(flora, grown), chosen[body[parent]], None


class SharedPlants(SharedParts[PlantParts]):
    """All plants of a refinement, as parts and the points on them."""

    def __init__(self, flora: Flora, seeds: Seeds, camera: Camera, filled: bool = False) -> None:
        super().__init__(camera, filled)
        self.flora, self._room = flora, MOST_BEYOND
        parts = PlantParts.of_subplants(flora, trunks(flora.rows, seeds)) if len(seeds) else PlantParts.empty()
        self.hold(parts, self.points_on(parts, None) if len(seeds) else SharePoints.empty())
        while (near := self.thick(self.parts) & self.parts.can_open(flora)).any():
            self.open(near, None)

    def can_open(self, parts: PlantParts) -> Mask:
        """As `SharedParts.can_open`."""
        return parts.can_open(self.flora)

    def branch_only(self, parts: PlantParts) -> Mask:
        """Branches without what grows on them."""
        return parts.branch_only

    def opened(self, parts: PlantParts) -> Iterator[tuple[PlantParts, Integers, Axes | None]]:
        """As `opened` of this module."""
        return opened(self.flora, parts)

    def pixels(self, parts: PlantParts) -> Floats:
        """Extent (n,) of parts in the image."""
        return parts.extent / self.camera.extent_around(parts.branches.position)

    def thick(self, parts: PlantParts) -> Mask:
        """Parts (n,) whose own branch is wide in the view somewhere, as if it were straight."""
        branches, camera = parts.branches, self.camera
        axis = branches.length[:, None] * branches.frame[:, :, 2]
        # As far from a place as its branch may come into view.
        beside = branches.radius + 0.5 * branches.length / (len(_PLACES) - 1)
        width = 2.0 * branches.radius / (THICK * min(camera.width, camera.height))
        out = np.zeros(len(parts), bool)
        for place in _PLACES:
            points = branches.position + place * axis
            out |= (width > camera.extent_around(points)) & (camera.distance_to_view(points) < beside)
        return out

    def points_on(self, parts: PlantParts, lines: Axes | None) -> SharePoints:
        """As `SharedParts.points_on`."""
        along = 0
        if lines is not None:
            along = parts.branches.length / np.maximum(2.0 * APART * parts.branches.radius, 1e-300)
            along = np.where(self.thick(parts), np.minimum(along, MOST_ALONG), 0.0).astype(np.int64)
        points = _share_points(self.flora, parts, self.pixels(parts), lines, self._times, along, self._room)
        self._room -= min(self._room, max(len(points) - self._times * FEWEST * len(parts), 0))
        return points

    def held_apart(self, nodes: int) -> tuple[InCells[Branches], InCells[Pieces]]:
        """As `held`: sub-plants, and branches alone as one piece each."""
        every = self.held(nodes)
        intact, opened = (every.take(np.flatnonzero(every.items.branch_only == alone)) for alone in (False, True))
        pieces = as_pieces(opened.items.branches)
        return InCells(intact.items.branches, intact.cell, intact.totals), InCells(pieces, opened.cell, opened.totals)


#: Axes that differ in length by more than this are stretched, and the same of the cosine between them.
_EVEN = 1e-4


@dataclass(frozen=True)
class AssetParts(Arrays):
    """Clusters of instances (n)."""

    instance: Integers32 = column(dtype=np.int32)  # (n,)
    cluster: Integers32 = column(dtype=np.int32)  # (n,): of `AssetTable.clusters`
    center: Floats = column(3)  # (n, 3): middle of its bound, meters
    totals: Totals = nested(Totals)  # of n
    extent: Floats  # (n,): longest side of its bound, meters

    @property
    def reach(self) -> Floats:
        """Distance (n,) from the middle within which all of each is, meters."""
        return 0.5 * np.sqrt(3.0) * self.extent


class PlacedAssets:
    """Assets and their instances, and what a cluster of an instance is in the world."""

    def __init__(self, assets: AssetTable, instances: Instances) -> None:
        self.assets, self.instances = assets, instances
        self.scale, self.largest = instances.scale, instances.largest
        gram = np.einsum("nki,nkj->nij", instances.linear, instances.linear)
        even = self.scale[:, None, None] ** 2 * np.eye(3)
        self.stretched = (np.abs(gram - even) > _EVEN * self.scale[:, None, None] ** 2).any(axis=(1, 2))

    def __len__(self) -> int:
        return len(self.instances)

    @classmethod
    def none(cls) -> Self:
        """No instances."""
        return cls(AssetTable.none(), Instances.empty())

    def take(self, index: NDArray) -> Self:
        """Some instances (k,) or a mask (n,) of them."""
        return PlacedAssets(self.assets, self.instances.take(index))

    def wholes(self) -> AssetParts:
        """All instances as they are."""
        return self.parts(np.arange(len(self)), self.assets.root[self.instances.asset])

    def parts(self, instance: Integers, cluster: Integers) -> AssetParts:
        """Clusters (n,) of instances (n,)."""
        clusters = self.assets.clusters
        low, high = clusters.low[cluster], clusters.high[cluster]
        side = (high - low).max(axis=1) * self.largest[instance]
        leaf, wood = self._areas(instance, cluster)
        width = clusters.width[cluster] * self.scale[instance]
        totals = Totals(leaf, wood, clusters.faces[cluster].astype(np.float64), width)
        center = self.to_world((low + high) / 2, instance)
        return AssetParts(instance.astype(np.int32), cluster.astype(np.int32), center, totals, side)

    def children(self, parts: AssetParts) -> tuple[AssetParts, Integers]:
        """Children of clusters (n,), and whose each is (m,)."""
        clusters = self.assets.clusters
        owner, index = spread(clusters.children[parts.cluster].astype(np.int64))
        return self.parts(parts.instance[owner], clusters.child[parts.cluster][owner] + index), owner

    def kites(self, parts: AssetParts) -> Floats:
        """Corners (k, 4, 3) of kites for all leaves of clusters (n,), meters."""
        leaves, clusters, asset = self.assets.leaves, self.assets.clusters, self.instances.asset[parts.instance]
        owner, index = spread(clusters.leaves[parts.cluster].astype(np.int64))
        leaf = leaves.take((self.assets.first_leaf[asset] + clusters.first_leaf[parts.cluster])[owner] + index)
        corners = (leaf.center + sign * half for sign in (-1.0, 1.0) for half in (leaf.along, leaf.across))
        return np.stack([self.to_world(corner, parts.instance[owner]) for corner in corners], axis=1)

    def to_world(self, points: NDArray[np.floating], instance: Integers) -> Floats:
        """Points (n, 3) of assets' spaces in the world, by instances (n,)."""
        linear, out = self.instances.linear, self.instances.position[instance]
        for i in range(3):
            for k in range(3):
                out[:, i] += linear[instance, i, k] * points[:, k]
        return out

    def cofactors(self, instance: Integers) -> Floats:
        """Matrices (n, 3, 3) that take area vectors of assets' spaces to the world."""
        a, b, c = np.moveaxis(self.instances.linear[instance], 2, 0)
        return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)

    def _areas(self, instance: NDArray, cluster: NDArray) -> tuple[Floats, Floats]:
        """Areas (n,) of sheets and of solids, m²; where an instance is stretched, as its samples say."""
        clusters, scale = self.assets.clusters, self.scale[instance] ** 2
        leaf, wood = clusters.leaf_area[cluster] * scale, clusters.wood_area[cluster] * scale
        stretched = np.flatnonzero(self.stretched[instance])
        if len(stretched):
            rows, of = cluster[stretched], instance[stretched]
            number = (clusters.leaf_samples + clusters.wood_samples)[rows].astype(np.int64)
            owner, index = spread(number)
            normal = self.assets.samples.normal[clusters.leaf_sample[rows][owner] + index].astype(np.float64)
            turned = np.einsum("nij,nj->ni", self.cofactors(of[owner]), normal)
            longer = np.bincount(owner, np.linalg.norm(turned, axis=1), len(rows)) / number
            leaf[stretched] *= longer / scale[stretched]
            wood[stretched] *= longer / scale[stretched]
        return leaf, wood

    def closed_leaves(self, parts: AssetParts) -> Floats:
        """Area (n,) of solids that facets stand for as for leaves, m²."""
        clusters = self.assets.clusters
        part = clusters.closed_leaf_area[parts.cluster] / np.maximum(clusters.wood_area[parts.cluster], 1e-300)
        return parts.totals.wood_area * part

    def keys(self, parts: AssetParts) -> Keys:
        """A key (n,) for each part, which tells it apart from all others of all instances."""
        local = parts.cluster - self.assets.root[self.instances.asset[parts.instance]]
        return child_key(self.instances.key[parts.instance], local)

    def picked(self, parts: AssetParts, key: Keys, leafy: bool, owner: Integers, index: NDArray) -> Integers:
        """Samples (m,) of parts (n,) with keys (n,): a run on leaves, or on wood, that begins anywhere."""
        clusters = self.assets.clusters
        first = (clusters.leaf_sample if leafy else clusters.wood_sample)[parts.cluster].astype(np.int64)
        number = (clusters.leaf_samples if leafy else clusters.wood_samples)[parts.cluster].astype(np.int64)
        start = (uniform(key, _ASSET_START) * number).astype(np.int64)
        return first[owner] + (start[owner] + index) % np.maximum(number[owner], 1)


class SharedAssets(SharedParts[AssetParts]):
    """All instances of assets of a refinement, as clusters and the points on them."""

    def __init__(self, placed: PlacedAssets, camera: Camera, filled: bool = False) -> None:
        super().__init__(camera, filled)
        self.placed = placed
        parts = placed.wholes()
        self.hold(parts, self.points_on(parts, None))

    def can_open(self, parts: AssetParts) -> Mask:
        """As `SharedParts.can_open`."""
        return self.placed.assets.clusters.children[parts.cluster] > 0

    def opened(self, parts: AssetParts) -> Iterator[tuple[AssetParts, Integers, None]]:
        """Children of clusters, as `SharedParts.opened`."""
        yield *self.placed.children(parts), None

    def points_on(self, parts: AssetParts, known: None) -> SharePoints:
        """Points on clusters, all in the root: at their samples."""
        pixels = parts.extent / self.camera.extent_around(parts.center)
        clusters, key = self.placed.assets.clusters, self.placed.keys(parts)
        closed_leaves = self.placed.closed_leaves(parts)
        number = np.ceil(np.maximum(pixels / PIXELS_A_POINT, FEWEST)) * self._times
        groups = []
        for leafy in (True, False):
            sheets = parts.totals.leaf_area if leafy else np.zeros(len(parts))
            solids = closed_leaves if leafy else parts.totals.wood_area - closed_leaves
            part = (sheets + solids / 2) / np.maximum(parts.totals.optical_area, 1e-300)
            samples = (clusters.leaf_samples if leafy else clusters.wood_samples)[parts.cluster]
            count = np.minimum(np.ceil(number * part), samples)
            count = np.where((sheets + solids > 0.0) & (samples > 0), np.maximum(count, 1), 0).astype(np.int64)
            owner, index = spread(count)
            pick = self.placed.picked(parts, key, leafy, owner, index)
            place = self.placed.to_world(self.placed.assets.samples.position[pick], parts.instance[owner])
            leaf, wood = ((area / np.maximum(count, 1))[owner].astype(np.float32) for area in (sheets, solids))
            cell = np.zeros(len(owner), np.int32)
            groups.append(SharePoints(owner.astype(np.int32), cell, place.astype(np.float32), leaf, wood))
        return SharePoints.concatenate(groups)
