# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Patches of a mesh: its islands, such as leaves, and pieces of islands that are large, such as trunks.

Clusters are made of whole patches, so that no leaf is in two of them. Blender calls connected faces an island.

Clusters are a hierarchy, as a species has orders of branches. Patches are divided in space, each time in two where a
cluster is longest and half of the triangles are on either side (a k-d tree; Bentley 1975); three at once, into eight.

What the faces of any mesh are part of: sheets such as leaves, or solids such as trunks, and how wide these are.

A species says which of its polygons are leaves. Of other meshes only the connections between faces are known, once
vertices at the same place are merged: many files split them at seams.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Integers32, Mask, connected, spread
from ..growth.hashing import mix
from ..parallel import blocks
from ..storage import memoized
from .asset import AssetSurface

#: Bytes of cached features, ten a face.
MOST_BYTES = 128 << 20
#: Squared boundary over area of a flat sheet, at least (a disc has 4π, a half ball 2π): with less it is bent back.
_SHEET = 2 * np.pi
_LEAF_FRACTION = 1 / 16  # a face of a leaf has at least this fraction, squared, of the leaf's extent
#: Leaves are many: none is larger than this fraction of the area of all in the mesh. A wall of one face is no leaf.
_ONE_OF_MANY = 1 / 64
_ROUNDS = 6  # how often curvature is averaged over neighbors: some faces around a branch


def _classified(positions: Floats, corner_verts: Integers, face_offsets: Integers) -> tuple[Mask, Mask, Floats]:
    """Which faces (f,) of a mesh are of solids, which of leaves, and widths (f,) of either, in the unit of positions.

    The mesh has positions (v, 3), vertices of corners (c,), and first corners of faces (f + 1,). Solids are closed, or
    tubes with open ends: half of them is never seen. A leaf is a sheet that consists of few faces, and is one of many.

    Components are connected faces. The width of a sheet is its area over its extent. That of a solid is 1 / H, with
    Steiner's mean curvature H of polyhedra (half the sum of edge length × signed angle, over the area) averaged over
    neighbors: 2 r for a long tube, r for a ball, no less for rough ground, where bumps and hollows cancel. Edges of
    no, one or many faces, faces of no area and faces that touch themselves are all allowed.
    """
    faces = len(face_offsets) - 1
    if not faces:
        return np.zeros(0, bool), np.zeros(0, bool), np.zeros(0)
    welded = _welded(positions)[corner_verts]
    sizes = np.diff(face_offsets)
    face_of_corner = np.repeat(np.arange(faces), sizes)
    following = np.arange(len(corner_verts)) + 1
    following[face_offsets[1:] - 1] = face_offsets[:-1]
    label = connected(int(welded.max()) + 1, welded, welded[following])
    component = np.unique(label[welded[face_offsets[:-1]]], return_inverse=True)[1].reshape(-1)
    points = positions[corner_verts]
    extent = _extents(points, component[face_of_corner], int(component.max()) + 1)
    center = np.add.reduceat(points, face_offsets[:-1], axis=0) / sizes[:, None]
    points = points - np.repeat(center, sizes, axis=0)
    vector = 0.5 * np.add.reduceat(np.cross(points, points[following]), face_offsets[:-1], axis=0)
    area = np.linalg.norm(vector, axis=1)
    total, number = np.bincount(component, area), len(extent)

    # Edges, as pairs of welded vertices; both half edges of a pair lie side by side after sorting.
    start, end = welded, welded[following]
    length = np.linalg.norm(positions[corner_verts[following]] - positions[corner_verts], axis=1)
    low, high = np.minimum(start, end).astype(np.int64), np.maximum(start, end)
    key = low * (int(welded.max()) + 1) + high
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    uses = np.diff(first, append=len(order))
    real = start[order[first]] != end[order[first]]
    alone = order[first[(uses == 1) & real]]
    boundary = np.bincount(component[face_of_corner[alone]], length[alone], number)
    closed = (boundary**2 < _SHEET * total) & (total > 0)
    pairs = first[(uses == 2) & real]
    a, b = face_of_corner[order[pairs]], face_of_corner[order[pairs + 1]]

    solid = closed[component]
    mean_width = np.where(closed, 0.5, 1.0) * total / np.where(extent > 0, extent, 1.0)
    width = mean_width[component]
    curved = 2.0 * _mean_curvature(vector, area, center, a, b, length[order[pairs]], faces)
    with np.errstate(divide="ignore"):
        local = np.where(curved > 0, 2.0 / np.maximum(curved, 1e-300), np.inf)
    width = np.where(solid, np.minimum(width, local), width)
    leaf = ~solid & (area >= _LEAF_FRACTION * extent[component] ** 2)
    leaf &= total[component] <= _ONE_OF_MANY * area[leaf].sum()
    return solid, leaf, width


def _welded(positions: Floats) -> Integers:
    """Number (v,) of the place of each vertex."""
    order = np.lexsort(positions.T)
    sorted_ = positions[order]
    new = np.ones(len(order), bool)
    new[1:] = (sorted_[1:] != sorted_[:-1]).any(axis=1)
    place = np.zeros(len(order), np.int64)
    place[order] = np.cumsum(new) - 1
    return place


def _extents(points: Floats, component: NDArray, number: int) -> Floats:
    """Diagonals (n,) of the boxes around components."""
    order = np.argsort(component, kind="stable")
    first = np.searchsorted(component[order], np.arange(number))
    points = points[order]
    return np.linalg.norm(np.maximum.reduceat(points, first) - np.minimum.reduceat(points, first), axis=1)


def _mean_curvature(
    vector: NDArray, area: NDArray, center: NDArray, a: NDArray, b: NDArray, length: NDArray, faces: int
) -> Floats:
    """Mean curvature H (f,), averaged over neighbors; positive where the surface bulges to the side of its normals.

    Faces that are turned inside out would make it negative; what counts is its amount.
    """
    normal = vector / np.maximum(area, 1e-300)[:, None]
    sine, cosine = np.linalg.norm(np.cross(normal[a], normal[b]), axis=1), np.einsum("ni,ni->n", normal[a], normal[b])
    angle = np.arctan2(sine, cosine)
    bulge = np.einsum("ni,ni->n", normal[a] - normal[b], center[a] - center[b])
    bend = 0.25 * length * angle * np.sign(bulge)  # half of ½ l θ to either face
    bend[(area[a] <= 0) | (area[b] <= 0)] = 0.0
    integral = np.bincount(a, bend, faces) + np.bincount(b, bend, faces)
    around, weight = area.copy(), 1.0 + np.bincount(a, minlength=faces) + np.bincount(b, minlength=faces)
    for _ in range(_ROUNDS):
        integral, around = (
            (v + np.bincount(a, v[b], faces) + np.bincount(b, v[a], faces)) / weight for v in (integral, around)
        )
    return np.abs(integral) / np.maximum(around, 1e-300)


#: `_classified`, its results kept for as long as there is room: each frame of an animation needs the same again.
mesh_features = memoized(MOST_BYTES)(_classified)


#: Faces of a patch at most; an island with more is cut into pieces of about so many that lie together.
MOST_FACES = 48
#: Triangles whose features are found at a time; bounds what that takes to some thirty megabytes.
BATCH = 100_000
_BITS = 10  # bits of a coordinate of the curve along which large islands are cut


@dataclass(frozen=True)
class Patches:
    """Patches (p) of a surface, and its triangles in their order."""

    triangle: Integers32  # (t,): triangles of the surface, patch after patch, those of a face together
    first: Integers  # (p + 1,): first of these of each patch
    faces: Integers32  # (p,): faces of each
    solid: Mask  # (p,): of a closed surface, or a tube with open ends: half of it is never seen
    width: Floats32  # (p,): of the leaf, or the local thickness of the solid, in the unit of the positions
    center: Floats32  # (p, 3): mean of its corners
    island: Floats32  # (p,): area of the island that each is or is cut from, in that unit squared
    pieces: Integers32  # (p,): how many that island is cut into

    def __len__(self) -> int:
        return len(self.faces)


def patches_of(surface: AssetSurface) -> Patches:
    """Divide a surface, which has faces, into patches."""
    island = islands(surface)
    triangle = np.argsort(island, kind="stable").astype(np.int32)
    island = island[triangle]
    solid, width = _features(surface, triangle, island)
    # Faces in that order: all of their triangles are in one island, and lie together.
    new_face = np.diff(surface.face[triangle], prepend=-1) != 0
    new_island = np.diff(island, prepend=-1) != 0
    start = np.flatnonzero(new_island)
    count = np.bincount(np.cumsum(new_island) - 1, new_face).astype(np.int64)
    if (count > MOST_FACES).any():
        places, sorted_ = _along_a_curve(surface, triangle, new_island, count > MOST_FACES)
        for column in (triangle, solid, width):
            column[places] = column[sorted_]
        new_face = np.diff(surface.face[triangle], prepend=-1) != 0
    number = np.cumsum(new_face) - np.cumsum(new_face)[start][np.cumsum(new_island) - 1]
    most = -(-count // np.ceil(count / MOST_FACES).astype(np.int64))
    new = new_island | (new_face & (number % most[np.cumsum(new_island) - 1] == 0))
    first = np.append(np.flatnonzero(new), len(triangle))
    owner = np.cumsum(new) - 1
    size = np.maximum(np.diff(first), 1)
    center, area = np.zeros((len(size), 3), np.float32), np.zeros(len(triangle), np.float32)
    for run in blocks(len(triangle), BATCH):
        corners = surface.positions[surface.triangles[triangle[run]]]
        sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area[run] = 0.5 * np.linalg.norm(np.cross(*sides), axis=1)
        for axis in range(3):
            center[:, axis] += np.bincount(owner[run], corners[:, :, axis].mean(axis=1), len(size))
    center /= size[:, None]
    faces = np.bincount(owner, new_face).astype(np.int32)
    mean_width = (np.add.reduceat(width, first[:-1]) / size).astype(np.float32)
    of = np.cumsum(new_island)[first[:-1]] - 1
    whole, pieces = np.add.reduceat(area, start)[of].astype(np.float32), np.bincount(of)[of].astype(np.int32)
    return Patches(triangle, first, faces, solid[first[:-1]], mean_width, center, whole, pieces)


def islands(surface: AssetSurface) -> Integers32:
    """Island (t,) of each triangle of a surface: many files split vertices at seams, so those of one place are one."""
    place = _places(surface.positions)
    corners = place[surface.triangles]
    # Triangles of a face hang together, whatever their corners.
    same = np.flatnonzero(np.diff(surface.face) == 0)
    a = np.concatenate([corners[:, 0], corners[:, 1], corners[same, 0]])
    b = np.concatenate([corners[:, 1], corners[:, 2], corners[same + 1, 0]])
    return connected(int(place.max(initial=-1)) + 1, a, b)[corners[:, 0]]


def _places(positions: Floats32) -> Integers32:
    """Number (v,) of the place of each vertex, by a hash of its coordinates."""
    bits = np.ascontiguousarray(positions + np.float32(0.0)).view(np.uint32)  # no negative zeros
    key = mix(mix(bits[:, 0].astype(np.uint64) << np.uint64(32) | bits[:, 1]) ^ bits[:, 2])
    order = np.argsort(key, kind="stable")
    key = key[order]
    new = np.ones(len(key), bool)
    new[1:] = key[1:] != key[:-1]
    place = np.empty(len(order), np.int32)
    place[order] = np.cumsum(new, dtype=np.int32) - 1
    return place


def _features(surface: AssetSurface, triangle: Integers32, island: Integers32) -> tuple[Mask, Floats32]:
    """Whether triangles (t,), sorted by island, are of solids, and how wide what they are of is."""
    solid, width = np.zeros(len(triangle), bool), np.zeros(len(triangle), np.float32)
    # Whole islands of about `BATCH` triangles at a time.
    first = np.flatnonzero(np.diff(island, prepend=-1))
    starts = first[np.flatnonzero(np.diff(first // BATCH, prepend=-1))].tolist()
    for start, stop in zip(starts, [*starts[1:], len(island)], strict=True):
        run = slice(start, stop)
        corners = surface.triangles[triangle[run]]
        used, vertex = np.unique(corners, return_inverse=True)
        offsets = np.arange(0, corners.size + 1, 3)
        positions = surface.positions[used].astype(np.float64)
        solid[run], _, width[run] = _classified(positions, vertex.reshape(-1).astype(np.int32), offsets)
    return solid, width


def _along_a_curve(
    surface: AssetSurface, triangle: Integers32, new_island: Mask, large: Mask
) -> tuple[Integers, Integers]:
    """Places (k,) of the triangles of large islands, and what is to be there (k,) to follow a curve that fills space.

    All triangles of a face stay together. The curve is Morton's ("A computer oriented geodetic data base", 1966).
    """
    start = np.append(np.flatnonzero(new_island), len(triangle))
    owner, index = spread(np.diff(start)[large])
    places = start[:-1][large][owner] + index
    corners = surface.positions[surface.triangles[triangle[places]]].mean(axis=1, dtype=np.float32)
    face = surface.face[triangle[places]]
    # All triangles of a face go where its first one is.
    corners = corners[np.maximum.accumulate(np.where(np.diff(face, prepend=-1) != 0, np.arange(len(places)), 0))]
    low = corners.min(axis=0)
    cell = (corners - low) / max(float((corners.max(axis=0) - low).max()), 1e-30) * ((1 << _BITS) - 1)
    code = np.zeros(len(places), np.int64)
    for axis in range(3):
        # Bits of numbers (n,) below 1,024 with two zeros between them.
        value = cell[:, axis].astype(np.int64)
        value = (value | value << 16) & 0x030000FF
        value = (value | value << 8) & 0x0300F00F
        value = (value | value << 4) & 0x030C30C3
        code |= ((value | value << 2) & 0x09249249) << axis
    return places, places[np.lexsort([face, code, owner])]


#: Triangles up to which a cluster has no children.
SMALL = 256
#: Divisions between a cluster and its children.
GENERATIONS = 3


@dataclass(frozen=True)
class Hierarchy:
    """Clusters (c), parents before children and children of one parent together; the first is all of the asset."""

    order: Integers  # (p,): patches, those of each cluster together
    #: first and last, (c,): which of them are of each: from the first on, before the last.
    first: Integers
    last: Integers
    parent: Integers32  # (c,): −1 for the first
    #: child and children, (c,): first child, and how many there are; 0 where there are none.
    child: Integers32
    children: Integers32

    @cached_property
    def smallest(self) -> Integers:
        """Clusters (k,) without children, in the order of their patches."""
        small = np.flatnonzero(self.children == 0)
        return small[np.argsort(self.first[small], kind="stable")]


def hierarchy_of(center: NDArray[np.floating], triangles: Integers, kind: Integers) -> Hierarchy:
    """Clusters of patches with middles (p, 3) and so many triangles (p,) each, at least one patch.

    Kinds (p,) are divided before anything else: a trunk among leaves would be as small as these for all that asks.
    """
    order = np.argsort(kind, kind="stable")
    first, last, parent = [np.zeros(1, np.int64)], [np.array([len(center)])], [np.array([-1])]
    start, stop, number, known = first[0], last[0], np.zeros(1, np.int64), 1
    begin = np.flatnonzero(np.diff(kind[order], prepend=-1))
    if len(begin) > 1:
        start, stop = begin.astype(np.int64), np.append(begin[1:], len(center))
        first.append(start)
        last.append(stop)
        parent.append(np.zeros(len(begin), np.int64))
        number, known = np.arange(1, 1 + len(begin)), 1 + len(begin)
    # The first cluster has fewer children, so that the last divisions, too, come as many at once.
    depth = max(int(np.ceil(np.log2(max(float(triangles.sum()), 1.0) / SMALL))), 0)
    generations = depth % GENERATIONS or GENERATIONS
    while len(number):
        inner, low, high = number, start, stop
        for _ in range(generations):
            order, low, high, inner = _divided(order, low, high, inner, center, triangles)
        # A cluster that is not divided any more has itself as its only child.
        real = np.bincount(inner, minlength=known)[inner] > 1
        start, stop, of = low[real], high[real], inner[real]
        first.append(start)
        last.append(stop)
        parent.append(of)
        number, known, generations = np.arange(known, known + len(of)), known + len(of), GENERATIONS
    parents = np.concatenate(parent).astype(np.int32)
    children = np.bincount(parents[1:], minlength=known).astype(np.int32)
    child = np.where(children > 0, np.searchsorted(parents[1:], np.arange(known)) + 1, 0)
    return Hierarchy(order, np.concatenate(first), np.concatenate(last), parents, child.astype(np.int32), children)


def _divided(
    order: Integers, low: Integers, high: Integers, number: Integers, center: NDArray[np.floating], triangles: Integers
) -> tuple[Integers, Integers, Integers, Integers]:
    """Divide runs (r,) of the order in two where they are large; new order, runs, and where each comes from."""
    size = high - low
    owner, within = spread(size)
    index = low[owner] + within
    patch = order[index]
    weight = triangles[patch].astype(np.float64)
    begin = np.cumsum(size) - size
    load = np.add.reduceat(weight, begin)
    dividing = (load > SMALL) & (size > 1)
    if not dividing.any():
        return order, low, high, number
    points = center[patch]
    least, most = np.minimum.reduceat(points, begin, axis=0), np.maximum.reduceat(points, begin, axis=0)
    axis = (most - least).argmax(axis=1)
    along = np.take_along_axis(points, axis[owner][:, None], axis=1)[:, 0].astype(np.float64)
    span = np.maximum((most - least)[np.arange(len(low)), axis], 1e-30)
    # What is not divided keeps its order. Equal places keep theirs, too, whatever sorts them.
    place = np.where(dividing[owner], (along - least[owner, axis[owner]]) / span[owner], 0.0)
    sorted_ = np.argsort(2 * owner + np.clip(place, 0.0, 1.0), kind="stable")
    order = order.copy()
    order[index] = patch[sorted_]
    before = np.cumsum(weight[sorted_]) - weight[sorted_] - (np.cumsum(load) - load)[owner]
    half = np.bincount(owner, before < load[owner] / 2, len(low)).astype(np.int64)
    half = np.clip(half, 1, np.maximum(size - 1, 1))
    middle = low + half
    runs = np.repeat(np.arange(len(low)), 1 + dividing)
    second = np.diff(runs, prepend=-1) == 0
    new_low = np.where(second, middle[runs], low[runs])
    return order, new_low, np.where(~second & dividing[runs], middle[runs], high[runs]), number[runs]
