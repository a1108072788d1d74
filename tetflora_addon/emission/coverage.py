# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies behind what: coverage of the image, and how deep in the shade things are.

What is drawn is opaque, so that a depth for each pixel says the same as the alpha buffer of the paper (sections 6.3 and
7): a pixel is full from the depth of what covers its center on. Parts are hidden where the farthest depth in the
rectangle of pixels that they touch lies before them, as by Greene, Kass and Miller ("Hierarchical Z-buffer visibility",
SIGGRAPH 1993), but from maxima of overlapping squares.

What lies deep in the shade owes the image nothing but to keep light out. Depths add up as along a view (paper, 6.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Mask, chunks, in_axes, spread
from ..camera.camera import Camera, circle_of_confusion
from ..parallel import blocks
from ..refinement.lights import Light, frame_toward, sun_of

#: Pixels around the image that count as part of it: the filter of a renderer reaches there.
MARGIN = 2
#: Side of the cells of the image, pixels, each of which goes its own way from front to back.
CELL = 24
#: Pairs of a triangle and a pixel of its box that are tested together: some 100 bytes each.
PAIRS_BATCH = 1 << 16
#: Polygons that are projected and tested together: their numbers stay in the cache.
_POLYGONS = 1 << 14
#: Columns, rows and depths (k, n) of the corners of polygons.
Projected = tuple[NDArray, NDArray, NDArray]
#: How much nearer than what it hides something is, over the depth of that: as far as several eyes count.
_NEARER = 1.0


@dataclass(frozen=True)
class Footprints(Arrays):
    """What things (n) may touch of the image."""

    #: low and high, (n, 2): corners of a rectangle that holds each of them, pixels from the lower left of the buffer.
    low: Floats32
    high: Floats32
    near: Floats32  # (n,): least depth, meters


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
        self._maxima: Floats32 | None = None
        left, right, bottom, top = wide.window
        self._scale = np.array([wide.width / (right - left), wide.height / (top - bottom)])

    def project(self, points: NDArray[np.floating]) -> tuple[NDArray, NDArray, NDArray]:
        """Columns and rows (n,) in pixels, and depths (n,) in meters, of points (n, 3)."""
        return _projected(self.camera, points, self._scale)

    def cells(self, column: NDArray[np.floating], row: NDArray[np.floating]) -> Integers:
        """Cells (n,) of the image that columns and rows (n,) lie in, or come nearest to."""
        height, width = self.depth.shape
        across = np.clip(np.nan_to_num(column - self.first), 0, width - 1).astype(np.int64) // CELL
        up = np.clip(np.nan_to_num(row), 0, height - 1).astype(np.int64) // CELL
        return up * (width // CELL + 1) + across

    def of_spheres(self, center: Floats, radius: Floats) -> Footprints:
        """Footprints of spheres around points (n, 3), radii (n,) in meters.

        Those that reach behind the eye's plane may touch everything, unless they are out of view as a whole.
        """
        camera = self.camera
        column, row, depth = self.project(center)
        near = depth - radius
        left, _, bottom, _ = camera.window
        scale = self._scale
        if camera.kind == "ORTHO":
            reach = (radius, radius)
        elif camera.kind == "PANO":
            angle = np.arcsin(np.clip(radius / np.maximum(depth, 1e-9), 0.0, 1.0))
            local = camera.to_camera_space(center)
            cosine = np.hypot(local[:, 0], local[:, 2]) / np.maximum(depth, 1e-9)
            reach = (angle / np.maximum(cosine - np.sin(angle), 1e-3), angle)
        else:
            # The silhouette of a sphere beside the axis is an ellipse, longer by its slope.
            steep, away = (column / scale[0] + left, row / scale[1] + bottom), radius / np.maximum(near, 1e-9)
            reach = tuple(away * np.sqrt(1.0 + of * of) for of in steep)
        blur = self.blur(center, depth)
        # One side after the other in memory, as they are read (`hidden`).
        low, high = np.empty((2, 2, len(near)), np.float32).transpose(0, 2, 1)
        for side, (place, far) in enumerate(zip((column, row), reach, strict=True)):
            far = far * scale[side] + blur
            low[:, side], high[:, side] = place - far, place + far
        if camera.kind != "ORTHO":
            around = np.flatnonzero(near <= camera.near if camera.kind == "PERSP" else near <= 0.0)
            outside = around[camera.distance_to_view(center[around]) > radius[around]]
            low[around], high[around] = -np.inf, np.inf
            high[outside] = -np.inf
        if camera.kind == "PANO":
            round_ = high[:, 0] - low[:, 0] > self.width / 2.0
            low[round_], high[round_] = -np.inf, np.inf
        return Footprints(low, high, near.astype(np.float32))

    def of_lines(self, start: Floats, end: Floats, radius: Floats, within: Footprints) -> Footprints:
        """Footprints of what reaches so far (n,) from lines between points (n, 3), within others (n,); meters.

        Those of which an end reaches behind the eye's plane have the others.
        """
        a, b = (self.of_spheres(of, radius) for of in (start, end))
        ahead = (np.isfinite(a.low) & np.isfinite(b.low)).all(axis=1)
        low = np.where(ahead[:, None], np.maximum(np.minimum(a.low, b.low), within.low), within.low)
        high = np.where(ahead[:, None], np.minimum(np.maximum(a.high, b.high), within.high), within.high)
        return Footprints(low, high, np.where(ahead, np.maximum(np.minimum(a.near, b.near), within.near), within.near))

    def tested(self, corners: NDArray[np.floating], wider: float) -> tuple[Footprints, Mask, list[Projected]]:
        """Which polygons with corners (n, k, 3), meters, are hidden if they are so many pixels wider on each side.

        Returns these wider footprints (n), a mask (n,), and where the corners of all others are, block by block.
        """
        footprints, hidden, drawn = [self.of_corners(corners[:0])[0]], [np.zeros(0, bool)], []
        for block in blocks(len(corners), _POLYGONS):
            prints, *places = self.of_corners(corners[block])
            prints = replace(prints, low=prints.low - np.float32(wider), high=prints.high + np.float32(wider))
            behind = self.hidden(prints)
            footprints.append(prints)
            hidden.append(behind)
            seen = np.flatnonzero(~behind)
            drawn.append(tuple(place[:, seen] for place in places))
        return Footprints.concatenate(footprints), np.concatenate(hidden), drawn

    def of_corners(self, corners: NDArray[np.floating]) -> tuple[Footprints, NDArray, NDArray, NDArray]:
        """Footprints of polygons with corners (n, k, 3), and the columns, rows and depths (k, n) of these."""
        n, k = corners.shape[:2]
        # Corner by corner: numpy takes ten times as long to find the least of three numbers side by side.
        column, row, depth = (v.reshape(k, n) for v in self.project(corners.transpose(1, 0, 2).reshape(-1, 3)))
        near = depth.min(axis=0)
        blur = self.blur(corners[:, 0], near)
        low = np.stack([column.min(axis=0) - blur, row.min(axis=0) - blur]).T
        high = np.stack([column.max(axis=0) + blur, row.max(axis=0) + blur]).T
        if self.camera.kind == "PERSP":
            around = near <= self.camera.near
            low[around], high[around] = -np.inf, np.inf
            high[depth.max(axis=0) <= 0.0] = -np.inf
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
            shifted = _projected(moved, points, self._scale)
            spread_ = np.maximum(spread_, np.hypot(shifted[0] - here[0], shifted[1] - here[1]))
        return spread_

    def outside(self, prints: Footprints) -> Mask:
        """Things (n,) of which nothing is in the image."""
        (left, bottom), (right, top) = prints.low.T, prints.high.T
        return (right < 0) | (top < 0) | (left > self.width) | (bottom > self.height)

    def hidden(self, prints: Footprints) -> Mask:
        """Things (n,) behind full pixels wherever they are in the image; those outside are."""
        if self._maxima is None:
            self._maxima = _maxima(self.depth)
        # Numbers of one side after the other: numpy takes four times as long over pairs.
        (left, bottom), (right, top), near = prints.low.T, prints.high.T, prints.near
        # Pixels that this buffer does not know of, and those of what reaches around the eye, may all be empty.
        known = np.isfinite(near) & np.isfinite(right)
        known &= ((left >= self.first) | (self.first == 0)) & ((right <= self.end) | (self.end == self.width))
        height, wide = self.depth.shape
        x0, x1 = (np.clip(of - self.first, 0.0, wide - 1.0).astype(np.int32) for of in (left, right))
        y0, y1 = (np.clip(of, 0.0, height - 1.0).astype(np.int32) for of in (bottom, top))
        level = np.frexp((np.maximum(x1 - x0, y1 - y0) + 1).astype(np.float32))[1] - 1
        # Four overlapping squares cover a rectangle, and more where one side is much longer.
        less, base = (np.int32(1) << level) - 1, level.astype(np.int64) * height
        farthest = np.zeros(len(near), np.float32)
        for row in ((base + y0) * wide, (base + np.maximum(y1 - less, y0)) * wide):
            for column in (x0, np.maximum(x1 - less, x0)):
                np.maximum(farthest, np.take(self._maxima, row + column), out=farthest)
        return ((farthest < near) & known) | self.outside(prints)

    def draw(self, column: NDArray, row: NDArray, depth: NDArray) -> None:
        """Fill pixels whose centers triangles cover, given the columns, rows and depths (3, n) of their corners."""
        low_x, high_x = column.min(axis=0), column.max(axis=0)
        low_y, high_y = row.min(axis=0), row.max(axis=0)
        far = depth.max(axis=0)
        # What is nearer than that does not hide what is behind it from all eyes.
        ok = (depth.min(axis=0) > max(self.camera.min_occluding_depth, 0.0)) & np.isfinite(far)
        if self.camera.kind == "PANO":
            ok &= high_x - low_x < self.width / 2.0
        x0 = np.clip(np.ceil(low_x - 0.5), self.first, self.end).astype(np.int64)
        x1 = np.clip(np.floor(high_x - 0.5), -1, self.end - 1).astype(np.int64)
        y0 = np.clip(np.ceil(low_y - 0.5), 0, self.height).astype(np.int64)
        y1 = np.clip(np.floor(high_y - 0.5), -1, self.height - 1).astype(np.int64)
        wide, count = np.maximum(x1 - x0 + 1, 0), np.maximum(x1 - x0 + 1, 0) * np.maximum(y1 - y0 + 1, 0)
        triangles = np.flatnonzero(ok & (count > 0))
        if not len(triangles):
            return
        self._maxima = None
        flat = self.depth.reshape(-1)
        for run in chunks(count[triangles], PAIRS_BATCH):
            which = triangles[run]
            owner, index = spread(count[which])
            t = which[owner]
            dy, dx = np.divmod(index, wide[t])
            px, py = x0[t] + dx, y0[t] + dy
            inside, z = _covered(column, row, depth, t, px + 0.5, py + 0.5)
            # Of small triangles the farthest corner, of large ones the depth at the pixel.
            z = np.minimum(z, far[t])[inside].astype(np.float32)
            np.minimum.at(flat, (py * self.depth.shape[1] + px - self.first)[inside], z)


def _projected(camera: Camera, points: NDArray[np.floating], scale: Floats) -> tuple[NDArray, NDArray, NDArray]:
    """`Coverage.project` for a camera with so many pixels (2,) for each unit of its window."""
    left, _, bottom, _ = camera.window
    local = in_axes(points, camera.frame * [1.0, 1.0, -1.0], camera.position)
    across, up, depth = np.moveaxis(local, -1, 0)
    if camera.kind == "PANO":
        (across, up), depth = camera.longitude_latitude(local), np.linalg.norm(local, axis=-1)
    elif camera.kind == "PERSP":
        ahead = np.maximum(depth, 1e-6)
        across, up = across / ahead, up / ahead
    return (across - left) * float(scale[0]), (up - bottom) * float(scale[1]), depth


def _covered(column: NDArray, row: NDArray, depth: NDArray, t: NDArray, x: NDArray, y: NDArray) -> tuple[Mask, Floats]:
    """Whether triangles t (m,) cover points x, y (m,), and their depths (m,) there."""
    ax, bx, cx = (np.take(column[k], t) - x for k in range(3))
    ay, by, cy = (np.take(row[k], t) - y for k in range(3))
    u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    whole = u + v + w
    sign = np.where(whole < 0, -1.0, 1.0)
    inside = (u * sign >= 0) & (v * sign >= 0) & (w * sign >= 0) & (whole != 0)
    # 1 / depth is linear in the image.
    inverse = (u / depth[0, t] + v / depth[1, t] + w / depth[2, t]) * sign
    return inside, np.abs(whole) / np.maximum(inverse, 1e-30)


def _maxima(depth: Floats32) -> Floats32:
    """Largest depths of squares of 1, 2, 4, ... pixels whose lower left is each pixel; beyond the image nothing is."""
    out = np.empty((int(np.log2(max(depth.shape))) + 1, *depth.shape), np.float32)
    out[0] = depth
    for number, (last, wide) in enumerate(pairwise(out)):
        side = 1 << number
        new = last.copy()
        np.maximum(new[:-side], last[side:], out=new[:-side])
        wide[:] = new
        np.maximum(wide[:, :-side], new[:, side:], out=wide[:, :-side])
    return out


#: Cells of the grid across the light along each side, and layers along it, at most.
CELLS, LAYERS = 192, 64
#: Least side of a cell, meters: an even fog of leaves knows nothing of smaller gaps.
LEAST = 1.0
_DOWN = np.array([0.0, 0.0, -1.0])


class Shade:
    """Optical depth between a place and the strongest light.

    Parameters
    ----------
    position : (m, 3) float
        Places that stand for areas (m,), meters.
    area : (m,) float
        One-sided area of sheets, m².
    lights : sequence of Light
        Of several the brightest sun counts; without any, the sky above.
    """

    def __init__(self, position: NDArray[np.floating], area: NDArray[np.floating], lights: Sequence[Light]) -> None:
        sun = sun_of(lights)
        self._frame = frame_toward(_DOWN if sun is None else -sun)
        if not len(position):
            self._table = None
            return
        places = in_axes(np.asarray(position, np.float64), self._frame)
        low, high = places.min(axis=0), places.max(axis=0)
        step = np.maximum((high - low)[:2].max() / CELLS, LEAST)
        self._low, self._high, self._step = low, high, np.array([step, step, max((high - low)[2] / LAYERS, LEAST)])
        self._size = np.floor((high - low) / self._step).astype(np.int64) + 1
        table = np.bincount(self._index(places), np.asarray(area, np.float64), int(self._size.prod()))
        # Randomly turned sheets show half of their area. Light comes from where the third coordinate is largest.
        table = table.reshape(self._size) * (0.5 / step**2)
        self._table = (np.cumsum(table[:, :, ::-1], axis=2)[:, :, ::-1] - 0.5 * table).ravel()

    def _index(self, places: Floats) -> Integers:
        cell = np.clip(np.floor((places - self._low) / self._step), 0, self._size - 1).astype(np.int64)
        return (cell[:, 0] * self._size[1] + cell[:, 1]) * self._size[2] + cell[:, 2]

    def depth(self, points: Floats, nearer: Floats | float = 0.0) -> Floats:
        """Optical depth (n,) of all that is between the light and points (n, 3), moved so many meters toward it."""
        if self._table is None:
            return np.zeros(len(points))
        places = in_axes(points, self._frame)
        places[:, 2] += nearer
        return np.take(self._table, self._index(places))
