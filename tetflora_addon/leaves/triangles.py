# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A leaf of a pixel or two as one triangle.

A folded leaf shows two planes, a bunch of needles many. Each copy takes one of them at random, in proportion to their
areas, and has the area of the whole leaf there: over many leaves, the area that is seen from any direction is kept.
Of closed models, as fruit, that is half of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .models import LeafModel, leaf_model

#: The topology of all of them.
TRIANGLE = leaf_model([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]])
#: Planes that stand for the faces of one material.
_PLANES = 4
#: Normals within so many radians of each other are one plane.
_FLAT = 0.01
_MOVES = 64


@dataclass(frozen=True)
class LeafTriangles:
    """Triangles (k) that stand for a leaf model.

    Attributes
    ----------
    positions : (k, 3, 3) float64
        Their vertices, in units of the leaf's size; each triangle has the area of the model, or half of a closed one's.
    uv : (k, 3, 2) float32
    share : (k,) float64
        Up to which random number, from 0 to 1, each is taken; the last is 1.
    material_index : (k,) int32, optional
        As of the model.
    """

    positions: NDArray[np.float64]
    uv: NDArray[np.float32]
    share: NDArray[np.float64]
    material_index: NDArray[np.int32] | None = None

    def chosen(self, number: NDArray[np.float64]) -> NDArray[np.int64]:
        """Which triangle (n,) copies with random numbers (n,) take."""
        return np.minimum(np.searchsorted(self.share, number, side="right"), len(self.share) - 1)


@lru_cache(maxsize=256)
def leaf_triangles(model: LeafModel) -> LeafTriangles:
    """The triangles of a leaf model: as long as it is, as wide as its area demands."""
    vectors = model.face_vectors
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, 1e-300)[:, None]
    materials = np.zeros(len(areas), np.int32) if model.material_index is None else model.material_index
    middle, spread, fan = _moments(model, normals)
    found = []
    for material in np.unique(materials):
        own = np.flatnonzero((materials == material) & (areas > 0))
        for plane in _planes(normals[own], areas[own]):
            normal = _mean_direction(normals[own][plane], areas[own][plane])
            corners = _triangle(model, normal, middle, spread, fan)
            found.append((corners, areas[own][plane].sum(), material))
    positions = np.array([corners for corners, _, _ in found])
    share = np.cumsum([area for _, area, _ in found])
    return LeafTriangles(
        positions,
        _texture(model, positions),
        share / share[-1],
        None if model.material_index is None else np.array([material for *_, material in found], np.int32),
    )


def _planes(normals: NDArray[np.float64], areas: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Faces in groups of about equal area, by how they are tilted across the direction that varies most."""
    values, axes = np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, normals, normals) / areas.sum())
    if values[1] < _FLAT**2:
        return [np.arange(len(areas))]
    facing = np.where(normals @ axes[:, 2] < 0.0, -1.0, 1.0)
    order = np.argsort(facing * (normals @ axes[:, 1]), kind="stable")
    planes = min(_PLANES, len(areas))
    done = np.cumsum(areas[order]) - areas[order] / 2
    group = np.minimum((planes * done / areas.sum()).astype(int), planes - 1)
    return [order[group == one] for one in np.unique(group)]


def _mean_direction(normals: NDArray[np.float64], areas: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean axis of normals, with the sign of most of them."""
    axis = np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, normals, normals))[1][:, 2]
    return axis if (areas * (normals @ axis)).sum() >= 0.0 else -axis


def _moments(
    model: LeafModel, normals: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Centroid (3,) and covariance (3, 3) of the area; centroids and areas (t, 4) of a fan of triangles."""
    first = model.corner_verts[model.face_offsets[:-1]]
    face = np.repeat(np.arange(model.polygons), np.diff(model.face_offsets))
    corners = np.stack([first[face], model.corner_verts, model.corner_verts[model.next_corner]], axis=1)
    points = model.positions[corners]
    # Negative where a face is concave; triangles at the ends of a fan have none.
    area = np.einsum("ti,ti->t", np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), normals[face]) / 2
    whole, sums = area.sum(), points.sum(axis=1)
    middle = (area[:, None] * sums / 3).sum(axis=0) / whole
    second = np.einsum("tki,tkj->tij", points, points) + sums[:, :, None] * sums[:, None]
    spread = np.einsum("t,tij->ij", area, second) / (12 * whole) - np.outer(middle, middle)
    return middle, spread, np.column_stack([sums / 3 - middle, area])


def _triangle(
    model: LeafModel,
    normal: NDArray[np.float64],
    middle: NDArray[np.float64],
    spread: NDArray[np.float64],
    fan: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Vertices (3, 3) of a triangle with a normal, between the ends of the model along its longer axis."""
    flat = np.eye(3) - np.outer(normal, normal)
    along = np.linalg.eigh(flat @ spread @ flat)[1][:, 2]
    along -= (along @ normal) * normal
    along /= np.linalg.norm(along)
    if (fan[:, 3] * (fan[:, :3] @ along) ** 3).sum() < 0.0:
        along = -along  # leaves taper off on one side; so does the triangle
    area = model.area * (0.5 if model.closed else 1.0)
    ends = (model.positions - middle) @ along
    low, high = ends.min(), ends.max()
    if (high - low) ** 2 < 2.0 * area:  # seen along its longer axis
        high = 2.0 / 3.0 * np.sqrt(2.0 * area)
        low = -high / 2.0
    half = area / (high - low) * np.cross(normal, along)
    return _within(middle + np.array([low * along - half, high * along, low * along + half]), model.reach)


def _within(corners: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """A triangle (3, 3), moved until bounds hold it, which count on the farthest vertex of the model."""
    for _ in range(_MOVES):
        away = np.linalg.norm(corners, axis=1)
        farthest = int(away.argmax())
        if away[farthest] <= reach:
            break
        corners = corners - (1.0 - reach / away[farthest]) * corners[farthest]
    return corners


def _texture(model: LeafModel, positions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Texture coordinates (k, 3, 2): those of the model, as far as a linear function follows them."""
    corners = model.positions[model.corner_verts]
    fitted = np.linalg.lstsq(np.column_stack([corners, np.ones(len(corners))]), model.uv, rcond=None)[0]
    uv = positions @ fitted[:3] + fitted[3]
    return np.clip(uv, model.uv.min(axis=0), model.uv.max(axis=0)).astype(np.float32)
