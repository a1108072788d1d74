# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Spines on fleshy leaves up close: they grow from areoles that are spread evenly over closed parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_ANGLE, cross, perpendicular
from .models import LeafModel, Spines

#: What the colour of the leaf is times that of spines, straw on green, and of the felt on areoles.
_SPINE, _FELT = (3.6, 1.9, 2.7), (1.7, 0.85, 0.9)
#: Height and radius of an areole over the distance of areoles, sides of it, and of a spine.
_CUSHION, _SIDES, _EDGES = (0.07, 0.11), 5, 3
#: Part at the base of the leaf that is bare.
_BARE = 0.08


def spined(model: LeafModel, spines: Spines, part: NDArray[np.int64]) -> tuple[LeafModel, NDArray[np.float32]]:
    """A model with spines on it.

    Parameters
    ----------
    model : LeafModel
    spines : Spines
    part : (f,) int64
        Its `bodies.closed_parts`, on which spines stand.

    Returns
    -------
    LeafModel
        Spines and areoles come after its own faces.
    tint : (f, 3) float32
        What the colour of the leaf is times that of each face.
    """
    place, normal = _areoles(model, part, spines.distance)
    height, wide = (spines.distance * size for size in _CUSHION)
    x = perpendicular(normal)
    felt = _pyramids(place - 0.5 * height * normal, place + height * normal, x, np.cross(normal, x), wide, _SIDES)
    # A few spines of each areole, evenly around it: each a little longer or shorter than the others.
    turn = GOLDEN_ANGLE * np.arange(len(place) * spines.number)
    owner = np.repeat(np.arange(len(place)), spines.number)
    lean = np.radians(spines.lean) * (0.7 + 0.6 * (0.381966 * np.arange(len(owner)) % 1.0))
    side = np.cos(turn)[:, None] * x[owner] + np.sin(turn)[:, None] * np.cross(normal, x)[owner]
    along = np.cos(lean)[:, None] * normal[owner] + np.sin(lean)[:, None] * side
    length = spines.length * (0.65 + 0.45 * (0.7548777 * np.arange(len(owner)) % 1.0))
    across = perpendicular(along)
    root = place[owner]
    needles = _pyramids(
        root, root + length[:, None] * along, across, cross(along, across), spines.thickness / 2, _EDGES
    )
    made, tints = model, [np.ones((model.polygons, 3))]
    for points, colour in ((felt, _FELT), (needles, _SPINE)):
        far = np.linalg.norm(points, axis=-1, keepdims=True)  # none reaches farther than the model, as bounds know it
        made = _with_triangles(made, points * np.minimum(model.reach / np.maximum(far, 1e-300), 1.0))
        tints.append(np.tile(colour, (len(points), 1)))
    return made, np.concatenate(tints).astype(np.float32)


def _areoles(
    body: LeafModel, part: NDArray[np.int64], distance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places (n, 3) on a body at least a distance apart, and its unit normals (n, 3) there."""
    first = body.corner_verts[body.face_offsets[:-1]]
    corners = np.add.reduceat(body.positions[body.corner_verts], body.face_offsets[:-1])
    middle = corners / np.diff(body.face_offsets)[:, None]
    area = np.linalg.norm(body.face_vectors, axis=1)
    own = np.flatnonzero((part >= 0) & (area > 0) & (body.positions[first, 1] > _BARE))
    # From face to face far away from it, so that places are dense soon; each takes those around it away.
    own = own[np.argsort(0.6180339887 * np.arange(len(own)) % 1.0)]
    chosen: list[int] = []
    free = np.ones(len(own), bool)
    while free.any():
        one = int(np.argmax(free))
        chosen.append(int(own[one]))
        free &= np.linalg.norm(middle[own] - middle[own[one]], axis=1) >= distance
    return middle[chosen], body.face_vectors[chosen] / area[chosen, None]


def _pyramids(
    base: NDArray[np.float64],
    tip: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    radius: float,
    sides: int,
) -> NDArray[np.float64]:
    """Sides (n * sides, 3, 3) of pyramids from bases to tips (n, 3), around axes perpendicular to x and y (n, 3)."""
    angle = 2.0 * np.pi * np.arange(sides + 1) / sides
    ring = base[:, None] + radius * (np.cos(angle)[:, None] * x[:, None] + np.sin(angle)[:, None] * y[:, None])
    top = np.broadcast_to(tip[:, None], ring[:, 1:].shape)
    return np.stack([ring[:, :-1], ring[:, 1:], top], axis=2).reshape(-1, 3, 3)


def _with_triangles(model: LeafModel, points: NDArray[np.float64]) -> LeafModel:
    """A model with triangles (t, 3, 3) more, whose texture lies below that of leaves, as that of stalks."""
    corners = len(model.positions) + np.arange(3 * len(points))
    ends = model.face_offsets[-1] + 3 * np.arange(1, len(points) + 1)
    return replace(
        model,
        positions=np.concatenate([model.positions, points.reshape(-1, 3)]),
        corner_verts=np.append(model.corner_verts, corners).astype(np.int32),
        face_offsets=np.append(model.face_offsets, ends).astype(np.int32),
        uv=np.concatenate([model.uv, np.tile([[0.5, -0.5]], (3 * len(points), 1))]).astype(np.float32),
    )
