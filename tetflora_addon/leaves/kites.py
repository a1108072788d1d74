# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A leaf of a pixel or two as one kite: a quadrilateral with the leaf's area, centroid, spread and widest place.

A kite is folded along the midrib as the leaf is. A bunch of needles shows many planes: each copy takes one of them at
random, in proportion to their areas, and has the area that the whole shows: over many leaves, the area that is seen
from any direction is kept. A kite stays what it is. Where planes have places of their own in the image, each of them
is a kite.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Integers32
from .models import LeafModel, fans, leaf_model

#: The topology of all of them.
KITE = leaf_model([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0], [-0.5, 0.5, 0.0]], [[0, 1, 2, 3]])
#: Planes that stand for the faces of one material.
_PLANES = 4
#: Normals within so many radians of each other are one plane.
_FLAT = 0.01
#: Mean square of the difference of normals up to which a leaf is a sheet that is folded once.
_FOLDED_ONCE = 0.006
_MOVES = 64
#: Widest places of kites along their length, from where they begin, and the skewness of their area along it (that of a
#: triangular distribution; Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions, vol. 2, 1995).
_WIDEST = np.linspace(1.0, 0.0, 65)
_SKEWNESS = np.sqrt(2.0) * (1.0 - 2.0 * _WIDEST) * (2.0 - _WIDEST) * (1.0 + _WIDEST)
_SKEWNESS /= 5.0 * (1.0 - _WIDEST * (1.0 - _WIDEST)) ** 1.5


@dataclass(frozen=True)
class LeafKites:
    """Kites (k) that stand for a leaf model."""

    #: (k, 4, 3): their vertices, in units of the leaf's size; each kite has the area that the model shows.
    positions: Floats
    uv: Floats32  # (k, 4, 2)
    share: Floats  # (k,): up to which random number, from 0 to 1, each is taken; the last is 1
    material_index: Integers32 | None = None  # (k,): as of the model

    def chosen(self, number: Floats) -> Integers:
        """Which kite (n,) copies with random numbers (n,) take."""
        return np.minimum(np.searchsorted(self.share, number, side="right"), len(self.share) - 1)


@lru_cache(maxsize=256)
def leaf_kites(model: LeafModel) -> LeafKites:
    """The kites of a leaf model."""
    found = _planes_of(model)
    fan = _fan(model)
    areas = np.array([one.area for one in found])
    # A face that is not flat counts as it is drawn.
    whole = float(fan[1].sum()) if found[0].fold is not None else model.shown_area
    positions = np.array([_kite(model, whole, one.normal, fan, one.fold or 0.0) for one in found])
    share = np.cumsum(areas) / areas.sum()
    return LeafKites(positions, _texture(model, positions), share, _materials_of(model, found))


@lru_cache(maxsize=256)
def leaf_planes(model: LeafModel) -> LeafModel:
    """A kite for each plane of a leaf model, where it is and as large as it shows; the model where it is as simple."""
    if model.polygons <= 2 * _PLANES and model.triangles <= 2 * model.polygons:
        return model
    found, (points, areas), (face, _) = _planes_of(model), _fan(model), fans(model)
    whole, positions = sum(one.area for one in found), []
    for one in found:
        fan = np.isin(face, one.faces)
        area = model.shown_area * one.area / whole
        positions.append(_kite(model, area, one.normal, (points[fan], areas[fan]), one.fold or 0.0))
    corners = np.array(positions)
    return replace(
        leaf_model(corners.reshape(-1, 3), np.arange(4 * len(found)).reshape(-1, 4).tolist()),
        uv=_texture(model, corners).reshape(-1, 2),
        material_index=_materials_of(model, found),
    )


@dataclass(frozen=True)
class _Plane:
    """Faces of a leaf model that are one sheet."""

    faces: Integers
    area: float
    normal: Floats  # (3,)
    material: int
    fold: float | None = None  # sine by which halves rise, of a leaf that is one sheet, folded once


def _planes_of(model: LeafModel) -> list[_Plane]:
    """The planes of a leaf model, material by material."""
    vectors = model.face_vectors
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, 1e-300)[:, None]
    materials = np.zeros(len(areas), np.int32) if model.material_index is None else model.material_index
    normal, fold, off = _sheet(*_fan(model))
    found = []
    for material in np.unique(materials):
        own = np.flatnonzero((materials == material) & (areas > 0))
        if off < _FOLDED_ONCE and len(own) == len(areas):
            return [_Plane(own, float(areas.sum()), normal, int(material), fold)]
        for plane in _planes(normals[own], areas[own]):
            turned, size = normals[own][plane], areas[own][plane]
            normal = np.linalg.eigh(np.einsum("f,fi,fj->ij", size, turned, turned))[1][:, 2]
            normal = normal if (size * (turned @ normal)).sum() >= 0.0 else -normal  # to the side of most of them
            found.append(_Plane(own[plane], float(size.sum()), normal, int(material)))
    return found


def _materials_of(model: LeafModel, found: list[_Plane]) -> Integers32 | None:
    return None if model.material_index is None else np.array([one.material for one in found], np.int32)


def _planes(normals: Floats, areas: Floats) -> list[Integers]:
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


def _fan(model: LeafModel) -> tuple[Floats, Floats]:
    """Corners (t, 3, 3) and areas (t,) of triangles that fan out over the faces."""
    face, corners = fans(model)
    normals = model.face_vectors / np.maximum(np.linalg.norm(model.face_vectors, axis=1), 1e-300)[:, None]
    points = np.ascontiguousarray(corners.swapaxes(0, 1))
    # Negative where a face is concave; triangles at the ends of a fan have none.
    vectors = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]) / 2
    area = np.copysign(np.linalg.norm(vectors, axis=1), np.einsum("ti,ti->t", vectors, normals[face]))
    return points, area


def _longer_axis(points: Floats, weight: Floats, normal: Floats) -> NDArray:
    """The direction (3,) in a plane along which triangles (t, 3, 3) about their centroid spread most, and how much."""
    sums = points.sum(axis=1)
    second = np.einsum("tki,tkj->tij", points, points) + sums[:, :, None] * sums[:, None]
    spread = np.einsum("t,tij->ij", weight, second) / 12
    flat = np.eye(3) - np.outer(normal, normal)
    along = np.linalg.eigh(flat @ spread @ flat)[1][:, 2]
    along -= (along @ normal) * normal
    return along / np.linalg.norm(along)


def _sheet(points: Floats, area: Floats) -> tuple[Floats, float, float]:
    """Triangles as a sheet that is folded along its longer axis: its normal (3,), the sine by which both halves rise,
    and the mean square by which normals are off.
    """
    vectors = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]) / 2
    whole, mean = area.sum(), vectors.sum(axis=0)
    if np.linalg.norm(mean) < whole / 2:
        return np.array([0.0, 0.0, 1.0]), 0.0, np.inf
    normal, weight = mean / np.linalg.norm(mean), area / whole
    centered = points - (weight[:, None] * points.mean(axis=1)).sum(axis=0)
    across = np.cross(_longer_axis(centered, weight, normal), normal)
    side = np.sign(centered.mean(axis=1) @ across)
    normals = vectors / np.where(area == 0.0, 1.0, area)[:, None]
    fold = float(np.clip(-(weight * side * (normals @ across)).sum(), -0.9, 0.9))
    expected = np.sqrt(1.0 - fold**2) * normal - (fold * side)[:, None] * across
    return normal, fold, float((weight * ((normals - expected) ** 2).sum(axis=1)).sum())


def _kite(model: LeafModel, area: float, normal: Floats, fan: tuple[Floats, Floats], fold: float = 0.0) -> Floats:
    """Vertices (4, 3) of a kite with an area and a normal, along the model's longer axis across that; both halves rise
    by a fold.
    """
    points, weight = fan[0], fan[1] / fan[1].sum()
    middle = (weight[:, None] * points.mean(axis=1)).sum(axis=0)
    points = points - middle
    along = _longer_axis(points, weight, normal)
    x = points @ along
    # Moments of a triangle are complete homogeneous polynomials of its corners.
    variance = max((weight * ((x**2).sum(1) + x.sum(1) ** 2)).sum() / 12, 1e-300)
    third = (x**3).sum(1) + x.prod(1) + (x**2 * (x.sum(1)[:, None] - x)).sum(1)
    skewness = (weight * third).sum() / 10 / variance**1.5
    widest = float(np.interp(skewness, _SKEWNESS, _WIDEST))
    length = np.sqrt(18.0 * variance / (1.0 - widest * (1.0 - widest)))
    tip = (2.0 - widest) / 3.0
    # No longer than the model, or bounds would not hold it; and no needle where it is seen along its longer axis.
    ends = (model.positions - middle) @ along
    length = min(length, ends.max() / tip, -ends.min() / (1.0 - tip))
    length = max(length, np.sqrt(2.0 * area))
    half, rise = area / length, area / length * fold
    base = (tip - 1.0) * length * along - rise / 3.0 * normal
    side, across = base + widest * length * along + rise * normal, np.sqrt(half**2 - rise**2) * np.cross(along, normal)
    # From base to tip, so that renderers divide it along the fold.
    return _within(middle + np.array([base, side + across, base + length * along, side - across]), model.reach)


def _within(corners: Floats, reach: float) -> Floats:
    """A kite (4, 3), moved until bounds hold it, which count on the farthest vertex of the model."""
    for _ in range(_MOVES):
        away = np.linalg.norm(corners, axis=1)
        farthest = int(away.argmax())
        if away[farthest] <= reach:
            break
        corners = corners - (1.0 - reach / away[farthest]) * corners[farthest]
    return corners


def _texture(model: LeafModel, positions: Floats) -> Floats32:
    """Texture coordinates (k, 4, 2): those of the model, as far as a linear function follows them."""
    corners = model.positions[model.corner_verts]
    fitted = np.linalg.lstsq(np.column_stack([corners, np.ones(len(corners))]), model.uv, rcond=None)[0]
    uv = positions @ fitted[:3] + fitted[3]
    return np.clip(uv, model.uv.min(axis=0), model.uv.max(axis=0)).astype(np.float32)
