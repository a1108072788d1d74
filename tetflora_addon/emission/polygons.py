# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of your own meshes: as the frontier draws them, and as meshes in world space where they stay as they are.

A face stays where it is no smaller than a facet, and where the feature that it belongs to is wide enough to be seen.
One whose fragments are all kept comes out as the face that it was.

Of many small ones facets are a stochastic simplification (Cook, Halstead, Planck and Ryu, SIGGRAPH 2007): of many small
triangles few are chosen at random, in proportion to their area, and their facets make up for the rest. The facets of a
triangle depend only on its own number: they stay when others come into view or are kept. Chances are spread evenly
along the triangles of a mesh, which keeps its area with little noise.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Integers, Integers32, Mask, chunks, column, spread, unit
from ..buffers import BLOCK_POLYGONS, MeshBuffers
from ..camera.camera import Camera
from ..growth.hashing import child_key, key_of_seed, mix, stepped, uniform
from ..proxies.microsurfaces import Facets
from ..refinement.contents import polygon_totals
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.polygons import Meshes, Polygons, mended
from .frontier import Canvas, FrontierKind, Owned, Shown, Waiting

#: Least fraction of a surface that is opaque where it hides what is behind.
OPAQUE = 0.99
#: Triangles that are drawn at a time.
_BATCH = 200_000
#: Draws of the place of a facet in its triangle.
_PLACE_U, _PLACE_V = 222, 223


@dataclass(frozen=True)
class FaceRows(Arrays):
    """Faces of instances of meshes (n)."""

    face: Integers32 = column(dtype=np.int32)  # (n,)
    instance: Integers32 = column(dtype=np.int32)  # (n,)
    center: Floats = column(3)  # (n, 3)
    reach: Floats  # (n,): as of `Polygons`
    optical: Floats  # (n,): area that each blocks, m²

    @classmethod
    def of(cls, whole: Polygons) -> Self:
        """Whole faces (n,)."""
        return cls(whole.face, whole.instance, whole.center, whole.reach, polygon_totals(whole).optical_area)

    def whole(self, meshes: Meshes) -> Polygons:
        """The faces themselves, of meshes."""
        none = np.full(len(self), -1, np.int32), np.zeros(0, np.int32), np.zeros((0, 3, 3))
        return Polygons(meshes, self.face, self.instance, *none, self.center, self.reach)


@dataclass(frozen=True)
class Faces(FrontierKind):
    """Faces of your own meshes."""

    meshes: Meshes  # without what only results need
    looks: tuple[str, ...]  # of surfaces
    camera: Camera
    limit: float  # width in pixels from which on features are drawn as they are
    stays = True

    @classmethod
    def of(cls, meshes: Meshes, camera: Camera, limit: float) -> Self:
        """All faces of meshes."""
        bare = copy(meshes)
        bare.surfaces = ()
        return cls(bare, tuple(surface.look for surface in meshes.surfaces), camera, limit)

    def optical(self, rows: FaceRows) -> Floats:
        """As of `FrontierKind`: what is kept is one face, however large."""
        extent = self.camera.extent_around(rows.center)
        return np.where(self._wide(rows), np.minimum(rows.optical, extent**2), rows.optical)

    def _wide(self, rows: FaceRows) -> Mask:
        width = self.meshes.width[rows.face] * self.meshes.mean_scale[rows.instance]
        return width >= self.limit * self.camera.extent_around(rows.center)

    def draw(self, canvas: Canvas, slab: Waiting, side: Floats, shown: list[Shown]) -> None:
        """As of `FrontierKind`."""
        rows = slab.parts
        kept = _stays(rows, side) | self._wide(rows)
        faces = rows.take(np.flatnonzero(kept))
        shown.append(("face", faces))
        canvas.add_shown(self.triangles(faces), len(faces))
        rest = np.flatnonzero(~kept)
        for whose, facets in self._facets(rows.take(rest), side[rest]):
            canvas.add_facets(whose, facets)

    def unseen(self, rows: FaceRows, side: Floats, _kept: Floats, shown: list[Shown]) -> Iterator[Owned]:
        """As of `FrontierKind`; large faces stay."""
        large = _stays(rows, side)
        shown.append(("face", rows.take(np.flatnonzero(large))))
        rest = np.flatnonzero(~large)
        yield from self._facets(rows.take(rest), side[rest])

    def _facets(self, rows: FaceRows, side: Floats) -> Iterator[Owned]:
        looks = np.array(self.looks)[self.meshes.surface[rows.instance]]
        polygons = rows.whole(self.meshes)
        for look in np.unique(looks).tolist():
            alike = np.flatnonzero(looks == look)
            for run in chunks(rows.optical[alike] / side[alike] ** 2 + 1, _BATCH):
                faces = alike[run]
                yield (None, look), chosen_facets(polygons.take(faces), rows.optical[faces], side[faces])

    def triangles(self, rows: FaceRows, least: float = 0.0) -> Floats:
        """Corners (t, 3, 3) of the triangles of opaque faces that are so many pixels wide at least, meters."""
        meshes = self.meshes
        wide = 2.0 * rows.reach >= least * self.camera.extent_around(rows.center)
        faces = rows.take(np.flatnonzero(wide & (meshes.coverage[meshes.slot[rows.face]] >= OPAQUE)))
        owner, index = spread(meshes.face_size[faces.face] - 2)
        return meshes.corners(meshes.face_triangle[faces.face][owner] + index, faces.instance[owner])


def _stays(rows: FaceRows, side: Floats) -> Mask:
    """Faces (n,) that are no smaller than facets of sides (n,), or as long and without area."""
    return (rows.optical >= side**2) | ((rows.optical <= 0.0) & (2.0 * rows.reach >= side))


def chosen_facets(polygons: Polygons, optical: Floats, side: Floats) -> Facets:
    """Facets of sides (n,), meters, for areas ``optical`` (n,), m², of whole faces (n,): on average as many as fit."""
    meshes = polygons.meshes
    owner, triangle, _ = polygons.triangles()
    vector, key = meshes.vectors(triangle, polygons.instance[owner]), key_of_seed(polygons.instance)[owner]
    area = np.linalg.norm(vector, axis=1)
    rate = optical / (np.maximum(np.bincount(owner, area, len(polygons)), 1e-300) * np.maximum(side, 1e-12) ** 2)
    pick, number = spread(np.floor(area * rate[owner] + stepped(key, triangle)).astype(np.int64))

    thing, triangle = owner[pick], triangle[pick]
    key = child_key(mix(key_of_seed(triangle) ^ key[pick]), number)  # several facets of a triangle lie apart
    corners = meshes.corners(triangle, polygons.instance[thing])
    root, v = np.sqrt(uniform(key, _PLACE_U)), uniform(key, _PLACE_V)
    center = np.einsum("nk,nki->ni", np.stack([1 - root, root * (1 - v), root * v], axis=1), corners)
    normal = unit(vector[pick])
    edges = np.roll(corners, -1, axis=1) - corners
    along = unit(edges[np.arange(len(pick)), np.linalg.norm(edges, axis=2).argmax(axis=1)])
    slot = meshes.slot[polygons.face[thing]]
    return Facets(center, np.cross(along, normal), along, side[thing], meshes.colors[slot], meshes.transmission[slot])


#: Shapes of attributes by their number of components; a mesh cannot hold others.
_FLOATS = {1: (), 2: (2,), 3: (3,)}


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
    kept = np.flatnonzero(~result.chosen(Decision.PROXY, Decision.HIDDEN)[held.cell] | np.isinf(held.totals.width))
    rank = np.zeros(len(result.tree), np.int64)
    rank[result.nodes] = result.rank
    return mended(held.items.take(kept[np.argsort(rank[held.cell[kept]], kind="stable")]))


def polygon_blocks(polygons: Polygons) -> Iterator[PolygonBlock]:
    """Polygons as meshes, some at a time."""
    runs = list(chunks(np.maximum(polygons.triangle_counts / 2, 1), BLOCK_POLYGONS))  # of quads; others by corners
    for number, run in enumerate(runs):
        faces = polygons.take(run)
        surface = faces.meshes.surface[faces.instance]
        for s in np.unique(surface):
            yield PolygonBlock(int(s), number, polygon_buffers(faces.take(surface == s)), (number + 1) / len(runs))


def polygon_buffers(polygons: Polygons) -> MeshBuffers:
    """Polygons of one surface as a mesh in world space.

    Whole faces share vertices and edges as in the surface, unless they have one twice; fragments are separate. Faces of
    mirrored instances are turned around, as in Blender. Normals, if any, are ``custom_normal``.
    """
    meshes = polygons.meshes
    cut = polygons.part >= 0
    whole, pieces = polygons.take(~cut), polygons.take(cut)
    size = meshes.face_size[whole.face]
    owner, index = spread(size)
    index = np.where(meshes.mirrored[whole.instance][owner], size[owner] - 1 - index, index)
    corner, instance = meshes.face_start[whole.face][owner] + index, whole.instance[owner]
    # Corners of faces with a vertex twice get vertices of their own, which keeps the mesh valid.
    own_place = np.repeat(meshes.degenerate[whole.face], size)
    count = len(meshes.positions)
    place = np.where(own_place, count + corner, meshes.corner_verts[corner])
    places = count + len(meshes.corner_verts)
    vertices, shared = np.unique(instance.astype(np.int64) * places + place, return_inverse=True)
    owner, vertex = np.divmod(vertices, max(places, 1))
    loose = vertex >= count
    vertex[loose] = meshes.corner_verts[vertex[loose] - count]
    points = meshes.to_world(meshes.positions[vertex][:, None], owner)[:, 0]
    offsets = np.cumsum([0, *size])

    turn = np.where(meshes.mirrored[pieces.instance][:, None], [[0, 2, 1]], [[0, 1, 2]])
    weights = np.take_along_axis(pieces.weights[pieces.part], turn[:, :, None], axis=1)
    triangle = pieces.triangle[pieces.part]
    fragments = (weights @ meshes.corners(triangle, pieces.instance)).reshape(-1, 3)
    corner_verts = np.concatenate([shared.reshape(-1), np.arange(len(fragments)) + len(points)]).astype(np.int32)

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
        edge_verts=np.zeros((0, 2), np.int32),  # Blender finds them, and each corner's
        corner_verts=corner_verts,
        corner_edges=corner_verts,
        face_offsets=np.concatenate([offsets, offsets[-1] + 3 * (1 + np.arange(len(pieces)))]).astype(np.int32),
        attributes=attributes,
        smooth=shown.normals is not None,
    )


def _at_corners(values: NDArray, corner: Integers, triangle: Integers, weights: Floats) -> Floats:
    """Values at corners of whole faces, then at those of fragments (n, 3, 3) of triangles (n, 3)."""
    between = (weights @ values[triangle].astype(np.float64)).reshape(-1, values.shape[1])
    return np.concatenate([values[corner].astype(np.float64), between])
