# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights, and the flat cameras through which they look at what they shine on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .panorama import face_cameras

#: Spots wider than this half angle, radians, are looked at as if they shone all around.
_WIDE = 1.2
#: Points farther than this from the middle of a view, as the tangent of the angle, are looked at by six views instead.
_STEEP = 2.5
#: Nearest that a lamp's view sees, metres.
_NEAR = 1e-2


@dataclass(frozen=True)
class Light:
    """Where light comes from.

    Attributes
    ----------
    kind : {'SUN', 'SPOT', 'POINT', 'AREA'}
        Parallel rays, a cone, all around, or a flat surface that shines to one side.
    position : (3,) float64
        Metres, world space; of no meaning for the sun.
    direction : (3,) float64
        Unit vector in which it shines; of no meaning for a point.
    width : float
        Angle in radians under which the sun is seen, or diameter in metres of the others: shadows are blurred by it.
    angle : float
        Half of the spot's cone, radians.
    colour : (3,) float64
        Linear RGB times energy: for the sun W/m² on a surface that faces it, for the others the W/sr that they send
        ahead, so that a surface at distance r that faces them gets colour / r² W/m².
    blend : float
        Share of a spot's cone over which it fades, 0 to 1.
    span : (2, 3) float64
        Half edges of an area, or half axes of an ellipse, metres.
    ellipse : bool
        Whether an area is a disk or an ellipse instead of a square or a rectangle.
    shadow : bool
        Whether anything stands in its light; without, everything is lit.
    """

    kind: Literal["SUN", "SPOT", "POINT", "AREA"]
    position: NDArray[np.float64]
    direction: NDArray[np.float64]
    width: float = 0.0
    angle: float = np.pi
    colour: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    blend: float = 0.0
    span: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 3)))
    ellipse: bool = False
    shadow: bool = True


def light_views(
    light: Light, vertices: NDArray[np.float64], points: NDArray[np.float64], resolution: int
) -> list[Camera]:
    """Flat cameras through which a light sees what receives it.

    Parameters
    ----------
    light : Light
    vertices : (n, 4, 3) float64
        Tetrahedra that stand in the light, metres.
    points : (m, 3) float64
        What receives it, metres.
    resolution : int
        Longer side of their pictures, pixels.

    Returns
    -------
    list of Camera
        None where nothing stands between the sun and what receives its light.
    """
    frame = frame_towards(light.direction)
    if light.kind == "SUN":
        received, corners = points @ frame, vertices.reshape(-1, 3) @ frame
        # Only where something stands between the sun and what receives its light: ground goes on to the horizon.
        low = np.maximum(received.min(axis=0), corners.min(axis=0))[:2] - 1e-3
        high = np.minimum(received.max(axis=0), corners.max(axis=0))[:2] + 1e-3
        if (low >= high).any():
            return []
        depth = np.concatenate([received[:, 2], corners[:, 2]])
        start, far = depth.max() + 1.0, float(np.ptp(depth)) + 2.0
        window = (float(low[0]), float(high[0]), float(low[1]), float(high[1]))
        return [Camera("ORTHO", frame[:, 2] * start, frame, window, 0.1, far, *_shape(*(high - low)))]
    distance = np.linalg.norm(np.concatenate([vertices.reshape(-1, 3), points]) - light.position, axis=1)
    far = float(distance.max()) + 1.0
    if light.kind == "SPOT" and light.angle < _WIDE:
        side = float(np.tan(max(light.angle, 1e-3)))
        window = (-side, side, -side, side)
        return [Camera("PERSP", light.position, frame, window, _NEAR, far, resolution, resolution)]
    around = Camera("PANO", light.position, frame, (-np.pi, np.pi, -np.pi / 2, np.pi / 2), _NEAR, far, 4, 2)
    return face_cameras(around, resolution)


def _shape(width: float, height: float) -> tuple[int, int]:
    """Size in pixels of a picture with square pixels; how large does not matter."""
    scale = 4096 / max(width, height)
    return max(round(width * scale), 1), max(round(height * scale), 1)


def frame_towards(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frame (3, 3) of a camera that looks in a direction (3,) of any length."""
    back = -np.asarray(direction, np.float64) / np.linalg.norm(direction)
    aside = np.eye(3)[np.argmin(np.abs(back))]
    right = np.cross(aside, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)


def lamp_views(position: NDArray[np.float64], points: NDArray[np.float64], resolution: int) -> list[Camera]:
    """Views of points (m, 3) from a lamp: one that fits them closely, or six all around where they surround it."""
    away = points - position
    distance = np.linalg.norm(away, axis=1)
    far = float(distance.max(initial=0.0)) + 1.0
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0 - position
    frame = frame_towards(middle if np.linalg.norm(middle) > _NEAR else np.array([0.0, 0.0, -1.0]))
    local = away @ frame
    depth = -local[:, 2]
    if (depth > _NEAR).all():
        flat = local[:, :2] / depth[:, None]
        if np.abs(flat).max() < _STEEP:
            low, high = flat.min(axis=0) - 1e-4, flat.max(axis=0) + 1e-4
            window = (float(low[0]), float(high[0]), float(low[1]), float(high[1]))
            return [Camera("PERSP", position, frame, window, _NEAR, far, *_shape(*(high - low)))]
    around = Camera("PANO", position, frame, (-np.pi, np.pi, -np.pi / 2, np.pi / 2), _NEAR, far, 4, 2)
    return face_cameras(around, resolution)
