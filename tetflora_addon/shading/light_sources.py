# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light as it would arrive with nothing in its way: from lamps to points, and from the sky by direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..refinement.light_views import Light
from .light_directions import DIRECTIONS, HARMONICS, harmonics, nearest_direction

#: Points on an area light along the longer and the shorter of its sides.
AREA_POINTS = 3
#: Points (evenly spread) by which the sky is read.
SKY_POINTS = 1 << 14
#: Share of a spot's cosine range over which it fades at least, as in Cycles: none has an edge without width.
_LEAST_BLEND = 1e-3


def split_areas(lights: tuple[Light, ...]) -> list[Light]:
    """Lights with each area as a few points of it, the same every time; colours add up."""
    made: list[Light] = []
    for light in lights:
        if light.kind != "AREA":
            made.append(light)
            continue
        across, along = _disk_points() if light.ellipse else _grid_points(light.span)
        for x, y in zip(across, along, strict=True):
            position = light.position + x * light.span[0] + y * light.span[1]
            made.append(replace(light, position=position, colour=light.colour / len(across)))
    return made


def _grid_points(span: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middles of equal parts of a rectangle, in half edges from its middle."""
    length = np.linalg.norm(span, axis=1)
    counts = np.clip(np.ceil(AREA_POINTS * length / max(length.max(), 1e-12)), 1, AREA_POINTS).astype(int)
    x, y = ((2 * np.arange(n) + 1) / n - 1.0 for n in counts)
    return np.repeat(x, len(y)), np.tile(y, len(x))


def _disk_points() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points that stand for equal parts of a disk (Vogel, "A better way to construct the sunflower head", 1979)."""
    index = np.arange(AREA_POINTS**2) + 0.5
    radius, turn = np.sqrt(index / len(index)), np.pi * (3.0 - np.sqrt(5.0)) * index
    return radius * np.cos(turn), radius * np.sin(turn)


def arriving(light: Light, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Light at points with nothing in between.

    Parameters
    ----------
    light : Light
        An area counts as the single point in its middle, see `split_areas`.
    points : (m, 3) float64
        Metres.

    Returns
    -------
    towards : (m, 3) float64
        Unit vectors to the light.
    irradiance : (m, 3) float64
        W/m² on a surface that faces the light, linear RGB.
    """
    if light.kind == "SUN":
        return np.tile(-light.direction, (len(points), 1)), np.tile(light.colour, (len(points), 1))
    away = light.position - points
    distance = np.linalg.norm(away, axis=1)
    # No nearer than the lamp's own surface.
    distance = np.maximum(distance, max(light.width / 2.0 if light.kind != "AREA" else 0.0, 1e-6))
    towards = away / distance[:, None]
    ahead = -(towards @ light.direction)
    falloff = 1.0 / distance**2
    if light.kind == "AREA":
        falloff = falloff * np.maximum(ahead, 0.0)
    elif light.kind == "SPOT":
        edge = np.cos(light.angle)
        share = np.clip((ahead - edge) / max((1.0 - edge) * light.blend, _LEAST_BLEND), 0.0, 1.0)
        falloff = falloff * share * share * (3.0 - 2.0 * share)
    return towards, falloff[:, None] * light.colour


@dataclass(frozen=True)
class World:
    """The sky, cut into what is nearest to each of `DIRECTIONS`.

    Attributes
    ----------
    parts : (24, 9, 3) float64
        Radiance of each part by harmonic and colour: their sum is the whole sky's, and a part that is hidden is left
        out of it.
    """

    parts: NDArray[np.float64]

    @classmethod
    def of(cls, radiance: Callable[[NDArray[np.float64]], ArrayLike]) -> World:
        """A sky whose radiance (m, 3) in unit directions (m, 3) is known."""
        index = np.arange(SKY_POINTS) + 0.5
        z, turn = 1.0 - 2.0 * index / SKY_POINTS, np.pi * (3.0 - np.sqrt(5.0)) * index
        level = np.sqrt(1.0 - z * z)
        towards = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)
        seen = np.broadcast_to(np.asarray(radiance(towards), np.float64), (SKY_POINTS, 3)) * (4.0 * np.pi / SKY_POINTS)
        part, basis = nearest_direction(towards), harmonics(towards)
        parts = np.zeros((len(DIRECTIONS), HARMONICS, 3))
        for k in range(HARMONICS):
            for channel in range(3):
                parts[:, k, channel] = np.bincount(part, basis[:, k] * seen[:, channel], len(DIRECTIONS))
        return cls(parts)

    @classmethod
    def plain(cls, colour: ArrayLike) -> World:
        """A sky of the same radiance (3,) everywhere."""
        return cls.of(lambda towards: np.asarray(colour, np.float64))

    @property
    def dark(self) -> bool:
        """Whether no light comes from it."""
        return not self.parts[:, 0].any()
