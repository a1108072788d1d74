# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The visibility step (paper, section 6.3): how many pixels a tetrahedron affects, and how much hides it.

The paper draws the tree front to back and reads an alpha buffer along the way. Since optical depths add up, the same
numbers come from sorting all fragments by pixel and front-to-back rank: what stands before a fragment is a cumulative
sum within its pixel. No pixel is visited in a loop.
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
class Visibility:
    """What the alpha buffer says of each tetrahedron.

    Attributes
    ----------
    pixels : (n,) float64
        Area in pixels of the final picture that the tetrahedron affects, hidden or not; 0 out of view.
    transmittance : (n,) float64
        Share of that area's light that is not held up by what stands in front, 0 to 1; 0 out of view.
    opacity : (n,) float64
        Mean of 1 − e^−τ over its own silhouette, 0 to 1; 0 out of view.
    nearest : (n,) float64
        Least distance from the eye along the buffer's rays, metres; infinite out of view.
    alpha : (height, width) float64
        Opacity of all tetrahedra together in each pixel of the buffer, as far as no occluder hides them. Row 0 is the
        lowest of the picture.
    """

    pixels: NDArray[np.float64]
    transmittance: NDArray[np.float64]
    opacity: NDArray[np.float64]
    nearest: NDArray[np.float64]
    alpha: NDArray[np.float64]


def visibility(
    vertices: NDArray[np.float64],
    extinction: ArrayLike,
    rank: ArrayLike,
    camera: Camera,
    resolution: int,
    occluders_depth: NDArray[np.float64] | None = None,
) -> Visibility:
    """Contribution of each tetrahedron to the picture.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra that do not overlap, metres, world space.
    extinction : (n,) float64
        κ ≥ 0 along the way from the eye, 1/m; may be infinite.
    rank : (n,) int
        Front-to-back ranks as `TetrahedralTree.order` gives them; any integers, smaller is nearer.
    camera : Camera
        The view, and the size of the final picture.
    resolution : int
        Longer side of the alpha buffer, pixels; `buffer_size` gives both sides.
    occluders_depth : (height · width,) float64, optional
        Where each pixel's ray ends at an opaque polygon, as `occluder_depth` gives it for the same size.

    Returns
    -------
    Visibility

    Raises
    ------
    ValueError
        If the occluders were drawn for a buffer of another size.
    """
    width, height = buffer_size(camera, resolution)
    vertices = np.asarray(vertices, np.float64).reshape(-1, 4, 3)
    cells = len(vertices)
    fragments = tetrahedron_fragments(vertices, camera, width, height)
    cell, pixel = fragments.cell, fragments.pixel
    share = np.ones(len(fragments))
    if occluders_depth is not None:
        if np.size(occluders_depth) != width * height:
            raise ValueError(f"the occluders' buffer does not have {width} × {height} pixels")
        end = np.ravel(occluders_depth)[pixel]
        share = np.clip((end - fragments.entry) / np.maximum(fragments.thickness, 1e-12), 0.0, 1.0)

    with np.errstate(invalid="ignore"):
        depth = np.asarray(extinction, np.float64)[cell] * fragments.thickness
    # 0 · ∞ where a ray touches an opaque cell in a point: nothing.
    own = np.nan_to_num(np.minimum(depth, OPAQUE), nan=0.0)
    before, total = _depth_before(own * np.minimum(fragments.coverage * share, 1.0), cell, pixel, rank, width * height)
    seen = np.exp(-before) * share

    weight = np.bincount(cell, fragments.coverage, cells)
    norm = np.where(weight > 0.0, weight, 1.0)
    pixels, whole = silhouette_pixels(vertices, camera)
    final = camera.width * camera.height / (width * height)
    nearest = np.full(cells, np.inf)
    np.minimum.at(nearest, cell, fragments.entry)
    return Visibility(
        pixels=np.where(whole & (weight > 0.0), pixels, weight * final),
        transmittance=np.bincount(cell, fragments.coverage * seen, cells) / norm,
        opacity=np.bincount(cell, -fragments.coverage * np.expm1(-own), cells) / norm,
        nearest=nearest,
        alpha=-np.expm1(-total).reshape(height, width),
    )


def _depth_before(
    depth: NDArray[np.float64], cell: NDArray[np.int32], pixel: NDArray[np.int32], rank: ArrayLike, pixels: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Optical depth in front of each fragment within its pixel, and that of each pixel altogether."""
    order = np.lexsort((np.asarray(rank)[cell], pixel))
    total = np.bincount(pixel, depth, pixels)
    summed = np.cumsum(depth[order])
    ends = np.cumsum(np.bincount(pixel, minlength=pixels))
    # What all earlier pixels hold is taken off again. Rounding must not leave less than nothing.
    earlier = np.concatenate([[0.0], summed])[np.concatenate([[0], ends[:-1]])]
    before = np.zeros_like(depth)
    before[order] = np.maximum(summed - depth[order] - earlier[pixel[order]], 0.0)
    return before, total
