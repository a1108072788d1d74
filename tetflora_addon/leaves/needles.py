# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Needles on a shoot: brushes, flat sprays, bundles of two to five.

Fewer and broader ones from afar, then all of them, flat, and prisms with a bend up close.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..parameters import limited
from .surfaces import VARIANTS, LeafSurface, joined, surface, tube, variant_offsets

_GOLDEN_ANGLE = np.radians(137.508)
#: What is not seen of the gaps between needles, of their distance along the shoot.
_GAP = 0.6
#: Error from which on there are fewer needles, needles are flat, and prisms have three sides.
SPARSE, FLAT, _THREE = 0.05, 0.004, 0.0012
#: One of so many needles stands for them all where there are fewer; what is not seen of the gaps then.
_OF, _SPARSE_GAP = 3, 2.4
#: Radius of shoots over that of needles, and of both at their ends.
_TAPER = 0.55
#: Places along a needle and its widths there, for errors above the first number.
_PROFILES = (
    (SPARSE, (0.0, 1.0), (1.0, 0.0)),
    (FLAT, (0.0, 0.35, 1.0), (0.55, 1.0, 0.0)),
    (_THREE, (0.0, 0.45, 0.88, 1.0), (0.5, 1.0, 0.8, 0.0)),
    (0.0, (0.0, 0.3, 0.6, 0.88, 1.0), (0.5, 0.95, 1.0, 0.7, 0.0)),
)


@dataclass(frozen=True)
class Needles:
    """Needles around one shoot or several; lengths are fractions of the whole."""

    needles: int = limited(100, 4, 400, "needles, all together")
    bundle: int = limited(1, 1, 5, "needles that stand together: 2, 3 or 5 in pines")
    length: float = limited(0.16, 0.01, 1, "length of a needle")
    thickness: float = limited(0.012, 0.001, 0.1, "thickness of a needle before it is given the area of the far form")
    angle: float = limited(50.0, 0, 120, "angle between shoot and needle at the base of the shoot, degrees")
    angle_tip: float = limited(25.0, 0, 120, "the same at its tip")
    flat: float = limited(0.3, 0, 1, "0: needles all around the shoot, 1: in one plane")
    bend: float = limited(0.12, -0.5, 0.5, "how far needles bend toward the tip of the shoot, fraction of their length")
    shoot: float = limited(0.9, 0.01, 1, "length of a shoot that bears them")
    shoots: int = limited(1, 1, 12, "shoots, spread as a fan")
    spread: float = limited(0.0, 0, 180, "angle between the outer shoots of a fan, degrees")
    lift: float = limited(0.0, 0, 1, "how far shoots of a fan stand out of its plane in turns")
    stem: float = limited(0.016, 0.001, 0.1, "thickness of a shoot")
    turn: float = limited(0.0, -180, 180, "turn of the whole about its axis, degrees")

    @property
    def gap(self) -> float:
        """Error of a level that has them all."""
        return _GAP * self.shoot * self.shoots / self.needles


def needle_surface(needles: Needles, tolerance: float, factor: float = 1.0) -> LeafSurface:
    """Needles within a tolerance, in units of the whole leaf's length; all are thicker by a factor."""
    parts = []
    step = needles.spread / max(needles.shoots - 1, 1)
    for i in range(needles.shoots):
        turn = np.radians(step * (i - (needles.shoots - 1) / 2.0))
        lift = needles.lift * (1 if i % 2 else -1) if needles.shoots > 1 else 0.0
        along = np.array([np.sin(turn), np.cos(turn), lift]) / np.sqrt(1.0 + lift**2)
        across = np.array([np.cos(turn), -np.sin(turn), 0.0])
        frame = np.stack([across, along, np.cross(across, along)], axis=1)
        parts.append(_shoot(needles, i, tolerance, factor).moved(frame, np.zeros(3)))
    error = needles.gap * (_SPARSE_GAP if tolerance > SPARSE else 1.0)
    error = error if tolerance > FLAT else min(tolerance, error)
    return replace(joined(parts), error=error)


def _shoot(needles: Needles, number: int, tolerance: float, factor: float) -> LeafSurface:
    """One shoot along y with its needles."""
    count = max(needles.needles // needles.shoots, needles.bundle)
    i = np.arange(0, count, _OF if tolerance > SPARSE else 1)
    node, within = i // needles.bundle, i % needles.bundle
    last = max((count - 1) // needles.bundle, 1)
    place = (node + 0.5 + 0.4 * np.stack([np.sin(i * 7.1 + 3.0 * k + number) for k in range(VARIANTS)])) / (last + 1)
    angle = np.radians(needles.angle + (needles.angle_tip - needles.angle) * place)
    angle = angle * (1.0 + 0.18 * np.sin(5.3 * i + 1.7 * np.arange(VARIANTS)[:, None]))
    turn = node * _GOLDEN_ANGLE + 1.3 * variant_offsets(3 + number)[:, None] + 0.25 * np.sin(11.7 * i)
    side, up = np.cos(turn), np.sin(turn) * (1.0 - needles.flat)
    size = np.maximum(np.hypot(side, up), 1e-9)
    zero = np.zeros_like(side)
    out = np.stack([side / size, zero, up / size], axis=2)
    if needles.bundle > 1:  # needles of a bundle lean apart
        apart = 2.0 * np.pi * within / needles.bundle
        other = np.stack([-out[..., 2], zero, out[..., 0]], axis=2)
        out = out + 0.3 * (np.cos(apart)[:, None] * other)
        angle = angle + 0.12 * np.sin(apart)
    axis = np.array([0.0, 1.0, 0.0])
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    direction = cos * axis + sin * out
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    length = needles.length * (1.0 + 0.15 * np.sin(3.1 * i + np.arange(VARIANTS)[:, None]))
    length = length * np.clip(0.75 + 1.5 * np.minimum(place, 1.15 - place), 0.0, 1.0)
    start = place[..., None] * needles.shoot * axis
    toward = axis - (direction * axis).sum(-1, keepdims=True) * direction
    made = [_needles(start, direction, toward, length, needles, tolerance, factor)]
    rings = 2 if tolerance > FLAT else 5
    stem = np.zeros((VARIANTS, rings, 3))
    stem[..., 1] = np.linspace(0.0, needles.shoot, rings)
    radius = needles.stem / 2.0 * np.linspace(1.0, _TAPER, rings)
    made.append(tube(stem, radius, 3 if tolerance > _THREE else 5))
    made[-1].uv[:, 1] -= 1.0  # below that of needles, as petioles
    return joined(made)


def _needles(
    start: Floats, direction: Floats, toward: Floats, length: Floats, needles: Needles, tolerance: float, factor: float
) -> LeafSurface:
    """Needles from starts (k, n, 3) in directions, of lengths (k, n), bent toward vectors (k, n, 3)."""
    flat, three = tolerance > FLAT, tolerance > _THREE
    along, wide = next((np.array(along), np.array(wide)) for error, along, wide in _PROFILES if tolerance > error)
    rings, (variants, count) = len(along), length.shape
    reach = length[..., None, None]
    axis = start[:, :, None] + reach * (
        along[:, None] * direction[:, :, None] + needles.bend * (along**2)[:, None] * toward[:, :, None]
    )
    across = np.cross(direction, toward + 1e-3)
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-9)
    other = np.cross(across, direction)
    radius = factor * needles.thickness / 2.0 * wide
    sides = 2 if flat else 3 if three else 4
    turn = np.pi * np.arange(2) if flat else 2 * np.pi * (np.arange(sides) + 0.5) / sides
    ring = np.cos(turn)[:, None] * across[:, :, None, :] + 0.8 * np.sin(turn)[:, None] * other[:, :, None, :]
    body = axis[:, :, :-1, None] + radius[:-1, None, None] * ring[:, :, None]
    points = np.concatenate([body.reshape(variants, count, -1, 3), axis[:, :, -1:]], axis=2)
    each, tip = points.shape[2], points.shape[2] - 1
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(1 if flat else sides), indexing="ij")
    corners = [i * sides + j, i * sides + (j + 1) % sides, (i + 1) * sides + (j + 1) % sides, (i + 1) * sides + j]
    quads = np.minimum(np.stack(corners, axis=-1).reshape(-1, 4), tip)
    faces = (quads + np.arange(count)[:, None, None] * each).reshape(-1, 4)
    v = np.append(np.repeat(along[:-1], sides), 1.0)
    u = np.append(np.tile(0.5 + 0.5 * np.cos(turn), rings - 1), 0.5)
    uv = np.tile(np.stack([u, v], axis=1), (count, 1))
    return surface(points.reshape(variants, -1, 3), faces, uv, solid=not flat)
