# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of a leaf in several variants that share their faces: what blades, needles and leaflets are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats, Integers, Integers32, Mask

#: Leaves of a form that are bent, folded and grown in different ways.
VARIANTS = 6
#: Steps toward an area at most, and the relative difference from which on it is reached.
_FITS, _FITTED = 12, 1e-7
_GOLDEN = 0.6180339887498949


def variant_offsets(number: int) -> Floats:
    """Even numbers (k,) from -1 to 1, one for each variant; others for each number that they are drawn by."""
    step = (_GOLDEN * (number + 1) ** 2 + 0.31 * number) % 1.0
    return 2.0 * ((np.arange(VARIANTS) * (_GOLDEN + 0.4 * step) + step) % 1.0) - 1.0


def next_corners(offsets: Integers32) -> Integers32:
    """The corner (c,) that follows each corner in its face, by where faces start (f + 1,)."""
    following = np.arange(1, offsets[-1] + 1, dtype=np.int32)
    following[offsets[1:] - 1] = offsets[:-1]
    return following


@dataclass(frozen=True)
class LeafSurface:
    """Faces of a leaf."""

    positions: Floats  # (k, v, 3): vertices of each variant, in units of the leaf's size
    corner_verts: Integers32  # (c,)
    face_offsets: Integers32  # (f + 1,)
    uv: Floats  # (c, 2)
    solid: Mask  # (f,): faces of closed bodies, as needles: half of their surface counts as one-sided area
    error: float = 0.0  # largest distance from the shape that it stands for

    @property
    def polygons(self) -> int:
        """Number of faces."""
        return len(self.solid)

    def areas(self) -> Floats:
        """One-sided areas (k,) of the variants."""
        return self._areas_of(self._area_vectors())

    def widened_to(self, area: float) -> LeafSurface:
        """The surface with its variants wider or narrower along x, until each has a one-sided area.

        Of a face's area vector, x does not depend on widths, and y and z are in proportion to them.
        """
        vectors, wide = self._area_vectors(), np.ones(len(self.positions))
        for _ in range(_FITS):
            ratio = area / self._areas_of(vectors * _along(1.0, wide, wide))
            if np.abs(ratio - 1.0).max() < _FITTED:
                break
            wide = wide * ratio
        return replace(self, positions=self.positions * _along(wide, 1.0, 1.0))

    def _area_vectors(self) -> Floats:
        """Twice the area vectors (k, f, 3) of all faces."""
        following = next_corners(self.face_offsets)
        points = self.positions[:, self.corner_verts]
        origin = np.repeat(points[:, self.face_offsets[:-1]], np.diff(self.face_offsets), axis=1)
        return np.add.reduceat(np.cross(points - origin, points[:, following] - origin), self.face_offsets[:-1], axis=1)

    def _areas_of(self, vectors: Floats) -> Floats:
        return (np.linalg.norm(vectors, axis=2) * np.where(self.solid, 0.25, 0.5)).sum(axis=1)

    def moved(self, matrix: Floats, place: Floats) -> LeafSurface:
        """The surface with its points times a matrix (3, 3) or (k, 3, 3), whose columns are its axes, at a place."""
        points = self.positions @ np.swapaxes(matrix, -1, -2) + np.reshape(place, (-1, 1, 3))
        return replace(self, positions=points)


def _along(*factors: float | Floats) -> Floats:
    """Factors of the axes, each one number or one of each variant (k,), for vectors (k, n, 3)."""
    return np.stack(np.broadcast_arrays(*factors), axis=-1)[..., None, :]


def surface(positions: Floats, faces: Integers, uv: Floats, solid: bool = False, error: float = 0.0) -> LeafSurface:
    """A surface of triangles and quads.

    Parameters
    ----------
    positions : (k, v, 3) float64
    faces : (f, 4) int
        Vertices; of triangles one is named twice in a row, or the last is -1. Less than three different ones are none.
    uv : (v, 2) float64
    solid, error
        As of `LeafSurface`.
    """
    faces = np.where(faces < 0, faces[:, :1], faces)
    kept = faces != np.roll(faces, -1, axis=1)
    whole = kept.sum(axis=1) >= 3
    faces, kept = faces[whole], kept[whole]
    corners = faces[kept]
    used, corners = np.unique(corners, return_inverse=True)
    corners = corners.reshape(-1)
    offsets = np.concatenate([[0], np.cumsum(kept.sum(axis=1))]).astype(np.int32)
    return LeafSurface(
        positions[:, used], corners.astype(np.int32), offsets, uv[used][corners], np.full(len(faces), solid), error
    )


def joined(parts: Sequence[LeafSurface]) -> LeafSurface:
    """Several surfaces with equal numbers of variants as one."""
    vertices = np.cumsum([0, *(part.positions.shape[1] for part in parts)])
    corners = np.cumsum([0, *(len(part.corner_verts) for part in parts)])
    return LeafSurface(
        np.concatenate([part.positions for part in parts], axis=1),
        np.concatenate([p.corner_verts + v for p, v in zip(parts, vertices, strict=False)]).astype(np.int32),
        np.concatenate([[0], *(p.face_offsets[1:] + c for p, c in zip(parts, corners, strict=False))]).astype(np.int32),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.solid for part in parts]),
        max(part.error for part in parts),
    )


def tube(points: Floats, radius: Floats, sides: int) -> LeafSurface:
    """A tube along points (k, n, 3), which do not lead upwards, with radii (n,); its texture runs around and along."""
    variants, rings, _ = points.shape
    along = np.gradient(points, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-12)
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-12)
    up = np.cross(side, along)
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(turn)[:, None] * side[:, :, None] + np.sin(turn)[:, None] * up[:, :, None]
    places = (points[:, :, None] + radius[:, None, None] * ring).reshape(variants, rings * sides, 3)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    after = (j + 1) % sides
    quads = np.stack([i * sides + j, i * sides + after, (i + 1) * sides + after, (i + 1) * sides + j], axis=-1)
    u = np.tile(0.5 + 0.5 * np.cos(turn), rings)
    v = np.repeat(np.linspace(0.0, 1.0, rings), sides)
    return surface(places, quads.reshape(-1, 4), np.stack([u, v], axis=1), solid=True)
