# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of an asset in the order of its clusters, looked at in runs: areas, bounds, orientation and samples.

A run is of whole clusters without children. What it takes does not grow with the asset.
Leaves are kites as well, which are drawn for a leaf of very few pixels, as for those of species (`leaves.levels`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Mask, chunks, column, spread, unit
from ..buffers import MeshBuffers, separate_polygons
from ..growth.hashing import GOLDEN, child_key, key_of_seed, uniform
from .asset import AssetKites, AssetSource, SurfaceSamples
from .patches import Hierarchy, Patches

#: Standard deviations along an ellipse's diameter, and the narrowest and the widest kite, of its length.
_DIAMETER, _NARROW, _WIDE = 4.0, 0.02, 1.5
_PLANE = 248  # draw of the face in whose plane a kite lies


def kite_mesh(leaves: AssetKites) -> MeshBuffers:
    """Kites (l,) as a mesh with the attributes that the material of proxies reads."""
    corners = [leaves.center - leaves.along, leaves.center - leaves.across]
    corners += [leaves.center + leaves.along, leaves.center + leaves.across]
    looks = {f"tf_{name}": getattr(leaves, name) for name in ("color", "transmission", "roughness")}
    attributes = {name: ("FACE", values.astype(np.float32)) for name, values in looks.items()}
    return separate_polygons(np.stack(corners, axis=1), attributes)


#: Triangles of which all is looked at at a time.
BATCH = 60_000
#: Samples of a cluster without children, and how many either kind of surface has at least.
SAMPLES, FEWEST = 32, 4
_SHEET_TRANSMISSION = 0.3  # transmission of sheets where the material leaves it open
_ROUGHNESS = 0.5  # roughness where nobody knows
#: Draws of the places of samples.
ALONG, _U, _V = 241, 242, 243
#: Islands of solids that are a larger part of all faces' area than this are wood; others are as many as leaves.
_WOOD = 1.0 / 256.0
_THICK = 0.3  # wood of more than this fraction of the largest width is thick
_MANY = 1 << 20  # more than the patches of any small cluster
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class PatchTable:
    """Patches (p) of all parts of a source."""

    patches: tuple[Patches | None, ...]  # by surface
    #: part and patch, (p,): part of the source, and patch of its surface.
    part: Integers32
    patch: Integers32
    center: Floats32  # (p, 3): in the space of the asset
    triangles: Integers32  # (p,)
    woody: Mask  # (p,): of a large solid: a trunk, not a berry or a closed leaf
    kind: NDArray[np.int8]  # (p,): 0 for leaves, 1 for thin wood, 2 for thick


def patch_table_of(source: AssetSource, patches: tuple[Patches | None, ...]) -> PatchTable:
    """All patches of the parts of a source, from those of its surfaces."""
    part, patch = spread(np.array([0 if p is None else len(p) for p in patches])[source.surface])
    center, triangles = np.zeros((len(part), 3), np.float32), np.zeros(len(part), np.int32)
    solid, (island, share, width) = np.zeros(len(part), bool), np.zeros((3, len(part)))
    for s, of_surface in enumerate(patches):
        rows = np.flatnonzero(source.surface[part] == s)
        if of_surface is not None and len(rows):
            matrix = source.matrices[part[rows]].astype(np.float32)
            center[rows] = np.einsum("nij,nj->ni", matrix[:, :3, :3], of_surface.center[patch[rows]]) + matrix[:, :3, 3]
            triangles[rows] = np.diff(of_surface.first)[patch[rows]]
            solid[rows] = of_surface.solid[patch[rows]]
            scale = np.cbrt(np.abs(np.linalg.det(matrix[:, :3, :3])))
            island[rows], width[rows] = of_surface.island[patch[rows]] * scale**2, of_surface.width[patch[rows]] * scale
            # An island is as many patches as it is cut into.
            share[rows] = island[rows] / np.maximum(np.round(of_surface.pieces[patch[rows]]), 1)
    woody = solid & (island > _WOOD * share.sum())
    thick = woody & (width > _THICK * width.max(initial=0.0, where=woody))
    kind = (woody.astype(np.int8) + thick).astype(np.int8)
    return PatchTable(patches, part.astype(np.int32), patch.astype(np.int32), center, triangles, woody, kind)


@dataclass(frozen=True)
class Run(Arrays):
    """Triangles (t) of a run of clusters."""

    cluster: Integers = column(dtype=np.int64)  # (t,): among those without children, in their order; ascending
    corners: Floats = column(3, 3)  # (t, 3, 3): in the space of the asset, meters
    part: Integers32 = column(dtype=np.int32)  # (t,)
    face: Integers32 = column(dtype=np.int32)  # (t,)
    #: new_face and new_patch, (t,): the first triangle of a face, and of a patch.
    new_face: Mask = column(dtype=bool)
    new_patch: Mask = column(dtype=bool)
    color: Floats32 = column(3, dtype=np.float32)  # (t, 3)
    transmission: Floats32 = column(dtype=np.float32)  # (t,)
    coverage: Floats32 = column(dtype=np.float32)  # (t,)
    roughness: Floats32 = column(dtype=np.float32)  # (t,)
    solid: Mask = column(dtype=bool)  # (t,)
    woody: Mask = column(dtype=bool)  # (t,)
    width: Floats32 = column(dtype=np.float32)  # (t,): meters


def runs_of(
    source: AssetSource, pool: PatchTable, hierarchy: Hierarchy, first: int = 0, last: int | None = None
) -> Iterator[Run]:
    """Triangles of the smallest clusters from one to before another, some clusters at a time."""
    small = hierarchy.smallest[first:last]
    done = np.concatenate([[0], np.cumsum(pool.triangles[hierarchy.order], dtype=np.int64)])
    load = done[hierarchy.last[small]] - done[hierarchy.first[small]]
    for run in chunks(load, BATCH):
        clusters = small[run]
        of, index = spread(hierarchy.last[clusters] - hierarchy.first[clusters])
        yield _run(source, pool, hierarchy.order[hierarchy.first[clusters][of] + index], first + run.start + of)


def _run(source: AssetSource, pool: PatchTable, patches: Integers, cluster: Integers) -> Run:
    """Triangles of some patches (k,), each of a cluster (k,)."""
    of, index = spread(pool.triangles[patches])
    part, woody = pool.part[patches][of], pool.woody[patches][of]
    run = replace(Run.zeros(len(of)), cluster=cluster[of], part=part, new_patch=index == 0, woody=woody)
    surface, color, transmission = source.surface[part], run.color, run.transmission
    for s in np.unique(surface):
        rows = np.flatnonzero(surface == s)
        of_surface, shown = pool.patches[s], source.surfaces[s]
        patch = pool.patch[patches][of[rows]]
        triangle = of_surface.triangle[of_surface.first[patch] + index[rows]]
        matrix = source.matrices[part[rows]]
        local = shown.positions[shown.triangles[triangle]].astype(np.float64)
        # By component: numpy multiplies small matrices one by one.
        for i in range(3):
            along = sum(matrix[:, i, k, None] * local[:, :, k] for k in range(3))
            run.corners[rows, :, i] = along + matrix[:, i, 3, None]
        run.face[rows] = of_face = shown.face[triangle]
        color[rows], run.coverage[rows] = shown.color[of_face], shown.coverage[of_face]
        run.roughness[rows] = _ROUGHNESS if shown.roughness is None else shown.roughness[of_face]
        run.solid[rows] = solid = of_surface.solid[patch]
        through = shown.transmission[of_face].astype(np.float32)
        unknown = np.where(solid, np.float32(0.0), np.float32(_SHEET_TRANSMISSION))
        transmission[rows] = np.where(np.isnan(through), unknown, through)
        both = rows[solid & ~woody[rows]]  # a facet or a kite is one sheet in place of the two sides of a closed leaf
        color[both], transmission[both] = through_both_sides(color[both], transmission[both])
        run.width[rows] = of_surface.width[patch] * np.cbrt(np.abs(np.linalg.det(matrix[:, :3, :3])))
    return replace(run, new_face=(np.diff(run.face, prepend=-1) != 0) | (np.diff(part, prepend=-1) != 0))


@dataclass(frozen=True)
class Measured:
    """What is known of the smallest clusters (c) of a run, and samples on them."""

    low: Floats  # (c, 3)
    high: Floats  # (c, 3)
    #: (c, 17): areas of sheets and solids, optical area; faces; patches that are not wood; area of solids that are not;
    #: optical area times width, color (3), transmission, and n nᵀ (6).
    sums: Floats
    samples: SurfaceSamples  # of s
    counts: Integers  # (c, 2): samples on leaves and on wood of each
    leaves: AssetKites  # of l: those of the clusters, one after the other; patches that are not wood
    #: part and face, (f,): faces of the clusters, one after the other.
    part: Integers32
    face: Integers32


def measured(run: Run) -> Measured:
    """Look at the triangles of a run."""
    start = np.flatnonzero(np.diff(run.cluster, prepend=-1))
    owner = np.cumsum(np.diff(run.cluster, prepend=-1) != 0) - 1
    vector = 0.5 * np.cross(run.corners[:, 1] - run.corners[:, 0], run.corners[:, 2] - run.corners[:, 0])
    size = np.linalg.norm(vector, axis=1)
    normal = vector / np.maximum(size, 1e-300)[:, None]
    shown = size * run.coverage
    optical = np.where(run.solid, 0.5, 1.0) * shown
    columns = [np.where(run.solid, 0.0, shown), np.where(run.solid, shown, 0.0), optical, run.new_face]
    columns += [run.new_patch & ~run.woody, np.where(run.solid & ~run.woody, shown, 0.0), optical * run.width]
    columns += [optical * run.color[:, k] for k in range(3)] + [optical * run.transmission]
    columns += [optical * normal[:, i] * normal[:, j] for i, j in _PAIRS]
    sums = np.stack([np.add.reduceat(column.astype(np.float64), start) for column in columns], axis=1)
    samples, counts = _samples(run, owner, start, optical, normal)
    first = np.flatnonzero(run.new_face)
    low = np.minimum.reduceat(run.corners.min(axis=1), start, axis=0)
    high = np.maximum.reduceat(run.corners.max(axis=1), start, axis=0)
    return Measured(low, high, sums, samples, counts, _leaves(run, optical, normal), run.part[first], run.face[first])


def _leaves(run: Run, optical: Floats, normal: Floats) -> AssetKites:
    """Patches that are not wood, as kites; triangles have optical areas (t,), m², and normals (t, 3)."""
    leafy = np.flatnonzero(~run.woody)
    if not len(leafy):
        return AssetKites.empty()
    corners, optical, normal, new = run.corners[leafy], optical[leafy], normal[leafy], run.new_patch[leafy]
    first, leaf = np.flatnonzero(new), np.cumsum(new) - 1
    cluster = run.cluster[leafy[first]]
    number = cluster * _MANY + np.arange(len(first)) - np.searchsorted(cluster, cluster)
    area = np.add.reduceat(optical, first)
    whole = np.maximum(area, 1e-300)[:, None]
    middle = corners.mean(axis=1)
    counted = np.maximum(optical, 1e-200)[:, None]  # leaves of no area are somewhere, too
    center = np.add.reduceat(counted * middle, first, axis=0) / np.add.reduceat(counted, first, axis=0)
    # Second moments of triangles: a twelfth of the sum over corners, and nine twelfths of the middle.
    away = np.concatenate([corners, np.sqrt(9.0) * middle[:, None]], axis=1)
    away[:, :3] -= center[leaf][:, None]
    away[:, 3] -= 3.0 * center[leaf]
    spread = np.zeros((len(first), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            moment = (away[:, :, i] * away[:, :, j]).sum(axis=1) / 12.0
            spread[:, i, j] = spread[:, j, i] = np.add.reduceat(optical * moment, first) / whole[:, 0]
    values, vectors = np.linalg.eigh(spread)
    done = np.cumsum(optical)
    place = (done - optical)[first] + uniform(key_of_seed(number), _PLANE) * area
    pick = np.clip(np.searchsorted(done, place, side="right"), first, np.append(first[1:], len(optical)) - 1)
    plane, long = normal[pick], vectors[:, :, 2]
    along = long - np.einsum("ni,ni->n", long, plane)[:, None] * plane
    flat = np.linalg.norm(along, axis=1) < 0.1  # a face across the leaf, as of its rim: any direction will do
    along[flat] = vectors[flat, :, 1] - np.einsum("ni,ni->n", vectors[flat, :, 1], plane[flat])[:, None] * plane[flat]
    along = unit(along)
    length = _DIAMETER * np.sqrt(np.maximum(values[:, 2], 0.0))
    side = np.sqrt(area)
    length = np.clip(length, side * np.sqrt(2.0 / _WIDE), side * np.sqrt(2.0 / _NARROW))
    width = 2.0 * area / np.maximum(length, 1e-300)
    mean = np.add.reduceat(optical[:, None] * run.color[leafy], first, axis=0) / whole
    looks = (np.add.reduceat(optical * look[leafy], first) / whole[:, 0] for look in (run.transmission, run.roughness))
    along, across = length[:, None] / 2 * along, width[:, None] / 2 * np.cross(plane, along)
    return AssetKites.typed(center, along, across, mean, *looks)


def shared_out(leaf: Floats, wood: Floats, number: int) -> Integers:
    """How many of a number of samples are on leaves and how many on wood (c, 2), by their optical areas (c,)."""
    on_leaves = np.clip(np.rint(number * leaf / np.maximum(leaf + wood, 1e-300)), FEWEST, number - FEWEST)
    on_leaves = np.where(leaf <= 0.0, 0, np.where(wood <= 0.0, number, on_leaves))
    return np.stack([on_leaves, np.where(wood <= 0.0, 0, number - on_leaves)], axis=1).astype(np.int64)


def well_spread(counts: Integers) -> tuple[Integers, Integers]:
    """Owner (m,) and place (m,) of so many things each, in an order in which any run is spread over all of an owner."""
    owner, index = spread(counts)
    rank = np.empty(len(owner), np.int64)
    rank[np.lexsort([index * GOLDEN % 1.0, owner])] = index  # of the owner's things by golden section
    return owner, rank


def _samples(
    run: Run, owner: Integers, start: Integers, optical: Floats, normal: NDArray
) -> tuple[SurfaceSamples, Integers]:
    """Samples of equal areas on leaves, and on wood, of the clusters of a run; leaves first, cluster by cluster."""
    kinds = [np.where(run.woody, 0.0, optical), np.where(run.woody, optical, 0.0)]
    areas = [np.add.reduceat(kind, start) for kind in kinds]
    counts = shared_out(*areas, SAMPLES)
    samples, order = [], []
    for kind, area, count in zip(kinds, areas, counts.T, strict=True):
        cluster, rank = well_spread(count)
        key = child_key(key_of_seed(run.cluster[start][cluster]), rank)
        done = np.cumsum(kind)
        before = (done - kind)[start]
        target = before[cluster] + area[cluster] * (rank + uniform(key, ALONG)) / np.maximum(count, 1)[cluster]
        pick = np.minimum(np.searchsorted(done, target, side="right"), len(kind) - 1)
        # Rounding may lead to a neighbor of another cluster or kind.
        pick = np.clip(pick, start[cluster], np.append(start[1:], len(kind))[cluster] - 1)
        root, v = np.sqrt(uniform(key, _U)), uniform(key, _V)
        weight = np.stack([1 - root, root * (1 - v), root * v], axis=1)
        place = np.einsum("nk,nki->ni", weight, run.corners[pick])
        look = (array[pick] for array in (normal, run.color, run.transmission, run.roughness))
        samples.append(SurfaceSamples.typed(place, *look))
        order.append(cluster)
    return SurfaceSamples.concatenate(samples).take(np.argsort(np.concatenate(order), kind="stable")), counts


def through_both_sides(
    color: NDArray[np.floating], transmission: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Colors (n, 3) and transmissions (n,) of closed leaves as one sheet, from those of their sides.

    Light that passes the first side meets the second from within, again and again: with r and t of a side, the whole
    reflects r + t² r / (1 − r²), and t² / (1 − r²) goes through (Stokes 1862).
    """
    through = color * transmission[:, None]
    back = color - through
    again = 1.0 / np.maximum(1.0 - back**2, 1e-6)
    passed = through**2 * again
    whole = back + through**2 * back * again + passed
    return whole, passed.sum(axis=1) / np.maximum(whole.sum(axis=1), 1e-12)
