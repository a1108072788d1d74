# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From an asset's faces to its clusters: bounds, areas, colors, orientation, samples and weights (paper, section 5).

The paper compiles a species before any plant is modeled. Here the model is there, and compiled in the same spirit:
what refinement asks of a cluster is known without looking at its polygons again.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers
from ..errors import TetFloraError
from ..growth.hashing import child_key, key_of_seed, uniform
from .asset import COUNTS, Asset, AssetKites, AssetSource, Clusters, SurfaceSamples
from .clusters import Hierarchy, hierarchy_of
from .facet_weights import facet_weights_of
from .measures import ALONG, Measured, measured, patch_table_of, runs_of, shared_out, well_spread
from .patches import patches_of

#: Samples of a cluster with children.
SAMPLES_ABOVE = 64


def compile_steps(source: AssetSource) -> Generator[float, None, Asset]:
    """Compile an asset; yields the fraction that is done.

    Raises
    ------
    TetFloraError
        It has no faces, or none of any area; the message names it.
    """
    if not source.faces:
        raise TetFloraError(f'"{source.name}" has no faces to refine; add faces, or choose another object')
    patches = []
    for number, surface in enumerate(source.surfaces):
        patches.append(patches_of(surface) if len(surface.triangles) else None)
        yield 0.5 * (number + 1) / len(source.surfaces)
    pool = patch_table_of(source, tuple(patches))
    hierarchy = hierarchy_of(pool.center, pool.triangles, pool.kind)
    parts: list[Measured] = []
    number = int((hierarchy.children == 0).sum())
    for run in runs_of(source, pool, hierarchy):
        parts.append(measured(run))
        yield 0.5 + 0.35 * float(run.cluster[-1] + 1) / number
    clusters, samples = _clusters(hierarchy, parts)
    if not clusters.optical_area[0] > 0.0:
        raise TetFloraError(f'"{source.name}": all of its faces are transparent or have no area; choose another object')

    def triangles(cluster: int):
        first, last = _smallest(hierarchy)[1][:, cluster]
        return runs_of(source, pool, hierarchy, int(first), int(last))

    weights = yield from facet_weights_of(clusters, samples, triangles, 0.85)
    part, face = (np.concatenate([getattr(p, name) for p in parts]) for name in ("part", "face"))
    clusters = replace(clusters, weights=weights)
    return Asset(
        source.name, source.digest, clusters, samples, AssetKites.concatenate([p.leaves for p in parts]), part, face
    )


def _smallest(hierarchy: Hierarchy) -> tuple[NDArray[np.intp], Integers]:
    """Clusters (k,) without children, in their order, and which of these each cluster has: (2, c), first and end."""
    small = np.flatnonzero(hierarchy.children == 0)
    small = small[np.argsort(hierarchy.first[small], kind="stable")]
    ends = [np.searchsorted(hierarchy.first[small], of) for of in (hierarchy.first, hierarchy.last)]
    return small, np.stack(ends)


def _clusters(hierarchy: Hierarchy, parts: list[Measured]) -> tuple[Clusters, SurfaceSamples]:
    """All clusters, from what is known of the smallest; weights of facets are 1."""
    small, (first, last) = _smallest(hierarchy)
    sums, low, high, counts = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("sums", "low", "high", "counts")
    )
    samples = SurfaceSamples.concatenate([part.samples for part in parts])
    # Of all that lies between two ends; nothing is summed over one large number less another.
    every = np.array([sums[a:b].sum(axis=0) for a, b in zip(first, last, strict=True)])
    bounds = np.array([(low[a:b].min(axis=0), high[a:b].max(axis=0)) for a, b in zip(first, last, strict=True)])
    above, above_counts = _samples_above(hierarchy, sums, counts, samples, first, last)
    every_counts = np.zeros((len(first), 2), np.int64)
    every_counts[small] = counts
    inner = np.flatnonzero(hierarchy.children > 0)
    every_counts[inner] = above_counts
    # Samples of the smallest clusters come first, then those of others.
    number = every_counts.sum(axis=1)
    begin = np.zeros(len(first), np.int64)
    begin[small] = np.cumsum(number[small]) - number[small]
    begin[inner] = len(samples) + np.cumsum(number[inner]) - number[inner]
    leaf, wood, optical, faces, leaves, closed_leaves = every[:, :6].T
    mean = every[:, 6:] / np.maximum(optical, 1e-300)[:, None]
    before, leaves_before = (np.cumsum(np.append(0, sums[:, k])) for k in (3, 4))
    areas = leaf, wood, np.minimum(closed_leaves, wood)
    one_leaf = (leaf + closed_leaves / 2) / np.maximum(leaves, 1.0)
    look = mean[:, 0], one_leaf, mean[:, 1:4], mean[:, 4], mean[:, 5:]
    of_samples = begin, every_counts[:, 0], begin + every_counts[:, 0], every_counts[:, 1]
    clusters = Clusters.typed(
        *(hierarchy.parent, hierarchy.child, hierarchy.children, *bounds.swapaxes(0, 1)),
        *(*areas, faces, before[first], *look, leaves_before[first], leaves, *of_samples),
        np.ones((len(first), len(COUNTS))),
    )
    return clusters, SurfaceSamples.concatenate([samples, above])


def _samples_above(
    hierarchy: Hierarchy, sums: Floats, counts: Integers, samples: SurfaceSamples, first: Integers, last: Integers
) -> tuple[SurfaceSamples, Integers]:
    """Samples of clusters with children (k): some of those of the smallest clusters, in proportion to their areas."""
    inner = np.flatnonzero(hierarchy.children > 0)
    areas = np.stack([sums[:, 0] + sums[:, 5] / 2, (sums[:, 1] - sums[:, 5]) / 2], axis=1)
    done = np.concatenate([np.zeros((1, 2)), np.cumsum(areas, axis=0)])
    within = done[last[inner]] - done[first[inner]]
    within[within < 1e-12 * np.maximum(done[-1], 1e-300)] = 0.0
    wanted = shared_out(within[:, 0], within[:, 1], SAMPLES_ABOVE)
    begin = np.cumsum(counts.sum(axis=1)) - counts.sum(axis=1)
    picks, owners = [], []
    for kind in range(2):
        owner, rank = well_spread(wanted[:, kind])
        key = child_key(key_of_seed(inner[owner] + (kind << 32)), rank)
        at = (rank + uniform(key, ALONG)) / np.maximum(wanted[:, kind], 1)[owner]
        place = done[first[inner], kind][owner] + within[owner, kind] * at
        smallest = np.clip(np.searchsorted(done[:, kind], place, side="right") - 1, 0, len(areas) - 1)
        inside = (place - done[smallest, kind]) / np.maximum(areas[smallest, kind], 1e-300)
        index = np.clip(
            (inside * counts[smallest, kind]).astype(np.int64), 0, np.maximum(counts[smallest, kind] - 1, 0)
        )
        picks.append(begin[smallest] + (counts[smallest, 0] if kind else 0) + index)
        owners.append(owner)
    order = np.argsort(np.concatenate(owners), kind="stable")
    return samples.take(np.concatenate(picks)[order]), wanted
