# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled assets: clusters with all that refinement asks about them, samples for facets, and several assets as one.

What an asset is before it is compiled: all of its faces, in its own space, and what each of them looks like.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats16, Floats32, Integers, Integers32, Mask, column

#: Faces up to which a cluster is drawn as a mesh of its own, where it is near.
MESH_FACES = 2048
#: Facets for each of which a weight is known, as of `proxies.facet_weights`.
COUNTS = 4.0 ** np.arange(-1, 6)


@dataclass(frozen=True)
class Clusters(Arrays):
    """Clusters (c) in the space of their asset: parents before children, those of one parent together."""

    #: parent, child and children, (c,): parent or −1, first child, and number of children.
    parent: Integers32 = column(dtype=np.int32)
    child: Integers32 = column(dtype=np.int32)
    children: Integers32 = column(dtype=np.int32)
    #: low and high, (c, 3): bounds of all vertices, meters.
    low: Floats = column(3)
    high: Floats = column(3)
    #: leaf_area and wood_area, (c,): one-sided area of sheets, and surface of solids, m², without what is transparent.
    leaf_area: Floats
    wood_area: Floats
    #: (c,): the part of that of solids which are as many as leaves: closed leaves, berries, twigs. Facets stand for
    #: them as for leaves.
    closed_leaf_area: Floats
    faces: Integers32 = column(dtype=np.int32)  # (c,)
    first_face: Integers = column(dtype=np.int64)  # (c,): first of its faces in the asset's order
    width: Floats  # (c,): mean width of its leaves and wood, by area, meters
    one_leaf: Floats  # (c,): mean optical area of its leaves, m²; 0 where there are none
    color: Floats = column(3)  # (c, 3)
    transmission: Floats  # (c,)
    moment: Floats = column(6)  # (c, 6): mean of n nᵀ by optical area: xx, yy, zz, xy, xz, yz
    first_leaf: Integers = column(dtype=np.int64)  # (c,): first of its leaves in the asset's order
    leaves: Integers32 = column(dtype=np.int32)  # (c,): leaves, and other islands as small
    #: leaf_sample, leaf_samples, wood_sample and wood_samples, (c,): first sample and number of samples on leaves, and
    #: on wood; each of either stands for an equal optical area.
    leaf_sample: Integers32 = column(dtype=np.int32)
    leaf_samples: Integers32 = column(dtype=np.int32)
    wood_sample: Integers32 = column(dtype=np.int32)
    wood_samples: Integers32 = column(dtype=np.int32)
    #: (c, 7): fraction of their area that facets need to block as much light, for each of `COUNTS`.
    weights: Floats = column(len(COUNTS))

    @property
    def optical_area(self) -> Floats:
        """Area (c,) that can block light, m²: sheets, and half of what is closed."""
        return self.leaf_area + self.wood_area / 2

    @property
    def leaf_optical(self) -> Floats:
        """The part (c,) of the optical area that facets stand for as for leaves, m²."""
        return self.leaf_area + self.closed_leaf_area / 2

    @property
    def leaf_faces(self) -> Floats:
        """Mean number (c,) of faces of a leaf; 1 where there are none, or more wood than leaves."""
        leafy = (self.leaf_optical >= 0.5 * self.optical_area) & (self.leaves > 0)
        return np.where(leafy, self.faces / np.maximum(self.leaves, 1), 1.0)

    @property
    def meshes(self) -> Mask:
        """Clusters (c,) that are drawn as meshes where they are near: the largest with no more than `MESH_FACES`.

        None has both leaves and wood where its children have either: kites take the place of leaves alone.
        """
        bark, least = self.optical_area - self.leaf_optical, 1e-9 * self.optical_area
        mixed = (bark > least) & (self.leaf_optical > least)
        small = ((self.faces <= MESH_FACES) & ~mixed) | (self.children == 0)
        return small & ~(small[self.parent] & (self.parent >= 0))


@dataclass(frozen=True)
class SurfaceSamples(Arrays):
    """Places (s) on the surfaces of clusters, in the space of their asset."""

    position: Floats32 = column(3, dtype=np.float32)  # (s, 3): meters
    normal: Floats16 = column(3, dtype=np.float16)  # (s, 3)
    color: Floats16 = column(3, dtype=np.float16)  # (s, 3)
    transmission: Floats16 = column(dtype=np.float16)  # (s,)
    roughness: Floats16 = column(dtype=np.float16)  # (s,)


@dataclass(frozen=True)
class AssetKites(Arrays):
    """Leaves (l) as kites of the same area, in the space of their asset.

    A kite lies in the plane of a face of the leaf, chosen by area: on average it shows the same area from everywhere.
    """

    center: Floats32 = column(3, dtype=np.float32)  # (l, 3): meters
    #: along and across, (l, 3): halves of its diagonals, meters.
    along: Floats32 = column(3, dtype=np.float32)
    across: Floats32 = column(3, dtype=np.float32)
    color: Floats16 = column(3, dtype=np.float16)  # (l, 3)
    transmission: Floats16 = column(dtype=np.float16)  # (l,)
    roughness: Floats16 = column(dtype=np.float16)  # (l,)


@dataclass(frozen=True)
class Asset:
    """A compiled asset."""

    name: str
    digest: str  # of the source
    clusters: Clusters  # of c
    samples: SurfaceSamples  # of s
    leaves: AssetKites  # of l: those of a cluster together
    #: part and face, (f,): part of the source, and face of its surface, for each face, those of a cluster together.
    part: Integers32
    face: Integers32

    @property
    def faces(self) -> int:
        """Number of its faces."""
        return len(self.face)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.clusters.nbytes + self.samples.nbytes + self.leaves.nbytes + self.part.nbytes + self.face.nbytes

    def faces_of(self, cluster: int) -> tuple[Integers32, Integers32]:
        """Parts (k,) and faces (k,) of a cluster."""
        start = int(self.clusters.first_face[cluster])
        run = slice(start, start + int(self.clusters.faces[cluster]))
        return self.part[run], self.face[run]

    def leaves_of(self, cluster: int) -> AssetKites:
        """Leaves (k,) of a cluster."""
        start = int(self.clusters.first_leaf[cluster])
        return self.leaves.take(slice(start, start + int(self.clusters.leaves[cluster])))


@dataclass(frozen=True)
class AssetTable:
    """Several assets as one: their clusters and samples, one asset after the other."""

    every: tuple[Asset, ...]
    clusters: Clusters  # of c
    samples: SurfaceSamples  # of s
    root: Integers  # (a + 1,): first cluster of each, and their number

    @classmethod
    def of(cls, assets: Sequence[Asset]) -> Self:
        """All of some."""
        root = np.cumsum([0, *(len(a.clusters) for a in assets)])
        sample = np.cumsum([0, *(len(a.samples) for a in assets)])
        moved = []
        for asset, first, before in zip(assets, root[:-1].tolist(), sample[:-1].tolist(), strict=True):
            clusters, cluster, number = asset.clusters, np.int32(first), np.int32(before)
            parent = np.where(clusters.parent < 0, clusters.parent, clusters.parent + cluster)
            samples = {"leaf_sample": clusters.leaf_sample + number, "wood_sample": clusters.wood_sample + number}
            moved.append(replace(clusters, parent=parent, child=clusters.child + cluster, **samples))
        samples = SurfaceSamples.concatenate([a.samples for a in assets])
        return cls(tuple(assets), Clusters.concatenate(moved), samples, root)

    def __getstate__(self) -> dict[str, object]:
        """Without what meshes of clusters are made of, and without copies: other processes draw leaves and facets."""
        none = np.zeros(0, np.int32)
        every = tuple(replace(asset, part=none, face=none) for asset in self.every)
        return {name: value for name, value in vars(self).items() if name != "leaves"} | {"every": every}

    @classmethod
    def none(cls) -> Self:
        """No assets."""
        return cls.of(())

    @cached_property
    def leaves(self) -> AssetKites:
        """Leaves of all assets, one after the other."""
        return AssetKites.concatenate([asset.leaves for asset in self.every])

    @cached_property
    def first_leaf(self) -> Integers:
        """The first (a,) of each asset."""
        return np.cumsum([0, *(len(asset.leaves) for asset in self.every)])

    @cached_property
    def leaf_faces(self) -> Floats:
        """As of `Clusters`."""
        return self.clusters.leaf_faces

    @cached_property
    def mesh_of(self) -> Integers:
        """The cluster (c,) with a mesh of its own that each is or lies in; −1 for those above such."""
        out = np.where(self.clusters.meshes, np.arange(len(self.clusters)), -1)
        while True:  # a level at a time
            parent = np.maximum(self.clusters.parent, 0)
            below = np.flatnonzero((out < 0) & (self.clusters.parent >= 0) & (out[parent] >= 0))
            if not len(below):
                return out
            out[below] = out[parent[below]]


@dataclass(frozen=True)
class Instances(Arrays):
    """Places of assets (n)."""

    asset: Integers32 = column(dtype=np.int32)  # (n,)
    #: (n, 3, 3): from the space of the asset to the world, without the translation: turned, stretched or mirrored.
    linear: Floats = column(3, 3)
    position: Floats = column(3)  # (n, 3): of the asset's origin, meters
    key: NDArray[np.uint64] = column(dtype=np.uint64)  # (n,): tells individuals apart

    def counted_from(self, origin: Floats) -> Self:
        """The same in coordinates that begin at a place (3,)."""
        return replace(self, position=self.position - origin) if origin.any() else self

    @property
    def scale(self) -> Floats:
        """Mean scale (n,): the cube root of the factor on volumes."""
        return np.cbrt(np.abs(np.linalg.det(self.linear)))

    @property
    def largest(self) -> Floats:
        """Largest factor (n,) on any length, or somewhat more where an instance is stretched (Frobenius norm)."""
        length = np.linalg.norm(self.linear, axis=1)
        even = length.max(axis=1, initial=0.0)
        skew = [(self.linear[:, :, i] * self.linear[:, :, i - 1]).sum(axis=1) for i in range(3)]
        uneven = (even > 1.001 * length.min(axis=1)) | (np.abs(skew).max(axis=0) > 1e-3 * even**2)
        return np.where(uneven, np.linalg.norm(self.linear, axis=(1, 2)), even)


@dataclass(frozen=True)
class AssetSurface:
    """Faces of one mesh."""

    name: str
    positions: Floats32  # (v, 3): in the space of the mesh, meters
    triangles: Integers32  # (t, 3): vertices of each
    face: Integers32  # (t,): the mesh's face that each is a part of; ascending
    color: Floats16  # (f, 3): mean linear color of what is not transparent of each face
    transmission: Floats16  # (f,): fraction of light that is scattered through; NaN where nobody knows
    coverage: Floats16  # (f,): fraction of each that is not transparent
    roughness: Floats16 | None = None  # (f,): of its gloss; None where nobody knows

    @property
    def faces(self) -> int:
        """Number of faces f."""
        return len(self.coverage)


@dataclass(frozen=True)
class AssetSource:
    """All surfaces of an asset, and where it shows them: a leaf may be a surface that it shows ten thousand times."""

    name: str  # of the object or collection, for messages
    surfaces: tuple[AssetSurface, ...]
    surface: Integers32  # (n,): surface of each part
    matrices: Floats  # (n, 4, 4): from the space of that surface to that of the asset
    digest: str  # hexadecimal; of all that the above follows from

    @property
    def faces(self) -> int:
        """Number of faces of all parts."""
        return int(sum(np.array([s.faces for s in self.surfaces], np.int64)[self.surface]))
