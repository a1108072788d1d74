# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of assets as the loop holds them: clusters, opened as sub-plants are (paper, section 6.5)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Integers, Integers32, Mask, column, nested, spread
from ..assets.asset import AssetTable, Instances
from ..camera.camera import Camera
from ..growth.hashing import child_key, uniform
from .contents import Totals
from .shared_parts import SharedParts, SharePoints

#: Pixels along a part for each of its points, and the fewest.
PIXELS_A_POINT, FEWEST = 6.0, 4
#: How many times as many points there are where proxies fill their tetrahedra.
FILLED = 4
#: Draw of this module: where a part's run of samples starts.
_START = 251
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

    def bounding_box(self) -> Floats:
        """Axis-aligned box (2, 3) around all of them, at least one, meters."""
        reach = self.reach[:, None]
        return np.stack([(self.center - reach).min(axis=0), (self.center + reach).max(axis=0)])


class PlacedAssets:
    """Assets and their instances, and what a cluster of an instance is in the world.

    Parameters
    ----------
    assets : AssetTable
    instances : Instances
    """

    def __init__(self, assets: AssetTable, instances: Instances) -> None:
        self.assets, self.instances = assets, instances
        self.scale, self.largest = instances.scale, instances.largest
        gram = np.einsum("nki,nkj->nij", instances.linear, instances.linear)
        even = self.scale[:, None, None] ** 2 * np.eye(3)
        self.stretched = (np.abs(gram - even) > _EVEN * self.scale[:, None, None] ** 2).any(axis=(1, 2))

    def __len__(self) -> int:
        return len(self.instances)

    @classmethod
    def none(cls) -> PlacedAssets:
        """No instances."""
        return cls(AssetTable.none(), Instances.empty())

    def take(self, index: NDArray) -> PlacedAssets:
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
        own = leaves.take((self.assets.first_leaf[asset] + clusters.first_leaf[parts.cluster])[owner] + index)
        corners = (own.center - own.along, own.center - own.across, own.center + own.along, own.center + own.across)
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
        some = np.flatnonzero(self.stretched[instance])
        if len(some):
            own, of = cluster[some], instance[some]
            owner, index = spread((clusters.leaf_samples + clusters.wood_samples)[own].astype(np.int64))
            normal = self.assets.samples.normal[clusters.leaf_sample[own][owner] + index].astype(np.float64)
            turned = np.einsum("nij,nj->ni", self.cofactors(of[owner]), normal)
            longer = np.bincount(owner, np.linalg.norm(turned, axis=1), len(own)) / np.bincount(
                owner, minlength=len(own)
            )
            leaf[some] *= longer / scale[some]
            wood[some] *= longer / scale[some]
        return leaf, wood

    def closed_leaves(self, parts: AssetParts) -> Floats:
        """Area (n,) of solids that facets stand for as for leaves, m²."""
        clusters = self.assets.clusters
        part = clusters.closed_leaf_area[parts.cluster] / np.maximum(clusters.wood_area[parts.cluster], 1e-300)
        return parts.totals.wood_area * part

    def keys(self, parts: AssetParts) -> NDArray[np.uint64]:
        """A key (n,) for each part, which tells it apart from all others of all instances."""
        local = parts.cluster - self.assets.root[self.instances.asset[parts.instance]]
        return child_key(self.instances.key[parts.instance], local)

    def picked(
        self, parts: AssetParts, key: NDArray[np.uint64], leafy: bool, owner: Integers, index: NDArray
    ) -> Integers:
        """Samples (m,) of parts (n,) with keys (n,): a run on leaves, or on wood, that begins anywhere."""
        clusters = self.assets.clusters
        first = (clusters.leaf_sample if leafy else clusters.wood_sample)[parts.cluster].astype(np.int64)
        number = (clusters.leaf_samples if leafy else clusters.wood_samples)[parts.cluster].astype(np.int64)
        start = (uniform(key, _START) * number).astype(np.int64)
        return first[owner] + (start[owner] + index) % np.maximum(number[owner], 1)


class SharedAssets(SharedParts[AssetParts]):
    """All instances of assets of a refinement, as clusters and the points on them.

    Parameters
    ----------
    placed : PlacedAssets
    camera : Camera
    filled : bool
        Whether proxies fill their tetrahedra, so that small ones without points would be holes.
    """

    def __init__(self, placed: PlacedAssets, camera: Camera, filled: bool = False) -> None:
        super().__init__(camera)
        self.placed, self._times = placed, FILLED if filled else 1
        parts = placed.wholes()
        self.hold(parts, self.points_on(parts, None))

    def can_open(self, parts: AssetParts) -> Mask:
        """As `SharedParts.can_open`."""
        return self.placed.assets.clusters.children[parts.cluster] > 0

    def branch_only(self, parts: AssetParts) -> Mask:
        """None of them counts apart."""
        return np.zeros(len(parts), bool)

    def opened(self, parts: AssetParts) -> Iterator[tuple[AssetParts, Integers, None]]:
        """Children of clusters, as `SharedParts.opened`."""
        yield *self.placed.children(parts), None

    def points_on(self, parts: AssetParts, known: None) -> SharePoints:
        """Points on clusters, all in the root: at their samples."""
        pixels = parts.extent / self.camera.extent_around(parts.center)
        clusters, key = self.placed.assets.clusters, self.placed.keys(parts)
        closed_leaves = self.placed.closed_leaves(parts)
        number = np.ceil(np.maximum(pixels / PIXELS_A_POINT, FEWEST)) * self._times
        made = []
        for leafy in (True, False):
            sheets = parts.totals.leaf_area if leafy else np.zeros(len(parts))
            solids = closed_leaves if leafy else parts.totals.wood_area - closed_leaves
            part = (sheets + solids / 2) / np.maximum(parts.totals.optical_area, 1e-300)
            there = (clusters.leaf_samples if leafy else clusters.wood_samples)[parts.cluster]
            count = np.minimum(np.ceil(number * part), there)
            count = np.where((sheets + solids > 0.0) & (there > 0), np.maximum(count, 1), 0).astype(np.int64)
            owner, index = spread(count)
            pick = self.placed.picked(parts, key, leafy, owner, index)
            place = self.placed.to_world(self.placed.assets.samples.position[pick], parts.instance[owner])
            leaf, wood = ((area / np.maximum(count, 1))[owner].astype(np.float32) for area in (sheets, solids))
            cell = np.zeros(len(owner), np.int32)
            made.append(SharePoints(owner.astype(np.int32), cell, place.astype(np.float32), leaf, wood))
        return SharePoints.concatenate(made)
