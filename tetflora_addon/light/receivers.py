# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What receives and blocks light: tetrahedra as clouds, and sheets, which are facets and leaves as they are drawn.

Leaves sit in clusters, and so do the facets that stand for them: half of the light that an even cloud would let
through to its surfaces does not reach those of a crown. Sheets that are drawn cast shadows, not their tetrahedra.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_TURN, Arrays, Floats, Integers, Mask, spiral, spread
from ..compiled.flora import Flora
from ..optics import recollision_albedo
from ..parallel import blocks
from ..refinement.loop import Refinement
from ..refinement.summaries import extinction_matrices, summarize
from ..tetrahedra.geometry import barycentric, barycentric_gradients, volume
from .scattering import albedo

#: How far the key points lie from the centroid toward the vertices. So placed, the mean over the four is that over
#: the tetrahedron for anything that is quadratic in it (Hammer, Marlowe and Stroud 1956).
INWARDS = 1.0 / np.sqrt(5.0)
# Barycentric coordinates of the key points.
_KEYS = (1.0 - INWARDS) / 4.0 + INWARDS * np.eye(4)
#: Maximum number of sheets of a tetrahedron on which light from all sides is sampled, and about that of all of them.
SAMPLES, ALL_SAMPLES = 8, 32_000
# Side of a pixel over that of a sheet: most sheets then lie in one pixel alone.
_ROOMY = 1.5
# Directions of the mean over the sphere, and cells at a time, to bound memory.
_DIRECTIONS, _CHUNK = 64, 65_536


@dataclass(frozen=True)
class MediumCells(Arrays):
    """Tetrahedra in the light, explicit ones included: n of them, without overlap."""

    vertices: Floats  # (n, 4, 3): positively oriented, meters
    matrices: Floats  # (n, 6): S of κ(ω) = √(ωᵀSω), as `summaries.extinction_matrices` gives it, 1/m²
    color: Floats  # (n, 3)
    transmission: Floats  # (n,): means of their contents
    normal: Floats  # (n, 3): axis in which most normals lie
    plane: Floats  # (n,): weight of the plane term, 0 to 1

    @classmethod
    def of(cls, flora: Flora, refinement: Refinement, nodes: Integers, even: Mask | None = None) -> Self:
        """Cells of a refinement, by some of its terminal nodes (n,).

        Where ``even`` (n,) is set, nothing else stands for the leaves, and the cloud dims what they scatter as their
        clumps do, of whose area the effective one is a fraction; see `optics.recollision_albedo`.
        """
        contents = refinement.contents
        # Large polygons are walls, not fog: they are occluders, and drawn as they are.
        fine = np.isfinite(contents.polygons.totals.width)
        if not fine.all():
            contents = replace(contents, polygons=contents.polygons.take(fine))
        assets = refinement.assets.placed, refinement.assets.held(len(refinement.tree))
        summaries = summarize(flora, contents, numbers_of(refinement, nodes), len(nodes), assets)
        vertices = refinement.tree.vertices(nodes)
        matrices, normal, plane = extinction_matrices(summaries, volume(vertices))
        color = summaries.color
        if even is not None:
            whole = summaries.optical_area
            part = summaries.effective_area(volume(vertices)) / np.where(whole > 0.0, whole, np.inf)
            color = recollision_albedo(color, np.where(even & (whole > 0.0), part, 1.0))
        return cls(vertices, matrices, color, summaries.transmission, normal, plane)

    @cached_property
    def gradients(self) -> Floats:
        """Gradients (n, 4, 3) of the barycentric coordinates, 1/m."""
        return barycentric_gradients(self.vertices)

    @cached_property
    def key_points(self) -> Floats:
        """Where light is sampled, (n, 4, 3): one point for each vertex."""
        return np.einsum("kj,njx->nkx", _KEYS, self.vertices)

    @cached_property
    def albedo(self) -> Floats:
        """Fraction (n, 3) of the light that is scattered again."""
        return albedo(self.color, self.transmission)

    def extinction(self, directions: Floats, cells: NDArray | slice = slice(None)) -> Floats:
        """κ (m,) of some tetrahedra along unit directions (3,) or (m, 3), 1/m."""
        matrices = self.matrices[cells]
        basis = _quadratic(np.broadcast_to(directions, (len(matrices), 3)))
        return np.sqrt(np.maximum(np.sum(matrices * basis, axis=1), 0.0))

    @cached_property
    def mean_extinction(self) -> Floats:
        """Mean (n,) over all directions of κ, 1/m.

        Within 1.3 % of the integral, which single orientations reach: a mean over points of a Fibonacci lattice on the
        half sphere; κ(ω) = κ(−ω). The form of κ is that of Heitz et al., "The SGGX Microflake Distribution", 2015.
        """
        index, result = np.arange(_DIRECTIONS) + 0.5, np.zeros(len(self))
        basis = _quadratic(spiral(index / _DIRECTIONS, index, GOLDEN_TURN)).T
        for part in blocks(len(self), _CHUNK):
            result[part] = np.sqrt(np.maximum(self.matrices[part] @ basis, 0.0)).mean(axis=1)
        return result

    def own_depth(self, points: Floats, cells: Integers, toward: Floats) -> Floats:
        """Optical depth (m,) between points and where light enters their tetrahedra; 0 where the cell is −1.

        ``toward`` (3,) or (m, 3) are unit vectors to the light.
        """
        result = np.zeros(len(points))
        rows = np.flatnonzero(cells >= 0)
        tetrahedra = cells[rows]
        toward = np.broadcast_to(toward, (len(points), 3))[rows]
        inside = np.maximum(barycentric(self.vertices[tetrahedra], points[rows]), 0.0)
        slopes = np.einsum("nkx,nx->nk", self.gradients[tetrahedra], toward)
        # Toward the light a coordinate falls by its slope; the cell ends where the first reaches zero.
        with np.errstate(divide="ignore", invalid="ignore"):
            lengths = np.where(slopes < 0.0, inside / -slopes, np.inf).min(axis=1)
        result[rows] = np.where(np.isfinite(lengths), lengths, 0.0) * self.extinction(toward, tetrahedra)
        return result

    def weights(self, points: Floats, cells: Integers) -> Floats:
        """Weights (m, 4) of the key points' samples for points in tetrahedra: linear in between, constant beyond."""
        inside = barycentric(self.vertices[cells], points)
        inside = np.maximum((inside - (1.0 - INWARDS) / 4.0) / INWARDS, 0.0)
        return inside / np.maximum(inside.sum(axis=1, keepdims=True), 1e-12)


def _quadratic(directions: Floats) -> Floats:
    """What S (n, 6) has to be multiplied with for ωᵀSω of directions (n, 3): (n, 6)."""
    x, y, z = directions.T
    return np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z], axis=1)


def numbers_of(refinement: Refinement, nodes: Integers) -> Integers:
    """Number of each node of the tree among some (n,), −1 where it is none of them."""
    index = np.full(len(refinement.tree), -1, dtype=np.int64)
    index[nodes] = np.arange(len(nodes))
    return index


@dataclass(frozen=True)
class SurfaceElements:
    """Facets, leaves or other small opaque quadrilaterals: m of them, in n tetrahedra."""

    corners: Floats  # (m, 4, 3): meters; a triangle repeats a corner
    #: (m,): tetrahedron (index into the clouds) of each, none negative; the nearest where it lies in none.
    cell: Integers
    replaced: Mask  # (n,): tetrahedra that cast no shadow themselves, since their sheets do

    def __len__(self) -> int:
        return len(self.cell)

    @classmethod
    def none(cls, count: int) -> Self:
        """No sheets among a number of tetrahedra."""
        return cls(np.zeros((0, 4, 3)), np.zeros(0, np.int64), np.zeros(count, bool))

    def pixels(self, limits: tuple[int, int]) -> int:
        """Longer side of a buffer that sees all sheets, with pixels somewhat larger than a sheet."""
        if not len(self):
            return limits[0]
        vector = np.cross(self.corners[:, 2] - self.corners[:, 0], self.corners[:, 3] - self.corners[:, 1])
        side = np.sqrt(np.median(np.linalg.norm(vector, axis=1)) / 2.0)
        return int(np.clip(np.ptp(self.corners.reshape(-1, 3), axis=0).max() / max(_ROOMY * side, 1e-9), *limits))

    def thinned(self, most: int) -> tuple[Self, Integers]:
        """At most so many sheets, larger as they are fewer, and the number (m,) of each of these among them, or −1."""
        step = -(-len(self) // most)
        if step <= 1:
            return self, np.arange(len(self))
        # Evenly among those of each tetrahedron, in whatever order they come.
        order = np.argsort(self.cell, kind="stable")[step // 2 :: step]
        number = np.full(len(self), -1)
        number[order] = np.arange(len(order))
        corners = self.corners[order]
        middle = corners.mean(axis=1, keepdims=True)
        grown = middle + (corners - middle) * np.sqrt(len(self) / len(order))
        return SurfaceElements(grown, self.cell[order], self.replaced), number

    def samples(self, clouds: MediumCells) -> "tuple[Floats, Integers, Integers, KeyMeans]":
        """Where light from all sides is sampled.

        Returns
        -------
        points : (k, 3) float64
            The key points of each tetrahedron without sheets, and the middles of some sheets of each other one.
        cells, sheets : (k,) int64
            As for `Illumination.direct`.
        keys : KeyMeans
            Which key point each counts for.
        """
        key = np.arange(4 * len(clouds))
        key = key[~self.replaced[key // 4]]
        order = np.argsort(self.cell, kind="stable")
        counts = np.bincount(self.cell, minlength=len(clouds))
        cell, place = spread(counts)
        # Evenly among those of a tetrahedron, in whatever order they come.
        step = np.maximum(-(-counts[cell] // int(np.clip(ALL_SAMPLES // max(len(clouds), 1), 1, SAMPLES))), 1)
        chosen = order[(place % step == 0) & self.replaced[cell]]
        middle = self.corners[chosen].mean(axis=1)
        nearest = np.argmax(clouds.weights(middle, self.cell[chosen]), axis=1)
        points = np.concatenate([clouds.key_points.reshape(-1, 3)[key], middle])
        cells = np.concatenate([key // 4, self.cell[chosen]])
        sheets = np.concatenate([np.full(len(key), -1), chosen])
        return points, cells, sheets, KeyMeans(np.concatenate([key, 4 * self.cell[chosen] + nearest]), len(clouds))


class KeyMeans:
    """Means of samples by key point: ``key`` (k,) is that of each sample, among the 4 n of ``count`` tetrahedra."""

    def __init__(self, key: Integers, count: int) -> None:
        self._key, self._count = key, count
        self._number = np.bincount(key, minlength=4 * count).reshape(count, 4)

    def means(self, values: Floats) -> Floats:
        """Means (4 n, ...) of values (k, ...); a key point without samples has its tetrahedron's mean."""
        flat = values.reshape(len(values), -1)
        sums = np.stack([np.bincount(self._key, column, 4 * self._count) for column in flat.T], axis=1)
        sums, number = sums.reshape(self._count, 4, -1), self._number[..., None]
        every = sums.sum(axis=1, keepdims=True) / np.maximum(number.sum(axis=1, keepdims=True), 1)
        return np.where(number > 0, sums / np.maximum(number, 1), every).reshape(4 * self._count, *values.shape[1:])

    def by_cell(self, values: Floats) -> Floats:
        """Means (n, ...) over the samples of each tetrahedron, from those (4 n, ...) of its key points."""
        values = values.reshape(self._count, 4, *values.shape[1:])
        weight = np.where(self._number.any(axis=1, keepdims=True), self._number, 1)
        weight = weight.reshape(self._count, 4, *(1,) * (values.ndim - 2))
        return (values * weight).sum(axis=1) / weight.sum(axis=1)
