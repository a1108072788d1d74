# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection to the camera's window: boxes and silhouettes of tetrahedra and triangles, without pixels.

Names: ``local`` is camera space (x right, y up, depth), meters; the *window* is the image at depth 1
(``'PERSP'``) or in meters (``'ORTHO'``).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Mask
from ..tetrahedra.geometry import EDGES, FACES, projected_area
from .camera import Camera


def silhouette_pixels(vertices: Floats, camera: Camera) -> tuple[Floats, Mask]:
    """Exact silhouette areas of tetrahedra on the final image.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        World space, meters.
    camera : Camera
        Its ``width`` and ``height`` are the image's.

    Returns
    -------
    pixels : (n,) float64
        Area in pixels of what is beyond the near plane; 0 where it is not known.
    whole : (n,) bool
        Where it is known: tetrahedra within the window that are not beyond the far plane, as all of the view are.
    """
    local = camera.to_camera_space(vertices)
    low, high, _ = window_bounds(local, camera)
    area, whole = silhouette_area(local, low, high, camera)
    left, right, bottom, top = camera.window
    return area * (camera.width * camera.height / ((right - left) * (top - bottom))), whole


def expected_pixels(vertices: Floats, camera: Camera) -> tuple[Floats, Mask]:
    """Silhouette areas of tetrahedra on the final image, also of those that are partly in view.

    Parameters
    ----------
    vertices, camera
        As for `silhouette_pixels`; the camera may be panoramic.

    Returns
    -------
    pixels : (n,) float64
        Exact for those that are whole in view. Of others half the pixels of the seen part of the box around them, which
        a tetrahedron hardly ever exceeds; 0 out of view. On a panorama from the area across the line of sight.
    whole : (n,) bool
    """
    if camera.kind == "PANO":
        return _on_the_sphere(vertices, camera)
    local = camera.to_camera_space(vertices)
    low, high, _ = window_bounds(local, camera)
    area, whole = silhouette_area(local, low, high, camera)
    left, right, bottom, top = camera.window
    seen = np.clip(np.minimum(high, [right, top]) - np.maximum(low, [left, bottom]), 0.0, None)
    area = np.where(whole, area, np.prod(seen, axis=1) / 2.0)
    return area / camera.pixel_size**2 * camera.pixel_gain(vertices.mean(axis=1)), whole


def _on_the_sphere(vertices: Floats, camera: Camera) -> tuple[Floats, Mask]:
    middle = vertices.mean(axis=1)
    toward = middle - camera.position
    distance = np.linalg.norm(toward, axis=1)
    area = projected_area(vertices, toward / np.maximum(distance, 1e-300)[:, None])
    # Nothing covers more than the whole sphere; what is around the eye covers much of it.
    pixels = np.minimum(area, 4.0 * np.pi * np.maximum(distance, camera.near) ** 2) / camera.pixel_extent(middle) ** 2
    outside = camera.distance_to_view(vertices.reshape(-1, 3)).reshape(-1, 4)
    return np.where((outside > 0.0).all(axis=1), 0.0, pixels), (outside <= 0.0).all(axis=1)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _project(local: Floats, camera: Camera) -> Floats:
    """Camera space ``(..., 3)`` to the window ``(..., 2)``; what is before the near plane counts as lying on it."""
    if camera.kind == "ORTHO":
        return local[..., :2]
    return local[..., :2] / np.maximum(local[..., 2:], camera.near)


def silhouette_area(local: Floats, low: Floats, high: Floats, camera: Camera) -> tuple[Floats, Mask]:
    """Areas ``(n,)`` on the window of tetrahedra beyond the near plane, 0 where not known, and where they are known."""
    left, right, bottom, top = camera.window
    near, far = camera.near, camera.far
    # A fraction of the window, so that rounding does not exclude what touches its border, as half of all cells may.
    slack = 1e-9 * np.array([right - left, top - bottom])
    whole = ((low >= np.array([left, bottom]) - slack) & (high <= np.array([right, top]) + slack)).all(axis=1)
    depth = local[..., 2]
    whole &= (depth.max(axis=1) <= far * (1.0 + 1e-9)) & (low <= high).all(axis=1)
    # Each ray crosses the surface twice. Signed areas of a closed surface add up to nothing, which gives the section
    # at the near plane from the four faces.
    area, ahead = np.zeros((len(local), 4)), depth >= near
    flat = _project(local, camera)
    for face, (i, j, k) in enumerate(FACES):
        area[:, face] = _cross(flat[:, j] - flat[:, i], flat[:, k] - flat[:, i]) / 2.0
    mixed = np.flatnonzero(~ahead.all(axis=1) & whole)
    for face, corners in enumerate(FACES):
        area[mixed, face] = _clipped_area(local[mixed[:, None], corners], camera)
    total = (np.abs(area).sum(axis=1) + np.abs(area.sum(axis=1))) / 2.0
    return np.where(whole, total, 0.0), whole


def _clipped_area(triangles: Floats, camera: Camera) -> Floats:
    """Signed areas ``(n,)`` on the window of the parts of triangles ``(n, 3, 3)`` beyond the near plane."""
    ahead = triangles[..., 2] >= camera.near
    flat = _project(triangles, camera)
    area, leaves, enters = np.zeros(len(triangles)), np.zeros((len(triangles), 2)), np.zeros((len(triangles), 2))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = triangles[:, i], triangles[:, j]
        crosses = ahead[:, i] != ahead[:, j]
        fraction = (camera.near - a[:, 2]) / np.where(crosses, b[:, 2] - a[:, 2], 1.0)
        cut = a + fraction[:, None] * (b - a)
        cut = cut[:, :2] if camera.kind == "ORTHO" else cut[:, :2] / camera.near
        start = np.where(ahead[:, i, None], flat[:, i], cut)
        end = np.where(ahead[:, j, None], flat[:, j], cut)
        area += np.where(ahead[:, i] | ahead[:, j], _cross(start, end), 0.0)
        leaves = np.where((crosses & ahead[:, i])[:, None], cut, leaves)
        enters = np.where((crosses & ahead[:, j])[:, None], cut, enters)
    return (area + _cross(leaves, enters)) / 2.0


def window_bounds(local: Floats, camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Boxes ``low``, ``high`` (n, 2) on the window, and a point (n, 2) on it that lies within the silhouette.

    The part before the near plane is cut off; boxes of what lies wholly before it or wholly beyond the far plane are
    empty: ``low > high``.
    """
    count = local.shape[1]
    near, far = camera.near, camera.far
    counted = (local[..., 2] >= near) & (local[..., 2].min(axis=1) < far)[:, None]
    mixed = np.flatnonzero(counted.any(axis=1) & ~counted.all(axis=1))
    flat = _project(local, camera)
    low = np.where(counted[..., None], flat, np.inf).min(axis=1)
    high = np.where(counted[..., None], flat, -np.inf).max(axis=1)
    total = np.where(counted[..., None], flat, 0.0).sum(axis=1)
    number = counted.sum(axis=1).astype(np.float64)
    for first, second in EDGES[(count > EDGES).all(axis=1)]:
        a, b = local[mixed, first], local[mixed, second]
        crosses = np.flatnonzero(counted[mixed, first] != counted[mixed, second])
        at, a, b = mixed[crosses], a[crosses], b[crosses]
        fraction = (near - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
        cut = a + fraction * (b - a)
        point = cut[:, :2] if camera.kind == "ORTHO" else cut[:, :2] / near
        low[at], high[at] = np.minimum(low[at], point), np.maximum(high[at], point)
        total[at] += point
        number[at] += 1.0
    return low, high, total / np.maximum(number, 1.0)[:, None]
