# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights, the flat cameras through which they see, and shadows of what the camera does not see (paper, section 6.1).

"If any light sources fall outside of the viewing pyramid, the space between them also needs to be refined in order to
calculate accurate shadows." A tree behind the camera is hidden, and its shadow is as coarse as its proxy. Each light
therefore draws the same tetrahedra into an alpha buffer of its own. What is hidden from the camera but lit, with
something behind it that the camera sees, counts by the pixels of its shadow there. It is treated as if it were seen:
leaves whose shadows have a shape become leaves, and the rest is divided until its shadow is small.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers
from ..camera.camera import Camera
from ..tetrahedra.geometry import volume
from ..tetrahedra.tree import TetrahedralTree
from .decisions import Decision, Terminals, mean_extinction
from .rasterize import buffer_size, image_places, occluder_depth, pixel_rays, tetrahedron_fragments
from .settings import RefinementSettings
from .visibility import AlphaBuffer, face_cameras

#: Pixels of a light's buffer along each side of a field that receives light as a whole: points that the camera sees
#: lie farther apart than the pixels of a light.
FIELD = 4
#: Longer side of the small image whose pixels find visible ground.
GROUND = 160
#: Spots wider than this half angle, radians, count as lights that shine all around.
_WIDE = 1.2
#: Points farther than this from the middle of a view, as the tangent of the angle, need six views.
_STEEP = 2.5
#: Nearest that a lamp's view sees, meters.
_NEAR = 1e-2


@dataclass(frozen=True)
class Light:
    """Where light comes from."""

    #: Parallel rays, a cone, all around, or a flat surface that shines to one side.
    kind: Literal["SUN", "SPOT", "POINT", "AREA"]
    position: Floats  # (3,): meters, world space; of no meaning for the sun
    direction: Floats  # (3,): unit vector in which it shines; of no meaning for a point
    #: Angle in radians under which the sun is seen, or diameter in meters of the others: shadows are blurred by it.
    width: float = 0.0
    angle: float = np.pi  # half of the spot's cone, radians
    #: (3,): linear RGB times energy: for the sun W/m² on a surface that faces it, for the others the W/sr that they
    #: send ahead, so that a surface at distance r that faces them gets color / r² W/m².
    color: Floats = field(default_factory=lambda: np.ones(3))
    blend: float = 0.0  # fraction of a spot's cone over which it fades, 0 to 1
    #: (2, 3): half edges of an area, or half axes of an ellipse, meters.
    span: Floats = field(default_factory=lambda: np.zeros((2, 3)))
    ellipse: bool = False  # whether an area is a disk or an ellipse instead of a square or a rectangle
    shadow: bool = True  # whether it casts shadows; without, everything is lit

    def counted_from(self, origin: Floats) -> Self:
        """The same in coordinates that begin at a place (3,) of the present ones."""
        return replace(self, position=self.position - origin)


def sun_of(lights: Sequence[Light]) -> Floats | None:
    """Where the light of the brightest sun that casts shadows comes from, a unit vector (3,); None without any."""
    suns = [light for light in lights if light.kind == "SUN" and light.shadow]
    return -max(suns, key=lambda one: float(np.mean(one.color))).direction if suns else None


def light_views(light: Light, vertices: Floats, points: Floats, resolution: int) -> list[Camera]:
    """Flat cameras through which a light sees what receives it.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Tetrahedra that stand in the light, meters.
    points : (m, 3) float64
        What receives it, meters.
    resolution : int
        Longer side of their images, pixels.

    Returns
    -------
    list of Camera
        Empty where nothing stands between the sun and what receives its light.
    """
    frame = frame_toward(light.direction)
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
        return [Camera("ORTHO", frame[:, 2] * start, frame, window, 0.1, far, *image_size(*(high - low)))]
    distance = np.linalg.norm(np.concatenate([vertices.reshape(-1, 3), points]) - light.position, axis=1)
    far = float(distance.max()) + 1.0
    if light.kind == "SPOT" and light.angle < _WIDE:
        side = float(np.tan(max(light.angle, 1e-3)))
        window = (-side, side, -side, side)
        return [Camera("PERSP", light.position, frame, window, _NEAR, far, resolution, resolution)]
    return _all_around(light.position, frame, far, resolution)


def _all_around(position: Floats, frame: Floats, far: float, resolution: int) -> list[Camera]:
    panorama = Camera("PANO", position, frame, (-np.pi, np.pi, -np.pi / 2, np.pi / 2), _NEAR, far, 4, 2)
    return face_cameras(panorama, resolution)


def image_size(width: float, height: float) -> tuple[int, int]:
    """Size in pixels of an image with square pixels for a window of any size; only the ratio matters."""
    scale = 4096 / max(width, height)
    return max(round(width * scale), 1), max(round(height * scale), 1)


def frame_toward(direction: Floats) -> Floats:
    """Frame (3, 3) of a camera that looks in a direction (3,) of any length."""
    back = -np.asarray(direction, np.float64) / np.linalg.norm(direction)
    right = np.cross(np.eye(3)[np.argmin(np.abs(back))], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)


def lamp_views(position: Floats, points: Floats, resolution: int) -> list[Camera]:
    """Views of points (m, 3) from a lamp: one that fits them closely, or six all around where they surround it."""
    away = points - position
    far = float(np.linalg.norm(away, axis=1).max(initial=0.0)) + 1.0
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0 - position
    frame = frame_toward(middle if np.linalg.norm(middle) > _NEAR else np.array([0.0, 0.0, -1.0]))
    local = away @ frame
    depth = -local[:, 2]
    if (depth > _NEAR).all():
        flat = local[:, :2] / depth[:, None]
        if np.abs(flat).max() < _STEEP:
            low, high = flat.min(axis=0) - 1e-4, flat.max(axis=0) + 1e-4
            window = (float(low[0]), float(high[0]), float(low[1]), float(high[1]))
            return [Camera("PERSP", position, frame, window, _NEAR, far, *image_size(*(high - low)))]
    return _all_around(position, frame, far, resolution)


@dataclass(frozen=True)
class Shadows:
    """Shadows of tetrahedra (n,) in the image, all lights together."""

    #: (n,): pixels of the final image that are darkened if all of it is opaque and nothing else is in the light.
    pixels: Floats
    #: (n,): width in pixels of the shadows of what they hold, 0 where it is lost in the light's penumbra.
    feature_px: Floats


def decide_by_shadows(
    decision: NDArray[np.int8], shadows: Shadows, cells: Terminals, settings: RefinementSettings
) -> NDArray[np.int8]:
    """Decisions (n,) where hidden tetrahedra are divided or made explicit for their shadows."""
    totals, out = cells.totals, decision.copy()
    counts = (decision == Decision.HIDDEN) & (shadows.pixels > settings.shadow_cutoff**2)
    large = shadows.feature_px >= settings.shadow_cutoff
    few = totals.polygons <= settings.few_polygons
    explicit = counts & (few | (large & (shadows.pixels <= settings.block**2)))
    out[counts & ~explicit] = Decision.SPLIT
    out[explicit] = Decision.EXPLICIT
    return out


def shadows_of(
    tree: TetrahedralTree,
    cells: Terminals,
    decision: NDArray[np.int8],
    lights: Sequence[Light],
    camera: Camera,
    ground: Floats,
    settings: RefinementSettings,
) -> Shadows:
    """Shadows (n,) of hidden tetrahedra on what the camera sees.

    ``decision`` (n,) is the `Decision` for each of ``cells``; ``ground`` (m, 3) are points of `seen_ground`, meters.
    """
    count, vertices = len(cells), tree.vertices(cells.nodes)
    pixels, feature = np.zeros(count), np.zeros(count)
    hidden = decision == Decision.HIDDEN
    if not hidden.any():
        return Shadows(pixels, feature)
    extinction = mean_extinction(cells.totals, volume(vertices))
    points = np.concatenate([ground, vertices[~hidden].mean(axis=1)])
    if not len(points):
        return Shadows(pixels, feature)
    # Meters that a pixel of the image spans where light is received.
    receiving = camera.extent_around(points), camera.extent_around(vertices.mean(axis=1))
    for light in (one for one in lights if one.shadow):
        for view in light_views(light, vertices, points, settings.visibility_resolution):
            size = buffer_size(view, settings.visibility_resolution)
            buffer = AlphaBuffer(view, settings.visibility_resolution)
            buffer.add(np.arange(count), vertices, extinction)
            lit = buffer.transmittance(tree.order(**view.line_of_sight)[cells.nodes])
            fragments = tetrahedron_fragments(vertices, view, *size)
            field, fields = _fields(fragments.pixel, size)
            far, fine = np.zeros(fields), np.full(fields, np.inf)
            seen = ~hidden[fragments.cell]
            np.maximum.at(far, field[seen], (fragments.entry + fragments.thickness)[seen])
            np.minimum.at(fine, field[seen], receiving[1][fragments.cell[seen]])
            _receive(view, size, points, receiving[0], far, fine)
            casts = np.flatnonzero(~seen & (far[field] > fragments.entry) & (lit[fragments.cell] > settings.hidden))
            cell, shaded = fragments.cell[casts], field[casts]
            middle = fragments.entry[casts] + fragments.thickness[casts] / 2.0
            # Detail that is smaller than the penumbra is not seen, however large the image is.
            if light.kind == "SUN":
                blur = light.width * (far[shaded] - middle)
                across = view.pixel_size * view.width / size[0]
            else:
                blur = light.width * (far[shaded] - middle) / np.maximum(middle, view.near)
                across = view.pixel_size * view.width / size[0] * far[shaded]
            extent = np.maximum(fine[shaded], np.maximum(blur, 0.0) / settings.shadow_cutoff)
            pixels += np.bincount(cell, fragments.coverage[casts] * lit[cell] * (across / extent) ** 2, count)
            # A light that is close throws large shadows.
            larger = 1.0 if light.kind == "SUN" else far[shaded] / np.maximum(middle, view.near)
            np.maximum.at(feature, cell, cells.totals.width[cell] * larger / extent)
    return Shadows(pixels, feature)


def seen_ground(camera: Camera, occluders: Floats | None, height: float) -> Floats:
    """Places (m, 3) where rays through the image meet occluders (t, 3, 3), or else level ground at a height; meters."""
    views = face_cameras(camera, GROUND // 2) if camera.kind == "PANO" else [camera]
    points = []
    for view in views:
        size = buffer_size(view, GROUND if len(views) == 1 else GROUND // 2)
        origins, directions = pixel_rays(view, *size)
        with np.errstate(divide="ignore", invalid="ignore"):
            level = (height - origins[:, 2]) / directions[:, 2]
        level = np.where(level > 0.0, level, np.inf)
        if occluders is not None and len(occluders):
            hit = occluder_depth(occluders, view, *size)
            level = np.where(np.isfinite(hit), hit, level)
        rays = np.flatnonzero(level < camera.far)
        points.append(origins[rays] + level[rays, None] * directions[rays])
    return np.concatenate(points)


def _fields(pixel: Integers, size: tuple[int, int]) -> tuple[Integers, int]:
    """Field (n,) of each pixel, and how many fields there are."""
    across, up = -(-size[0] // FIELD), -(-size[1] // FIELD)
    row, column = np.divmod(pixel.astype(np.int64), size[0])
    return (row // FIELD) * across + column // FIELD, across * up


def _receive(view: Camera, size: tuple[int, int], points: Floats, extent: Floats, far: Floats, fine: Floats) -> None:
    """Put points that receive light into the fields: how far away they are, and how fine the image is there."""
    place, depth, meters = image_places(view, points, size)
    inside = np.flatnonzero((depth > view.near) & (place >= 0.0).all(axis=1) & (place < size).all(axis=1))
    column, row = place[inside].astype(np.int64).T
    field, _ = _fields(row * size[0] + column, size)
    np.maximum.at(far, field, meters[inside])
    np.minimum.at(fine, field, extent[inside])


#: Places along a shadow that are looked at; they lie the farther apart the longer it is.
_STEPS = 12
#: Meters to the first of them, and where a shadow without a floor ends.
_FIRST, _LONGEST = 1.0, 300.0
#: Where no light is known: length of shadows over the distance from the view.
_UNKNOWN = 2.5


@dataclass(frozen=True)
class ShadowReach:
    """Where shadows of things end up."""

    camera: Camera
    lights: Sequence[Light] = ()  # those that throw shadows
    floor: float = -np.inf  # height below which nothing receives any, meters

    def distance(self, points: Floats, distance_to_view: Floats, reach: Floats | float = 0.0) -> Floats:
        """Meters (n,) that shadows of points (n, 3) fall before they are in view; infinite where they never are.

        ``distance_to_view`` (n,) is that of the points from the view, meters; a shadow falls at least so far, and
        within the view it falls no meter. Where no light is known, as under an image of the sky, it is a multiple of
        that. ``reach`` (n,) is how far what casts the shadow extends around each point.
        """
        reach = np.broadcast_to(reach, len(points))
        if not any(light.shadow for light in self.lights):
            return _UNKNOWN * np.maximum(distance_to_view, 0.0)
        shortest = np.where(distance_to_view > 0.0, np.inf, 0.0)
        outside = np.flatnonzero(distance_to_view > 0.0)
        for light in self.lights:
            if len(outside) and light.shadow:
                shortest[outside] = np.minimum(shortest[outside], self._of(light, points[outside], reach[outside]))
        return np.maximum(shortest, np.maximum(distance_to_view, 0.0))

    def _of(self, light: Light, points: Floats, reach: Floats) -> Floats:
        if light.kind == "SUN":
            ray = np.broadcast_to(light.direction, points.shape)
        else:
            ray = points - light.position
            ray = ray / np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-12)
        # Nothing is seen below the floor.
        with np.errstate(divide="ignore", invalid="ignore"):
            down = np.where(ray[:, 2] < 0.0, (self.floor - points[:, 2] - reach) / ray[:, 2], np.inf)
        longest = np.clip(down, _FIRST, _LONGEST)
        shortest, before = np.full(len(points), np.inf), np.zeros(len(points))
        for step in range(1, _STEPS + 1):
            fallen = _FIRST * (longest / _FIRST) ** (step / _STEPS)
            # A place stands for the way from the one before.
            near = self.camera.distance_to_view(points + fallen[:, None] * ray) <= (fallen - before) / 2.0 + reach
            shortest = np.where(near, np.minimum(shortest, fallen), shortest)
            before = fallen
        return shortest
