# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as the engine sees it: a window at unit depth or on the sphere, projection and its inverse."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

#: Cosine of the latitude from which on panoramas count as if no pixels were added towards the poles: 84 degrees.
LEAST_COSINE = 0.1
#: How far from several eyes things are at least to hide others from all of them, in radii of the eyes' room.
_OPEN = 2.0


@dataclass(frozen=True)
class Camera:
    """A perspective, orthographic or panoramic camera.

    Camera space is Blender's: +x right, +y up, looking along −z. *Depth* is the distance along the viewing direction.

    Attributes
    ----------
    kind : {'PERSP', 'ORTHO', 'PANO'}
        Perspective, parallel rays along the viewing direction, or an equirectangular panorama: columns are longitudes
        and rows are latitudes.
    position : (3,) float64
        The eye; for ``'ORTHO'`` the point from which depth is counted.
    frame : (3, 3) float64
        Rotation; columns are the camera's x, y and z axes in world space.
    window : tuple of float
        ``(left, right, bottom, top)`` of the picture at depth 1 (``'PERSP'``), at any depth in metres (``'ORTHO'``), or
        in radians (``'PANO'``): longitude from the viewing direction to the right, latitude from its plane upwards.
        Lens shift, sensor fit and pixel aspect are in it; it need not be symmetric.
    near, far : float
        Clipping depths, metres, ``0 < near < far``.
    width, height : int
        Size of the final picture in pixels.
    lens_radius : float
        Radius of the lens, metres; 0 where all is sharp.
    focus : float
        Depth that is sharp, metres.
    shutter : tuple of Camera
        The camera at other times while the shutter is open, and the other eyes of a stereoscopic picture; often empty.
    setback : float
        How far, in depth, the position lies behind the eye, metres: not 0 where the camera stands for several.
    room : float
        How far from that eye others are for which it stands, metres; see `view_cells`.
    """

    kind: Literal["PERSP", "ORTHO", "PANO"]
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    window: tuple[float, float, float, float]
    near: float
    far: float
    width: int
    height: int
    lens_radius: float = 0.0
    focus: float = np.inf
    shutter: tuple[Camera, ...] = ()
    setback: float = 0.0
    room: float = 0.0

    @property
    def eye(self) -> NDArray[np.float64]:
        """Where the picture is seen from (3,), metres: before the position where the camera stands for several."""
        left, right, bottom, top = self.window
        ahead = np.array([(left + right) / 2.0, (bottom + top) / 2.0, -1.0])
        return self.position + self.setback * (self.frame @ ahead)

    @property
    def line_of_sight(self) -> dict[str, NDArray[np.float64]]:
        """What `TetrahedralTree.order` needs to know of the camera: the eye or the direction of its rays."""
        return {"direction": -self.frame[:, 2]} if self.kind == "ORTHO" else {"eye": self.position}

    @property
    def pixel_size(self) -> float:
        """Side of a pixel at depth 1 (perspective), at any depth (orthographic) or 1 m away (panorama), metres."""
        left, right, bottom, top = self.window
        return float(np.sqrt((right - left) * (top - bottom) / (self.width * self.height)))

    def to_camera_space(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points ``(..., 3)`` to (x right, y up, depth) ``(..., 3)``, metres."""
        return ((points - self.position) @ self.frame) * np.array([1.0, 1.0, -1.0])

    def clearance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of world points (n, 3) from the space that the picture shows, metres; negative within it."""
        x, y, depth = self.to_camera_space(points).T
        left, right, bottom, top = self.window
        if self.kind == "PANO":
            return self._beside_panorama(np.stack([x, y, depth], axis=-1))
        if self.kind == "ORTHO":
            return np.max([x - right, left - x, y - top, bottom - y], axis=0)
        walls = [
            (x - right * depth, right),
            (left * depth - x, left),
            (y - top * depth, top),
            (bottom * depth - y, bottom),
        ]
        return np.max([distance / np.hypot(1.0, slope) for distance, slope in walls], axis=0)

    def widened(self, margin: float, margin_up: float | None = None) -> Camera:
        """The same camera with more around its picture.

        Parameters
        ----------
        margin : float
            Share of the picture's width that is added on the left and on the right.
        margin_up : float, optional
            Share of its height that is added below and above; as ``margin`` if it is not given.
        """
        left, right, bottom, top = self.window
        # Whole pixels, so that the pixels of the picture stay where they are.
        across = round(margin * self.width)
        up = round((margin if margin_up is None else margin_up) * self.height)
        step_x, step_y = (right - left) / self.width, (top - bottom) / self.height
        if self.kind == "PANO":
            # There is nothing beyond the poles, nor beyond the whole way round.
            across = min(across, int((2.0 * np.pi - (right - left)) / (2.0 * step_x) + 1e-9))
            up = min(up, max(int(min(np.pi / 2.0 - top, bottom + np.pi / 2.0) / step_y + 1e-9), 0))
        return replace(
            self,
            window=(left - across * step_x, right + across * step_x, bottom - up * step_y, top + up * step_y),
            width=self.width + 2 * across,
            height=self.height + 2 * up,
        )

    def longitude_latitude(self, local: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Place on a panorama of points ``(..., 3)`` in camera space, radians.

        The longitude is the one nearest to the middle of the window.
        """
        x, y, depth = np.moveaxis(local, -1, 0)
        middle = (self.window[0] + self.window[1]) / 2.0
        longitude = np.arctan2(x, depth) - middle
        longitude = middle + longitude - 2.0 * np.pi * np.round(longitude / (2.0 * np.pi))
        return longitude, np.arctan2(y, np.hypot(x, depth))

    def _beside_panorama(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        left, right, bottom, top = self.window
        longitude, latitude = self.longitude_latitude(local)
        far, across = np.linalg.norm(local, axis=-1), np.hypot(local[..., 0], local[..., 2])

        def beyond(angle: NDArray[np.float64], metres: NDArray[np.float64]) -> NDArray[np.float64]:
            return metres * np.sin(np.clip(angle, -np.pi / 2.0, np.pi / 2.0))

        # What goes all the way round or to a pole has no walls there.
        beside = np.full(far.shape, -np.inf)
        if right - left < 2.0 * np.pi - 1e-9:
            beside = np.maximum(beside, beyond(np.maximum(longitude - right, left - longitude), across))
        if top < np.pi / 2.0 - 1e-9:
            beside = np.maximum(beside, beyond(latitude - top, far))
        if bottom > -np.pi / 2.0 + 1e-9:
            beside = np.maximum(beside, beyond(bottom - latitude, far))
        return beside

    def pixel_extent(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres that one pixel spans at each of the world points ``(..., 3)``; result ``(...)``.

        Points nearer than the near plane count as lying on it.
        """
        if self.kind == "ORTHO":
            return np.full(np.shape(points)[:-1], self.pixel_size)
        if self.kind == "PANO":
            local = self.to_camera_space(points)
            distance = np.maximum(np.linalg.norm(local, axis=-1), self.near)
            # Towards the poles a picture has more pixels for each solid angle.
            cosine = np.hypot(local[..., 0], local[..., 2]) / distance
            return self.pixel_size * self._nearest(distance) * np.sqrt(np.clip(cosine, LEAST_COSINE, 1.0))
        depth = self.to_camera_space(points)[..., 2]
        return self.pixel_size * self._nearest(depth - self.setback)

    @property
    def closest(self) -> float:
        """Least distance from an eye at which things count, metres; see `_nearest`."""
        return max(self.room / 2.0, self.near if self.setback == 0.0 else 0.0)

    @property
    def hides_from(self) -> float:
        """Depth from which on things hide what is behind them, metres: nearer ones not from all eyes; 0 for one eye."""
        return self.setback + _OPEN * self.room

    def pixel_gain(self, points: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """Pixels ``(...)`` of what is at points ``(..., 3)`` for each that it has as seen from the position.

        1 but where the camera stands for several, of which the nearest counts.
        """
        if self.setback == 0.0:
            return 1.0
        depth = np.maximum(self.to_camera_space(points)[..., 2], self.near)
        return (self.pixel_size * depth / self.pixel_extent(points)) ** 2

    def _nearest(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances from the nearest of the eyes, given those from the one in the middle, metres.

        Within their room nobody knows: half of it is as near as it comes to what is not grazed.
        """
        return np.maximum(distance - self.room, self.closest)

    def extent_around(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres (n,) that one pixel spans at points (n, 3), in view or not.

        Beside and behind the camera depth says nothing, but distance does.
        """
        extent = self.pixel_extent(points)
        if self.kind == "PERSP":
            away = np.linalg.norm(points - self.eye, axis=-1)
            extent = np.maximum(extent, self.pixel_size * (away - self.room))
        return extent
