# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What instances of assets are drawn as: instances of the originals, of clusters of them, or facets.

Decisions are made for clusters of up to `asset.MESH_FACES` faces. One is real with the probability that its leaves are,
by a hash of its own, so that nothing pops. An instance of which most is real is drawn as the original: that costs
nothing more, and keeps all that the artist has made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..growth.hashing import Draw, uniform
from ..proxies.asset_facets import asset_facet_sizes, facets_of_assets
from ..proxies.facet_sizes import FacetPixels, FacetSizes
from ..proxies.microsurfaces import Facets, kept_out_of_view
from ..refinement.asset_parts import AssetParts
from ..refinement.decisions import real_fraction
from ..subplants.pieces import chunks
from .asset_sight import AssetPortions, AssetSight
from .leaf_detail import FADING
from .plants import KITES, MIXED

#: How many times as far plain instances are kept where the renderer shows a mesh in many places for the cost of one.
FARTHER = 20.0
#: Facets of a cluster from which on those of its children have places of their own, and where it is seen in part.
MANY, FEW = 48.0, 6.0
#: Faces of a leaf up to which there is no kite for it.
SIMPLE = 3.0
#: Approximate number of facets that are made at a time.
AT_ONCE = 200_000


@dataclass(frozen=True)
class Keeping:
    """When an instance is drawn as the original.

    Attributes
    ----------
    always : (a,) bool
        Assets of which every instance is.
    fraction : float
        Fraction of its faces that are to be real; more than 1 for never.
    shared : bool
        Meshes of clusters cost the renderer as much as one of them, in however many places. Else each place counts.
    kites : bool
        Leaves of few pixels are kites. Without them nothing is gained by any, and all that is seen is real, but for
        specks: `FARTHER` times as far as else.
    """

    always: NDArray[np.bool_]
    fraction: float = 0.6
    shared: bool = False
    kites: bool = True


@dataclass(frozen=True)
class AssetPlan:
    """What instances are drawn as.

    Attributes
    ----------
    whole : (k,) int64
        Instances that are the originals.
    meshes, kites : AssetParts of m, of k
        Clusters that are meshes of their own faces, and of kites for their leaves.
    facets : AssetPortions of n
        Clusters that are facets.
    """

    whole: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    meshes: AssetParts = field(default_factory=AssetParts.empty)
    kites: AssetParts = field(default_factory=AssetParts.empty)
    facets: AssetPortions = field(default_factory=AssetPortions.empty)


def real_fractions(
    sight: AssetSight, portions: AssetPortions, limit: float | None, kites: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fractions (n,) of clusters that are meshes, if only of kites, and (n,) that are their own faces.

    limit: width in pixels up to which leaves are facets; None: of each that reaches into an explicit tetrahedron, all.
    """
    seen = portions.real & (portions.visibility > 0.0)
    if limit is None:
        own = (seen & (portions.visibility >= 0.5)).astype(np.float64)
        return own, own
    parts = portions.parts
    pixels = parts.totals.width / np.maximum(sight.camera.extent_around(parts.centre), 1e-300)
    pixels = pixels * portions.visibility**FADING
    if not kites:
        # An instance costs as much as three facets: all that is seen is real, but for specks.
        seen, pixels = portions.visibility > 0.0, pixels * FARTHER
    some = np.where(seen, real_fraction(pixels, limit), 0.0)
    # A card or a leaf of two triangles is no more than a kite.
    simple = sight.placed.assets.leaf_faces[parts.cluster] <= SIMPLE
    return some, np.where(simple | (not kites), some, some * real_fraction(pixels, KITES))


def plan_of(sight: AssetSight, limit: float | None, keeping: Keeping) -> AssetPlan:
    """Decide for all instances; ``limit`` as for `real_fractions`."""
    placed, portions = sight.placed, sight.portions()
    if not len(portions):
        return AssetPlan()
    assets, instances = placed.assets, placed.instances
    mesh_of = assets.mesh_of
    always = keeping.always[instances.asset]
    portions = portions.take(~always[portions.parts.instance])
    done = [AssetPortions.empty()]
    if not keeping.kites and keeping.fraction <= 1.0:
        # Whole instances that are real need not be opened to find out that most of each is.
        root = portions.parts.cluster == assets.root[instances.asset[portions.parts.instance]]
        real = root & (real_fractions(sight, portions, limit, keeping.kites)[1] >= 1.0)
        always = always.copy()
        always[portions.parts.instance[real]] = True
        portions = portions.take(~real)
    while len(portions):
        # Down to the clusters that are meshes of their own, where some of them may be real.
        above = mesh_of[portions.parts.cluster] < 0
        some = real_fractions(sight, portions, limit, keeping.kites)[0] > 0.0
        opening = above & (some | (portions.real & portions.mixed & (sight.pixels(portions) > MIXED)))
        done.append(portions.take(~opening))
        portions, _ = sight.opened(portions.take(opening))
    every = AssetPortions.concatenate(done)
    instance, mesh = every.parts.instance.astype(np.int64), mesh_of[every.parts.cluster]
    inner = np.flatnonzero(mesh >= 0)
    pair, of = np.unique(instance[inner] * len(assets.clusters) + mesh[inner], return_inverse=True)
    area = every.parts.totals.optical_area[inner]
    whole_area = np.maximum(np.bincount(of, area, len(pair)), 1e-300)
    meshed, full = (
        np.bincount(of, area * f[inner], len(pair)) / whole_area
        for f in real_fractions(sight, every, limit, keeping.kites)
    )
    owner, cluster = pair // len(assets.clusters), pair % len(assets.clusters)
    own = placed.parts(owner, cluster)
    number = uniform(placed.keys(own), Draw.TRANSITION)
    real = number < full
    faces = np.bincount(owner[real], own.totals.polygons[real], len(placed))
    all_faces = assets.clusters.faces[assets.root[instances.asset]]
    whole = always | (faces >= keeping.fraction * all_faces)
    apart = ~whole[owner]
    kites = ~real & (number < meshed) & (assets.clusters.leaves[cluster] > 0)
    left = ~whole[instance]
    left[inner] &= ~(real | kites)[of]
    return AssetPlan(np.flatnonzero(whole), own.take(real & apart), own.take(kites & apart), every.take(left))


def planned_facets(
    sight: AssetSight, plan: AssetPlan, pixels: FacetPixels, form: Callable[[Facets, bool], Any] | None = None
) -> Iterator[tuple[Any, bool]]:
    """Facets of a plan, or what a form makes of them, and whether they are seen, some at a time."""
    expected = sizes_of(sight, plan.facets).counts(pixels) + 1.0
    for run in chunks(expected, AT_ONCE):
        for facets, seen in _facets_of(sight, plan.facets.take(run), pixels):
            if len(facets):
                yield facets if form is None else form(facets, seen), seen


def sizes_of(sight: AssetSight, portions: AssetPortions) -> FacetSizes:
    """Sizes of the facets of portions (n,), were they drawn as they are."""
    seen = portions.visibility, portions.coarse, portions.beside
    return asset_facet_sizes(sight.placed, portions.parts, sight.shadows, *seen)


def _facets_of(sight: AssetSight, portions: AssetPortions, pixels: FacetPixels) -> Iterator[tuple[Facets, bool]]:
    """Facets of portions, which are opened as far as their places show."""
    while len(portions):
        seen, sizes = portions.visibility > 0.0, sizes_of(sight, portions)
        count, extent = sizes.counts(pixels), sight.pixels(portions)
        # Where there are more facets than samples they would lie in heaps, and let light pass in between.
        opening = (count > MANY) | (portions.mixed & (extent > MIXED) & (count > FEW))
        opening &= sight.assets.can_open(portions.parts)
        for group, beside in ((seen, False), (~seen & ~portions.beside, False), (~seen & portions.beside, True)):
            some = np.flatnonzero(group & ~opening)
            if len(some):
                own = sizes.take(some)
                left_out = np.where(seen[some], 0.0, 1.0 - own.enough(pixels))
                made = facets_of_assets(sight.placed, portions.parts.take(some), own, pixels, left_out)
                if not seen[some[0]]:
                    made = kept_out_of_view(made, sight.camera.clearance, not beside)
                yield made, bool(seen[some[0]] or not beside)
        portions, _ = sight.opened(portions.take(opening))
