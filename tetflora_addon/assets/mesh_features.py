# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the faces of any mesh are part of: sheets such as leaves, or solids such as trunks, and how wide these are.

A species says which of its polygons are leaves. Of other meshes only the connections between faces are known, once
vertices at the same place are merged: many files split them at seams.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, connected
from ..storage import memoized

#: Bytes of cached features, ten a face.
MOST_BYTES = 128 << 20
#: Squared boundary over area of a flat sheet, at least (a disc has 4π, a half ball 2π): with less it is bent back.
_SHEET = 2 * np.pi
#: A face of a leaf has at least this fraction, squared, of the leaf's extent.
_LEAF_FRACTION = 1 / 16
#: Leaves are many: none is larger than this fraction of the area of all in the mesh. A wall of one face is no leaf.
_ONE_OF_MANY = 1 / 64
#: How often curvature is averaged over neighbors: some faces around a branch.
_ROUNDS = 6


def classified(positions: Floats, corner_verts: Integers, face_offsets: Integers) -> tuple[Mask, Mask, Floats]:
    """Classify the faces of a mesh.

    Parameters
    ----------
    positions : (v, 3) float64
    corner_verts : (c,) int
    face_offsets : (f + 1,) int

    Returns
    -------
    solid : (f,) bool
        Of a closed surface, or a tube with open ends: half of it is never seen.
    leaf : (f,) bool
        Of a sheet that consists of few faces, and is one of many.
    width : (f,) float64
        Of the leaf, or the local thickness of the solid, in the unit of the positions.

    Notes
    -----
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
    vector, center = _measures(positions, corner_verts, face_offsets, following, sizes)
    area = np.linalg.norm(vector, axis=1)
    number = int(component.max()) + 1
    total = np.bincount(component, area, number)
    extent = _extents(positions[corner_verts], component[face_of_corner], number)

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


def _measures(
    positions: NDArray, corner_verts: NDArray, face_offsets: NDArray, following: NDArray, sizes: NDArray
) -> tuple[Floats, Floats]:
    """Area vectors and mean corners (f, 3) of faces."""
    points = positions[corner_verts]
    center = np.add.reduceat(points, face_offsets[:-1], axis=0) / sizes[:, None]
    points = points - np.repeat(center, sizes, axis=0)
    return 0.5 * np.add.reduceat(np.cross(points, points[following]), face_offsets[:-1], axis=0), center


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
    angle = np.arctan2(
        np.linalg.norm(np.cross(normal[a], normal[b]), axis=1), np.einsum("ni,ni->n", normal[a], normal[b])
    )
    bulge = np.einsum("ni,ni->n", normal[a] - normal[b], center[a] - center[b])
    own = 0.25 * length * angle * np.sign(bulge)  # half of ½ l θ to either face
    own[(area[a] <= 0) | (area[b] <= 0)] = 0.0
    integral = np.bincount(a, own, faces) + np.bincount(b, own, faces)
    around, weight = area.copy(), 1.0 + np.bincount(a, minlength=faces) + np.bincount(b, minlength=faces)
    for _ in range(_ROUNDS):
        integral, around = (
            (v + np.bincount(a, v[b], faces) + np.bincount(b, v[a], faces)) / weight for v in (integral, around)
        )
    return np.abs(integral) / np.maximum(around, 1e-300)


#: `classified`, its results kept for as long as there is room: each frame of an animation needs the same again.
mesh_features = memoized(MOST_BYTES)(classified)
