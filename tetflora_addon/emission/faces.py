# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of your own meshes as the frontier draws them: as they are, or facets that stand for many small ones.

A face stays where it is no smaller than a facet, and where the feature that it belongs to is wide enough to be seen.

Facets are a stochastic simplification (Cook, Halstead, Planck and Ryu, SIGGRAPH 2007): of many small triangles few are
chosen at random, in proportion to their area, and their facets make up for the rest. The facets of a triangle depend
only on its own number: they stay when others come into view or are kept. Chances are spread evenly along the triangles
of a mesh, which keeps its area with little noise.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Integers, Integers32, Mask, chunks, column, spread, unit
from ..camera.camera import Camera
from ..growth.hashing import child_key, key_of_seed, mix, stepped, uniform
from ..proxies.microsurfaces import Facets
from ..refinement.contents import polygon_totals
from ..refinement.polygons import Meshes, Polygons
from .frontier import Canvas, FrontierKind, Shown, Waiting, Whose

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

    def spheres(self, rows: FaceRows) -> tuple[Floats, Floats]:
        """As of `FrontierKind`."""
        return rows.center, rows.reach

    def optical(self, rows: FaceRows) -> Floats:
        """As of `FrontierKind`: what is kept is one face, however large."""
        extent = self.camera.extent_around(rows.center)
        return np.where(self._wide(rows), np.minimum(rows.optical, extent**2), rows.optical)

    def ordered(self, rows: FaceRows) -> FaceRows:
        """As of `FrontierKind`."""
        return rows.take(np.lexsort([rows.face, *rows.center.T]))

    def _wide(self, rows: FaceRows) -> Mask:
        width = self.meshes.width[rows.face] * self.meshes.mean_scale[rows.instance]
        return width >= self.limit * self.camera.extent_around(rows.center)

    def draw(self, canvas: Canvas, slab: Waiting, side: Floats, shown: list[Shown]) -> None:
        """As of `FrontierKind`."""
        rows = slab.parts
        kept = _stays(rows, side) | self._wide(rows)
        own = rows.take(np.flatnonzero(kept))
        shown.append(("face", own))
        canvas.add_shown(self.triangles(own), len(own))
        rest = np.flatnonzero(~kept)
        for whose, facets in self._facets(rows.take(rest), side[rest]):
            canvas.add_facets(whose, facets)

    def unseen(self, rows: FaceRows, side: Floats, _kept: Floats, shown: list[Shown]) -> Iterator[tuple[Whose, Facets]]:
        """As of `FrontierKind`; large faces stay."""
        large = _stays(rows, side)
        shown.append(("face", rows.take(np.flatnonzero(large))))
        rest = np.flatnonzero(~large)
        yield from self._facets(rows.take(rest), side[rest])

    def _facets(self, rows: FaceRows, side: Floats) -> Iterator[tuple[Whose, Facets]]:
        looks = np.array(self.looks)[self.meshes.surface[rows.instance]]
        polygons = rows.whole(self.meshes)
        for look in np.unique(looks).tolist():
            own = np.flatnonzero(looks == look)
            for run in chunks(rows.optical[own] / side[own] ** 2 + 1, _BATCH):
                some = own[run]
                yield (None, look), chosen_facets(polygons.take(some), rows.optical[some], side[some])

    def triangles(self, rows: FaceRows, least: float = 0.0) -> Floats:
        """Corners (t, 3, 3) of the triangles of opaque faces that are so many pixels wide at least, meters."""
        meshes = self.meshes
        wide = 2.0 * rows.reach >= least * self.camera.extent_around(rows.center)
        some = rows.take(np.flatnonzero(wide & (meshes.coverage[meshes.slot[rows.face]] >= OPAQUE)))
        owner, index = spread(meshes.face_size[some.face] - 2)
        return meshes.corners(meshes.face_triangle[some.face][owner] + index, some.instance[owner])


def _stays(rows: FaceRows, side: Floats) -> Mask:
    """Faces (n,) that are no smaller than facets of sides (n,), or as long and without area."""
    return (rows.optical >= side**2) | ((rows.optical <= 0.0) & (2.0 * rows.reach >= side))


def chosen_facets(polygons: Polygons, optical: Floats, side: Floats) -> Facets:
    """Facets of polygons (n,) that stand for an area ``optical`` (n,) in m², with sides (n,) in meters.

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
    center = np.einsum("nk,nki->ni", at, corners)
    normal = unit(vector[pick])
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).argmax(axis=1)
    along = unit(edges[np.arange(len(pick)), longest])
    slot = meshes.slot[face]
    material = meshes.colors[slot], meshes.transmission[slot]
    return Facets(center, np.cross(along, normal), along, side[thing], *material)


def _keys(polygons: Polygons, owner: Integers) -> NDArray[np.uint64]:
    """Keys (m,) of triangles of polygons by their instance and, for fragments, by their corners."""
    key = key_of_seed(polygons.instance)
    cut = np.flatnonzero(polygons.part >= 0)
    corners = polygons.weights[polygons.part[cut]].reshape(-1, 9) + 0.0  # no negative zeros, which have other bits
    for bits in np.ascontiguousarray(corners).view(np.uint64).T:
        key[cut] = mix(key[cut] ^ bits)
    return key[owner]
