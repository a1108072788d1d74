# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Finer forms of a leaf for those that are near: the same area, and an error that says from which size they are needed.

The model of a species is the coarsest level and stays as it is. Each finer level knows how far it is from the shape it
stands for, in lengths of the leaf, and is drawn where the one before it would be off by more than a part of a pixel.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Lock

import numpy as np

from ..arrays import Floats, Floats32, Integers, Mask
from ..optics import needle_color
from .models import LeafModel, closed_parts, mean_silhouette, rounded, spined
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
#: Needles that hide more of each other than this are scales.
_SCALES = 0.6
#: Divisions of closed parts, one more than at most.
_ROUNDEST = 5
#: Points on each edge of a coarse model at which its distance from the shape is measured.
_ON_EDGE = 9

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


def shown_area(shape: Shape, made: LeafSurface) -> float:
    """One-sided area of flat leaves that would show as much as polygons of a shape: needles hide each other."""
    return 2.0 * mean_silhouette(_model_of(made)) if isinstance(shape, Needles) else float(made.areas().mean())


def fitted(shape: Shape, tolerance: float, area: float, reach: float = np.inf, amount: float = 1.0) -> LeafSurface:
    """Polygons of a shape within a tolerance, which show as much as a flat leaf of a one-sided area.

    None reaches farther than the model. All variants of blades and compound leaves have that area, as these become
    wider or narrower. Needles hide each other: they become thicker until they show as much, turned all ways.
    """
    made = surface_of(shape, tolerance, amount)
    smaller = min(reach / float(np.linalg.norm(made.positions, axis=2).max()), 1.0)
    factor, growth = 1.0, _GROWTH
    if isinstance(shape, Needles):
        shown = np.log(shown_area(shape, made))
        for _ in range(_FITS):
            step = (np.log(area / smaller**2) - shown) / growth
            step = float(np.clip(step, np.log(_THINNEST / factor), np.log(_THICKEST / factor)))
            factor *= np.exp(step)
            made, before = surface_of(shape, tolerance, amount, factor), shown
            shown = np.log(shown_area(shape, made))
            growth = float(np.clip((shown - before) / step, 0.3, 1.0)) if abs(step) > _FITTED else growth
    elif isinstance(shape, Compound):  # the surface grows with the width almost evenly
        mean, wide = made.areas().mean(), surface_of(shape, tolerance, amount, _WIDER).areas().mean()
        factor += (_WIDER - 1.0) * float((area / smaller**2 - mean) / (wide - mean))
        made = surface_of(shape, tolerance, amount, min(max(factor, _THINNEST), _THICKEST))
    made = replace(made, positions=made.positions * smaller, error=made.error * smaller)
    if not isinstance(shape, Needles):
        made = made.widened_to(area)
    turn = np.radians(shape.turn)
    frame = np.array([[np.cos(turn), 0.0, np.sin(turn)], [0.0, 1.0, 0.0], [-np.sin(turn), 0.0, np.cos(turn)]])
    return made.moved(frame, np.zeros(3)) if shape.turn else made


class _Finer:
    """Finer levels of a model, made as they are asked for: the last ones take as long as all others."""

    def __init__(self, model: LeafModel) -> None:
        self._lock, self._found = Lock(), []
        if model.shape is None:
            self._next = iter([])
            self._found += _round_levels(model)
        else:
            self._next = _each_level(model, model.shape)
        self._complete = model.shape is None

    def until(self, error: float = 0.0, number: int = 1 << 10) -> tuple[list[LeafLevel], bool]:
        """Levels, the coarsest first, up to one within an error or up to a number; and whether these are all."""
        with self._lock:
            # The last one may still give way to the next.
            while not self._complete and len(self._found) <= number:
                if any(level.error <= error for level in self._found[:-1]):
                    break
                self._add(next(self._next, None))
            return (self._found if self._complete else self._found[:-1]), self._complete

    def _add(self, level: LeafLevel | None) -> None:
        if level is None:
            self._complete = True
        elif self._found and level.model.polygons <= _DEARER * self._found[-1].model.polygons:
            self._found[-1] = level
        else:
            self._found.append(level)


@lru_cache(maxsize=128)
def _finer(model: LeafModel) -> _Finer:
    return _Finer(model)


def _each_level(model: LeafModel, shape: Shape) -> Iterator[LeafLevel]:
    """Levels of a model that has a shape, each worth while for its error."""
    error = coarse_error(model)
    for tolerance in (2.0 * SPARSE, *TOLERANCES) if isinstance(shape, Needles) else TOLERANCES:
        made = fitted(shape, tolerance, model.area, model.reach)
        if made.error > _FINER * error:
            continue
        if made.polygons > MOST_POLYGONS:
            break
        stem = _stems(made)
        tint = np.where(stem[:, None], _TINTS[isinstance(shape, Needles)], 1.0).astype(np.float32)
        again = np.where(stem, 0.0, _recollision(shape, made)).astype(np.float32)
        solid = isinstance(shape, Needles) and tolerance <= FLAT
        yield LeafLevel(_model_of(made), made.positions.astype(np.float32), made.error, tint, again, solid)
        error = made.error


def _stems(made: LeafSurface) -> Mask:
    """Which faces (f,) of a surface are stems."""
    first = made.face_offsets[:-1]
    return (made.uv[first, 1] < -_STEM) | (made.uv[first + 1, 1] < -_STEM)


def _recollision(shape: Shape, made: LeafSurface) -> float:
    """Probability that light which one of the polygons of a shape scatters meets another."""
    return max(1.0 - shown_area(shape, made) / float(made.areas().mean()), 0.0)


@lru_cache(maxsize=128)
def needle_ratio(model: LeafModel) -> float:
    """Half of the surface of the needles that a model stands for, over its own area.

    1 for leaves, and for scales that hide each other so much that what is measured of them are their sprays.
    """
    if not isinstance(model.shape, Needles):
        return 1.0
    made = fitted(model.shape, TOLERANCES[-1], model.area, model.reach)
    faces = np.linalg.norm(_model_of(made).face_vectors, axis=1) * np.where(made.solid, 0.5, 1.0)
    scales = _recollision(model.shape, made) > _SCALES
    return 1.0 if scales else float(faces[~_stems(made)].sum()) / model.area


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
    made = fitted(model.shape, TOLERANCES[2], model.area, model.reach, amount=0.0)
    fine, coarse = _margin(_model_of(made), not isinstance(model.shape, Compound)), _margin(model, stems=True)
    inside = _farthest(fine, coarse)
    if isinstance(model.shape, Compound) and model.shape.pairs > 1:
        # Leaflets that close up are one surface until the gaps between them can be seen, however deep these are.
        inside = min(inside, (model.shape.last - model.shape.first) / (model.shape.pairs - 1))
    return max(inside, _farthest(coarse, fine))


def _round_levels(model: LeafModel) -> tuple[LeafLevel, ...]:
    """Levels of a model with closed parts, which become rounder."""
    found: list[LeafLevel] = []
    for times in range(1, _ROUNDEST if _is_round(model) else 1):
        made, error = rounded(model, times)
        if made.polygons > MOST_POLYGONS:
            break
        tint, again = np.ones((made.polygons, 3), np.float32), np.zeros(made.polygons, np.float32)
        found.append(LeafLevel(made, made.positions[None].astype(np.float32), error, tint, again))
    if found and model.spines is not None:  # only up close: before, they are much thinner than pixels
        made, tint = spined(found[-1].model, model.spines, closed_parts(found[-1].model))
        again, shapes = np.zeros(made.polygons, np.float32), made.positions[None].astype(np.float32)
        found[-1] = replace(found[-1], model=made, shapes=shapes, tint=tint, again=again)
    return tuple(found)


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
    off = [
        distance_to_links(part[:, None], other[None, :, 0], other[None, :, 1]).min(axis=1) for part in _parts(points)
    ]
    return float(np.concatenate(off).max())


def _parts(points: Floats) -> list[Floats]:
    return np.array_split(points, len(points) // 256 + 1)


def _model_of(made: LeafSurface) -> LeafModel:
    """A model of the first variant of a surface."""
    return LeafModel(made.positions[0], made.corner_verts, made.face_offsets, made.uv.astype(np.float32))
