# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as the engine sees it: a window at unit depth, projection and its inverse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """A perspective or orthographic camera.

    Camera space is Blender's: +x right, +y up, looking along −z. *Depth* is the distance along the viewing direction.

    Attributes
    ----------
    kind : {'PERSP', 'ORTHO'}
        Perspective, or parallel rays along the viewing direction.
    position : (3,) float64
        The eye; for ``'ORTHO'`` the point from which depth is counted.
    frame : (3, 3) float64
        Rotation; columns are the camera's x, y and z axes in world space.
    window : tuple of float
        ``(left, right, bottom, top)`` of the picture at depth 1 (``'PERSP'``) or at any depth in metres
        (``'ORTHO'``). Lens shift, sensor fit and pixel aspect are in it; it need not be symmetric.
    near, far : float
        Clipping depths, metres, ``0 < near < far``.
    width, height : int
        Size of the final picture in pixels.
    """

    kind: Literal["PERSP", "ORTHO"]
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    window: tuple[float, float, float, float]
    near: float
    far: float
    width: int
    height: int

    @property
    def pixel_size(self) -> float:
        """Side of a pixel at depth 1 (perspective) or at any depth (orthographic), metres."""
        left, right, bottom, top = self.window
        return float(np.sqrt((right - left) * (top - bottom) / (self.width * self.height)))

    def to_camera_space(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points ``(..., 3)`` to (x right, y up, depth) ``(..., 3)``, metres."""
        return ((points - self.position) @ self.frame) * np.array([1.0, 1.0, -1.0])

    def pixel_extent(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres that one pixel spans at each of the world points ``(..., 3)``; result ``(...)``.

        Points nearer than the near plane count as lying on it.
        """
        if self.kind == "ORTHO":
            return np.full(np.shape(points)[:-1], self.pixel_size)
        depth = self.to_camera_space(points)[..., 2]
        return self.pixel_size * np.maximum(depth, self.near)
