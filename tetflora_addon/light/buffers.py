# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light sees of the tetrahedra (paper, section 7): volume shadow, with polygons as an opaque part of it.

The paper renders the scene from each light front to back, collects volume shadow in a gray buffer and polygon shadow
in a z-buffer, and takes samples on the way. Here all fragments are sorted by pixel and distance once. Optical depth in
front of any point is a cumulative sum; the light that tetrahedra scatter to it follows from the same order. Samples
are blended between the four nearest pixels.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_TURN, Floats, Integers, Mask, chunks, spread
from ..camera.camera import Camera
from ..parallel import blocks
from ..refinement.rasterize import buffer_size, image_places, occluder_depth, tetrahedron_fragments
from ..refinement.visibility import OPAQUE, depth_in_front

#: Distance behind polygons at which their shadows begin, in pixels of the buffer: none shadows what lies on it.
BIAS = 1.5
#: Points that are looked up together; some 500 bytes each.
POINT_BATCH = 1 << 18
#: Maximum number of parts of a sheet, and maximum fraction of a pixel that a sheet covers.
_MOST_PARTS, _MOST_COVERED = 1 << 12, 0.98
#: Golden section, by which parts of a sheet step along its second side.
_GOLDEN = GOLDEN_TURN / (2.0 * np.pi)


@dataclass(frozen=True)
class _Taps:
    """The four pixels around each point (m, 4), their weights, and how far away the point is (m,)."""

    pixel: Integers
    weight: Floats
    meters: Floats


class LightBuffer:
    """Tetrahedra and polygons in the order in which light meets them.

    Parameters
    ----------
    camera : Camera
        Flat view from the light.
    resolution : int
        Longer side of the buffer, pixels.
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra that do not overlap, meters.
    extinction : (n,) float64
        κ ≥ 0 along the light, 1/m.
    occluders : (t, 3, 3) float64, optional
        Opaque triangles, meters.
    sheets : (m, 4, 3) float64, optional
        Corners of opaque facets or leaves, which count by what they cover of each pixel, numbered from n.
    """

    def __init__(
        self,
        camera: Camera,
        resolution: int,
        vertices: Floats,
        extinction: Floats,
        occluders: Floats | None = None,
        sheets: Floats | None = None,
    ) -> None:
        self.camera = camera
        self.width, self.height = buffer_size(camera, resolution)
        # What casts no shadow need not be drawn.
        casting = np.flatnonzero(extinction > 0.0).astype(np.int32)
        fragments = tetrahedron_fragments(vertices[casting], camera, self.width, self.height)
        owner = casting[fragments.cell]
        with np.errstate(invalid="ignore"):
            depth = np.nan_to_num(np.minimum(extinction[owner] * fragments.thickness, OPAQUE))
        depth = depth * np.minimum(fragments.coverage, 1.0)
        parts = [(owner, fragments.pixel, fragments.entry, fragments.thickness, depth)]
        if occluders is not None and len(occluders):
            end = occluder_depth(occluders, camera, self.width, self.height)
            hit = np.flatnonzero(np.isfinite(end))
            across = camera.pixel_size * camera.width / self.width
            shifted = end[hit] + BIAS * across * (1.0 if camera.kind == "ORTHO" else end[hit])
            parts.append((np.full(len(hit), -1, np.int32), hit, shifted, np.zeros(len(hit)), np.full(len(hit), OPAQUE)))
        if sheets is not None and len(sheets):
            parts += [(owner + np.int32(len(vertices)), *rest) for owner, *rest in self._sheet_fragments(sheets)]
        cell, pixel, entry, thickness, depth = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        # One number to sort and look up by: the pixel, with the distance as its fraction.
        self._reach = float(entry.max(initial=0.0)) * 1.001 + 1e-9
        key = self._key(pixel, entry)
        order = np.argsort(key, kind="stable")  # other sorts order equal keys by processor
        self._order_key, self._cell = key[order], cell[order]
        self._pixel = pixel[order].astype(np.int32)
        # Sums need doubles; what is looked up does not.
        entry, thickness, depth = entry[order], thickness[order], depth[order]
        self._entry, self._thickness, self._depth = (a.astype(np.float32) for a in (entry, thickness, depth))
        first, before = depth_in_front(self._pixel, depth)
        self._first, self._before = first.astype(np.int32), before.astype(np.float32)
        own_key = self._cell * np.int64(self.width * self.height) + self._pixel
        self._by_cell = np.argsort(own_key).astype(np.int32)
        self._own_key = own_key[self._by_cell]

    def _sheet_fragments(self, sheets: Floats) -> Iterator[tuple[NDArray, ...]]:
        """Owner, pixel, entry, thickness 0 and optical depth −ln (1 − c) of sheets that cover c of a pixel, in runs."""
        across = self.camera.pixel_size * self.camera.width / self.width
        # The view may show part of the scene; where a sheet is not ahead, it would have parts without end.
        center = sheets.mean(axis=1, dtype=np.float64)
        reach = np.linalg.norm(sheets - center[:, None], axis=2).max(axis=1)
        numbers = np.flatnonzero(self.camera.distance_to_view(center) <= reach)
        sheets, center = sheets[numbers], center[numbers]
        vector = np.cross(sheets[:, 2] - sheets[:, 0], sheets[:, 3] - sheets[:, 1]) / 2.0
        if self.camera.kind == "ORTHO":
            seen, pixel_area = np.abs(vector @ self.camera.frame[:, 2]), np.full(len(sheets), across**2)
        else:
            away = center - self.camera.position
            distance = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
            seen = np.abs(np.sum(vector * away, axis=1)) / distance
            # Beside the middle of a flat view a pixel sees less of the sphere.
            pixel_area = (across * distance) ** 2 * np.abs(away @ self.camera.frame[:, 2] / distance) ** 3
        # Below the size of a pixel a sheet is where its middle is; above, its parts leave no pixel between them out: as
        # many as its area and length ask for, since blades of grass are long, and narrower than a pixel.
        pixel_area = np.maximum(pixel_area, 1e-18)
        covered = seen / pixel_area
        longest = np.linalg.norm(sheets - np.roll(sheets, 1, axis=1), axis=2).max(axis=1) / np.sqrt(pixel_area)
        number = np.where(longest > 1.0, np.fmin(np.ceil(4.0 * (covered + longest)), _MOST_PARTS), 1).astype(int)
        covered /= number
        corners = np.ascontiguousarray(sheets.transpose(1, 2, 0))
        for run in chunks(number, POINT_BATCH - _MOST_PARTS):
            owner, part = spread(number[run])
            owner += run.start
            # Even along sides as along diagonals: blades are long in either way.
            u, v = (part + 0.5) / number[owner], ((part - (number[owner] - 1) / 2.0) * _GOLDEN + 0.5) % 1.0
            weights = (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v
            points = sum(c.take(owner, axis=1) * weight for c, weight in zip(corners, weights, strict=True)).T
            owner, pixel, meters, fraction = self._by_pixel(points, owner, covered)
            depth = -np.log1p(-np.minimum(fraction, _MOST_COVERED))
            yield numbers[owner].astype(np.int32), pixel.astype(np.int32), meters, np.zeros(len(owner)), depth

    def _by_pixel(self, points: Floats, owner: Integers, covered: Floats) -> tuple[Integers, Integers, Floats, Floats]:
        """Parts of sheets by sheet and nearest pixel: both (f,), mean distance (f,), and the fraction that they cover.

        Parts are at ``points`` (m, 3), of sheets ``owner`` (m,); each of sheet i covers ``covered[i]`` of a pixel.
        """
        place, meters, inside = self._places(points)
        owner = owner[inside]
        column, row = np.clip(np.ceil(place).astype(np.int64) - 1, 0, [self.width - 1, self.height - 1]).T
        nearest = row * self.width + column
        both = owner * (self.width * self.height) + nearest
        key, first, inverse = np.unique(both, return_index=True, return_inverse=True)
        fraction = np.bincount(inverse.ravel(), covered[owner], len(key))
        meters = np.bincount(inverse.ravel(), meters, len(key)) / np.maximum(np.bincount(inverse.ravel()), 1)
        return owner[first], nearest[first], meters, fraction

    def __len__(self) -> int:
        return len(self._pixel)

    def transmittance(self, points: Floats, cells: Integers, own_depth: Floats) -> tuple[Floats, Mask]:
        """Fraction of the light that reaches points.

        Parameters
        ----------
        points : (m, 3) float64
            Meters, world space.
        cells : (m,) int
            Tetrahedron that holds each or sheet on which it lies, −1 where there is none.
        own_depth : (m,) float64
            Optical depth of that tetrahedron between where light enters it and the point. However coarse the pixels,
            no tetrahedron darkens itself by more, and no point is darkened by less.

        Returns
        -------
        transmittance : (m,) float64
            0 to 1; 1 where the point is out of view.
        seen : (m,) bool
            Whether the point is in view.
        """
        result, seen = np.ones(len(points)), np.zeros(len(points), bool)
        for part in blocks(len(points), POINT_BATCH):
            taps, inside = self._taps(points[part])
            depth = exact = own_depth[part][inside][:, None]
            if len(self):
                place, behind = self._last_before(taps)
                depth = np.where(behind, self._up_to(place, taps), 0.0)
                fragment, has = self._own_fragments(taps, cells[part][inside])
                # Small ones may overlap; what begins before the last fragment was counted in full.
                counted = np.where(fragment < place, self._depth[fragment], self._partly(fragment, taps))
                drawn = np.where(has & (fragment <= place), counted, 0.0)
                # Where the point's own tetrahedron does not reach into a pixel, its neighbors do, or nothing is there.
                depth = np.maximum(np.maximum(depth - drawn, 0.0) + np.minimum(drawn, exact), exact)
            rows = np.flatnonzero(inside) + part.start
            result[rows] = (np.exp(-depth) * taps.weight).sum(axis=1)
            seen[rows] = True
        return result, seen

    def light_up(self, sources: Floats, polygons: Floats) -> None:
        """Let tetrahedra and sheets (n + m, 3) and polygons (3,) shine, for `scattered`.

        Sources are radiances J that thick tetrahedra and sheets would have; they emit J (1 − e^−τ).
        """
        if len(self):
            emitted = np.where((self._cell >= 0)[:, None], sources[np.maximum(self._cell, 0)], polygons)
            self._emitted = emitted.astype(np.float32)
            self._arriving = self._gathered(emitted).astype(np.float32)

    def scattered(self, points: Floats) -> Floats:
        """Radiance (m, 3) that arrives at points (m, 3) along the buffer's rays from what shines in front of them."""
        result = np.zeros((len(points), 3))
        if not len(self):
            return result
        emitted, arriving = self._emitted, self._arriving
        for part in blocks(len(points), POINT_BATCH):
            taps, inside = self._taps(points[part])
            place, behind = self._last_before(taps)
            through = np.exp(-(self._up_to(place, taps) - self._before[place]))[..., None]
            light = arriving[place] * through + emitted[place] * (1.0 - through)
            light = np.where(behind[..., None], light, 0.0) * taps.weight[..., None]
            result[np.flatnonzero(inside) + part.start] = light.sum(axis=1)
        return result

    def _gathered(self, emitted: Floats) -> Floats:
        """Radiance (f, 3) in front of each fragment, by a prefix scan over (transmittance, radiance) of its pixel.

        Two stretches in a row are one: T = T₁ T₂, L = L₁ T₂ + L₂. Doubling their length covers all in few rounds
        (Hillis and Steele, "Data Parallel Algorithms", 1986).
        """
        through = np.exp(-self._depth.astype(np.float64))
        light = (emitted * (1.0 - through)[:, None]).T.copy()
        rank = np.arange(len(self)) - self._first
        through[rank == 0] = 0.0  # from pixel to pixel
        step = 1
        while step <= rank.max():
            light[:, step:] += light[:, :-step] * through[step:]
            through[step:] *= through[:-step]
            step *= 2
        before = np.zeros((len(self), 3))
        before[1:] = light[:, :-1].T
        before[rank == 0] = 0.0
        return before

    def _key(self, pixel: NDArray, meters: Floats) -> Floats:
        return pixel + np.clip(meters / self._reach, 0.0, 1.0) * 0.999999

    def _places(self, points: Floats) -> tuple[Floats, Floats, Mask]:
        """Places (k, 2) in pixels of those points that are in view; how far away they are (k,); which (m,)."""
        size = np.array([self.width, self.height])
        place, depth, meters = image_places(self.camera, points, size)
        inside = (depth >= self.camera.near) & (place >= -1e-9).all(axis=1) & (place <= size + 1e-9).all(axis=1)
        return place[inside], meters[inside], inside

    def _taps(self, points: Floats) -> tuple[_Taps, Mask]:
        """Pixels around those points (k,) that are in view, and which these are (m,)."""
        place, meters, inside = self._places(points)
        place = place - 0.5
        low = np.floor(place)
        fraction = place - low
        aside, up = np.array([[0, 1, 0, 1], [0, 0, 1, 1]])
        column = np.clip(low[:, :1] + aside, 0, self.width - 1).astype(np.int64)
        row = np.clip(low[:, 1:] + up, 0, self.height - 1).astype(np.int64)
        weight = np.abs(1 - aside - fraction[:, :1]) * np.abs(1 - up - fraction[:, 1:])
        return _Taps(row * self.width + column, weight, meters), inside

    def _last_before(self, taps: _Taps) -> tuple[Integers, Mask]:
        """The last fragment (k, 4) that begins in front of each point in each pixel, and whether there is one."""
        key = self._key(taps.pixel, taps.meters[:, None])
        place = np.searchsorted(self._order_key, key.ravel(), side="right").reshape(key.shape) - 1
        behind = place >= 0
        place = np.maximum(place, 0)
        return place, behind & (self._pixel[place] == taps.pixel)

    def _own_fragments(self, taps: _Taps, cells: Integers) -> tuple[Integers, Mask]:
        """Fragment (k, 4) of each point's own tetrahedron in each pixel, and whether there is one."""
        key = cells.astype(np.int64)[:, None] * (self.width * self.height) + taps.pixel
        place = np.searchsorted(self._own_key, key.ravel()).reshape(key.shape)
        place = np.minimum(place, len(self) - 1)
        return self._by_cell[place], (self._own_key[place] == key) & (cells >= 0)[:, None]

    def _partly(self, place: Integers, taps: _Taps) -> Floats:
        """Optical depth of fragments as far as it lies in front of the points."""
        inside = (taps.meters[:, None] - self._entry[place]) / np.maximum(self._thickness[place], 1e-9)
        return self._depth[place] * np.clip(inside, 0.0, 1.0)

    def _up_to(self, place: Integers, taps: _Taps) -> Floats:
        """Optical depth in front of the points, through the last fragment that begins there."""
        return self._before[place] + self._partly(place, taps)
