# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges of tetrahedra over an image, by what was decided about them, in the colors of the top view."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from tetflora_addon.refinement import decisions

#: Display colors, opacity included; what is rarer comes later, and on top.
COLORS = {"HIDDEN": (110, 115, 130, 110), "PROXY": (245, 140, 25, 150), "EXPLICIT": (20, 80, 215, 70)}
#: Tetrahedra that are smaller, in pixels, would hide the image under their lines.
LEAST = 10.0
_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_FINER = 3  # times as many pixels while lines are drawn


def draw_wires(picture: Path, camera: object, refinement: object) -> None:
    """Draw the edges of terminal tetrahedra that hold something over an image of a perspective camera.

    Parameters
    ----------
    picture : Path
        Is replaced.
    camera : Camera
    refinement : Refinement
    """
    decision = decisions.Decision
    shown = Image.open(picture).convert("RGBA")
    lines = Image.new("RGBA", (shown.width * _FINER, shown.height * _FINER))
    draw = ImageDraw.Draw(lines)
    tree, nodes = refinement.tree, refinement.nodes
    for name, color in COLORS.items():
        chosen = nodes[(refinement.decision == decision[name]) & tree.inside[nodes]]
        for line in (projected_edges(tree.vertices(chosen), camera) * lines.size).reshape(-1, 4).tolist():
            draw.line(line, fill=color, width=_FINER)
    lines = lines.resize(shown.size, Image.Resampling.BOX)
    Image.alpha_composite(shown, lines).convert("RGB").save(picture)


def projected_edges(vertices: NDArray[np.float64], camera: object) -> NDArray[np.float64]:
    """Edges of tetrahedra (n, 4, 3) that are large enough, from the left and from the top in fractions of the image.

    Returns
    -------
    (m, 2, 2) float64
        Ends of edges, cut off where they come nearer than the camera sees.
    """
    ends = camera.to_camera_space(vertices)[:, _EDGES]
    seen = (ends[..., 2] > camera.near).any(axis=2)
    owner = np.broadcast_to(np.arange(len(vertices))[:, None], seen.shape)[seen]
    a, b = ends[seen][:, 0], ends[seen][:, 1]
    a, b = _cut(a, b, camera.near), _cut(b, a, camera.near)
    left, right, bottom, top = camera.window
    flat = np.stack([a, b], axis=1)
    flat = flat[..., :2] / flat[..., 2:]
    flat = np.stack([(flat[..., 0] - left) / (right - left), (top - flat[..., 1]) / (top - bottom)], axis=2)
    spread = np.zeros(len(vertices))
    np.maximum.at(spread, owner, np.linalg.norm((flat[:, 1] - flat[:, 0]) * [camera.width, camera.height], axis=1))
    return flat[spread[owner] >= LEAST]


def _cut(point: NDArray[np.float64], other: NDArray[np.float64], near: float) -> NDArray[np.float64]:
    """Points (m, 3), moved toward the other ends of their edges as far as they are nearer than ``near``."""
    missing = np.maximum(near - point[:, 2], 0.0)
    fraction = np.divide(missing, other[:, 2] - point[:, 2], out=np.zeros(len(point)), where=missing > 0.0)
    return point + fraction[:, None] * (other - point)
