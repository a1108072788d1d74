# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tetrahedra and triangles to a small image of the camera's window (paper, section 6.3), many at once.

Pixels are counted row by row from the lower left corner, ``pixel = row · width + column``. A ray starts at the eye
(``'PERSP'``) or on the plane of depth 0 (``'ORTHO'``) and goes through a pixel's center; positions on it are meters
along it. Nothing nearer than the near plane or beyond the far plane is seen.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Arrays, Floats, Integers, Integers32, chunks, column, spread
from ..camera.camera import Camera, silhouette_area, window_bounds
from ..parallel import blocks
from ..tetrahedra.geometry import face_area_vectors, projected_area, volume

#: Pairs of a primitive and a pixel of its bounding box that are tested together; some 100 bytes each.
PAIR_BATCH = 1 << 14
#: Primitives whose bounding boxes are computed together.
PRIMITIVE_BATCH = 1 << 17
#: Tetrahedra that are drawn at a time.
TETRAHEDRON_BATCH = 1 << 11
#: Shift of the sample from the pixel's center, in pixels. The view pyramid's own planes run exactly through centers of
#: pixels; shifted by next to nothing, each ray is on one side of every such plane.
SHIFT = (1.7e-6, 2.9e-6)
#: Up to this many pixels of silhouette, a tetrahedron counts by its area and mean thickness instead of by samples:
#: then the optical depth that it brings into the image is exact, however the pixels' centers fall.
SMALL = 4.0
#: What planes through the eye, or parallel to all rays, are off it by: far less than any that are not.
_PARALLEL = 1e-150


@dataclass(frozen=True)
class Fragments(Arrays):
    """Tetrahedra as seen from pixels, in no particular order."""

    cell: Integers32 = column(dtype=np.int32)  # (f,): which tetrahedron
    pixel: Integers32 = column(dtype=np.int32)  # (f,): which pixel
    entry: Floats  # (f,): where the ray enters, meters along the ray
    thickness: Floats  # (f,): meters of the ray inside
    #: (f,): pixels that the fragment stands for: 1, or for small tetrahedra their area divided among their fragments.
    coverage: Floats


def buffer_size(camera: Camera, resolution: int) -> tuple[int, int]:
    """Width and height in pixels of a small image whose longer side is ``resolution``, shaped as the final image."""
    scale = resolution / max(camera.width, camera.height)
    return max(1, round(camera.width * scale)), max(1, round(camera.height * scale))


def pixel_rays(camera: Camera, width: int, height: int) -> tuple[Floats, Floats]:
    """Origins and unit directions (height · width, 3) of the rays through the pixels' centers, world space."""
    x, y = _centers(camera, width, height)
    grid = np.stack([np.tile(x, height), np.repeat(y, width), np.zeros(width * height)], axis=1)
    frame = camera.frame * np.array([1.0, 1.0, -1.0])
    if camera.kind == "ORTHO":
        return camera.position + grid @ frame.T, np.tile(-camera.frame[:, 2], (width * height, 1))
    toward = (grid + np.array([0.0, 0.0, 1.0])) @ frame.T
    return np.tile(camera.position, (width * height, 1)), toward / np.linalg.norm(toward, axis=1, keepdims=True)


def tetrahedron_fragments(vertices: Floats, camera: Camera, width: int, height: int) -> Fragments:
    """What the rays through the pixels' centers meet of each tetrahedron.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, meters, world space. They may hold the eye or cross its plane.
    width, height : int
        Size of the small image, pixels.

    Returns
    -------
    Fragments
        One for each pixel whose ray goes through a tetrahedron. One that lies in view between the pixels' centers has
        a single fragment, in the pixel of its projected centroid. One out of view has none.

    Notes
    -----
    A tetrahedron of few pixels (`SMALL`) has its silhouette's area as coverage, divided among its fragments, and its
    mean chord V / A as thickness: Σ coverage · thickness over all pixels is its volume, per area of a pixel.
    """
    # One after another: threads, and other processes, took as long for the many small steps of this.
    batches = blocks(len(vertices), TETRAHEDRON_BATCH)
    parts = [(block.start, _fragments(vertices[block], camera, width, height)) for block in batches]
    return Fragments.concatenate([replace(part, cell=part.cell + np.int32(start)) for start, part in parts])


def occluder_depth(triangles: Floats, camera: Camera, width: int, height: int) -> Floats:
    """Where each pixel's ray first meets an opaque triangle (height · width,), meters along it; infinite for none.

    Two-sided triangles (t, 3, 3), meters, world space, may cross the eye's plane; flat or infinite ones do not count.
    """
    nearest = np.full(width * height, np.inf)
    for start in range(0, len(triangles), PRIMITIVE_BATCH):
        part = np.asarray(triangles[start : start + PRIMITIVE_BATCH], np.float64)
        _draw_triangles(part[np.isfinite(part).all(axis=(1, 2))], camera, width, height, nearest)
    return nearest


def _fragments(vertices: Floats, camera: Camera, width: int, height: int) -> Fragments:
    """Fragments of as many tetrahedra as fit into memory.

    A face bounds the depth of a parallel ray by a linear function of where the ray crosses the window, and that of a
    ray from the eye by the reciprocal of one. On which side it does is the same for all rays.
    """
    local = camera.to_camera_space(vertices)
    low, high, middle = window_bounds(local, camera)
    box = _pixel_box(low, high, camera, width, height)
    # Camera space is mirrored (depth is −z), so outward normals of positive tetrahedra point inwards there.
    inward = face_area_vectors(local)
    offset = -np.sum(inward * local[:, [1, 0, 0, 0]], axis=2)
    # Inside where offset + x · normal_x + y · normal_y + depth · normal_z >= 0, or all but offset times depth.
    parallel = camera.kind == "ORTHO"
    divisor, constant = (inward[..., 2], offset) if parallel else (offset, inward[..., 2])
    divisor = np.where(np.abs(divisor) < _PARALLEL, np.copysign(_PARALLEL, divisor), divisor)
    least = divisor > 0.0
    order = np.argsort(~least, axis=1, kind="stable")
    planes = [np.take_along_axis(-c / divisor, order, 1) for c in (constant, inward[..., 0], inward[..., 1])]
    ends = (camera.near, camera.far) if parallel else (1.0 / camera.far, 1.0 / max(camera.near, _PARALLEL))
    x, y = _centers(camera, width, height)
    parts, below = [Fragments.empty()], least.sum(axis=1)
    for count in range(5):
        for rows in _rows(box, np.flatnonzero(below == count)):
            index, column, bounds = _within(planes, count, ends, rows, x, y)
            cell, row = rows.cell[index], rows.number[index]
            enter, leave = bounds if parallel else (1.0 / bounds[1], 1.0 / bounds[0])
            meters = _ray_meters(camera, x[column], y[row])
            # Half the memory of intp; a heavy scene has millions of fragments.
            which, pixel = cell.astype(np.int32), (row * width + column).astype(np.int32)
            parts.append(Fragments(which, pixel, enter * meters, (leave - enter) * meters, np.ones(len(which))))
    fragments = Fragments.concatenate(parts)
    return _with_small_ones(vertices, local, camera, (width, height), (low, high, middle), fragments)


@dataclass(frozen=True)
class _Rows:
    """Rows of boxes (r,): whose they are, which rows of the image, their first pixels and how many they have."""

    cell: Integers
    number: Integers
    first: Integers
    wide: Integers

    @property
    def columns(self) -> Integers:
        """Columns (h,) of all their pixels."""
        return np.arange(int(self.wide.sum())) + np.repeat(self.first - np.cumsum(self.wide) + self.wide, self.wide)


def _within(
    planes: Sequence[Floats], count: int, ends: tuple[float, float], rows: _Rows, x: Floats, y: Floats
) -> tuple[Integers, Integers, tuple[Floats, Floats]]:
    """Rows and columns (h,) of pixels whose rays pass through tetrahedra, and bounds (h,) of depths or reciprocals.

    The first ``count`` of four planes (n, 4), each a constant and slopes along x and y, are lower bounds.
    """
    column = rows.columns
    px, py = x[column], y[rows.number]
    least, most = (np.full(len(column), end) for end in ends)
    for face in range(4):
        constant, along, up = (np.take(plane[:, face], rows.cell) for plane in planes)
        value = np.repeat(along, rows.wide)
        value *= px
        value += np.repeat(constant + up * py, rows.wide)
        if face < count:
            np.maximum(least, value, out=least)
        else:
            np.minimum(most, value, out=most)
    hit = np.flatnonzero(most > least)
    return np.repeat(np.arange(len(rows.wide)), rows.wide)[hit], column[hit], (least[hit], most[hit])


def _rows(box: Integers, which: Integers) -> Iterator[_Rows]:
    """Rows of some of the boxes, about `PAIR_BATCH` pixels at a time."""
    wide, high = (np.maximum(box[which, i + 1] - box[which, i] + 1, 0) for i in (0, 2))
    kept = np.flatnonzero(wide * high)
    which, wide, high = which[kept], wide[kept], high[kept]
    for run in chunks(wide * high, PAIR_BATCH):
        owner, number = spread(high[run])
        cell = which[run][owner]
        if len(cell):
            yield _Rows(cell, box[cell, 2] + number, box[cell, 0], wide[run][owner])


def _with_small_ones(
    vertices: Floats, local: Floats, camera: Camera, size: tuple[int, int], bounds: Sequence[Floats], pieces: Fragments
) -> Fragments:
    """Add fragments for tetrahedra between the pixels' centers, and set the coverage of all."""
    (width, height), (low, high, middle) = size, bounds
    corner, step = _grid(camera, width, height)
    count = np.bincount(pieces.cell, minlength=len(vertices))
    area, whole = silhouette_area(local, low, high, camera)
    area = area / np.prod(step)
    # Of what is partly out of view only the box is known; a tetrahedron fills half of it or less.
    far_corner = [camera.window[1], camera.window[3]]
    seen = np.clip((np.minimum(high, far_corner) - np.maximum(low, corner)) / step, 0.0, None)
    area = np.where(whole, area, np.minimum(1.0, np.prod(seen, axis=1) / 2.0))
    with np.errstate(invalid="ignore"):
        place = (middle - corner) / step
        visible = ((place >= 0.0) & (place <= [width, height])).all(axis=1) & (area > 0.0)
    missed = np.flatnonzero((count == 0) & visible)
    col, row = np.minimum(place[missed].astype(np.int64), [width - 1, height - 1]).T
    depth = np.clip(local[missed, :, 2].mean(axis=1), camera.near, camera.far)
    along = depth * _ray_meters(camera, *middle[missed].T)
    by_area = whole & (area < SMALL) & (count > 0)
    by_area[missed] = True
    small = np.flatnonzero(by_area)
    chord = np.zeros(len(vertices))
    if camera.kind == "ORTHO":
        direction = -camera.frame[:, 2]
    else:
        direction = vertices[small].mean(axis=1) - camera.position
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
    across = projected_area(vertices[small], direction)
    chord[small] = volume(vertices[small]) / np.where(across > 0.0, across, 1.0)

    cell = np.concatenate([pieces.cell, missed.astype(np.int32)])
    pixel = np.concatenate([pieces.pixel, (row * width + col).astype(np.int32)])
    entry = np.concatenate([pieces.entry, np.maximum(along - chord[missed] / 2.0, 0.0)])
    thickness = np.concatenate([pieces.thickness, chord[missed]])
    by_area = by_area[cell]
    thickness = np.where(by_area, chord[cell], thickness)
    return Fragments(cell, pixel, entry, thickness, np.where(by_area, area[cell] / np.maximum(count[cell], 1), 1.0))


def _draw_triangles(triangles: Floats, camera: Camera, width: int, height: int, nearest: Floats) -> None:
    """Lower ``nearest``, meters along each pixel's ray, to where finite triangles are."""
    local = camera.to_camera_space(triangles)
    low, high, _ = window_bounds(local, camera)
    box = _pixel_box(low, high, camera, width, height)
    drawn = np.flatnonzero((box[:, 1] >= box[:, 0]) & (box[:, 3] >= box[:, 2]))
    local, box = local[drawn], box[drawn]
    normal = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
    constant = np.sum(normal * local[:, 0], axis=1)
    # A side's plane through the eye is linear in the point (x, y, 1) of the window; so is a side seen in parallel.
    flat = local if camera.kind != "ORTHO" else np.concatenate([local[..., :2], np.ones((*local.shape[:2], 1))], axis=2)
    sides = np.cross(flat, np.roll(flat, -1, axis=1))
    near, far = camera.near, camera.far
    x, y = _centers(camera, width, height)
    for rows in _rows(box, np.arange(len(box))):
        cell, row, col = np.repeat(rows.cell, rows.wide), np.repeat(rows.number, rows.wide), rows.columns
        px, py = x[col], y[row]
        lowest, highest = np.full(len(cell), np.inf), np.full(len(cell), -np.inf)
        for side in range(3):
            a, b, c = (sides[:, side, i][cell] for i in range(3))
            value = a * px + b * py + c
            lowest, highest = np.minimum(lowest, value), np.maximum(highest, value)
        hit = np.flatnonzero((lowest >= 0.0) | (highest <= 0.0))
        px, py, n = px[hit], py[hit], normal[cell[hit]]
        across = n[:, 0] * px + n[:, 1] * py
        with np.errstate(divide="ignore", invalid="ignore"):
            if camera.kind == "ORTHO":
                depth = (constant[cell[hit]] - across) / n[:, 2]
            else:
                depth = constant[cell[hit]] / (across + n[:, 2])
        # Comparisons with what is not a number are false: triangles seen edge-on drop out here.
        seen = np.flatnonzero((depth >= near) & (depth <= far))
        hit = hit[seen]
        np.minimum.at(nearest, row[hit] * width + col[hit], depth[seen] * _ray_meters(camera, px[seen], py[seen]))


def _grid(camera: Camera, width: int, height: int) -> tuple[Floats, Floats]:
    """Lower left corner of the window (2,), and the size of a pixel on it (2,)."""
    left, right, bottom, top = camera.window
    return np.array([left, bottom]), np.array([(right - left) / width, (top - bottom) / height])


def image_places(camera: Camera, points: Floats, size: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
    """Where points (n, 3) are in a flat image of so many pixels, (n, 2) from its lower left corner; depths; distances.

    Distances (n,) are those along rays, meters; places of what is nearer than the near plane mean nothing.
    """
    local = camera.to_camera_space(points)
    left, right, bottom, top = camera.window
    flat, depth = local[:, :2], local[:, 2]
    if camera.kind == "ORTHO":
        meters = depth
    else:
        flat, meters = flat / np.where(depth >= camera.near, depth, 1.0)[:, None], np.linalg.norm(local, axis=1)
    return (flat - [left, bottom]) / [right - left, top - bottom] * size, depth, meters


def _centers(camera: Camera, width: int, height: int) -> tuple[Floats, Floats]:
    """Window coordinates of the pixels' centers: x by column, y by row."""
    corner, step = _grid(camera, width, height)
    return tuple(corner[i] + (np.arange((width, height)[i]) + 0.5 + SHIFT[i]) * step[i] for i in (0, 1))


def _ray_meters(camera: Camera, x: Floats, y: Floats) -> Floats | float:
    """Meters along the ray through (x, y) of the window for each meter of depth."""
    return 1.0 if camera.kind == "ORTHO" else np.sqrt(1.0 + x * x + y * y)


def _pixel_box(low: Floats, high: Floats, camera: Camera, width: int, height: int) -> Integers:
    """First and last column, first and last row ``(n, 4)`` of the pixels whose centers lie in boxes on the window."""
    (corner, step), size = _grid(camera, width, height), np.array([width, height])
    # A hair wider than the box: a center on a side must not be lost to rounding. Clipped before the conversion,
    # because the box of what starts at the near plane may be wider than integers go, and that of nothing infinite.
    first = np.ceil(np.clip((low - corner) / step - 0.5 - 1e-5, 0, size))
    last = np.floor(np.clip((high - corner) / step - 0.5 + 1e-5, -1, size - 1))
    return np.stack([first[:, 0], last[:, 0], first[:, 1], last[:, 1]], axis=1).astype(np.int64)
