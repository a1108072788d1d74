# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of assets: as what the frontier draws them.

What is refined becomes originals, meshes of clusters, kites, or facets. Decisions are made for clusters of up to
`asset.MESH_FACES` faces. One is real with the probability that its leaves are, by a hash of its own, so that nothing
pops. An instance of which most is real is drawn as the original: that costs nothing more, and keeps all that the artist
has made. What is drawn as it is covers the image by its leaves, as far as these are more than a few pixels, or else by
facets, as many as are needed for that.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, chunks, column
from ..assets.costs import FARTHER, OriginalPolicy
from ..camera.camera import Camera
from ..growth.hashing import Draw, uniform
from ..proxies.microsurfaces import facet_totals, facets_of_assets
from ..proxies.primitives import triangle_corners
from ..refinement.decisions import explicit_fraction
from ..refinement.loop import Refinement
from ..refinement.shared_parts import AssetParts, PlacedAssets
from .frontier import Canvas, FrontierKind, Owned, Shown, Waiting, opaque_fractions
from .plants import KITES, inside_explicit

#: Stands for a species where facets are of assets.
ASSETS = -1
#: Faces of a leaf up to which there is no kite for it.
SIMPLE = 3.0
#: Pixels of facets that only tell what is covered.
COVERING = 2.0
#: Kites that are drawn at a time.
_KITES_BATCH = 200_000


@dataclass(frozen=True)
class AssetPlan:
    """Instances of assets that are drawn as they are."""

    originals: Integers  # (k,): instances that are the originals
    #: meshes and kites, of m, of k: PlacedClusters that are meshes of their own faces, and of kites for their leaves.
    meshes: AssetParts
    kites: AssetParts = field(default_factory=AssetParts.empty)

    @classmethod
    def of(cls, placed: PlacedAssets, originals: OriginalPolicy, shown: list[Shown]) -> Self:
        """What a drawing has shown."""
        every = {
            label: AssetParts.concatenate([AssetParts.empty(), *(rows for what, rows in shown if what == label)])
            for label in ("original", "cluster", "kites")
        }
        whole = np.zeros(len(placed), bool)
        whole[every["original"].instance] = True
        whole |= originals.always[placed.instances.asset]
        return cls(np.flatnonzero(whole), every["cluster"], every["kites"])


@dataclass(frozen=True)
class ClusterRows(AssetParts):
    """PlacedClusters of instances (n), as the frontier has them."""

    shown: Mask = column(dtype=bool)  # (n,): drawn as they are: only what they cover is to be found

    @classmethod
    def of(cls, parts: AssetParts, shown: Mask) -> Self:
        """Parts (n,), of which some are shown already."""
        return cls(*vars(parts).values(), shown)


@dataclass(frozen=True)
class PlacedClusters(FrontierKind):
    """PlacedClusters of instances."""

    placed: PlacedAssets
    camera: Camera
    originals: OriginalPolicy
    limit: float  # width in pixels up to which leaves are facets
    looks: NDArray[np.str_]  # (i,) str: of instances; what stands for different ones is kept apart
    #: As of `FrontierKind`: where there are few facets, only those of plants gain by being finer than asked for.
    larger: float = 1.0

    def everything(self) -> ClusterRows:
        """All instances."""
        return ClusterRows.of(self.placed.wholes(), self.originals.always[self.placed.instances.asset])

    def optical(self, rows: ClusterRows) -> Floats:
        """As of `FrontierKind`; of what is drawn as it is, for facets that only tell what is covered."""
        return np.where(rows.shown, COVERING**-2.0, 1.0) * rows.totals.optical_area

    def one_leaf(self, rows: ClusterRows) -> Floats:
        """As of `FrontierKind`."""
        return self.placed.assets.clusters.one_leaf[rows.cluster] * self.placed.scale[rows.instance] ** 2

    def enough(self, rows: ClusterRows) -> Floats:
        """As of `FrontierKind`; nothing of what is drawn as it is."""
        clusters = self.placed.assets.clusters
        side = (clusters.high - clusters.low)[rows.cluster]
        silhouette = sum(side[:, i] * side[:, (i + 1) % 3] for i in range(3)) / 2.0
        silhouette = silhouette * self.placed.scale[rows.instance] ** 2
        return np.where(rows.shown, 0.0, opaque_fractions(silhouette, rows.totals.optical_area))

    def can_open(self, rows: ClusterRows) -> Mask:
        """As of `FrontierKind`; of what is drawn as it is, only what facets tell about."""
        told = rows.shown & (self.placed.assets.mesh_of[rows.cluster] >= 0) & self._wide(rows)
        return (self.placed.assets.clusters.children[rows.cluster] > 0) & ~told

    def opened(self, rows: ClusterRows) -> tuple[ClusterRows, Integers]:
        """As of `FrontierKind`."""
        parts, owner = self.placed.children(rows)
        return ClusterRows.of(parts, rows.shown[owner]), owner

    def to_be_opened(self, rows: ClusterRows) -> Mask:
        """Those above clusters with meshes of their own, of which some may be real."""
        return ~rows.shown & (self.placed.assets.mesh_of[rows.cluster] < 0) & (self.explicit(rows)[0] > 0.0)

    def _wide(self, rows: ClusterRows) -> Mask:
        """PlacedClusters (n,) of which leaves are wide enough for kites of theirs to be told apart."""
        return rows.totals.width > KITES * self.camera.extent_around(rows.center)

    def explicit(self, rows: AssetParts) -> tuple[Floats, Floats]:
        """Fractions (n,) of clusters that are meshes, if only of kites, and (n,) that are their own faces."""
        pixels = rows.totals.width / np.maximum(self.camera.extent_around(rows.center), 1e-300)
        if not self.originals.kites:
            # An instance costs as much as three facets: all that is seen is real, but for specks.
            pixels = pixels * FARTHER
        explicit = explicit_fraction(pixels, self.limit)
        # A card or a leaf of two triangles is no more than a kite.
        plain = (self.placed.assets.leaf_faces[rows.cluster] <= SIMPLE) | (not self.originals.kites)
        return explicit, np.where(plain, explicit, explicit * explicit_fraction(pixels, KITES))

    def met(self, rows: ClusterRows, shown: list[Shown]) -> ClusterRows:
        """As of `FrontierKind`."""
        assets, asset = self.placed.assets, self.placed.instances.asset[rows.instance]
        explicit, full = self.explicit(rows)
        number = uniform(self.placed.keys(rows), Draw.TRANSITION)
        whole = ~rows.shown & (rows.cluster == assets.root[asset]) & (full >= self.originals.fraction)
        candidates = ~rows.shown & ~whole & (self.placed.assets.mesh_of[rows.cluster] == rows.cluster)
        mesh = candidates & (number < full)
        kites = candidates & ~mesh & (number < explicit) & (assets.clusters.leaves[rows.cluster] > 0)
        for what, chosen in (("original", whole), ("cluster", mesh), ("kites", kites)):
            if chosen.any():
                shown.append((what, rows.take(np.flatnonzero(chosen))))
        return replace(rows, shown=rows.shown | whole | mesh | kites)

    def draw(self, canvas: Canvas, slab: Waiting, side: Floats, _shown: list[Shown]) -> None:
        """As of `FrontierKind`."""
        rows = slab.parts
        rest = np.flatnonzero(~rows.shown)
        for whose, facets in self._facets(rows.take(rest), side[rest]):
            canvas.add_facets(whose, facets)
        drawn = rows.take(np.flatnonzero(rows.shown))
        faces = 0.0 if self.originals.shared else drawn.totals.polygons.sum()
        wide = self._wide(drawn)
        near = drawn.take(np.flatnonzero(wide))
        for run in chunks(self.placed.assets.clusters.leaves[near.cluster], _KITES_BATCH):
            canvas.add_shown(self.placed.kites(near.take(run)))
        # Wood, and leaves of few pixels.
        totals = facet_totals(self.placed, drawn)
        totals = replace(totals, leaf_area=np.where(wide, 0.0, totals.leaf_area))
        least = COVERING * self.camera.extent_around(drawn.center)
        facets = facets_of_assets(self.placed, drawn, totals, np.maximum(least, np.sqrt(self.one_leaf(drawn))), least)
        canvas.add_shown(triangle_corners(facets), float(faces))

    def unseen(self, rows: ClusterRows, side: Floats, kept: Floats, _shown: list[Shown]) -> Iterator[Owned]:
        """As of `FrontierKind`."""
        rest = np.flatnonzero(~rows.shown)
        yield from self._facets(rows.take(rest), side[rest], 1.0 - kept[rest])

    def _facets(self, rows: ClusterRows, side: Floats, left_out: Floats | None = None) -> Iterator[Owned]:
        looks = self.looks[rows.instance]
        leaf = np.maximum(side, np.sqrt(self.one_leaf(rows)))
        for look in np.unique(looks).tolist():
            alike = np.flatnonzero(looks == look)
            clusters, out = rows.take(alike), None if left_out is None else left_out[alike]
            totals = facet_totals(self.placed, clusters)
            yield (ASSETS, look), facets_of_assets(self.placed, clusters, totals, leaf[alike], side[alike], out)


def explicit_plan(result: Refinement, originals: OriginalPolicy) -> AssetPlan:
    """Where shells stand for all other instances: what lies in explicit tetrahedra for the most part."""
    placed = result.assets.placed
    assets, asset, number = placed.assets, placed.instances.asset, len(placed.assets.clusters)
    parts, inside = inside_explicit(
        result.assets, result, lambda clusters, inside: (assets.mesh_of[clusters.cluster] < 0) & (inside < 1.0)
    )
    while (above := (assets.mesh_of[parts.cluster] < 0) & (inside >= 1.0)).any():  # so are all that these consist of
        within, _ = placed.children(parts.take(above))
        parts = AssetParts.concatenate([parts.take(~above), within])
        inside = np.concatenate([inside[~above], np.ones(len(within))])
    mesh = assets.mesh_of[parts.cluster]
    inner = np.flatnonzero(mesh >= 0)
    pair, of = np.unique(parts.instance[inner].astype(np.int64) * number + mesh[inner], return_inverse=True)
    area = parts.totals.optical_area[inner]
    most = np.bincount(of, area * inside[inner], len(pair)) >= 0.5 * np.bincount(of, area, len(pair))
    clusters = placed.parts(*np.divmod(pair[most], max(number, 1)))
    faces = np.bincount(clusters.instance, clusters.totals.polygons, len(placed))
    whole = originals.always[asset] | (faces >= originals.fraction * assets.clusters.faces[assets.root[asset]])
    return AssetPlan(np.flatnonzero(whole), clusters.take(~whole[clusters.instance]))
