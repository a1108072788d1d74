# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage of the image by what is drawn: where pixels are full, what lies behind is hidden, and nothing else is.

The paper renders front to back and keeps an alpha buffer (sections 6.3 and 7). What is drawn here is opaque, so that a
depth for each pixel says the same: a pixel is full from the depth of what covers its center on. Parts are tested by
their bounds against the farthest depth in the rectangle of pixels that they touch, as by Greene, Kass and Miller
("Hierarchical Z-buffer visibility", SIGGRAPH 1993), but from maxima of overlapping squares; a part is hidden only where
all of that is full before it begins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, spread
from ..camera.camera import Camera, circle_of_confusion

#: Pixels around the image that count as part of it: the filter of a renderer reaches there.
MARGIN = 2
#: Side of the cells of the image, pixels, each of which goes its own way from front to back.
CELL = 24
#: Pairs of a triangle and a pixel of its box that are tested together: some 100 bytes each.
PAIRS_BATCH = 1 << 20
#: How much nearer than what it hides something is, over the depth of that: as far as several eyes count.
_NEARER = 1.0


@dataclass(frozen=True)
class Footprints(Arrays):
    """What things (n) may touch of the image.

    Attributes
    ----------
    low, high : (n, 2) float32
        Corners of a rectangle that holds each of them, pixels from the lower left of the buffer.
    near : (n,) float32
        Least depth, meters.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    near: NDArray[np.float32]


class Coverage:
    """Depth from which on each pixel of an image is full.

    Parameters
    ----------
    camera : Camera
        Its image, and so many pixels around it.
    tile : int, int, optional
        First column and end of what this buffer knows; by default all of the image. Nothing hides beyond.

    Attributes
    ----------
    depth : (height, columns) float32
        Depth of what covers the center of each pixel, meters; infinite where nothing does.
    """

    def __init__(self, camera: Camera, tile: tuple[int, int] | None = None) -> None:
        wide = camera.widened(MARGIN / camera.width, MARGIN / camera.height)
        self.camera, self.width, self.height = wide, wide.width, wide.height
        first, end = (0, wide.width) if tile is None else tile
        self.first, self.end = max(first, 0), min(end, wide.width)
        self.depth = np.full((wide.height, self.end - self.first), np.inf, np.float32)
        self._maxima: list[NDArray[np.float32]] = []
        left, right, bottom, top = wide.window
        self._scale = np.array([wide.width / (right - left), wide.height / (top - bottom)])

    def project(self, points: NDArray[np.floating]) -> tuple[NDArray, NDArray, NDArray]:
        """Columns and rows (n,) in pixels, and depths (n,) in meters, of points (n, 3)."""
        return _projected(self.camera, points, self._scale)

    def cells(self, column: NDArray[np.floating], row: NDArray[np.floating]) -> NDArray[np.int64]:
        """Cells (n,) of the image that columns and rows (n,) lie in, or come nearest to."""
        height, width = self.depth.shape
        across = np.clip(np.nan_to_num(column - self.first), 0, width - 1).astype(np.int64) // CELL
        up = np.clip(np.nan_to_num(row), 0, height - 1).astype(np.int64) // CELL
        return up * (width // CELL + 1) + across

    def of_spheres(self, center: NDArray[np.float64], radius: NDArray[np.float64]) -> Footprints:
        """Footprints of spheres around points (n, 3), radii (n,) in meters.

        Those that reach behind the eye's plane may touch everything, unless they are out of view as a whole.
        """
        camera = self.camera
        column, row, depth = self.project(center)
        near = depth - radius
        left, _, bottom, _ = camera.window
        scale = self._scale
        if camera.kind == "ORTHO":
            reach = radius[:, None] * scale
        elif camera.kind == "PANO":
            angle = np.arcsin(np.clip(radius / np.maximum(depth, 1e-9), 0.0, 1.0))
            local = camera.to_camera_space(center)
            cosine = np.hypot(local[:, 0], local[:, 2]) / np.maximum(depth, 1e-9)
            reach = np.stack([angle / np.maximum(cosine - np.sin(angle), 1e-3), angle], axis=1) * scale
        else:
            # The silhouette of a sphere beside the axis is an ellipse, longer by its slope.
            slope = np.stack([column / scale[0] + left, row / scale[1] + bottom], axis=1)
            reach = (radius / np.maximum(near, 1e-9))[:, None] * np.sqrt(1.0 + slope**2) * scale
        place, reach = np.stack([column, row], axis=1), reach + self.blur(center, depth)[:, None]
        low, high = place - reach, place + reach
        if camera.kind != "ORTHO":
            around = near <= camera.near if camera.kind == "PERSP" else near <= 0.0
            outside = around & (camera.distance_to_view(center) > radius)
            low[around], high[around] = -np.inf, np.inf
            high[outside] = -np.inf
        if camera.kind == "PANO":
            round_ = high[:, 0] - low[:, 0] > self.width / 2.0
            low[round_], high[round_] = -np.inf, np.inf
        return Footprints(low.astype(np.float32), high.astype(np.float32), near.astype(np.float32))

    def of_corners(self, corners: NDArray[np.floating]) -> tuple[Footprints, NDArray, NDArray, NDArray]:
        """Footprints of polygons with corners (n, k, 3), and the columns, rows and depths (n, k) of these."""
        n, k = corners.shape[:2]
        column, row, depth = (v.reshape(n, k) for v in self.project(corners.reshape(-1, 3)))
        near = depth.min(axis=1)
        blur = self.blur(corners[:, 0], near)
        low = np.stack([column.min(axis=1) - blur, row.min(axis=1) - blur], axis=1)
        high = np.stack([column.max(axis=1) + blur, row.max(axis=1) + blur], axis=1)
        if self.camera.kind == "PERSP":
            around = near <= self.camera.near
            low[around], high[around] = -np.inf, np.inf
            high[depth.max(axis=1) <= 0.0] = -np.inf
        elif self.camera.kind == "PANO":
            round_ = high[:, 0] - low[:, 0] > self.width / 2.0
            low[round_], high[round_] = -np.inf, np.inf
        return Footprints(low, high, near), column, row, depth

    def blur(self, points: NDArray[np.floating], depth: NDArray[np.floating]) -> NDArray[np.floating]:
        """Pixels (n,) by which points (n, 3) at depths (n,) are spread, and shifted between the eyes of a view.

        One buffer stands for all moments of the shutter and all eyes: what is tested reaches so much farther.
        """
        camera, spread_ = self.camera, np.zeros(len(depth))
        if camera.lens_radius > 0.0:
            spread_ = spread_ + circle_of_confusion(camera, depth) * self._scale.max()
        if camera.cell_radius > 0.0:
            # What hides is a part of the way nearer, and moves against what it hides as the eye does.
            spread_ = spread_ + _NEARER * camera.cell_radius / np.maximum(depth, 1e-6) * self._scale.max()
        here = None
        for other in camera.shutter:
            here = self.project(points)[:2] if here is None else here
            moved = replace(camera, position=other.position, frame=other.frame, shutter=())
            there = _projected(moved, points, self._scale)
            spread_ = np.maximum(spread_, np.hypot(there[0] - here[0], there[1] - here[1]))
        return spread_

    def outside(self, prints: Footprints) -> NDArray[np.bool_]:
        """Things (n,) of which nothing is in the image."""
        return (
            (prints.high[:, 0] < 0)
            | (prints.high[:, 1] < 0)
            | (prints.low[:, 0] > self.width)
            | (prints.low[:, 1] > self.height)
        )

    def hidden(self, prints: Footprints) -> NDArray[np.bool_]:
        """Things (n,) behind full pixels wherever they are in the image; those outside are."""
        if not self._maxima:
            self._maxima = _maxima(self.depth)
        size, first = np.array([self.end - self.first, self.height]), np.array([self.first, 0])
        # Pixels that this buffer does not know of, and those of what reaches around the eye, may all be empty.
        known = np.isfinite(prints.near) & ~((prints.low[:, 0] < self.first) & (self.first > 0))
        known &= ~((prints.high[:, 0] > self.end) & (self.end < self.width)) & np.isfinite(prints.high[:, 0])
        low, high = (
            np.clip(np.floor(np.clip(of, -1.0, 1e9)) - first, 0, size - 1).astype(np.int64)
            for of in (prints.low, prints.high)
        )
        level = np.log2((high - low).max(axis=1) + 1).astype(np.int64)
        out = np.zeros(len(low), bool)
        for number in np.unique(level):
            some, table = np.flatnonzero(level == number), self._maxima[number].ravel()
            # Four overlapping squares cover a rectangle, and more where one side is much longer.
            low_, last = low[some], np.maximum(high[some] - (1 << number) + 1, low[some])
            farthest = np.zeros(len(some), np.float32)
            for row in (low_[:, 1], last[:, 1]):
                for column in (low_[:, 0], last[:, 0]):
                    np.maximum(farthest, np.take(table, row * size[0] + column), out=farthest)
            out[some] = farthest < prints.near[some]
        return (out & known) | self.outside(prints)

    def draw(self, column: NDArray, row: NDArray, depth: NDArray) -> None:
        """Fill pixels whose centers triangles cover, given the columns, rows and depths (n, 3) of their corners."""
        low_x, high_x = column.min(axis=1), column.max(axis=1)
        low_y, high_y = row.min(axis=1), row.max(axis=1)
        far = depth.max(axis=1)
        # What is nearer than that does not hide what is behind it from all eyes.
        ok = (depth.min(axis=1) > max(self.camera.min_occluding_depth, 0.0)) & np.isfinite(far)
        if self.camera.kind == "PANO":
            ok &= high_x - low_x < self.width / 2.0
        x0 = np.clip(np.ceil(low_x - 0.5), self.first, self.end).astype(np.int64)
        x1 = np.clip(np.floor(high_x - 0.5), -1, self.end - 1).astype(np.int64)
        y0 = np.clip(np.ceil(low_y - 0.5), 0, self.height).astype(np.int64)
        y1 = np.clip(np.floor(high_y - 0.5), -1, self.height - 1).astype(np.int64)
        wide, count = np.maximum(x1 - x0 + 1, 0), np.maximum(x1 - x0 + 1, 0) * np.maximum(y1 - y0 + 1, 0)
        some = np.flatnonzero(ok & (count > 0))
        if not len(some):
            return
        self._maxima = []
        flat = self.depth.reshape(-1)
        ends = np.cumsum(count[some])
        start = 0
        while start < len(some):
            before = ends[start - 1] if start else 0
            stop = max(start + 1, int(np.searchsorted(ends, before + PAIRS_BATCH, side="right")))
            which = some[start:stop]
            owner, index = spread(count[which])
            t = which[owner]
            dy, dx = np.divmod(index, wide[t])
            px, py = x0[t] + dx, y0[t] + dy
            inside, z = _covered(column, row, depth, t, px + 0.5, py + 0.5)
            # Of small triangles the farthest corner, of large ones the depth at the pixel.
            z = np.minimum(z, far[t])[inside].astype(np.float32)
            np.minimum.at(flat, (py * self.depth.shape[1] + px - self.first)[inside], z)
            start = stop


def _projected(
    camera: Camera, points: NDArray[np.floating], scale: NDArray[np.float64]
) -> tuple[NDArray, NDArray, NDArray]:
    """`Coverage.project` for a camera with so many pixels (2,) for each unit of its window."""
    left, _, bottom, _ = camera.window
    # By component, in the precision of the points: a product with a matrix of three rows takes many times as long.
    away = [points[:, i] - points.dtype.type(camera.position[i]) for i in range(3)]
    frame = camera.frame.astype(points.dtype)
    across, up, depth = (sum(away[i] * frame[i, k] for i in range(3)) for k in range(3))
    depth = -depth
    if camera.kind == "PANO":
        local = np.stack([across, up, depth], axis=-1)
        (across, up), depth = camera.longitude_latitude(local), np.linalg.norm(local, axis=-1)
    elif camera.kind == "PERSP":
        ahead = np.maximum(depth, 1e-6)
        across, up = across / ahead, up / ahead
    return (across - left) * scale[0], (up - bottom) * scale[1], depth


def _covered(
    column: NDArray, row: NDArray, depth: NDArray, t: NDArray, x: NDArray, y: NDArray
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Whether triangles t (m,) cover points x, y (m,), and their depths (m,) there."""
    ax, bx, cx = (column[t, k] - x for k in range(3))
    ay, by, cy = (row[t, k] - y for k in range(3))
    u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    whole = u + v + w
    sign = np.where(whole < 0, -1.0, 1.0)
    inside = (u * sign >= 0) & (v * sign >= 0) & (w * sign >= 0) & (whole != 0)
    # 1 / depth is linear in the image.
    inverse = (u / depth[t, 0] + v / depth[t, 1] + w / depth[t, 2]) * sign
    return inside, np.abs(whole) / np.maximum(inverse, 1e-30)


def _maxima(depth: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Largest depths of squares of 1, 2, 4, ... pixels whose lower left is each pixel; beyond the image nothing is."""
    levels, side = [depth], 1
    while 2 * side <= max(depth.shape):
        last = levels[-1]
        new = last.copy()
        np.maximum(new[:-side], last[side:], out=new[:-side])
        wide = new.copy()
        np.maximum(wide[:, :-side], new[:, side:], out=wide[:, :-side])
        levels.append(wide)
        side *= 2
    return levels
