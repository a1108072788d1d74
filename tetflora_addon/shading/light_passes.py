# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which views a light takes of the scene, and the buffers that it sees it in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..refinement.camera import Camera
from ..refinement.light_views import Light, lamp_views, light_views
from .light_buffers import LightBuffer
from .light_clouds import Clouds
from .light_sheets import Sheets

#: Limits of the longer side of a lamp's buffer, pixels.
LAMP_PIXELS = (64, 2048)


@dataclass(frozen=True)
class Near:
    """Where light counts most: around the eye.

    Attributes
    ----------
    eye : (3,) float64
        Metres.
    radii : tuple of float
        Of what suns see in views of their own, metres, the smallest first.
    """

    eye: NDArray[np.float64]
    radii: tuple[float, ...] = ()


def light_resolution(camera: Camera) -> int:
    """Longer side in pixels of a lamp's buffer: that of the picture (paper: "of proportional size")."""
    return int(np.clip(max(camera.width, camera.height), *LAMP_PIXELS))


def to_eye(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (m, 3) from points to the camera."""
    if camera.kind == "ORTHO":
        return np.tile(camera.frame[:, 2], (len(points), 1))
    away = camera.eye - points
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def buffers_of(
    light: Light,
    clouds: Clouds,
    sheets: Sheets,
    occluders: NDArray[np.float64] | None,
    resolution: int,
    near: Near | None = None,
) -> list[LightBuffer]:
    """Buffers in which a light sees tetrahedra, sheets and polygons: one, six all around, or none without any.

    A sun has further ones before it for what is ``near``, in which the same pixels are smaller.
    """
    views = _views(light, clouds, occluders, resolution) if len(clouds) else []
    if light.kind == "SUN" and near is not None:
        views = [closer for view in views for closer in _closer(view, near)] + views
    return [_buffer(view, light, clouds, sheets, occluders, resolution) for view in views]


def _views(light: Light, clouds: Clouds, occluders: NDArray[np.float64] | None, resolution: int) -> list[Camera]:
    corners = clouds.vertices.reshape(-1, 3)
    if light.kind != "SUN":
        return lamp_views(light.position, corners, resolution)
    # Where occluders are decides how far the view reaches, not how wide it is.
    every = corners if occluders is None or not len(occluders) else np.concatenate([corners, occluders.reshape(-1, 3)])
    return light_views(light, clouds.vertices, every, resolution)


def _closer(view: Camera, near: Near) -> list[Camera]:
    """Parts of a sun's view."""
    left, right, bottom, top = view.window
    made = []
    x, y = (near.eye @ view.frame)[:2]
    for radius in near.radii:
        window = max(left, x - radius), min(right, x + radius), max(bottom, y - radius), min(top, y + radius)
        width, height = window[1] - window[0], window[3] - window[2]
        if min(width, height) > 0.0 and max(width, height) < 0.7 * max(right - left, top - bottom):
            scale = 4096 / max(width, height)
            shape = {"width": max(round(width * scale), 1), "height": max(round(height * scale), 1)}
            made.append(replace(view, window=window, **shape))
    return made


def _buffer(
    view: Camera,
    light: Light,
    clouds: Clouds,
    sheets: Sheets,
    occluders: NDArray[np.float64] | None,
    resolution: int,
) -> LightBuffer:
    along = light.direction if light.kind == "SUN" else -to_eye(view, clouds.vertices.mean(axis=1))
    extinction = np.where(sheets.replaced, 0.0, clouds.extinction(along))
    return LightBuffer(view, resolution, clouds.vertices, extinction, occluders, sheets.corners)
