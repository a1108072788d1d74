# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as the engine sees it: a window at unit depth, projection and its inverse."""

from __future__ import annotations

from dataclasses import dataclass, replace
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

    def clearance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of world points (n, 3) from the space that the picture shows, metres; negative within it."""
        x, y, depth = self.to_camera_space(points).T
        left, right, bottom, top = self.window
        if self.kind == "ORTHO":
            return np.max([x - right, left - x, y - top, bottom - y], axis=0)
        walls = [
            (x - right * depth, right),
            (left * depth - x, left),
            (y - top * depth, top),
            (bottom * depth - y, bottom),
        ]
        return np.max([distance / np.hypot(1.0, slope) for distance, slope in walls], axis=0)

    def widened(self, margin: float) -> Camera:
        """The same camera with more around its picture: ``margin`` of its width and height on each side."""
        left, right, bottom, top = self.window
        # Whole pixels, so that the pixels of the picture stay where they are.
        across, up = round(margin * self.width), round(margin * self.height)
        dx, dy = across * (right - left) / self.width, up * (top - bottom) / self.height
        return replace(
            self,
            window=(left - dx, right + dx, bottom - dy, top + dy),
            width=self.width + 2 * across,
            height=self.height + 2 * up,
        )

    def pixel_extent(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres that one pixel spans at each of the world points ``(..., 3)``; result ``(...)``.

        Points nearer than the near plane count as lying on it.
        """
        if self.kind == "ORTHO":
            return np.full(np.shape(points)[:-1], self.pixel_size)
        depth = self.to_camera_space(points)[..., 2]
        return self.pixel_size * np.maximum(depth, self.near)

    def extent_around(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres (n,) that one pixel spans at points (n, 3), in view or not.

        Beside and behind the camera depth says nothing, but distance does.
        """
        extent = self.pixel_extent(points)
        if self.kind == "PERSP":
            extent = np.maximum(extent, self.pixel_size * np.linalg.norm(points - self.position, axis=-1))
        return extent
