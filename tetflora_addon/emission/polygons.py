# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Explicit polygons that refinement keeps, and facets that stand for the others.

Polygons are kept where they are seen and where a facet would be no smaller. A face whose fragments are all kept comes
out as the face that it was.

Facets are a stochastic simplification (Cook, Halstead, Planck and Ryu, SIGGRAPH 2007): of many small triangles few are
chosen at random, in proportion to their area, and their facets make up for the rest. The facets of a triangle depend
only on its own number: they stay when others come into view or are kept. Chances are spread evenly along the triangles
of a mesh, which keeps its area with little noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread, unit
from ..buffers import BLOCK_POLYGONS, MeshBuffers
from ..camera.camera import Camera
from ..growth.hashing import child_key, key_of_seed, mix, stepped, uniform
from ..proxies.facet_sizes import polygon_facet_sizes
from ..proxies.microsurfaces import Facets, kept_out_of_view
from ..refinement.contents import Held
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.polygons import Polygons, area_fractions
from ..subplants.pieces import chunks

#: Shapes of attributes by their number of components; a mesh cannot hold others.
_FLOATS = {1: (), 2: (2,), 3: (3,)}
#: Part of a face that may be missing through rounding errors alone.
_WHOLE = 1e-6
#: Draws of the place of a facet in its triangle.
_PLACE_U, _PLACE_V = 222, 223


@dataclass(frozen=True)
class PolygonBlock:
    """Polygons of one surface in one block of space.

    Attributes
    ----------
    surface : int
        Index into the surfaces of the meshes.
    number : int
        Of the block, front to back.
    buffers : MeshBuffers
        ``material_index`` is the surface's slot.
    fraction : float
        Fraction of all polygons that is done with this block.
    """

    surface: int
    number: int
    buffers: MeshBuffers
    fraction: float


def polygon_blocks(result: Refinement, camera: Camera, facet_pixels: float | None = 0.6) -> Iterator[PolygonBlock]:
    """Polygons that are kept: all in explicit tetrahedra, and those in others that are no smaller than a facet.

    Parameters
    ----------
    result : Refinement
    camera : Camera
    facet_pixels : float or None
        Side of a facet that is seen, in pixels; None where proxies are shells, which stand for all but large polygons.
    """
    held = result.holdings.polygons
    if not len(held):
        return
    cell = held.cell
    kept = ~result.chosen(Decision.PROXY, Decision.HIDDEN)[cell]
    if facet_pixels is None:
        kept |= ~np.isfinite(held.totals.width)
    else:
        sizes = polygon_facet_sizes(held, camera, result.chosen(Decision.HIDDEN))
        kept |= sizes.kept(facet_pixels)
    rank = np.zeros(len(result.tree), np.int64)
    rank[result.nodes] = result.rank
    polygons, rank = held.items.take(kept), rank[cell[kept]]
    order = np.argsort(rank, kind="stable")
    polygons = mended(polygons.take(order))
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


def _face_corners(whole: Polygons) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
    """Corners (c,) of faces, the instance (c,) of each, and how many (f,) each face has."""
    meshes = whole.meshes
    size = meshes.face_size[whole.face]
    owner, index = spread(size)
    mirrored = meshes.mirrored[whole.instance][owner]
    index = np.where(mirrored, size[owner] - 1 - index, index)
    return meshes.face_start[whole.face][owner] + index, whole.instance[owner], size


def _edges(corner_verts: NDArray, offsets: NDArray, vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges (e, 2) of faces, each once, and that from each corner (c,) to the next."""
    following = np.arange(len(corner_verts)) + 1
    following[offsets[1:] - 1] = offsets[:-1]
    after = corner_verts[following]
    key = np.minimum(corner_verts, after) * max(vertices, 1) + np.maximum(corner_verts, after)
    edges, number = np.unique(key, return_inverse=True)
    return np.stack(np.divmod(edges, max(vertices, 1)), axis=1), number.reshape(-1)


def _at_corners(
    values: NDArray, corner: NDArray[np.integer], triangle: NDArray[np.integer], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Values at corners of whole faces, then at those of fragments (n, 3, 3) of triangles (n, 3)."""
    between = (weights @ values[triangle].astype(np.float64)).reshape(-1, values.shape[1])
    return np.concatenate([values[corner].astype(np.float64), between])


def hidden_polygon_facets(
    result: Refinement, camera: Camera, facet_pixels: float, at_once: float
) -> Iterator[tuple[str, Facets, bool]]:
    """`polygon_facets` of all polygons in proxies, hidden or not, each with the look of their surfaces before."""
    held = result.holdings.polygons
    proxies = held.take(result.chosen(Decision.PROXY, Decision.HIDDEN)[held.cell])
    if not len(proxies):
        return
    meshes = proxies.items.meshes
    looks = np.array([surface.look for surface in meshes.surfaces])[meshes.surface[proxies.items.instance]]
    for look in np.unique(looks).tolist():
        for made in polygon_facets(proxies.take(looks == look), result, camera, facet_pixels, at_once):
            yield look, *made


def polygon_facets(
    held: Held[Polygons], result: Refinement, camera: Camera, facet_pixels: float, at_once: float = np.inf
) -> Iterator[tuple[Facets, bool]]:
    """Facets of the polygons of proxies (``held``) that are not kept, about ``at_once`` at a time.

    Yields facets and whether they are seen: neither hidden nor beside the view.
    """
    sizes = polygon_facet_sizes(held, camera, result.chosen(Decision.HIDDEN))
    side, inside = sizes.sides(facet_pixels), result.in_view[held.cell]
    left, expected = ~sizes.kept(facet_pixels), sizes.counts(facet_pixels) + 1  # polygons take memory too
    for alike, seen, beside in (
        (inside & ~sizes.hidden, True, False),
        (inside & sizes.hidden, False, False),
        (~inside, False, True),
    ):
        chosen = np.flatnonzero(left & alike)
        for run in chunks(expected[chosen], at_once):
            some = chosen[run]
            made = chosen_facets(held.items.take(some), sizes.optical[some], side[some])
            yield kept_out_of_view(made, camera.clearance) if beside else made, seen


def chosen_facets(polygons: Polygons, optical: NDArray[np.float64], side: NDArray[np.float64]) -> Facets:
    """Facets of polygons (n,) that stand for an area ``optical`` (n,) in m², with sides (n,) in metres.

    Their number is random; its expectation is the area over that of a facet.
    """
    meshes = polygons.meshes
    owner, triangle, fraction = polygons.triangles()
    vector = meshes.vectors(triangle, polygons.instance[owner])
    own = fraction * np.linalg.norm(vector, axis=1)
    of_polygon = np.bincount(owner, own, len(polygons))
    rate = optical / (np.maximum(of_polygon, 1e-300) * np.maximum(side, 1e-12) ** 2)
    key = _keys(polygons, owner)
    pick, number = spread(np.floor(own * rate[owner] + stepped(key, triangle)).astype(np.int64))

    thing = owner[pick]
    face, instance = polygons.face[thing], polygons.instance[thing]
    key = child_key(mix(key_of_seed(triangle[pick]) ^ key[pick]), number)  # several facets of a triangle lie apart
    weights = np.broadcast_to(np.eye(3), (len(pick), 3, 3)).copy()
    cut = np.flatnonzero(polygons.part[thing] >= 0)
    weights[cut] = polygons.weights[polygons.part[thing[cut]]]
    corners = weights @ meshes.corners(triangle[pick], instance)
    root, v = np.sqrt(uniform(key, _PLACE_U)), uniform(key, _PLACE_V)
    at = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    centre = np.einsum("nk,nki->ni", at, corners)
    normal = unit(vector[pick])
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).argmax(axis=1)
    along = unit(edges[np.arange(len(pick)), longest])
    slot = meshes.slot[face]
    material = meshes.colours[slot], meshes.transmission[slot]
    return Facets(centre, np.cross(along, normal), along, side[thing], *material)


def _keys(polygons: Polygons, owner: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Keys (m,) of triangles of polygons by their instance and, for fragments, by their corners."""
    key = key_of_seed(polygons.instance)
    cut = np.flatnonzero(polygons.part >= 0)
    corners = polygons.weights[polygons.part[cut]].reshape(-1, 9) + 0.0  # no negative zeros, which have other bits
    for bits in np.ascontiguousarray(corners).view(np.uint64).T:
        key[cut] = mix(key[cut] ^ bits)
    return key[owner]
