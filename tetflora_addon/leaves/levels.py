# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of a leaf beside its model, that of its species: finer forms up close, and one kite for a pixel or two.

Each finer level has the same area, and knows how far it is from the shape it stands for, in lengths of the leaf; it is
drawn where the one before it would be off by more than a part of a pixel.

A kite is a quadrilateral with the leaf's area, centroid, spread and widest place, folded along the midrib as the leaf
is. A bunch of needles shows many planes: each copy takes one of them at random, in proportion to their areas, and has
the area that the whole shows: over many leaves, the area that is seen from any direction is kept. A kite stays what it
is. Where planes have places of their own in the image, each of them is a kite.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Integers32, Mask
from ..optics import needle_color
from .models import LeafModel, closed_parts, fans, leaf_model, mean_silhouette, rounded, spined
from .outlines import Blade, distance_to_links
from .surfaces import FLAT, SPARSE, Compound, LeafSurface, Needles, blade_surface, compound_surface, needle_surface

#: Tolerances of levels, in lengths of the leaf.
TOLERANCES = (0.03, 0.012, 0.004, 0.0015, 0.0005, 0.0002)
#: Polygons of a leaf that no level has more of.
MOST_POLYGONS = 20_000
#: A level is worth while where its error is at most this fraction of that of the level before,
_FINER = 0.75
#: and takes its place where it has no more than so many times its polygons.
_DEARER = 1.35
#: Faces with less than this as texture coordinate v, negative, are stems; their tints, of petioles and of shoots.
_STEM, _TINTS = 1e-6, ((1.25, 1.1, 0.9), (1.7, 0.75, 0.6))
#: Steps of needles toward an area, the relative thickness from which on one tells how it grows with the thickness, and
#: the power by which it is taken to grow before: shoots stay, and needles hide more of each other.
_FITS, _FITTED, _GROWTH = 3, 0.01, 0.75
#: Factors of thickness and width at most, and that of a width by which is seen how the area grows with it.
_THINNEST, _THICKEST, _WIDER = 0.2, 8.0, 1.5
_SCALES = 0.6  # needles that hide more of each other than this are scales
_ROUNDEST = 5  # divisions of closed parts, one more than at most
_ON_EDGE = 9  # points on each edge of a coarse model at which its distance from the shape is measured

Shape = Blade | Needles | Compound


@dataclass(frozen=True, eq=False)
class LeafLevel:
    """A leaf within an error."""

    model: LeafModel  # faces and texture; the vertices of the first variant
    shapes: Floats32  # (k, v, 3): vertices of each variant, in units of the leaf's size
    error: float  # largest distance of the margin from that of the shape, in lengths of the leaf
    tint: Floats32  # (f, 3): what the color of a leaf is times that of each face: shoots are brown, petioles pale
    #: (f,): probability that light which a face scatters meets another: needles on a shoot hide each other.
    again: Floats32
    solid: bool = False  # whether light that enters a face comes out of another, as of prisms: all others are sheets

    def colors(self, whole: Floats32) -> Floats32:
        """Colors (n, f, 3) of faces, from those of leaves: that of a species with needles is that of its shoots."""
        whole = np.minimum(whole * self.tint, 1.0)
        return needle_color(whole, self.again[:, None]) if self.again.any() else whole


def surface_of(shape: Shape, tolerance: float, amount: float = 1.0, factor: float = 1.0) -> LeafSurface:
    """Polygons of a shape within a tolerance, before they have the area of a model and are turned.

    ``amount`` says how much variants differ, 0 to 1; ``factor`` makes needles thicker and leaflets wider.
    """
    if isinstance(shape, Needles):
        return needle_surface(shape, tolerance, factor)
    if isinstance(shape, Compound):
        return compound_surface(shape, tolerance, amount, factor)
    return blade_surface(shape, tolerance / (1.0 - shape.petiole), amount)


def shown_area(shape: Shape, leaf: LeafSurface) -> float:
    """One-sided area of flat leaves that would show as much as polygons of a shape: needles hide each other."""
    return 2.0 * mean_silhouette(_model_of(leaf)) if isinstance(shape, Needles) else float(leaf.areas().mean())


def fitted(shape: Shape, tolerance: float, area: float, reach: float = np.inf, amount: float = 1.0) -> LeafSurface:
    """Polygons of a shape within a tolerance, which show as much as a flat leaf of a one-sided area.

    None reaches farther than the model. All variants of blades and compound leaves have that area, as these become
    wider or narrower. Needles hide each other: they become thicker until they show as much, turned all ways.
    """
    leaf = surface_of(shape, tolerance, amount)
    smaller = min(reach / float(np.linalg.norm(leaf.positions, axis=2).max()), 1.0)
    factor, growth = 1.0, _GROWTH
    if isinstance(shape, Needles):
        shown = np.log(shown_area(shape, leaf))
        for _ in range(_FITS):
            step = (np.log(area / smaller**2) - shown) / growth
            step = float(np.clip(step, np.log(_THINNEST / factor), np.log(_THICKEST / factor)))
            factor *= np.exp(step)
            leaf, before = surface_of(shape, tolerance, amount, factor), shown
            shown = np.log(shown_area(shape, leaf))
            growth = float(np.clip((shown - before) / step, 0.3, 1.0)) if abs(step) > _FITTED else growth
    elif isinstance(shape, Compound):  # the surface grows with the width almost evenly
        mean, wide = leaf.areas().mean(), surface_of(shape, tolerance, amount, _WIDER).areas().mean()
        factor += (_WIDER - 1.0) * float((area / smaller**2 - mean) / (wide - mean))
        leaf = surface_of(shape, tolerance, amount, min(max(factor, _THINNEST), _THICKEST))
    leaf = replace(leaf, positions=leaf.positions * smaller, error=leaf.error * smaller)
    if not isinstance(shape, Needles):
        leaf = leaf.widened_to(area)
    turn = np.radians(shape.turn)
    frame = np.array([[np.cos(turn), 0.0, np.sin(turn)], [0.0, 1.0, 0.0], [-np.sin(turn), 0.0, np.cos(turn)]])
    return leaf.moved(frame, np.zeros(3)) if shape.turn else leaf


class _Finer:
    """Finer levels of a model, made as they are asked for: the last ones take as long as all others."""

    def __init__(self, model: LeafModel) -> None:
        self._lock, self._complete = Lock(), model.shape is None
        self._levels = list(_round_levels(model)) if self._complete else []
        self._next = _each_level(model)

    def until(self, error: float = 0.0, number: int = 1 << 10) -> tuple[list[LeafLevel], bool]:
        """Levels, the coarsest first, up to one within an error or up to a number; and whether these are all."""
        with self._lock:
            # The last one may still give way to the next.
            while not self._complete and len(self._levels) <= number:
                if any(level.error <= error for level in self._levels[:-1]):
                    break
                self._add(next(self._next, None))
            return (self._levels if self._complete else self._levels[:-1]), self._complete

    def _add(self, level: LeafLevel | None) -> None:
        if level is None:
            self._complete = True
        elif self._levels and level.model.polygons <= _DEARER * self._levels[-1].model.polygons:
            self._levels[-1] = level
        else:
            self._levels.append(level)


@lru_cache(maxsize=128)
def _finer(model: LeafModel) -> _Finer:
    return _Finer(model)


def _each_level(model: LeafModel) -> Iterator[LeafLevel]:
    """Levels of a model that has a shape, each worth while for its error."""
    shape, error = model.shape, coarse_error(model)
    for tolerance in (2.0 * SPARSE, *TOLERANCES) if isinstance(shape, Needles) else TOLERANCES:
        leaf = fitted(shape, tolerance, model.area, model.reach)
        if leaf.error > _FINER * error:
            continue
        if leaf.polygons > MOST_POLYGONS:
            break
        stem = _stems(leaf)
        tint = np.where(stem[:, None], _TINTS[isinstance(shape, Needles)], 1.0).astype(np.float32)
        again = np.where(stem, 0.0, _recollision(shape, leaf)).astype(np.float32)
        solid = isinstance(shape, Needles) and tolerance <= FLAT
        yield LeafLevel(_model_of(leaf), leaf.positions.astype(np.float32), leaf.error, tint, again, solid)
        error = leaf.error


def _stems(leaf: LeafSurface) -> Mask:
    """Which faces (f,) of a surface are stems."""
    first = leaf.face_offsets[:-1]
    return (leaf.uv[first, 1] < -_STEM) | (leaf.uv[first + 1, 1] < -_STEM)


def _recollision(shape: Shape, leaf: LeafSurface) -> float:
    """Probability that light which one of the polygons of a shape scatters meets another."""
    return max(1.0 - shown_area(shape, leaf) / float(leaf.areas().mean()), 0.0)


@lru_cache(maxsize=128)
def needle_ratio(model: LeafModel) -> float:
    """Half of the surface of the needles that a model stands for, over its own area.

    1 for leaves, and for scales that hide each other so much that what is measured of them are their sprays.
    """
    if not isinstance(model.shape, Needles):
        return 1.0
    leaf = fitted(model.shape, TOLERANCES[-1], model.area, model.reach)
    faces = np.linalg.norm(_model_of(leaf).face_vectors, axis=1) * np.where(leaf.solid, 0.5, 1.0)
    return 1.0 if _recollision(model.shape, leaf) > _SCALES else float(faces[~_stems(leaf)].sum()) / model.area


@lru_cache(maxsize=128)
def hidden_gloss(model: LeafModel) -> float:
    """Part of the gloss of leaves that those for which a model stands hide from each other."""
    if not isinstance(model.shape, Needles):
        return 0.0
    return _recollision(model.shape, fitted(model.shape, TOLERANCES[0], model.area, model.reach))


def leaf_levels(model: LeafModel, number: int = 1 << 10) -> tuple[LeafLevel, ...]:
    """Finer levels of a model, the coarsest of them first, at least so many; none where it is flat, without shape."""
    return tuple(_finer(model).until(number=number)[0])


def level_errors(model: LeafModel, finest: float = 0.0) -> Floats:
    """Errors (levels + 1,) of a model and its finer levels, in lengths of the leaf; 0 that of the last one.

    None is finer than needed for the finest error that is asked for.
    """
    levels, every = _finer(model).until(finest)
    errors = np.array([coarse_error(model), *(level.error for level in levels)])
    errors[-1] = 0.0 if every else errors[-1]
    return errors


def chosen_level(model: LeafModel, pixels: Floats) -> Integers:
    """Level (n,) of leaves, 0 the model itself, whose lengths are so many times the tolerated error in the image.

    The coarsest one whose error is within it.
    """
    most = pixels.max(initial=0.0)
    if most * coarse_error(model) <= 1.0:  # far away: nobody needs to make them
        return np.zeros(len(pixels), np.int64)
    errors = level_errors(model, 1.0 / most)
    return np.searchsorted(-errors, -1.0 / np.maximum(pixels, 1e-300), side="left").clip(0, len(errors) - 1)


def chosen_polygons(model: LeafModel, pixels: Floats) -> tuple[Floats, Floats]:
    """Polygons (n,) of leaves at the levels that `chosen_level` gives them, and triangles (n,) of these."""
    level = chosen_level(model, pixels)
    finer = _finer(model).until(1.0 / pixels.max())[0] if level.any() else ()
    counts = [(one.polygons, one.triangles) for one in (model, *(level.model for level in finer))]
    return tuple(np.array(counts, dtype=np.float64)[level].T)


@lru_cache(maxsize=128)
def coarse_error(model: LeafModel) -> float:
    """Largest distance between the margins of a model and of its shape, in lengths of the leaf; 0 without any.

    Of the shape as it is meant; single leaves differ from it by more, as leaves do. Needles cannot be told apart from
    what stands for them until the gaps between them can be seen.
    """
    if model.shape is None:
        return rounded(model, 0)[1] if _is_round(model) else 0.0
    if isinstance(model.shape, Needles):
        return max(6.0 * model.shape.gap, 0.03)
    leaf = fitted(model.shape, TOLERANCES[2], model.area, model.reach, amount=0.0)
    fine, coarse = _margin(_model_of(leaf), not isinstance(model.shape, Compound)), _margin(model, stems=True)
    inside = _farthest(fine, coarse)
    if isinstance(model.shape, Compound) and model.shape.pairs > 1:
        # Leaflets that close up are one surface until the gaps between them can be seen, however deep these are.
        inside = min(inside, (model.shape.last - model.shape.first) / (model.shape.pairs - 1))
    return max(inside, _farthest(coarse, fine))


def _round_levels(model: LeafModel) -> tuple[LeafLevel, ...]:
    """Levels of a model with closed parts, which become rounder."""
    levels: list[LeafLevel] = []
    for times in range(1, _ROUNDEST if _is_round(model) else 1):
        body, error = rounded(model, times)
        if body.polygons > MOST_POLYGONS:
            break
        tint, again = np.ones((body.polygons, 3), np.float32), np.zeros(body.polygons, np.float32)
        levels.append(LeafLevel(body, body.positions[None].astype(np.float32), error, tint, again))
    if levels and model.spines is not None:  # only up close: before, they are much thinner than pixels
        body, tint = spined(levels[-1].model, model.spines, closed_parts(levels[-1].model))
        again, shapes = np.zeros(body.polygons, np.float32), body.positions[None].astype(np.float32)
        levels[-1] = replace(levels[-1], model=body, shapes=shapes, tint=tint, again=again)
    return tuple(levels)


def _is_round(model: LeafModel) -> bool:
    """Whether parts of a model are closed, which is not one of the artist's own objects."""
    return not model.textured and model.material_index is None and bool((closed_parts(model) >= 0).any())


def _margin(model: LeafModel, stems: bool) -> Floats:
    """Edges (e, 2, 3) that belong to one face only; all of closed models. Without stems, whose v is negative, if so."""
    edges, of_corner = model.edges
    if not stems:
        stem = np.zeros(len(edges), bool)
        stem[of_corner[model.uv[:, 1] < -_STEM]] = True
        edges, of_corner = edges[~stem], (np.cumsum(~stem) - 1)[of_corner[~stem[of_corner]]]
    single = edges[np.bincount(of_corner, minlength=len(edges)) == 1]
    return model.positions[single if len(single) else edges]


def _farthest(one: Floats, other: Floats) -> float:
    """Largest distance of points on edges (e, 2, 3) from others."""
    place = np.linspace(0.0, 1.0, _ON_EDGE)[:, None, None]
    points = (one[:, 0] + place * (one[:, 1] - one[:, 0])).reshape(-1, 3)
    parts = np.array_split(points, len(points) // 256 + 1)
    off = [distance_to_links(part[:, None], other[None, :, 0], other[None, :, 1]).min(axis=1) for part in parts]
    return float(np.concatenate(off).max())


def _model_of(leaf: LeafSurface) -> LeafModel:
    """A model of the first variant of a surface."""
    return LeafModel(leaf.positions[0], leaf.corner_verts, leaf.face_offsets, leaf.uv.astype(np.float32))


#: The topology of all of them.
KITE = leaf_model([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 1.0, 0.0], [-0.5, 0.5, 0.0]], [[0, 1, 2, 3]])
_PLANES = 4  # planes that stand for the faces of one material
_FLAT = 0.01  # normals within so many radians of each other are one plane
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
    planes = _planes_of(model)
    fan = _fan(model)
    areas = np.array([one.area for one in planes])
    # A face that is not flat counts as it is drawn.
    whole = float(fan[1].sum()) if planes[0].fold is not None else model.shown_area
    positions = np.array([_kite(model, whole, one.normal, fan, one.fold or 0.0) for one in planes])
    share = np.cumsum(areas) / areas.sum()
    return LeafKites(positions, _texture(model, positions), share, _materials_of(model, planes))


@lru_cache(maxsize=256)
def leaf_planes(model: LeafModel) -> LeafModel:
    """A kite for each plane of a leaf model, where it is and as large as it shows; the model where it is as simple."""
    if model.polygons <= 2 * _PLANES and model.triangles <= 2 * model.polygons:
        return model
    planes, (points, areas), (face, _) = _planes_of(model), _fan(model), fans(model)
    whole, positions = sum(one.area for one in planes), []
    for one in planes:
        fan = np.isin(face, one.faces)
        area = model.shown_area * one.area / whole
        positions.append(_kite(model, area, one.normal, (points[fan], areas[fan]), one.fold or 0.0))
    corners = np.array(positions)
    kites = leaf_model(corners.reshape(-1, 3), np.arange(4 * len(planes)).reshape(-1, 4).tolist())
    return replace(kites, uv=_texture(model, corners).reshape(-1, 2), material_index=_materials_of(model, planes))


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
    planes = []
    for material in np.unique(materials):
        faces = np.flatnonzero((materials == material) & (areas > 0))
        if off < _FOLDED_ONCE and len(faces) == len(areas):
            return [_Plane(faces, float(areas.sum()), normal, int(material), fold)]
        for plane in _planes(normals[faces], areas[faces]):
            turned, size = normals[faces][plane], areas[faces][plane]
            normal = np.linalg.eigh(np.einsum("f,fi,fj->ij", size, turned, turned))[1][:, 2]
            normal = normal if (size * (turned @ normal)).sum() >= 0.0 else -normal  # to the side of most of them
            planes.append(_Plane(faces[plane], float(size.sum()), normal, int(material)))
    return planes


def _materials_of(model: LeafModel, planes: list[_Plane]) -> Integers32 | None:
    return None if model.material_index is None else np.array([one.material for one in planes], np.int32)


def _planes(normals: Floats, areas: Floats) -> list[Integers]:
    """Faces in groups of about equal area, by how they are tilted across the direction that varies most."""
    values, axes = np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, normals, normals) / areas.sum())
    if values[1] < _FLAT**2:
        return [np.arange(len(areas))]
    order = np.argsort(np.where(normals @ axes[:, 2] < 0.0, -1.0, 1.0) * (normals @ axes[:, 1]), kind="stable")
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
    return points, np.copysign(np.linalg.norm(vectors, axis=1), np.einsum("ti,ti->t", vectors, normals[face]))


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
    """Triangles as a sheet folded along its longer axis: normal (3,), sine of the fold, mean square error of normal."""
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
    """Vertices (4, 3) of a kite with an area, a normal, and a fold by which both halves rise, along the longer axis."""
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
    return np.clip(positions @ fitted[:3] + fitted[3], model.uv.min(axis=0), model.uv.max(axis=0)).astype(np.float32)
