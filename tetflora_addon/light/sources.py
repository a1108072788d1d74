# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Unblocked light from lamps to points and from the sky by direction, and the buffers in which lights see a scene."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import GOLDEN_ANGLE, Floats, spiral
from ..camera.camera import Camera, to_eye
from ..refinement.lights import Light, image_size, lamp_views, light_views
from .buffers import LightBuffer
from .receivers import MediumCells, SurfaceElements
from .scattering import DIRECTIONS, HARMONICS, harmonics

#: Maximum number of points on an area light along each of its sides.
AREA_POINTS = 3
#: Points (evenly spread) at which the sky is sampled.
SKY_POINTS = 1 << 14
#: Limits of the longer side of a lamp's buffer, pixels.
LAMP_PIXELS = (64, 2048)
#: Minimum fraction of a spot's cosine range over which it fades, as in Cycles.
_LEAST_BLEND = 1e-3


def split_areas(lights: tuple[Light, ...]) -> list[Light]:
    """Lights with each area as a few points of it, the same every time; colors add up."""
    split: list[Light] = []
    for light in lights:
        if light.kind != "AREA":
            split.append(light)
            continue
        across, along = _disk_points() if light.ellipse else _grid_points(light.span)
        for x, y in zip(across, along, strict=True):
            position = light.position + x * light.span[0] + y * light.span[1]
            split.append(replace(light, position=position, color=light.color / len(across)))
    return split


def _grid_points(span: Floats) -> tuple[Floats, Floats]:
    """Middles of equal parts of a rectangle, in half edges from its middle."""
    length = np.linalg.norm(span, axis=1)
    counts = np.clip(np.ceil(AREA_POINTS * length / max(length.max(), 1e-12)), 1, AREA_POINTS).astype(int)
    x, y = ((2 * np.arange(n) + 1) / n - 1.0 for n in counts)
    return np.repeat(x, len(y)), np.tile(y, len(x))


def _disk_points() -> tuple[Floats, Floats]:
    """Points that stand for equal parts of a disk (Vogel, "A better way to construct the sunflower head", 1979)."""
    index = np.arange(AREA_POINTS**2) + 0.5
    radius, turn = np.sqrt(index / len(index)), GOLDEN_ANGLE * index
    return radius * np.cos(turn), radius * np.sin(turn)


def arriving(light: Light, points: Floats) -> tuple[Floats, Floats]:
    """Unblocked light at points.

    Parameters
    ----------
    light : Light
        An area counts as the point in its middle, see `split_areas`.
    points : (m, 3) float64
        Meters.

    Returns
    -------
    toward : (m, 3) float64
        Unit vectors to the light.
    irradiance : (m, 3) float64
        W/m² on a surface that faces the light, linear RGB.
    """
    if light.kind == "SUN":
        return np.tile(-light.direction, (len(points), 1)), np.tile(light.color, (len(points), 1))
    away = light.position - points
    distance = np.linalg.norm(away, axis=1)
    # No nearer than the lamp's own surface.
    distance = np.maximum(distance, max(light.width / 2.0 if light.kind != "AREA" else 0.0, 1e-6))
    toward = away / distance[:, None]
    ahead = -(toward @ light.direction)
    falloff = 1.0 / distance**2
    if light.kind == "AREA":
        falloff = falloff * np.maximum(ahead, 0.0)
    elif light.kind == "SPOT":
        edge = np.cos(light.angle)
        blend = np.clip((ahead - edge) / max((1.0 - edge) * light.blend, _LEAST_BLEND), 0.0, 1.0)
        falloff = falloff * blend * blend * (3.0 - 2.0 * blend)
    return toward, falloff[:, None] * light.color


@dataclass(frozen=True)
class World:
    """The sky, cut into what is nearest to each of `DIRECTIONS`."""

    #: (24, 9, 3): radiance of each part by harmonic and color; the sum over the visible parts is that of the sky.
    parts: Floats

    @classmethod
    def of(cls, radiance: Callable[[Floats], ArrayLike]) -> Self:
        """A sky whose radiance (m, 3) in unit directions (m, 3) is known."""
        index = np.arange(SKY_POINTS) + 0.5
        toward = spiral(1.0 - 2.0 * index / SKY_POINTS, index)
        seen = np.broadcast_to(np.asarray(radiance(toward), np.float64), (SKY_POINTS, 3)) * (4.0 * np.pi / SKY_POINTS)
        part, basis = np.argmax(toward @ DIRECTIONS.T, axis=1), harmonics(toward)
        parts = np.zeros((len(DIRECTIONS), HARMONICS, 3))
        for k in range(HARMONICS):
            for channel in range(3):
                parts[:, k, channel] = np.bincount(part, basis[:, k] * seen[:, channel], len(DIRECTIONS))
        return cls(parts)

    @classmethod
    def plain(cls, color: ArrayLike) -> Self:
        """A sky of the same radiance (3,) everywhere."""
        return cls.of(lambda toward: np.asarray(color, np.float64))

    @property
    def dark(self) -> bool:
        """Whether no light comes from it."""
        return not self.parts[:, 0].any()


@dataclass(frozen=True)
class Near:
    """The surroundings of an eye (3,), which suns see in views of their own, by radii, the smallest first; meters."""

    eye: Floats
    radii: tuple[float, ...] = ()


def light_resolution(camera: Camera) -> int:
    """Longer side in pixels of a lamp's buffer: that of the image (paper: "of proportional size")."""
    return int(np.clip(max(camera.width, camera.height), *LAMP_PIXELS))


def buffers_of(
    light: Light, clouds: MediumCells, sheets: SurfaceElements, occluders: Floats, pixels: int, near: Near | None = None
) -> list[LightBuffer]:
    """Buffers, of so many pixels along, in which a light sees all in its way: one, six all around, or none.

    A sun has further ones before it for what is ``near``, with smaller pixels.
    """
    if not len(clouds):
        return []
    corners, sun = clouds.vertices.reshape(-1, 3), light.kind == "SUN"
    if sun:
        # Occluders affect how far the view reaches, not how wide it is.
        every = np.concatenate([corners, occluders.reshape(-1, 3)])
        views = light_views(light, clouds.vertices, every, pixels)
        views = [closer for view in views for closer in _closer(view, near)] + views if near else views
    else:
        views = lamp_views(light.position, corners, pixels)
    buffers = []
    for view in views:
        along = light.direction if sun else -to_eye(view, clouds.vertices.mean(axis=1))
        extinction = np.where(sheets.replaced, 0.0, clouds.extinction(along))
        buffers.append(LightBuffer(view, pixels, clouds.vertices, extinction, occluders, sheets.corners))
    return buffers


def _closer(view: Camera, near: Near) -> list[Camera]:
    """Parts of a sun's view around an eye."""
    left, right, bottom, top = view.window
    views = []
    x, y = (near.eye @ view.frame)[:2]
    for radius in near.radii:
        window = max(left, x - radius), min(right, x + radius), max(bottom, y - radius), min(top, y + radius)
        width, height = window[1] - window[0], window[3] - window[2]
        if min(width, height) > 0.0 and max(width, height) < 0.7 * max(right - left, top - bottom):
            columns, rows = image_size(width, height)
            views.append(replace(view, window=window, width=columns, height=rows))
    return views
