# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Twigs thinner than a pixel, among leaves that are real: one triangle from base to tip each.

It has half of the surface of the twig's tube, turned about its line at random: over many twigs the area that is seen
from any direction is that of the tubes, whose far side is never seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import unit
from ..buffers import MeshBuffers, concatenate_buffers
from ..compiled.flora import Flora
from ..growth.axes import Axes
from ..growth.colours import branch_colours
from ..growth.growth import WholeBranches
from ..growth.hashing import Draw, uniform
from ..growth.wind import moment
from .pieces import Pieces, wood_areas
from .tubes import base_girth


def twig_buffers(
    flora: Flora, whole: Sequence[WholeBranches], wider: Sequence[NDArray[np.float64]] | None = None
) -> MeshBuffers | None:
    """Triangles in the place of tubes.

    Parameters
    ----------
    flora : Flora
    whole : sequence of WholeBranches
        Of any rows.
    wider : sequence of (n,) float64, optional
        How many times as wide each triangle is: it stands for so many twigs.

    Returns
    -------
    MeshBuffers or None
        Attributes as of `tubes.tube_buffers`; None without branches.
    """
    wider = [np.ones(len(some)) for some in whole] if wider is None else wider
    some = zip(whole, wider, strict=True)
    return concatenate_buffers([_triangles(flora, own, times) for own, times in some if len(own)])


def _triangles(flora: Flora, whole: WholeBranches, times: NDArray[np.float64]) -> MeshBuffers:
    branches, number = whole.branches, len(whole)
    base, tip = _ends(whole.lines)
    along = tip - base
    length = np.linalg.norm(along, axis=1)
    turn = 2.0 * np.pi * uniform(branches.key, Draw.TWIG_TURN)[:, None]
    across = np.cos(turn) * branches.frame[:, :, 0] + np.sin(turn) * branches.frame[:, :, 1]
    direction = unit(along)
    across = unit(across - (across * direction).sum(axis=1, keepdims=True) * direction)
    # A triangle is half as wide on average as at its base.
    none = np.zeros(number)
    surface = wood_areas(flora, Pieces(branches, none, none + 1.0, base, tip))
    half = 0.5 * (times * surface / np.maximum(length, 1e-12))[:, None] * across
    corners = np.stack([base - half, base + half, tip], axis=1)
    motion = {}
    if whole.lines.later is not None:
        speed = [
            (then - now) / moment(flora.rows) for then, now in zip(_ends(whole.lines.later), (base, tip), strict=True)
        ]
        velocity = np.stack([speed[0], speed[0], speed[1]], axis=1).reshape(-1, 3)
        motion = {"velocity": ("POINT", velocity.astype(np.float32))}
    girth = base_girth(branches)
    high = branches.length / np.maximum(girth, 1e-9)
    uv = np.zeros((number, 3, 2), np.float32)
    uv[:, 1, 0], uv[:, 2, 0], uv[:, 2, 1] = 1.0, 0.5, high
    each = np.arange(3 * number, dtype=np.int32)
    return MeshBuffers(
        positions=corners.reshape(-1, 3).astype(np.float32),
        edge_verts=np.stack([each, each + np.tile(np.array([1, 1, -2], np.int32), number)], axis=1),
        corner_verts=each,
        corner_edges=each,
        face_offsets=np.arange(0, 3 * number + 1, 3, dtype=np.int32),
        attributes={
            "UVMap": ("CORNER", uv.reshape(-1, 2)),
            "tf_colour": ("FACE", branch_colours(flora.rows, branches.row, branches.key).astype(np.float32)),
            "tf_transmission": ("FACE", np.zeros(number, np.float32)),
            "tf_girth": ("FACE", girth.astype(np.float32)),
            **motion,
        },
        smooth=True,
    )


def _ends(lines: Axes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """First and last knots (n, 3) of lines."""
    every = np.arange(len(lines.segments))
    return lines.knot(every, np.zeros(len(every), np.int64)), lines.knot(every, lines.segments)
