# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Explicit polygons (paper, sections 5 and 6.1): faces of meshes that were modeled elsewhere, and their fragments.

Nothing is copied when polygons move from tetrahedron to tetrahedron. A whole face is two numbers, the face and the
instance of its mesh. A fragment, clipped off by a plane, is a triangle in the barycentric coordinates of one of the
triangles of its face. Positions, texture coordinates and all other attributes of its corners follow from these; the
fragments of a face add up to it whatever the sequence of cuts.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Mask, chunks, spread
from ..parallel import blocks

#: Triangles that are measured at a time; bounds what that takes to some hundred megabytes.
MEASURE_BATCH = 200_000
#: Meters, and factors, from which on squares of areas need not be numbers any more.
_FARTHEST = 1e12
#: A fragment that reaches beyond a plane by less than this fraction of its size is not cut again by rounding errors.
_TOUCHING = 1e-9


@dataclass(frozen=True)
class Surface:
    """One mesh in its own space, shared by all of its instances."""

    name: str  # of the object, for messages and results
    positions: Floats  # (v, 3): vertices in the mesh's own space
    corner_verts: Integers32  # (c,): vertex of each face corner
    face_offsets: Integers32  # (f + 1,): where each face's corners start
    #: (t, 3): corners of the triangles that faces consist of: n − 2 for a face of n corners, face after face.
    triangles: Integers32
    material: Integers32  # (f,): slot of each face
    colors: Floats  # (s, 3): mean color of each slot's material, linear RGB
    #: transmission and coverage, (s,): fraction of scattered light that passes, and of the surface that is opaque.
    transmission: Floats
    coverage: Floats
    solid: Mask  # (f,): the face belongs to a nearly closed surface, of which half is never seen; see `assets.patches`
    #: (f,): the face is a good part of one of many similar things, such as leaves; several may be drawn as one.
    leaf: Mask
    width: Floats  # (f,): width of the feature that the face belongs to, in the mesh's own units
    #: str to (c, k), interpolated across faces: texture coordinates (k = 2), colors and vectors (3), numbers (1).
    attributes: Mapping[str, Floats32] = field(default_factory=dict)
    normals: Floats32 | None = None  # (c, 3): of corners where any face is smooth, in the mesh's own space
    look: str = ""  # what stands for surfaces with different ones is kept apart


class Meshes:
    """Surfaces and where their instances stand; polygons refer to its faces, triangles and instances by number.

    Parameters
    ----------
    surface : (i,) int
        Which of them each instance shows.
    matrices : (i, 4, 4) float64
        Of instances, to world space; any affine map.

    Raises
    ------
    ValueError
        A position or matrix holds what is no number, or one beyond all measure; the message names the surface.
    """

    def __init__(self, surfaces: Sequence[Surface], surface: Integers, matrices: NDArray) -> None:
        self.surfaces = tuple(surfaces)
        self.surface = np.asarray(surface, np.int32)
        matrices = np.asarray(matrices, np.float64).reshape(-1, 4, 4)
        sound = (np.abs(matrices) < _FARTHEST).all(axis=(1, 2))  # false for nan as well
        broken = [s.name for s in surfaces if not (np.abs(s.positions) < _FARTHEST).all()]
        broken += [surfaces[s].name for s in self.surface[~sound]]
        if broken:
            raise ValueError(
                f'"{broken[0]}" has vertices or a transform that are not finite, or beyond {_FARTHEST:g} m; delete the '
                "vertices or reset the transform"
            )
        # Rows times these are vectors in the world; the cofactors do the same for area vectors.
        self.linear = np.ascontiguousarray(matrices[:, :3, :3].transpose(0, 2, 1))
        self.origin = matrices[:, :3, 3].copy()
        rows = self.linear
        self.cofactors = np.cross(np.roll(rows, -1, axis=1), np.roll(rows, -2, axis=1))
        self.mirrored = np.linalg.det(rows) < 0
        self.largest = np.linalg.norm(rows, ord=2, axis=(1, 2)) if len(rows) else np.zeros(0)
        self.mean_scale = np.linalg.norm(rows, axis=2).mean(axis=1)
        sizes = [[len(array) for array in (s.positions, s.corner_verts, s.material, s.colors)] for s in surfaces]
        starts = np.cumsum([[0] * 4, *sizes], axis=0).T
        self.first_vertex, self.first_corner, self.first_face, self.first_slot = starts
        every, none = list(zip(surfaces, *starts[:, :-1], strict=True)), np.zeros(0, np.int64)
        self.corner_verts = np.concatenate([none, *(s.corner_verts + vertex for s, vertex, *_ in every)])
        self.face_start = np.concatenate([none, *(s.face_offsets[:-1] + corner for s, _, corner, *_ in every)])
        self.face_size = np.concatenate([none, *(np.diff(s.face_offsets) for s in surfaces)])
        self.triangles = np.concatenate([none.reshape(0, 3), *(s.triangles + corner for s, _, corner, *_ in every)])
        self.face_triangle = np.cumsum(self.face_size - 2) - (self.face_size - 2)
        self.slot = np.concatenate([none, *(s.material + slot for s, *_, slot in every)])

        def joined(empty: NDArray, *names: str) -> Iterator[NDArray]:
            return (np.concatenate([empty, *(getattr(s, name) for s in surfaces)]) for name in names)

        self.positions, self.colors = joined(np.zeros((0, 3)), "positions", "colors")
        self.transmission, self.coverage, self.width = joined(np.zeros(0), "transmission", "coverage", "width")
        self.solid, self.leaf = joined(np.zeros(0, bool), "solid", "leaf")

    def counted_from(self, origin: Floats) -> Self:
        """The same in coordinates that begin at a place (3,) of the present ones."""
        moved = copy(self)
        moved.origin = self.origin - origin
        return moved

    # What follows is measured on demand: frames of an animation that reuse the result of another never need it.

    @cached_property
    def area_vectors(self) -> Floats:
        """Area vectors (t, 3) of triangles in their mesh's own space."""
        a, b, c = (self.positions[self.corner_verts[self.triangles[:, k]]] for k in range(3))
        return 0.5 * np.cross(b - a, c - a)

    @cached_property
    def centers(self) -> Floats:
        """Centers (f, 3) of the boxes around faces."""
        points = self.positions[self.corner_verts]
        low = np.minimum.reduceat(points, self.face_start, axis=0)
        return (low + np.maximum.reduceat(points, self.face_start, axis=0)) / 2

    @cached_property
    def radii(self) -> Floats:
        """Radii (f,) of the spheres about these centers that hold the faces."""
        points = self.positions[self.corner_verts]
        away = np.linalg.norm(points - np.repeat(self.centers, self.face_size, axis=0), axis=1)
        return np.maximum.reduceat(away, self.face_start)

    @cached_property
    def degenerate(self) -> Mask:
        """Faces (f,) with a vertex twice, which a valid mesh does not have."""
        face = np.repeat(np.arange(len(self.face_start)), self.face_size)
        order = np.lexsort([self.corner_verts, face])
        twice = (np.diff(face[order]) == 0) & (np.diff(self.corner_verts[order]) == 0)
        return np.bincount(face[order[1:][twice]], minlength=len(self.face_start)) > 0

    @property
    def faces(self) -> int:
        """Faces of all instances together."""
        return int(np.diff(self.first_face)[self.surface].sum())

    def to_world(self, points: Floats, instance: Integers) -> Floats:
        """Points (n, k, 3) of instances (n,) in world space, meters."""
        return points @ self.linear[instance] + self.origin[instance, None]

    def corners(self, triangle: Integers, instance: Integers) -> Floats:
        """Corners (n, 3, 3) of triangles of instances in world space, meters."""
        return self.to_world(self.positions[self.corner_verts[self.triangles[triangle]]], instance)

    def vectors(self, triangle: Integers, instance: Integers) -> Floats:
        """Area vectors (n, 3) of triangles of instances in world space, m²."""
        return np.einsum("ni,nij->nj", self.area_vectors[triangle], self.cofactors[instance])


@dataclass(frozen=True)
class Polygons(Arrays):
    """Whole faces and fragments of faces, n in all, m of them fragments."""

    meshes: Meshes  # what the numbers below count through
    face: Integers32  # (n,)
    instance: Integers32  # (n,)
    part: Integers32  # (n,): row of the two arrays below, −1 for whole faces
    triangle: Integers32  # (m,)
    weights: Floats  # (m, 3, 3): barycentric coordinates in the triangle, for each corner of the fragment a row
    center: Floats  # (n, 3): somewhere within, meters, world space
    reach: Floats  # (n,): distance from there within which all of it lies, meters

    @classmethod
    def everything(cls, meshes: Meshes) -> Self:
        """All faces of all instances, whole."""
        instance, face = spread(np.diff(meshes.first_face)[meshes.surface])
        face += meshes.first_face[meshes.surface][instance]
        center = np.zeros((len(face), 3))
        for block in blocks(len(face), MEASURE_BATCH):
            center[block] = meshes.to_world(meshes.centers[face[block], None], instance[block])[:, 0]
        reach = meshes.radii[face] * meshes.largest[instance]
        whole = np.full(len(face), -1, np.int32)
        none = np.zeros(0, np.int32), np.zeros((0, 3, 3))
        return cls(meshes, face.astype(np.int32), instance.astype(np.int32), whole, *none, center, reach)

    @classmethod
    def empty(cls) -> Self:
        """None at all."""
        return cls.everything(_NOTHING)

    @classmethod
    def fragments(cls, meshes: Meshes, face: NDArray, instance: NDArray, triangle: NDArray, weights: NDArray) -> Self:
        """Fragments (n,) of faces, given by a triangle (n,) each and weights (n, 3, 3) in it."""
        corners = weights @ meshes.corners(triangle, instance)
        center = corners.mean(axis=1)
        reach = np.linalg.norm(corners - center[:, None], axis=2).max(axis=1, initial=0.0)
        numbers = (np.asarray(a, np.int32) for a in (face, instance, np.arange(len(face)), triangle))
        return cls(meshes, *numbers, weights, center, reach)

    def take(self, index: NDArray | slice) -> Self:
        """Rows by indices (k,), mask (n,) or slice; fragments go with the faces that refer to them."""
        part = self.part[index]
        cut = np.flatnonzero(part >= 0)
        rows = part[cut]
        part = np.full(len(part), -1, np.int32)
        part[cut] = np.arange(len(cut), dtype=np.int32)
        faces = (a[index] for a in (self.face, self.instance))
        more = (a[rows] for a in (self.triangle, self.weights))
        return Polygons(self.meshes, *faces, part, *more, self.center[index], self.reach[index])

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """All of several in one; they refer to the same meshes."""
        parts = [p for p in parts if len(p)] or [cls.empty()]
        if len(parts) == 1:
            return parts[0]
        first = np.cumsum([0] + [len(p.triangle) for p in parts[:-1]])
        shifted = [np.where(p.part < 0, p.part, p.part + n) for p, n in zip(parts, first, strict=True)]
        columns = {
            name: np.concatenate([getattr(p, name) for p in parts])
            for name in ("face", "instance", "triangle", "weights", "center", "reach")
        }
        return replace(parts[0], part=np.concatenate(shifted).astype(np.int32), **columns)

    @property
    def triangle_counts(self) -> Integers:
        """Triangles (n,) that each consists of: 1 for a fragment."""
        return np.where(self.part >= 0, 1, self.meshes.face_size[self.face] - 2)

    def triangles(self) -> tuple[Integers, Integers, Floats]:
        """Triangles of whole faces, and fragments, in the order of the polygons.

        Returns
        -------
        owner : (k,) int64
            Polygon that each belongs to.
        triangle : (k,) int64
        fraction : (k,) float64
            Of the triangle's area; 1 except for fragments.
        """
        cut = self.part >= 0
        owner, index = spread(self.triangle_counts)
        triangle, fraction = self.meshes.face_triangle[self.face][owner] + index, np.ones(len(owner))
        fragments = np.flatnonzero(cut[owner])
        rows = self.part[owner[fragments]]
        triangle[fragments], fraction[fragments] = self.triangle[rows], area_fractions(self.weights)[rows]
        return owner, triangle, fraction

    def as_fragments(self) -> tuple[Integers, Self]:
        """The polygon (k,) that each fragment comes from, and fragments; whole faces become their triangles."""
        owner, triangle, _ = self.triangles()
        weights = np.broadcast_to(np.eye(3), (len(owner), 3, 3)).copy()
        fragments = np.flatnonzero(self.part[owner] >= 0)
        weights[fragments] = self.weights[self.part[owner[fragments]]]
        return owner, Polygons.fragments(self.meshes, self.face[owner], self.instance[owner], triangle, weights)

    def areas(self) -> Floats:
        """Areas (n,), m²."""
        areas = np.zeros(len(self))
        for run in chunks(self.triangle_counts, MEASURE_BATCH):
            polygons = self.take(run)
            owner, triangle, fraction = polygons.triangles()
            area = np.linalg.norm(self.meshes.vectors(triangle, polygons.instance[owner]), axis=1)
            areas[run] = np.bincount(owner, fraction * area, len(polygons))
        return areas

    def distances(self, planes: Floats) -> tuple[Floats, Floats]:
        """Least and greatest signed distances (n,) of the corners from planes (n, 4), meters."""
        low, high = np.zeros((2, len(self)))
        whole, cut = np.flatnonzero(self.part < 0), np.flatnonzero(self.part >= 0)
        if len(whole):
            meshes, face = self.meshes, self.face[whole]
            owner, index = spread(meshes.face_size[face])
            points = meshes.positions[meshes.corner_verts[meshes.face_start[face][owner] + index]]
            points = meshes.to_world(points[:, None], self.instance[whole][owner])[:, 0]
            plane = planes[whole][owner]
            distance = np.einsum("ni,ni->n", points, plane[:, :3]) + plane[:, 3]
            first = np.flatnonzero(index == 0)
            low[whole], high[whole] = np.minimum.reduceat(distance, first), np.maximum.reduceat(distance, first)
        if len(cut):
            distance = self.take(cut).corner_distances(planes[cut])
            low[cut], high[cut] = distance.min(axis=1), distance.max(axis=1)
        return low, high

    def corner_distances(self, planes: Floats) -> Floats:
        """Signed distances (n, 3) of the corners of fragments from planes (n, 4), meters."""
        corners = self.weights[self.part] @ self.meshes.corners(self.triangle[self.part], self.instance)
        return np.einsum("nki,ni->nk", corners, planes[:, :3]) + planes[:, 3:]

    def touching(self) -> Floats:
        """Meters (n,) within which rounding errors may carry a corner across a plane."""
        return _TOUCHING * self.reach


def area_fractions(weights: Floats) -> Floats:
    """Fraction (n,) of its triangle's area that a fragment with weights (n, 3, 3) takes."""
    a, b = weights[:, 1, 1:] - weights[:, 0, 1:], weights[:, 2, 1:] - weights[:, 0, 1:]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


_NOTHING = Meshes((), np.zeros(0, np.int32), np.zeros((0, 4, 4)))


#: Part of a face that may be missing through rounding errors alone.
_WHOLE = 1e-6


def mended(polygons: Polygons) -> Polygons:
    """The same polygons, with a face in place of its first fragment where all of its fragments are there."""
    cut = np.flatnonzero(polygons.part >= 0)
    if not len(cut):
        return polygons
    meshes = polygons.meshes
    key = polygons.instance[cut].astype(np.int64) * len(meshes.face_size) + polygons.face[cut]
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    covered = np.bincount(number, area_fractions(polygons.weights)[polygons.part[cut]])
    complete = covered >= meshes.face_size[polygons.face[cut[first]]] - 2 - _WHOLE
    part = polygons.part.copy()
    part[cut[complete[number]]] = -1
    stays = np.ones(len(polygons), bool)
    stays[cut[complete[number]]] = False
    stays[cut[first[complete]]] = True
    return replace(polygons, part=part).take(stays)
