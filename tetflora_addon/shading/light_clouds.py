# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tetrahedra as clouds in the light: what the shadow pass needs to know of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..plants.compiled import Flora
from ..refinement.loop import Refinement
from ..tetrahedra.geometry import barycentric, barycentric_gradients, volume
from .light_scattering import albedo
from .summaries import extinction_matrices, summarise

#: How far the key points lie from the centroid towards the vertices. So placed, the mean over the four is that over
#: the tetrahedron for anything that is quadratic in it (Hammer, Marlowe and Stroud 1956).
INWARDS = 1.0 / np.sqrt(5.0)
# Barycentric coordinates of the key points.
_KEYS = (1.0 - INWARDS) / 4.0 + INWARDS * np.eye(4)


@dataclass(frozen=True)
class Clouds:
    """Tetrahedra that stand in the light, explicit ones included: n of them, without overlap.

    Attributes
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented, metres.
    matrices : (n, 6) float64
        S of κ(ω) = √(ωᵀSω), as `summaries.extinction_matrices` gives it, 1/m².
    colour : (n, 3) float64
    transmission : (n,) float64
        Means of what they hold.
    normal : (n, 3) float64
        Axis in which most normals lie.
    plane : (n,) float64
        Weight of the plane term, 0 to 1.
    """

    vertices: NDArray[np.float64]
    matrices: NDArray[np.float64]
    colour: NDArray[np.float64]
    transmission: NDArray[np.float64]
    normal: NDArray[np.float64]
    plane: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.vertices)

    @classmethod
    def of(cls, flora: Flora, refinement: Refinement, even: NDArray[np.bool_] | None = None) -> Clouds:
        """Everything that the loop left, in the order of ``refinement.nodes``.

        Where ``even`` (n,) is set, a cloud is all that stands for its leaves, and dims what they scatter as their
        clumps do: what leaves one surface meets another of its clump with the probability p = 1 − effective / whole
        area, so that of the colour ω there comes ω (1 − p) / (1 − p ω) (Smolander and Stenberg, "Simple
        parameterizations of the radiation budget of uniform broadleaved and coniferous canopies", 2005).
        """
        nodes, contents = refinement.nodes, refinement.contents
        # Large polygons are walls, not fog: they come as occluders.
        fine = np.isfinite(contents.polygons.amounts.width)
        if not fine.all():
            contents = replace(contents, polygons=contents.polygons.take(fine))
        summaries = summarise(flora, contents, cell_of_node(refinement), len(nodes))
        vertices = refinement.tree.vertices(nodes)
        matrices, normal, plane = extinction_matrices(summaries, volume(vertices))
        colour = summaries.colour
        if even is not None:
            volumes = volume(vertices)
            again = 1.0 - summaries.effective_area(volumes) / np.where(
                summaries.optical_area > 0.0, summaries.optical_area, np.inf
            )
            again = np.where(even & (summaries.optical_area > 0.0), np.clip(again, 0.0, 1.0), 0.0)[:, None]
            colour = colour * (1.0 - again) / (1.0 - again * colour)
        return cls(vertices, matrices, colour, summaries.transmission, normal, plane)

    @cached_property
    def gradients(self) -> NDArray[np.float64]:
        """Gradients (n, 4, 3) of the barycentric coordinates, 1/m."""
        return barycentric_gradients(self.vertices)

    @cached_property
    def key_points(self) -> NDArray[np.float64]:
        """Where light is sampled, (n, 4, 3): one point for each vertex."""
        return np.einsum("kj,njx->nkx", _KEYS, self.vertices)

    @cached_property
    def albedo(self) -> NDArray[np.float64]:
        """Share (n, 3) of the light that is scattered again."""
        return albedo(self.colour, self.transmission)

    def extinction(self, directions: NDArray[np.float64], cells: NDArray | slice = slice(None)) -> NDArray[np.float64]:
        """κ (m,) of some tetrahedra along unit directions (3,) or (m, 3), 1/m."""
        matrices = self.matrices[cells]
        x, y, z = np.moveaxis(np.broadcast_to(directions, (len(matrices), 3)), 1, 0)
        basis = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z], axis=1)
        return np.sqrt(np.maximum(np.sum(matrices * basis, axis=1), 0.0))

    def own_depth(
        self, points: NDArray[np.float64], cells: NDArray[np.integer], towards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Optical depth (m,) between points and where light enters their tetrahedra; 0 where the cell is −1.

        Parameters
        ----------
        points : (m, 3) float64
        cells : (m,) int
        towards : (3,) or (m, 3) float64
            Unit vectors to the light.
        """
        result = np.zeros(len(points))
        some = np.flatnonzero(cells >= 0)
        own = cells[some]
        towards = np.broadcast_to(towards, (len(points), 3))[some]
        inside = np.maximum(barycentric(self.vertices[own], points[some]), 0.0)
        slopes = np.einsum("nkx,nx->nk", self.gradients[own], towards)
        # Towards the light a coordinate falls by its slope; the cell ends where the first reaches zero.
        with np.errstate(divide="ignore", invalid="ignore"):
            lengths = np.where(slopes < 0.0, inside / -slopes, np.inf).min(axis=1)
        result[some] = np.where(np.isfinite(lengths), lengths, 0.0) * self.extinction(towards, own)
        return result

    def weights(self, points: NDArray[np.float64], cells: NDArray[np.integer]) -> NDArray[np.float64]:
        """Weights (m, 4) of the key points' samples for points in tetrahedra: linear between the key points.

        Beyond them the sample of the nearest side stays: nothing is extrapolated.
        """
        inside = barycentric(self.vertices[cells], points)
        inside = np.maximum((inside - (1.0 - INWARDS) / 4.0) / INWARDS, 0.0)
        return inside / np.maximum(inside.sum(axis=1, keepdims=True), 1e-12)


def cell_of_node(refinement: Refinement) -> NDArray[np.int64]:
    """Number (nodes,) in `Clouds.of` of each node of the tree, −1 where it is none of them."""
    index = np.full(len(refinement.tree), -1, dtype=np.int64)
    index[refinement.nodes] = np.arange(len(refinement.nodes))
    return index
