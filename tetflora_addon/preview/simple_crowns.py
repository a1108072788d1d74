# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of which only the size is known, such as assets, as double cones or boxes for the viewport."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import origin_near
from .levels import as_shown
from .light_plants import MOST_PLANTS, Shapes

_SIDES = 6
_WIDEST = 0.4  # fraction of the crown's height at which it is widest
_SHADES = 0.5, 1.0  # of the lowest and the highest corner, by height
_TRUNK = 0.03  # radius of the trunk over that of the crown


def simple_crowns(
    matrices: NDArray[np.float64],
    size: tuple[float, float, float],
    colour: Sequence[float],
    boxes: bool = False,
    most: int = MOST_PLANTS,
) -> Shapes:
    """Plants of one size as crowns, stretched and turned as their places are.

    Parameters
    ----------
    matrices : (n, 4, 4) float64
        To world space.
    size : tuple of float
        Radius of the crown, its base and its top above the ground, metres.
    colour : (3,) float
        Linear RGB.
    boxes : bool
        Edges of boxes instead of faces.
    most : int
        Plants that are shown; of more, every second, third and so on is.
    """
    corners, indices = _box(*size) if boxes else _crown(*size)
    of, origin = len(matrices), origin_near(matrices[:, :3, 3])
    shown = matrices[:: max(-(-of // most), 1)]
    positions = corners @ shown[:, :3, :3].transpose(0, 2, 1) + (shown[:, None, :3, 3] - origin)
    shade = np.interp(corners[:, 2], [0.0, size[2]], _SHADES)
    colours = as_shown(np.clip(np.asarray(colour) * shade[:, None], 0.0, 1.0))
    every = indices[None] + len(corners) * np.arange(len(shown))[:, None, None]
    return Shapes(
        positions.reshape(-1, 3).astype(np.float32),
        np.tile(colours, (len(shown), 1)).astype(np.float32),
        every.reshape(-1, indices.shape[1]).astype(np.int32),
        len(shown),
        of,
        origin,
    )


def joined(parts: Sequence[Shapes]) -> Shapes:
    """Shapes of the same kind, at least one, as one."""
    origin = parts[0].origin
    firsts = np.cumsum([0, *(len(part.positions) for part in parts)]).tolist()
    return Shapes(
        np.concatenate([(part.positions + (part.origin - origin)).astype(np.float32) for part in parts]),
        np.concatenate([part.colours for part in parts]),
        np.concatenate([part.indices + np.int32(first) for part, first in zip(parts, firsts, strict=False)]),
        sum(part.plants for part in parts),
        sum(part.of for part in parts),
        origin,
    )


def _crown(radius: float, base: float, top: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners (v, 3) and triangles (t, 3): a crown from its lowest corner over a ring to its highest, and a trunk."""
    angle = np.arange(_SIDES) * 2.0 * np.pi / _SIDES
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + base + _WIDEST * (top - base)], axis=1)
    foot = np.array([[-1.0, -0.6, 0.0], [1.0, -0.6, 0.0], [0.0, 1.0, 0.0]]) * _TRUNK * radius
    corners = np.concatenate([[[0.0, 0.0, base], [0.0, 0.0, top]], ring, foot])
    i = np.arange(_SIDES)
    j = (i + 1) % _SIDES
    middle, trunk = 1, 2 + _SIDES
    lower = np.stack([0 * i, 2 + j, 2 + i], axis=1)
    upper = np.stack([2 + i, 2 + j, 0 * i + 1], axis=1)
    stem = np.array([(trunk, trunk + 1, middle), (trunk + 1, trunk + 2, middle), (trunk + 2, trunk, middle)])
    return corners, np.concatenate([lower, upper, stem])


def _box(radius: float, base: float, top: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners (8, 3) and edges (12, 2) of the box around a crown."""
    corners = [(x * radius, y * radius, z) for z in (base, top) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    edges = [(i, (i + 1) % 4) for i in range(4)]
    edges += [(a + 4, b + 4) for a, b in edges] + [(i, i + 4) for i in range(4)]
    return np.array(corners, np.float64), np.array(edges)
