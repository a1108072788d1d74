# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows in the picture from what the camera does not see (paper, section 6.1).

"If any light sources fall outside of the viewing pyramid, the space between them also needs to be refined in order to
calculate accurate shadows." A tree behind the camera is hidden, and its shadow is as coarse as its proxy. Each light
therefore looks at the same tetrahedra through an alpha buffer of its own. What is hidden from the camera but lit, with
something behind it that the camera sees, counts by the pixels that its shadow has there, and is decided on as if it
were seen: leaves whose shadows have a shape become leaves, and the rest is divided until its shadow is small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..tetrahedra.geometry import volume
from ..tetrahedra.tree import TetrahedralTree
from .camera import Camera
from .cells import Terminals, mean_extinction
from .decisions import Decision
from .light_views import Light, light_views
from .panorama import face_cameras
from .rasterise import buffer_size, occluder_depth, pixel_rays, tetrahedron_fragments
from .settings import RefinementSettings
from .visibility import AlphaBuffer

__all__ = ["Light", "Shadows", "decide_by_shadows", "seen_ground", "shadows_of"]

#: Pixels of a light's buffer along each side of a field of which is known what receives its light: points that the
#: camera sees lie less close together than the pixels of a light.
FIELD = 4
#: Longer side of the small picture whose pixels tell where ground is seen.
GROUND = 160


@dataclass(frozen=True)
class Shadows:
    """What the shadows of tetrahedra (n,) are in the picture, all lights together.

    Attributes
    ----------
    pixels : (n,) float64
        Pixels of the final picture that are darkened if all of it is opaque and nothing else is in the light.
    feature : (n,) float64
        Width in pixels of the shadows of what they hold, 0 where it is lost in the light's penumbra.
    """

    pixels: NDArray[np.float64]
    feature: NDArray[np.float64]


def decide_by_shadows(
    decision: NDArray[np.int8], shadows: Shadows, cells: Terminals, settings: RefinementSettings
) -> NDArray[np.int8]:
    """Decisions (n,) where hidden tetrahedra are divided or made explicit for their shadows."""
    amounts, out = cells.amounts, decision.copy()
    counts = (decision == Decision.HIDDEN) & (shadows.pixels > settings.shadow_cutoff**2)
    large = shadows.feature >= settings.shadow_cutoff
    few = amounts.polygons <= settings.few_polygons
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
    ground: NDArray[np.float64],
    settings: RefinementSettings,
) -> Shadows:
    """Shadows of hidden tetrahedra on what the camera sees.

    Parameters
    ----------
    tree : TetrahedralTree
    cells : Terminals of n
    decision : (n,) int8
        `Decision` for each of them.
    lights : sequence of Light
    camera : Camera
    ground : (m, 3) float64
        Points that the camera sees beside the plants, see `seen_ground`, metres.
    settings : RefinementSettings

    Returns
    -------
    Shadows of n
    """
    count, vertices = len(cells), tree.vertices(cells.nodes)
    pixels, feature = np.zeros(count), np.zeros(count)
    hidden = decision == Decision.HIDDEN
    if not hidden.any():
        return Shadows(pixels, feature)
    extinction = mean_extinction(cells.amounts, volume(vertices))
    points = np.concatenate([ground, vertices[~hidden].mean(axis=1)])
    if not len(points):
        return Shadows(pixels, feature)
    # Metres that a pixel of the picture spans where light is received.
    receiving = camera.extent_around(points), camera.extent_around(vertices.mean(axis=1))
    for light in (one for one in lights if one.shadow):
        for view in light_views(light, vertices, points, settings.visibility_resolution):
            size = buffer_size(view, settings.visibility_resolution)
            buffer = AlphaBuffer(view, settings.visibility_resolution)
            buffer.add(np.arange(count), vertices, extinction)
            lit = buffer.transmittance(tree.order(**view.line_of_sight)[cells.nodes])
            found = tetrahedron_fragments(vertices, view, *size)
            field, fields = _fields(found.pixel, size)
            far, fine = np.zeros(fields), np.full(fields, np.inf)
            seen = ~hidden[found.cell]
            np.maximum.at(far, field[seen], (found.entry + found.thickness)[seen])
            np.minimum.at(fine, field[seen], receiving[1][found.cell[seen]])
            _receive(view, size, points, receiving[0], far, fine)
            casts = np.flatnonzero(~seen & (far[field] > found.entry) & (lit[found.cell] > settings.hidden))
            cell, at = found.cell[casts], field[casts]
            middle = found.entry[casts] + found.thickness[casts] / 2.0
            # Detail that is smaller than the penumbra is not seen, however large the picture is.
            if light.kind == "SUN":
                blur = light.width * (far[at] - middle)
                across = view.pixel_size * view.width / size[0]
            else:
                blur = light.width * (far[at] - middle) / np.maximum(middle, view.near)
                across = view.pixel_size * view.width / size[0] * far[at]
            extent = np.maximum(fine[at], np.maximum(blur, 0.0) / settings.shadow_cutoff)
            pixels += np.bincount(cell, found.coverage[casts] * lit[cell] * (across / extent) ** 2, count)
            # A light that is close throws large shadows.
            larger = 1.0 if light.kind == "SUN" else far[at] / np.maximum(middle, view.near)
            np.maximum.at(feature, cell, cells.amounts.width[cell] * larger / extent)
    return Shadows(pixels, feature)


def seen_ground(camera: Camera, occluders: NDArray[np.float64] | None, height: float) -> NDArray[np.float64]:
    """Points (m, 3) that rays through the picture meet: polygons that hide plants, or else level ground.

    Parameters
    ----------
    camera : Camera
    occluders : (t, 3, 3) float64 or None
        Triangles, metres.
    height : float
        Of the level ground that is assumed where there are none, metres.
    """
    views = face_cameras(camera, GROUND // 2) if camera.kind == "PANO" else [camera]
    found = []
    for view in views:
        size = buffer_size(view, GROUND if len(views) == 1 else GROUND // 2)
        origins, directions = pixel_rays(view, *size)
        with np.errstate(divide="ignore", invalid="ignore"):
            level = (height - origins[:, 2]) / directions[:, 2]
        level = np.where(level > 0.0, level, np.inf)
        if occluders is not None and len(occluders):
            hit = occluder_depth(occluders, view, *size)
            level = np.where(np.isfinite(hit), hit, level)
        some = np.flatnonzero(level < camera.far)
        found.append(origins[some] + level[some, None] * directions[some])
    return np.concatenate(found)


def _fields(pixel: NDArray[np.integer], size: tuple[int, int]) -> tuple[NDArray[np.int64], int]:
    """Field (n,) of each pixel, and how many fields there are."""
    across, up = -(-size[0] // FIELD), -(-size[1] // FIELD)
    row, column = np.divmod(pixel.astype(np.int64), size[0])
    return (row // FIELD) * across + column // FIELD, across * up


def _receive(
    view: Camera,
    size: tuple[int, int],
    points: NDArray[np.float64],
    extent: NDArray[np.float64],
    far: NDArray[np.float64],
    fine: NDArray[np.float64],
) -> None:
    """Put points that receive light into the fields: how far away they are, and how fine the picture is there."""
    local = view.to_camera_space(points)
    left, right, bottom, top = view.window
    depth = local[:, 2]
    ahead = depth > view.near
    flat = local[:, :2] if view.kind == "ORTHO" else local[:, :2] / np.where(ahead, depth, 1.0)[:, None]
    place = (flat - [left, bottom]) / [right - left, top - bottom] * size
    some = np.flatnonzero(ahead & (place >= 0.0).all(axis=1) & (place < size).all(axis=1))
    column, row = place[some].astype(np.int64).T
    field, _ = _fields(row * size[0] + column, size)
    metres = depth[some] if view.kind == "ORTHO" else np.linalg.norm(local[some], axis=1)
    np.maximum.at(far, field, metres)
    np.minimum.at(fine, field, extent[some])
