# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of a leaf in several variants that share their faces: what blades, needles and leaflets are made of.

Needles on a shoot are brushes, flat sprays, bundles of two to five: fewer and broader ones from afar, then all of them,
flat, and prisms with a bend up close.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..arrays import Floats, Integers, Integers32, Mask
from ..parameters import limited

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

    def widened_to(self, area: float) -> Self:
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

    def moved(self, matrix: Floats, place: Floats) -> Self:
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


_GOLDEN_ANGLE = np.radians(137.508)
#: What is not seen of the gaps between needles, of their distance along the shoot.
_GAP = 0.6
#: Error from which on there are fewer needles, needles are flat, and prisms have three sides.
SPARSE, FLAT, _THREE = 0.05, 0.004, 0.0012
#: One of so many needles stands for them all where there are fewer; what is not seen of the gaps then.
_OF, _SPARSE_GAP = 3, 2.4
#: Radius of shoots over that of needles, and of both at their ends.
_TAPER = 0.55
#: Places along a needle and its widths there, for errors above the first number.
_PROFILES = (
    (SPARSE, (0.0, 1.0), (1.0, 0.0)),
    (FLAT, (0.0, 0.35, 1.0), (0.55, 1.0, 0.0)),
    (_THREE, (0.0, 0.6, 1.0), (0.6, 1.0, 0.0)),
    (0.0, (0.0, 0.4, 0.85, 1.0), (0.5, 1.0, 0.75, 0.0)),
)


@dataclass(frozen=True)
class Needles:
    """Needles around one shoot or several; lengths are fractions of the whole."""

    needles: int = limited(100, 4, 400, "needles, all together")
    bundle: int = limited(1, 1, 5, "needles that stand together: 2, 3 or 5 in pines")
    length: float = limited(0.16, 0.01, 1, "length of a needle")
    thickness: float = limited(0.012, 0.001, 0.1, "thickness of a needle before it is given the area of the far form")
    angle: float = limited(50.0, 0, 120, "angle between shoot and needle at the base of the shoot, degrees")
    angle_tip: float = limited(25.0, 0, 120, "the same at its tip")
    flat: float = limited(0.3, 0, 1, "0: needles all around the shoot, 1: in one plane")
    bend: float = limited(0.12, -0.5, 0.5, "how far needles bend toward the tip of the shoot, fraction of their length")
    shoot: float = limited(0.9, 0.01, 1, "length of a shoot that bears them")
    shoots: int = limited(1, 1, 12, "shoots, spread as a fan")
    spread: float = limited(0.0, 0, 180, "angle between the outer shoots of a fan, degrees")
    lift: float = limited(0.0, 0, 1, "how far shoots of a fan stand out of its plane in turns")
    stem: float = limited(0.016, 0.001, 0.1, "thickness of a shoot")
    turn: float = limited(0.0, -180, 180, "turn of the whole about its axis, degrees")

    @property
    def gap(self) -> float:
        """Error of a level that has them all."""
        return _GAP * self.shoot * self.shoots / self.needles


def needle_surface(needles: Needles, tolerance: float, factor: float = 1.0) -> LeafSurface:
    """Needles within a tolerance, in units of the whole leaf's length; all are thicker by a factor."""
    parts = []
    step = needles.spread / max(needles.shoots - 1, 1)
    for i in range(needles.shoots):
        turn = np.radians(step * (i - (needles.shoots - 1) / 2.0))
        lift = needles.lift * (1 if i % 2 else -1) if needles.shoots > 1 else 0.0
        along = np.array([np.sin(turn), np.cos(turn), lift]) / np.sqrt(1.0 + lift**2)
        across = np.array([np.cos(turn), -np.sin(turn), 0.0])
        frame = np.stack([across, along, np.cross(across, along)], axis=1)
        parts.append(_shoot(needles, i, tolerance, factor).moved(frame, np.zeros(3)))
    error = needles.gap * (_SPARSE_GAP if tolerance > SPARSE else 1.0)
    error = error if tolerance > FLAT else min(tolerance, error)
    return replace(joined(parts), error=error)


def _shoot(needles: Needles, number: int, tolerance: float, factor: float) -> LeafSurface:
    """One shoot along y with its needles."""
    count = max(needles.needles // needles.shoots, needles.bundle)
    i = np.arange(0, count, _OF if tolerance > SPARSE else 1)
    node, within = i // needles.bundle, i % needles.bundle
    last = max((count - 1) // needles.bundle, 1)
    place = (node + 0.5 + 0.4 * np.stack([np.sin(i * 7.1 + 3.0 * k + number) for k in range(VARIANTS)])) / (last + 1)
    angle = np.radians(needles.angle + (needles.angle_tip - needles.angle) * place)
    angle = angle * (1.0 + 0.18 * np.sin(5.3 * i + 1.7 * np.arange(VARIANTS)[:, None]))
    turn = node * _GOLDEN_ANGLE + 1.3 * variant_offsets(3 + number)[:, None] + 0.25 * np.sin(11.7 * i)
    side, up = np.cos(turn), np.sin(turn) * (1.0 - needles.flat)
    size = np.maximum(np.hypot(side, up), 1e-9)
    zero = np.zeros_like(side)
    out = np.stack([side / size, zero, up / size], axis=2)
    if needles.bundle > 1:  # needles of a bundle lean apart
        apart = 2.0 * np.pi * within / needles.bundle
        other = np.stack([-out[..., 2], zero, out[..., 0]], axis=2)
        out = out + 0.3 * (np.cos(apart)[:, None] * other)
        angle = angle + 0.12 * np.sin(apart)
    axis = np.array([0.0, 1.0, 0.0])
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    direction = cos * axis + sin * out
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    length = needles.length * (1.0 + 0.15 * np.sin(3.1 * i + np.arange(VARIANTS)[:, None]))
    length = length * np.clip(0.75 + 1.5 * np.minimum(place, 1.15 - place), 0.0, 1.0)
    start = place[..., None] * needles.shoot * axis
    toward = axis - (direction * axis).sum(-1, keepdims=True) * direction
    made = [_needles(start, direction, toward, length, needles, tolerance, factor)]
    rings = 2 if tolerance > FLAT else 5
    stem = np.zeros((VARIANTS, rings, 3))
    stem[..., 1] = np.linspace(0.0, needles.shoot, rings)
    radius = needles.stem / 2.0 * np.linspace(1.0, _TAPER, rings)
    made.append(tube(stem, radius, 3 if tolerance > _THREE else 5))
    made[-1].uv[:, 1] -= 1.0  # below that of needles, as petioles
    return joined(made)


def _needles(
    start: Floats, direction: Floats, toward: Floats, length: Floats, needles: Needles, tolerance: float, factor: float
) -> LeafSurface:
    """Needles from starts (k, n, 3) in directions, of lengths (k, n), bent toward vectors (k, n, 3)."""
    flat, three = tolerance > FLAT, tolerance > _THREE
    along, wide = next((np.array(along), np.array(wide)) for error, along, wide in _PROFILES if tolerance > error)
    rings, (variants, count) = len(along), length.shape
    reach = length[..., None, None]
    axis = start[:, :, None] + reach * (
        along[:, None] * direction[:, :, None] + needles.bend * (along**2)[:, None] * toward[:, :, None]
    )
    across = np.cross(direction, toward + 1e-3)
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-9)
    other = np.cross(across, direction)
    radius = factor * needles.thickness / 2.0 * wide
    sides = 2 if flat else 3 if three else 4
    turn = np.pi * np.arange(2) if flat else 2 * np.pi * (np.arange(sides) + 0.5) / sides
    ring = np.cos(turn)[:, None] * across[:, :, None, :] + 0.8 * np.sin(turn)[:, None] * other[:, :, None, :]
    body = axis[:, :, :-1, None] + radius[:-1, None, None] * ring[:, :, None]
    points = np.concatenate([body.reshape(variants, count, -1, 3), axis[:, :, -1:]], axis=2)
    each, tip = points.shape[2], points.shape[2] - 1
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(1 if flat else sides), indexing="ij")
    corners = [i * sides + j, i * sides + (j + 1) % sides, (i + 1) * sides + (j + 1) % sides, (i + 1) * sides + j]
    quads = np.minimum(np.stack(corners, axis=-1).reshape(-1, 4), tip)
    faces = (quads + np.arange(count)[:, None, None] * each).reshape(-1, 4)
    v = np.append(np.repeat(along[:-1], sides), 1.0)
    u = np.append(np.tile(0.5 + 0.5 * np.cos(turn), rings - 1), 0.5)
    uv = np.tile(np.stack([u, v], axis=1), (count, 1))
    return surface(points.reshape(variants, -1, 3), faces, uv, solid=not flat)
