# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The visibility step (paper, section 6.3): how many pixels a tetrahedron affects, and how much hides it.

The paper draws the tree front to back and reads an alpha buffer along the way. Since optical depths add up, the same
numbers come from sorting all fragments by pixel and front-to-back rank: what stands before a fragment is a cumulative
sum within its pixel. No pixel is visited in a loop. A tetrahedron is drawn once; its fragments stay until it is
divided.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .camera import Camera
from .rasterise import buffer_size, tetrahedron_fragments
from .silhouette import silhouette_pixels

#: Optical depth of one fragment at most. e^−60 is no light at all, and larger numbers, or infinite ones, would take
#: the precision from the cumulative sum over the whole image.
OPAQUE = 60.0


@dataclass(frozen=True)
class Outline:
    """What can be said of each tetrahedron (n,) without the others.

    Attributes
    ----------
    pixels : (n,) float64
        Area in pixels of the final picture that the tetrahedron affects, hidden or not; 0 out of view.
    opacity : (n,) float64
        Mean of 1 − e^−τ over its own silhouette, 0 to 1; 0 out of view.
    nearest : (n,) float64
        Least distance from the eye along the buffer's rays, metres; infinite out of view.
    """

    pixels: NDArray[np.float64]
    opacity: NDArray[np.float64]
    nearest: NDArray[np.float64]


class AlphaBuffer:
    """The fragments of all tetrahedra in a small image, as they come and go.

    Parameters
    ----------
    camera : Camera
        The view, and the size of the final picture.
    resolution : int
        Longer side of the buffer, pixels; `buffer_size` gives both sides.
    occluders_depth : (height · width,) float64, optional
        Where each pixel's ray ends at an opaque polygon, as `occluder_depth` gives it for the same size.

    Raises
    ------
    ValueError
        If the occluders were drawn for a buffer of another size.
    """

    def __init__(self, camera: Camera, resolution: int, occluders_depth: NDArray[np.float64] | None = None) -> None:
        self.camera = camera
        self.width, self.height = buffer_size(camera, resolution)
        self.end = None if occluders_depth is None else np.ravel(occluders_depth)
        if self.end is not None and len(self.end) != self.width * self.height:
            raise ValueError(f"the occluders' buffer does not have {self.width} × {self.height} pixels")
        self._cell, self._pixel = np.zeros((2, 0), np.int32)
        # Optical depth that a fragment brings into its pixel, the pixels that it stands for and those not occluded.
        self._depth, self._coverage, self._open = np.zeros((3, 0))

    def add(self, cells: NDArray[np.integer], vertices: NDArray[np.float64], extinction: ArrayLike) -> Outline:
        """Draw tetrahedra.

        Parameters
        ----------
        cells : (n,) int
            Numbers by which they are known from now on, zero or positive, each new.
        vertices : (n, 4, 3) float64
            Positively oriented, overlapping with none that is there, metres, world space.
        extinction : (n,) float64
            κ ≥ 0 along the way from the eye, 1/m; may be infinite.

        Returns
        -------
        Outline
        """
        count = len(vertices)
        fragments = tetrahedron_fragments(vertices, self.camera, self.width, self.height)
        cell, pixel, coverage = fragments.cell, fragments.pixel, fragments.coverage
        share = np.ones(len(fragments))
        if self.end is not None:
            behind = (self.end[pixel] - fragments.entry) / np.maximum(fragments.thickness, 1e-12)
            share = np.clip(behind, 0.0, 1.0)
        with np.errstate(invalid="ignore"):
            depth = np.asarray(extinction, np.float64)[cell] * fragments.thickness
        # 0 · ∞ where a ray touches an opaque cell in a point: nothing.
        own = np.nan_to_num(np.minimum(depth, OPAQUE), nan=0.0)
        weight = np.bincount(cell, coverage, count)
        opacity = np.bincount(cell, -coverage * np.expm1(-own), count) / np.where(weight > 0.0, weight, 1.0)
        pixels, whole = silhouette_pixels(vertices, self.camera)
        final = self.camera.width * self.camera.height / (self.width * self.height)
        nearest = np.full(count, np.inf)
        np.minimum.at(nearest, cell, fragments.entry)
        for name, values in (
            ("_cell", np.asarray(cells, np.int32)[cell]),
            ("_pixel", pixel),
            ("_depth", own * np.minimum(coverage * share, 1.0)),
            ("_coverage", coverage),
            ("_open", coverage * share),
        ):
            setattr(self, name, np.concatenate([getattr(self, name), values]))
        return Outline(np.where(whole & (weight > 0.0), pixels, weight * final), opacity, nearest)

    def remove(self, chosen: NDArray[np.bool_]) -> None:
        """Take away tetrahedra; ``chosen`` is a mask by their numbers."""
        stay = np.flatnonzero(~chosen[self._cell])
        if len(stay) < len(self._cell):
            for name in ("_cell", "_pixel", "_depth", "_coverage", "_open"):
                setattr(self, name, getattr(self, name)[stay])

    def transmittance(self, rank: NDArray[np.integer]) -> NDArray[np.float64]:
        """Share of each tetrahedron's light, 0 to 1, that nothing in front holds up; 0 out of view.

        Parameters
        ----------
        rank : (numbers,) int
            Front-to-back rank by number, as `TetrahedralTree.order` gives it; smaller is nearer, none negative.

        Returns
        -------
        (numbers,) float64
        """
        seen = self._open * np.exp(-self._depth_before(rank))
        weight = np.bincount(self._cell, self._coverage, len(rank))
        return np.bincount(self._cell, seen, len(rank)) / np.where(weight > 0.0, weight, 1.0)

    def alpha(self) -> NDArray[np.float64]:
        """Opacity (height, width) of all tetrahedra together, as far as no occluder hides them; row 0 is lowest."""
        total = np.bincount(self._pixel, self._depth, self.width * self.height)
        return -np.expm1(-total).reshape(self.height, self.width)

    def _depth_before(self, rank: NDArray[np.integer]) -> NDArray[np.float64]:
        """Optical depth in front of each fragment within its pixel."""
        # One number to sort by is several times as fast as two.
        key = self._pixel.astype(np.int64) * (int(rank.max(initial=0)) + 1) + np.take(rank, self._cell)
        order = np.argsort(key)
        depth = np.take(self._depth, order)
        summed = np.cumsum(depth)
        ends = np.cumsum(np.bincount(self._pixel, minlength=self.width * self.height))
        # What all earlier pixels hold is taken off again. Rounding must not leave less than nothing.
        earlier = np.concatenate([[0.0], summed])[np.concatenate([[0], ends[:-1]])]
        before = np.zeros_like(depth)
        before[order] = np.maximum(summed - depth - np.take(earlier, np.take(self._pixel, order)), 0.0)
        return before
