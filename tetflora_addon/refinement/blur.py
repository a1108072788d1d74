# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much further a picture reaches where its lens is open or its camera moves: depth of field and motion blur.

A lens of radius R that is focused on depth f draws a point at depth z as a disc; at depth 1 its radius is R |1/z − 1/f|
(M. Potmesil and I. Chakravarty, "A lens and aperture camera model for synthetic image generation", Computer Graphics
15 (3), 1981). What lies beside the view by less than that is in the picture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .camera import Camera

#: Margins never exceed this share of the picture on each side. A twig at the lens is blurred over more than all of it,
#: but so thinly that its leaves cannot be told.
MOST = 0.5


def blur_margins(camera: Camera, centre: NDArray[np.float64], reach: NDArray[np.float64]) -> tuple[float, float]:
    """Shares of the picture's width and height by which blur reaches beyond it.

    Parameters
    ----------
    camera : Camera
        With its lens and shutter.
    centre : (n, 3) float64
        Middles of the plants, metres, world space.
    reach : (n,) float64
        Radii of spheres around them that hold the plants, metres.

    Returns
    -------
    across, up : float
        For each side of the picture, 0 to `MOST`. Where nothing is blurred, 0.
    """
    if not len(centre) or not (camera.lens_radius > 0.0 or camera.shutter):
        return 0.0, 0.0
    depth = _depths(camera, centre)
    near, far = camera.near - camera.setback, camera.far - camera.setback
    nearest = np.maximum(depth - reach - camera.room, camera.closest)
    farthest = np.maximum(np.minimum(depth + reach + camera.room, far), camera.closest)
    ahead = (depth + reach > near) & (depth - reach < far)
    radius = np.maximum(circle_of_confusion(camera, nearest), circle_of_confusion(camera, farthest))
    metres = radius if camera.kind == "ORTHO" else radius * farthest
    seen = ahead & (camera.clearance(centre) - reach < metres)
    left, right, bottom, top = camera.window
    size = np.array([right - left, top - bottom])
    margins = np.max(radius[seen], initial=0.0) / size
    if seen.any() and camera.kind != "PANO":
        between = float(nearest[seen].min()), float(farthest[seen].max())
        for other in camera.shutter:
            margins = np.maximum(margins, _movement(camera, other, between) / size)
    across, up = np.minimum(margins, MOST).tolist()
    return across, up


def circle_of_confusion(camera: Camera, depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Radius (n,) on the window of the discs that points at depths (n,), metres, are drawn as; see the module."""
    if camera.lens_radius <= 0.0:
        return np.zeros(len(depth))
    if camera.kind == "ORTHO":
        return camera.lens_radius * np.abs(depth / camera.focus - 1.0)
    return camera.lens_radius * np.abs(1.0 / np.maximum(depth, camera.closest) - 1.0 / camera.focus)


def _depths(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depths (n,) from the eye, metres, or distances where a picture is all around it."""
    local = camera.to_camera_space(points)
    return np.linalg.norm(local, axis=-1) if camera.kind == "PANO" else local[..., 2] - camera.setback


def _movement(camera: Camera, other: Camera, depths: tuple[float, float]) -> NDArray[np.float64]:
    """How far beyond the window of a camera (2,) the view of another reaches between two depths.

    That view is convex, and so is its picture: the corners are enough.
    """
    left, right, bottom, top = other.window
    corners = np.array([(x, y, 1.0) for x in (left, right) for y in (bottom, top)])
    scale = [np.array([1.0, 1.0, d]) if other.kind == "ORTHO" else np.full(3, d) for d in depths]
    local = np.concatenate([corners * s for s in scale]) * np.array([1.0, 1.0, -1.0])
    seen = camera.to_camera_space(local @ other.frame.T + other.position)
    if camera.kind == "PERSP":
        if (seen[:, 2] <= 0.0).any():
            return np.full(2, np.inf)
        seen = seen / seen[:, 2:]
    left, right, bottom, top = camera.window
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    return np.max([np.array([left, bottom]) - low, high - np.array([right, top]), np.zeros(2)], axis=0)
