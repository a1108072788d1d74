# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of your own meshes that stay as they are, as meshes in world space.

A face whose fragments are all kept comes out as the face that it was.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Integers32, chunks, spread
from ..buffers import BLOCK_POLYGONS, MeshBuffers
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.polygons import Polygons, area_fractions

#: Shapes of attributes by their number of components; a mesh cannot hold others.
_FLOATS = {1: (), 2: (2,), 3: (3,)}
#: Part of a face that may be missing through rounding errors alone.
_WHOLE = 1e-6


@dataclass(frozen=True)
class PolygonBlock:
    """Polygons of one surface in one block of space."""

    surface: int  # index into the surfaces of the meshes
    number: int  # of the block, front to back
    buffers: MeshBuffers  # ``material_index`` is the surface's slot
    fraction: float  # fraction of all polygons that is done with this block


def kept_polygons(result: Refinement) -> Polygons:
    """Polygons that are kept where shells stand for all others: all in explicit tetrahedra, and large ones."""
    held = result.cell_polygons.polygons
    proxy = result.chosen(Decision.PROXY, Decision.HIDDEN)[held.cell]
    kept = np.flatnonzero(~proxy | np.isinf(held.totals.width))
    rank = np.zeros(len(result.tree), np.int64)
    rank[result.nodes] = result.rank
    return mended(held.items.take(kept[np.argsort(rank[held.cell[kept]], kind="stable")]))


def polygon_blocks(polygons: Polygons) -> Iterator[PolygonBlock]:
    """Polygons as meshes, some at a time."""
    runs = list(chunks(np.maximum(polygons.triangle_counts / 2, 1), BLOCK_POLYGONS))  # of quads; others by corners
    for number, run in enumerate(runs):
        own = polygons.take(run)
        surface = own.meshes.surface[own.instance]
        for s in np.unique(surface):
            buffers = polygon_buffers(own.take(surface == s))
            yield PolygonBlock(int(s), number, buffers, (number + 1) / len(runs))


def mended(polygons: Polygons) -> Polygons:
    """The same polygons, with a face in place of its first fragment where all of its fragments are there."""
    cut = np.flatnonzero(polygons.part >= 0)
    if not len(cut):
        return polygons
    meshes = polygons.meshes
    key = polygons.instance[cut].astype(np.int64) * len(meshes.face_size) + polygons.face[cut]
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    there = np.bincount(number, area_fractions(polygons.weights)[polygons.part[cut]])
    complete = there >= meshes.face_size[polygons.face[cut[first]]] - 2 - _WHOLE
    part = polygons.part.copy()
    part[cut[complete[number]]] = -1
    stays = np.ones(len(polygons), bool)
    stays[cut[complete[number]]] = False
    stays[cut[first[complete]]] = True
    return replace(polygons, part=part).take(stays)


def polygon_buffers(polygons: Polygons) -> MeshBuffers:
    """Polygons of one surface as a mesh in world space.

    Whole faces share vertices and edges as in the surface, unless they have one twice; fragments are separate. Faces of
    mirrored instances are turned around, as in Blender. Normals, where the surface has any, are the attribute
    ``custom_normal``.
    """
    meshes = polygons.meshes
    cut = polygons.part >= 0
    whole, pieces = polygons.take(~cut), polygons.take(cut)
    corner, instance, size = _face_corners(whole)
    # Corners of faces with a vertex twice get vertices of their own, which keeps the mesh valid.
    own_place = np.repeat(meshes.degenerate[whole.face], size)
    count = len(meshes.positions)
    place = np.where(own_place, count + corner, meshes.corner_verts[corner])
    places = count + len(meshes.corner_verts)
    vertices, corner_verts = np.unique(instance.astype(np.int64) * places + place, return_inverse=True)
    own, vertex = np.divmod(vertices, max(places, 1))
    loose = vertex >= count
    vertex[loose] = meshes.corner_verts[vertex[loose] - count]
    points = meshes.to_world(meshes.positions[vertex][:, None], own)[:, 0]
    offsets = np.cumsum([0, *size])
    edges, corner_edges = _edges(corner_verts.reshape(-1), offsets, len(vertices))

    turn = np.where(meshes.mirrored[pieces.instance][:, None], [[0, 2, 1]], [[0, 1, 2]])
    weights = np.take_along_axis(pieces.weights[pieces.part], turn[:, :, None], axis=1)
    triangle = pieces.triangle[pieces.part]
    fragments = (weights @ meshes.corners(triangle, pieces.instance)).reshape(-1, 3)
    every = np.arange(len(fragments))
    after = every - every % 3 + (every + 1) % 3

    surface = int(meshes.surface[polygons.instance[0]])
    shown = meshes.surfaces[surface]
    first = meshes.first_corner[surface]
    attributes: dict[str, tuple[str, NDArray]] = {}
    for name, values in shown.attributes.items():
        if values.shape[1] in _FLOATS:
            both = _at_corners(values, corner - first, meshes.triangles[triangle] - first, weights)
            attributes[name] = ("CORNER", both.reshape(-1, *_FLOATS[values.shape[1]]).astype(np.float32))
    if shown.normals is not None:
        normals = _at_corners(shown.normals, corner - first, meshes.triangles[triangle] - first, weights)
        which = np.concatenate([instance, np.repeat(pieces.instance, 3)])
        normals = np.einsum("ni,nij->nj", normals, meshes.cofactors[which])
        normals *= np.where(meshes.mirrored[which], -1.0, 1.0)[:, None]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        attributes["custom_normal"] = ("CORNER", normals.astype(np.float32))
    faces = np.concatenate([whole.face, pieces.face])
    attributes["material_index"] = ("FACE", shown.material[faces - meshes.first_face[surface]].astype(np.int32))
    return MeshBuffers(
        positions=np.concatenate([points, fragments]).astype(np.float32),
        edge_verts=np.concatenate([edges, np.stack([every, after], axis=1) + len(points)]).astype(np.int32),
        corner_verts=np.concatenate([corner_verts.reshape(-1), every + len(points)]).astype(np.int32),
        corner_edges=np.concatenate([corner_edges, every + len(edges)]).astype(np.int32),
        face_offsets=np.concatenate([offsets, offsets[-1] + 3 * (1 + np.arange(len(pieces)))]).astype(np.int32),
        attributes=attributes,
        smooth=shown.normals is not None,
    )


def _face_corners(whole: Polygons) -> tuple[Integers, Integers32, Integers]:
    """Corners (c,) of faces, the instance (c,) of each, and how many (f,) each face has."""
    meshes = whole.meshes
    size = meshes.face_size[whole.face]
    owner, index = spread(size)
    mirrored = meshes.mirrored[whole.instance][owner]
    index = np.where(mirrored, size[owner] - 1 - index, index)
    return meshes.face_start[whole.face][owner] + index, whole.instance[owner], size


def _edges(corner_verts: NDArray, offsets: NDArray, vertices: int) -> tuple[Integers, Integers]:
    """Edges (e, 2) of faces, each once, and that from each corner (c,) to the next."""
    following = np.arange(len(corner_verts)) + 1
    following[offsets[1:] - 1] = offsets[:-1]
    after = corner_verts[following]
    key = np.minimum(corner_verts, after) * max(vertices, 1) + np.maximum(corner_verts, after)
    edges, number = np.unique(key, return_inverse=True)
    return np.stack(np.divmod(edges, max(vertices, 1)), axis=1), number.reshape(-1)


def _at_corners(values: NDArray, corner: Integers, triangle: Integers, weights: Floats) -> Floats:
    """Values at corners of whole faces, then at those of fragments (n, 3, 3) of triangles (n, 3)."""
    between = (weights @ values[triangle].astype(np.float64)).reshape(-1, values.shape[1])
    return np.concatenate([values[corner].astype(np.float64), between])
