# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From an asset's faces to its clusters: bounds, areas, colors, orientation, samples and weights (paper, section 5).

The paper compiles a species before any plant is modeled. Here the model is there, and compiled in the same spirit:
what refinement asks of a cluster is known without looking at its polygons again.

Facets need a fraction of the area of their cluster to block as much light as it does, which is their weight. Leaves
hide each other; a few large facets in their place do so less, and would be too opaque (`proxies.facet_weights` says
more). Parallel rays are cast through the triangles of some clusters of each depth, which let through what is
transparent, and through facets at their samples, as many as there may be.
"""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..arrays import Floats, Integers, perpendicular, unit
from ..compiled.clumping import basis, covered
from ..errors import TetFloraError
from ..growth.hashing import child_key, key_of_seed, uniform
from .asset import COUNTS, Asset, AssetKites, AssetSource, Clusters, SurfaceSamples
from .measures import ALONG, Measured, Run, measured, patch_table_of, runs_of, shared_out, well_spread
from .patches import Hierarchy, hierarchy_of, patches_of

#: Rays across the longer side of a cluster; clusters of a depth that are looked at, and directions.
RAYS, CLUSTERS = 56, 3
DIRECTIONS = np.array([[0.8, 0.5, 0.33166248], [-0.45, 0.85, 0.27386128], [0.35, 0.25, 0.90277350]])
#: Facets for each number of them, over all sets; sets of few large ones; and weights that are tried.
FACETS, FEW_SETS, TRIED = 192, 16, np.array([0.25, 0.5, 0.75, 1.0])
#: Rays that a cluster blocks from which on what they tell counts more than that leaves so sparse hide nothing.
SURE = 64.0
_TURN, _PICK = 245, 246
_CORNERS = np.array([[0.0, 1.0], [-np.sqrt(3) / 2, -0.5], [np.sqrt(3) / 2, -0.5]]) * 2 / 27**0.25


def _facet_weights(
    clusters: Clusters, samples: SurfaceSamples, triangles: Callable[[int], Iterator[Run]]
) -> Generator[float, None, Floats]:
    """Weights (c, counts) for each of `asset.COUNTS`, by the triangles of a cluster in runs; yields what is done."""
    depth = np.zeros(len(clusters), np.int64)
    while (deeper := np.where(clusters.parent >= 0, depth[clusters.parent] + 1, 0)).max() > depth.max():
        depth = deeper
    weights = np.ones((len(clusters), len(COUNTS)))
    for level in range(int(depth.max()) + 1):
        leafy = np.flatnonzero((depth == level) & (clusters.optical_area > 0.0))
        picks = np.unique((np.arange(CLUSTERS) + 0.5) * len(leafy) // CLUSTERS).astype(np.int64)
        sums = np.zeros((2, len(COUNTS), len(TRIED)))
        for cluster in leafy[picks[: len(leafy)]].tolist():
            sums += _looked(clusters, samples, cluster, triangles(cluster))
        weights[depth == level] = _fitting(sums)
        yield 0.85 + 0.15 * (level + 1) / (int(depth.max()) + 1)
    return weights


def _fitting(areas: Floats) -> Floats:
    """Weights (counts,) with which facets block as much: areas (2, counts, tried) of the cluster, and of its facets."""
    wanted, shade = areas
    out = np.ones(len(COUNTS))
    for k in range(len(COUNTS)):
        if shade[k].max() > 0.0:
            out[k] = np.interp(wanted[k, 0], shade[k], TRIED, left=TRIED[0] * wanted[k, 0] / max(shade[k, 0], 1e-300))
        blocked = wanted[k, 0] * RAYS**2
        out[k] = (blocked * out[k] + SURE) / (blocked + SURE)
    return np.clip(out, 0.1, 1.0)


@dataclass(frozen=True)
class _View:
    """A lattice of rays through the bound of a cluster, all in one direction: one a step of u and of v."""

    u: Floats
    v: Floats
    origin: Floats
    step: float

    @classmethod
    def of(cls, clusters: Clusters, cluster: int, direction: Floats) -> Self:
        u, v = basis(direction / np.linalg.norm(direction))
        bound = np.stack([clusters.low[cluster], clusters.high[cluster]])
        box = np.stack(np.meshgrid(*bound.T, indexing="ij"), -1).reshape(-1, 3)
        flat = np.stack([box @ u, box @ v], axis=1)
        return cls(u, v, flat.min(axis=0), max(float(np.ptp(flat, axis=0).max()), 1e-12) / RAYS)

    def met(self, corners: Floats) -> tuple[Integers, Integers]:
        """Triangles (k,) of some (t, 3, 3), and rays (k, 2), that meet."""
        flat = (np.stack([corners @ self.u, corners @ self.v], axis=-1).reshape(-1, 2) - self.origin) / self.step
        first = np.arange(0, len(flat), 3)
        return covered(flat, first, np.full(len(first), 3))


def _looked(clusters: Clusters, samples: SurfaceSamples, cluster: int, runs: Iterator[Run]) -> Floats:
    """Areas (2, counts, tried) that a cluster blocks, and that its facets do, over those of its bound."""
    views = [_View.of(clusters, cluster, direction) for direction in DIRECTIONS]
    through = np.zeros((len(views), RAYS * RAYS))
    for run in runs:
        # Both sides of what is closed count: it is either that blocks a ray.
        light = np.log(np.maximum(1.0 - run.coverage.astype(np.float64), 1e-12))
        for per_ray, view in zip(through, views, strict=True):
            triangle, ray = view.met(run.corners)
            inside = np.flatnonzero(((ray >= 0) & (ray < RAYS)).all(axis=1))
            per_ray += np.bincount(ray[inside, 0] * RAYS + ray[inside, 1], light[triangle[inside]], RAYS * RAYS)
    out = np.zeros((2, len(COUNTS), len(TRIED)))
    out[0] = float((1.0 - np.exp(through)).sum()) / RAYS**2
    for k, count in enumerate(COUNTS):
        for w, weight in enumerate(TRIED):
            for view in views:
                out[1, k, w] += _blocked_by_facets(clusters, samples, cluster, view, float(count), weight)
    return out


def _blocked_by_facets(
    clusters: Clusters, samples: SurfaceSamples, cluster: int, view: _View, count: float, weight: float
) -> float:
    """Area over that of the lattice that ``count`` facets block, the mean of several sets of them."""
    each = max(round(count), 1)
    sets = int(np.ceil(FACETS / each)) if each >= 4 else FEW_SETS
    area = clusters.optical_area[cluster] / count * weight
    # Facets of dense clusters may be far larger than the bound: rays farther apart tell as much about these.
    apart = max(float(np.sqrt(area)) / (RAYS * view.step), 1.0)
    view = replace(view, step=view.step * apart)
    number = np.arange(sets * each)
    owner = number // each
    key = child_key(key_of_seed(number), cluster)
    leaf = clusters.leaf_optical[cluster] / clusters.optical_area[cluster]
    runs = (clusters.leaf_sample, clusters.wood_sample), (clusters.leaf_samples, clusters.wood_samples)
    on_leaf = (number % each + uniform(key_of_seed(owner), _PICK)) / each < leaf
    first, many = (np.where(on_leaf, a[cluster], b[cluster]) for a, b in runs)
    pick = first + np.minimum((uniform(key, _PICK) * many).astype(np.int64), np.maximum(many - 1, 0))
    normal = unit(samples.normal[pick].astype(np.float64))
    across = perpendicular(normal)
    turn = 2 * np.pi * uniform(key, _TURN)[:, None]
    across = np.cos(turn) * across + np.sin(turn) * np.cross(normal, across)
    along = np.cross(normal, across)
    place = samples.position[pick].astype(np.float64)
    corner = _CORNERS[None, :, :1] * across[:, None] + _CORNERS[None, :, 1:] * along[:, None]
    facet, ray = view.met(place[:, None] + np.sqrt(area) * corner)
    if not len(facet):
        return 0.0
    x, y = ray.T  # one by one: numpy takes fifty times as long along two columns at once
    cell = np.sort((owner[facet] * (np.ptp(x) + 1) + x - x.min()) * (np.ptp(y) + 1) + y - y.min())
    # A facet smaller than a step is missed more often than not, but hit by as many rays on the mean.
    return (1 + int(np.count_nonzero(np.diff(cell)))) * apart**2 / sets / RAYS**2 * min(count, 1.0)


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
    for run in runs_of(source, pool, hierarchy):
        parts.append(measured(run))
        yield 0.5 + 0.35 * float(run.cluster[-1] + 1) / len(hierarchy.smallest)
    clusters, samples = _clusters(hierarchy, parts)
    if not clusters.optical_area[0] > 0.0:
        raise TetFloraError(f'"{source.name}": all of its faces are transparent or have no area; choose another object')

    def triangles(cluster: int):
        first, last = _smallest(hierarchy)[1][:, cluster]
        return runs_of(source, pool, hierarchy, int(first), int(last))

    weights = yield from _facet_weights(clusters, samples, triangles)
    part, face = (np.concatenate([getattr(p, name) for p in parts]) for name in ("part", "face"))
    clusters, leaves = replace(clusters, weights=weights), AssetKites.concatenate([p.leaves for p in parts])
    return Asset(source.name, source.digest, clusters, samples, leaves, part, face)


def _smallest(hierarchy: Hierarchy) -> tuple[Integers, Integers]:
    """Clusters (k,) without children, in their order, and which of these each cluster has: (2, c), first and end."""
    small = hierarchy.smallest
    return small, np.stack([np.searchsorted(hierarchy.first[small], of) for of in (hierarchy.first, hierarchy.last)])


def _clusters(hierarchy: Hierarchy, parts: list[Measured]) -> tuple[Clusters, SurfaceSamples]:
    """All clusters, from what is known of the smallest; weights of facets are 1."""
    small, (first, last) = _smallest(hierarchy)
    names = "sums", "low", "high", "counts"
    sums, low, high, counts = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
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
        fraction = (rank + uniform(key, ALONG)) / np.maximum(wanted[:, kind], 1)[owner]
        place = done[first[inner], kind][owner] + within[owner, kind] * fraction
        smallest = np.clip(np.searchsorted(done[:, kind], place, side="right") - 1, 0, len(areas) - 1)
        inside = (place - done[smallest, kind]) / np.maximum(areas[smallest, kind], 1e-300)
        many = counts[smallest, kind]
        index = np.clip((inside * many).astype(np.int64), 0, np.maximum(many - 1, 0))
        picks.append(begin[smallest] + (counts[smallest, 0] if kind else 0) + index)
        owners.append(owner)
    return samples.take(np.concatenate(picks)[np.argsort(np.concatenate(owners), kind="stable")]), wanted
