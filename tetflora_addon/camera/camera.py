# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as the engine sees it: a window at unit depth or on the sphere, its projection, and its blur.

Blur makes an image reach further. A lens of radius R focused on depth f draws a point at depth z as a disc, whose
radius at depth 1 is R |1/z − 1/f| (M. Potmesil and I. Chakravarty, "A lens and aperture camera model for synthetic
image generation", Computer Graphics 15 (3), 1981). What lies beside the view by less than that is in the image.

Coordinates begin near the camera, wherever in the world that is. Blender stores vertices in single precision: 1,000 km
from the world's origin they are 6 cm apart, wider than a leaf. A job therefore counts from a corner of a wide grid
(`Camera.local`), with everything that it reads; the objects that it makes carry the way back to the world. Corners are
exact in single precision up to billions of meters.

Boxes and silhouettes of tetrahedra and triangles are projected to its window without pixels. Names: ``local`` is camera
space (x right, y up, depth), meters; the *window* is the image at depth 1 (``'PERSP'``) or in meters (``'ORTHO'``).
"""

from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Mask, in_axes, length
from ..tetrahedra.geometry import EDGES, FACES, projected_area

#: Side of the grid, meters. Up to half of it from the world's origin, coordinates are those of the world.
GRID = 1024.0
#: Cosine of the latitude from which on panoramas count as if no pixels were added toward the poles: 84 degrees.
LEAST_COSINE = 0.1
#: How far from several eyes things are at least to hide others from all of them, in cell radii.
_OPEN = 2.0


def origin_near(points: ArrayLike) -> Floats:
    """The corner (3,) of the grid that is nearest to most points (n, 3), or to one (3,); meters, world space."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    if not len(points):
        return np.zeros(3)
    return np.rint(np.median(points, axis=0) / GRID) * GRID + 0.0  # never −0


@dataclass(frozen=True)
class Camera:
    """A perspective, orthographic or panoramic camera.

    Camera space is Blender's: +x right, +y up, looking along −z. *Depth* is the distance along the viewing direction.
    """

    #: Perspective, parallel rays along the viewing direction, or an equirectangular panorama: columns are longitudes
    #: and rows are latitudes.
    kind: Literal["PERSP", "ORTHO", "PANO"]
    position: Floats  # (3,): the eye; for ``'ORTHO'`` the point from which depth is counted
    frame: Floats  # (3, 3): rotation; columns are the camera's x, y and z axes in world space
    #: ``(left, right, bottom, top)`` of the image at depth 1 (``'PERSP'``), at any depth in meters (``'ORTHO'``), or in
    #: radians (``'PANO'``): longitude from the viewing direction to the right, latitude from its plane upwards. Lens
    #: shift, sensor fit and pixel aspect are in it; it need not be symmetric.
    window: tuple[float, float, float, float]
    #: near and far: clipping depths, meters, ``0 < near < far``.
    near: float
    far: float
    #: width and height: size of the final image in pixels.
    width: int
    height: int
    lens_radius: float = 0.0  # radius of the lens, meters; 0 where all is sharp
    focus: float = np.inf  # depth that is sharp, meters
    #: The camera at other times while the shutter is open, and the other eyes of a stereoscopic image; often empty.
    shutter: tuple[Self, ...] = ()
    #: How far, in depth, the position lies behind the eye, meters: not 0 where the camera stands for several.
    setback: float = 0.0
    #: Largest distance from that eye to the others that the camera stands for, meters; see `view_cells`.
    cell_radius: float = 0.0
    #: (3,): where in the world coordinates begin, meters: those of the camera, and of all that is refined for it.
    origin: Floats = field(default_factory=lambda: np.zeros(3))

    def local(self) -> Self:
        """The same camera in coordinates that begin near it."""
        return self.counted_from(origin_near(self.position + self.origin))

    def counted_from(self, origin: Floats) -> Self:
        """The same camera in coordinates that begin at a place (3,) in the world."""
        by = origin - self.origin
        if not by.any():
            return self
        shutter = tuple(other.counted_from(origin) for other in self.shutter)
        return replace(self, position=self.position - by, shutter=shutter, origin=origin)

    def smaller(self, most: int) -> Self:
        """The same camera with an image of so many pixels at most on its longer side."""
        return self.resized(min(most / max(self.width, self.height), 1.0))

    def resized(self, times: float) -> Self:
        """The same camera with so many times as many pixels on each side, at least one."""
        width, height = max(round(times * self.width), 1), max(round(times * self.height), 1)
        return replace(self, width=width, height=height, shutter=tuple(one.resized(times) for one in self.shutter))

    @property
    def eye(self) -> Floats:
        """Where the image is seen from (3,), meters: before the position where the camera stands for several."""
        left, right, bottom, top = self.window
        ahead = np.array([(left + right) / 2.0, (bottom + top) / 2.0, -1.0])
        return self.position + self.setback * (self.frame @ ahead)

    @property
    def line_of_sight(self) -> dict[str, Floats]:
        """What `TetrahedralTree.order` needs to know of the camera: the eye or the direction of its rays."""
        return {"direction": -self.frame[:, 2]} if self.kind == "ORTHO" else {"eye": self.position}

    @property
    def pixel_size(self) -> float:
        """Side of a pixel at depth 1 (perspective), at any depth (orthographic) or 1 m away (panorama), meters."""
        left, right, bottom, top = self.window
        return float(np.sqrt((right - left) * (top - bottom) / (self.width * self.height)))

    def to_camera_space(self, points: Floats) -> Floats:
        """World points ``(..., 3)`` to (x right, y up, depth) ``(..., 3)``, meters."""
        return in_axes(np.asarray(points, np.float64), self.frame * [1.0, 1.0, -1.0], self.position)

    def distance_to_view(self, points: Floats) -> Floats:
        """Distance of world points (n, 3) from the space that the image shows, meters; negative within it."""
        x, y, depth = self.to_camera_space(points).T
        left, right, bottom, top = self.window
        if self.kind == "PANO":
            return self._beside_panorama(np.stack([x, y, depth], axis=-1))
        if self.kind == "ORTHO":
            return np.max([x - right, left - x, y - top, bottom - y], axis=0)
        beyond = x - right * depth, left * depth - x, y - top * depth, bottom * depth - y
        slopes = np.hypot(1.0, (right, left, top, bottom))
        return np.max([distance / slope for distance, slope in zip(beyond, slopes, strict=True)], axis=0)

    def widened(self, margin: float, margin_up: float | None = None) -> Self:
        """The same camera with more around its image.

        Parameters
        ----------
        margin : float
            Fraction of the image's width that is added on the left and on the right.
        margin_up : float, optional
            Fraction of its height that is added below and above; as ``margin`` if it is not given.
        """
        left, right, bottom, top = self.window
        # Whole pixels, so that the pixels of the image stay where they are.
        across = round(margin * self.width)
        up = round((margin if margin_up is None else margin_up) * self.height)
        step_x, step_y = (right - left) / self.width, (top - bottom) / self.height
        if self.kind == "PANO":
            # There is nothing beyond the poles, nor beyond the whole way round.
            across = min(across, int((2.0 * np.pi - (right - left)) / (2.0 * step_x) + 1e-9))
            up = min(up, max(int(min(np.pi / 2.0 - top, bottom + np.pi / 2.0) / step_y + 1e-9), 0))
        window = left - across * step_x, right + across * step_x, bottom - up * step_y, top + up * step_y
        return replace(self, window=window, width=self.width + 2 * across, height=self.height + 2 * up)

    def longitude_latitude(self, local: Floats) -> tuple[Floats, Floats]:
        """Place on a panorama of points ``(..., 3)`` in camera space, radians.

        The longitude is the one nearest to the middle of the window.
        """
        x, y, depth = np.moveaxis(local, -1, 0)
        middle = (self.window[0] + self.window[1]) / 2.0
        longitude = np.arctan2(x, depth) - middle
        longitude = middle + longitude - 2.0 * np.pi * np.round(longitude / (2.0 * np.pi))
        return longitude, np.arctan2(y, np.hypot(x, depth))

    def _beside_panorama(self, local: Floats) -> Floats:
        left, right, bottom, top = self.window
        longitude, latitude = self.longitude_latitude(local)
        far, across = np.linalg.norm(local, axis=-1), np.hypot(local[..., 0], local[..., 2])

        def beyond(angle: Floats, meters: Floats) -> Floats:
            return meters * np.sin(np.clip(angle, -np.pi / 2.0, np.pi / 2.0))

        # What goes all the way round or to a pole has no walls there.
        outside = np.full(far.shape, -np.inf)
        if right - left < 2.0 * np.pi - 1e-9:
            outside = np.maximum(outside, beyond(np.maximum(longitude - right, left - longitude), across))
        if top < np.pi / 2.0 - 1e-9:
            outside = np.maximum(outside, beyond(latitude - top, far))
        if bottom > -np.pi / 2.0 + 1e-9:
            outside = np.maximum(outside, beyond(bottom - latitude, far))
        return outside

    def pixel_extent(self, points: Floats) -> Floats:
        """Meters that one pixel spans at each of the world points ``(..., 3)``; result ``(...)``.

        Points nearer than the near plane count as lying on it.
        """
        if self.kind == "ORTHO":
            return np.full(np.shape(points)[:-1], self.pixel_size)
        if self.kind == "PANO":
            local = self.to_camera_space(points)
            distance = np.maximum(np.linalg.norm(local, axis=-1), self.near)
            # Toward the poles an image has more pixels for each solid angle.
            cosine = np.hypot(local[..., 0], local[..., 2]) / distance
            return self.pixel_size * self._nearest(distance) * np.sqrt(np.clip(cosine, LEAST_COSINE, 1.0))
        return self.pixel_size * self._nearest(self.to_camera_space(points)[..., 2] - self.setback)

    @property
    def closest(self) -> float:
        """Least distance from an eye at which things count, meters; see `_nearest`."""
        return max(self.cell_radius / 2.0, self.near if self.setback == 0.0 else 0.0)

    @property
    def min_occluding_depth(self) -> float:
        """Depth from which on things hide what is behind them, meters: nearer ones not from all eyes; 0 for one eye."""
        return self.setback + _OPEN * self.cell_radius

    def pixel_gain(self, points: Floats) -> Floats | float:
        """Pixels ``(...)`` of what is at points ``(..., 3)`` for each that it has as seen from the position.

        1 but where the camera stands for several, of which the nearest counts.
        """
        if self.setback == 0.0:
            return 1.0
        depth = np.maximum(self.to_camera_space(points)[..., 2], self.near)
        return (self.pixel_size * depth / self.pixel_extent(points)) ** 2

    def _nearest(self, distance: Floats) -> Floats:
        """Distances from the nearest of the eyes, given those from the one in the middle, meters.

        Within the cell nobody knows: half of its radius is as near as it comes to what is not grazed.
        """
        return np.maximum(distance - self.cell_radius, self.closest)

    def extent_around(self, points: Floats) -> Floats:
        """Meters (n,) that one pixel spans at points (n, 3), in view or not.

        Beside and behind the camera depth says nothing, but distance does.
        """
        extent = self.pixel_extent(points)
        if self.kind == "PERSP":
            extent = np.maximum(extent, self.pixel_size * (length(points - self.eye) - self.cell_radius))
        return extent


#: Margins never exceed this fraction of the image on each side. A twig at the lens is blurred over more than all of it,
#: but so thinly that its leaves cannot be distinguished.
MOST = 0.5


def to_eye(camera: Camera, points: Floats) -> Floats:
    """Unit vectors (m, 3) from points to the camera."""
    if camera.kind == "ORTHO":
        return np.tile(camera.frame[:, 2], (len(points), 1))
    away = camera.eye - points
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def blur_margins(camera: Camera, center: Floats, reach: Floats) -> tuple[float, float]:
    """Fractions of the image's width and height by which blur reaches beyond it.

    Parameters
    ----------
    camera : Camera
        With its lens and shutter.
    center : (n, 3) float64
        Middles of the plants, meters, world space.
    reach : (n,) float64
        Radii of spheres around them that hold the plants, meters.

    Returns
    -------
    across, up : float
        For each side of the image, 0 to `MOST`. Where nothing is blurred, 0.
    """
    if not len(center) or not (camera.lens_radius > 0.0 or camera.shutter):
        return 0.0, 0.0
    local = camera.to_camera_space(center)
    # From the eye; distances where an image is all around it.
    depth = np.linalg.norm(local, axis=-1) if camera.kind == "PANO" else local[..., 2] - camera.setback
    near, far = camera.near - camera.setback, camera.far - camera.setback
    nearest = np.maximum(depth - reach - camera.cell_radius, camera.closest)
    farthest = np.maximum(np.minimum(depth + reach + camera.cell_radius, far), camera.closest)
    ahead = (depth + reach > near) & (depth - reach < far)
    radius = np.maximum(circle_of_confusion(camera, nearest), circle_of_confusion(camera, farthest))
    meters = radius if camera.kind == "ORTHO" else radius * farthest
    seen = ahead & (camera.distance_to_view(center) - reach < meters)
    left, right, bottom, top = camera.window
    size = np.array([right - left, top - bottom])
    margins = np.max(radius[seen], initial=0.0) / size
    if seen.any() and camera.kind != "PANO":
        between = float(nearest[seen].min()), float(farthest[seen].max())
        for other in camera.shutter:
            margins = np.maximum(margins, _movement(camera, other, between) / size)
    across, up = np.minimum(margins, MOST).tolist()
    return across, up


def circle_of_confusion(camera: Camera, depth: Floats) -> Floats:
    """Radius (n,) on the window of the discs that points at depths (n,), meters, are drawn as; see the module."""
    if camera.lens_radius <= 0.0:
        return np.zeros(len(depth))
    if camera.kind == "ORTHO":
        return camera.lens_radius * np.abs(depth / camera.focus - 1.0)
    return camera.lens_radius * np.abs(1.0 / np.maximum(depth, camera.closest) - 1.0 / camera.focus)


def _movement(camera: Camera, other: Camera, depths: tuple[float, float]) -> Floats:
    """How far beyond the window of a camera (2,) the view of another reaches between two depths.

    That view is convex, and so is its image: the corners are enough.
    """
    left, right, bottom, top = other.window
    corners = np.array([(x, y, 1.0) for x in (left, right) for y in (bottom, top)])
    scale = [np.array([1.0, 1.0, d]) if other.kind == "ORTHO" else np.full(3, d) for d in depths]
    local = np.concatenate([corners * s for s in scale]) * np.array([1.0, 1.0, -1.0])
    seen = camera.to_camera_space(local @ other.frame.T + other.position)
    if camera.kind == "PERSP":
        if (seen[:, 2] <= 0.0).any():
            return np.full(2, np.inf)
        seen = seen / seen[:, 2:]
    left, right, bottom, top = camera.window
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    return np.max([np.array([left, bottom]) - low, high - np.array([right, top]), np.zeros(2)], axis=0)


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
    # Each ray crosses the surface twice. Signed areas of a closed surface add up to 0: the four faces give the section.
    area, ahead = np.zeros((len(local), 4)), depth >= near
    flat = _project(local, camera)
    for face, (i, j, k) in enumerate(FACES):
        area[:, face] = _cross(flat[:, j] - flat[:, i], flat[:, k] - flat[:, i]) / 2.0
    mixed = np.flatnonzero(~ahead.all(axis=1) & whole)
    for face, corners in enumerate(FACES):
        area[mixed, face] = _clipped_area(local[mixed[:, None], corners], camera)
    return np.where(whole, (np.abs(area).sum(axis=1) + np.abs(area.sum(axis=1))) / 2.0, 0.0), whole


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

    What is before the near plane is cut off; boxes of what is wholly before it or too far are empty: ``low > high``.
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
        crossing, a, b = mixed[crosses], a[crosses], b[crosses]
        fraction = (near - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
        cut = a + fraction * (b - a)
        point = cut[:, :2] if camera.kind == "ORTHO" else cut[:, :2] / near
        low[crossing], high[crossing] = np.minimum(low[crossing], point), np.maximum(high[crossing], point)
        total[crossing] += point
        number[crossing] += 1.0
    return low, high, total / np.maximum(number, 1.0)[:, None]
