# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Twigs thinner than a pixel: one triangle from base to tip each, or a ribbon along those that bend.

It has half of the surface of the twig's tube, turned about its line at random: over many twigs the area that is seen
from any direction is that of the tubes, whose far side is never seen.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Integers, spread, unit
from ..buffers import MeshBuffers, concatenate_buffers
from ..compiled.flora import Flora
from ..growth.axes import Axes
from ..growth.branches import Branches
from ..growth.colors import branch_colors
from ..growth.growth import WholeBranches, radius_at
from ..growth.hashing import Draw, uniform
from ..growth.wind import moment
from .pieces import Pieces, wood_areas
from .tubes import base_girth, wood_attributes


def twig_buffers(
    flora: Flora, whole: WholeBranches, wider: Floats | None = None, parts: Integers | None = None
) -> MeshBuffers | None:
    """Triangles and ribbons in the place of tubes.

    Parameters
    ----------
    flora : Flora
    whole : WholeBranches of n
        Of any rows.
    wider : (n,) float64, optional
        How many times as wide each is: it stands for so many twigs.
    parts : (n,) int64, optional
        Quadrilaterals that ribbons consist of; 1, or without it, for triangles.

    Returns
    -------
    MeshBuffers or None
        Attributes as of `tubes.tube_buffers`; None without branches.
    """
    wider = np.ones(len(whole)) if wider is None else wider
    bent = np.zeros(len(whole), bool) if parts is None else parts > 1
    straight, some = np.flatnonzero(~bent), np.flatnonzero(bent)
    made = [_triangles(flora, whole.take(straight), wider[straight])] if len(straight) else []
    if len(some):
        made.append(_ribbons(flora, whole.take(some), wider[some], parts[some]))
    return concatenate_buffers(made)


def _triangles(flora: Flora, whole: WholeBranches, times: Floats) -> MeshBuffers:
    """A triangle from base to tip of each of branches (n,), so many times (n,) as wide."""
    branches, number = whole.branches, len(whole)
    base, tip = _ends(whole.lines)
    along = tip - base
    length = np.linalg.norm(along, axis=1)
    direction = unit(along)
    across = _turned(branches, branches.frame)
    across = unit(across - (across * direction).sum(axis=1, keepdims=True) * direction)
    # A triangle is half as wide on average as at its base.
    none = np.zeros(number)
    surface = wood_areas(flora, Pieces(branches, none, none + 1.0, base, tip))
    half = 0.5 * (times * surface / np.maximum(length, 1e-12))[:, None] * across
    corners = np.stack([base - half, base + half, tip], axis=1)
    velocity = None
    if whole.lines.later is not None:
        then = _ends(whole.lines.later)
        speed = [(end - now) / moment(flora.rows) for end, now in zip(then, (base, tip), strict=True)]
        velocity = np.stack([speed[0], speed[0], speed[1]], axis=1).reshape(-1, 3)
    each = np.arange(3 * number, dtype=np.int32)
    uv = np.zeros((number, 3, 2))
    uv[:, 1, 0], uv[:, 2, 0], uv[:, 2, 1] = 1.0, 0.5, _height(branches)
    edges = np.stack([each, each + np.tile(np.array([1, 1, -2], np.int32), number)], axis=1)
    topology = edges, each, each, 3 * np.arange(number + 1)
    corners, uv = corners.reshape(-1, 3), uv.reshape(-1, 2)
    return _buffers(flora, branches, np.arange(number), corners, velocity, uv, topology)


def _ribbons(flora: Flora, whole: WholeBranches, times: Floats, parts: Integers) -> MeshBuffers:
    """A chain of quadrilaterals (n,) along each of branches (n,), so many times (n,) as wide, as girths taper."""
    branches, lines = whole.branches, whole.lines
    ring, number = spread(parts + 1)
    place = number / parts[ring]
    middle, frame = lines.at(ring, place)
    own = branches.take(ring)
    sides = flora.rows["sides"][own.row]
    around = times[ring] * sides * np.sin(np.pi / sides) * radius_at(flora.rows, own, place)
    half = 0.5 * around[:, None] * _turned(own, frame)
    corners = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    velocity = None
    if lines.later is not None:
        velocity = np.repeat((lines.later.at(ring, place)[0] - middle) / moment(flora.rows), 2, axis=0)
    # Each ring has an edge of its own; behind all but the last are two more, and a face.
    first = np.flatnonzero(number < parts[ring])
    low = 2 * first
    quads = np.stack([low, low + 1, low + 3, low + 2], axis=1)
    rungs, beside = len(ring), np.arange(len(first))
    edges = np.concatenate([np.arange(2 * rungs).reshape(-1, 2), quads[:, [0, 3]], quads[:, [1, 2]]])
    left, right = rungs + beside, rungs + len(first) + beside
    border = np.stack([first, right, first + 1, left], axis=1)
    high = place * _height(branches)[ring]
    across = np.array([0.0, 1.0, 1.0, 0.0])[None] + np.zeros((len(first), 1))
    uv = np.stack([across, np.stack([high[first], high[first], high[first + 1], high[first + 1]], axis=1)], axis=2)
    topology = edges, quads.ravel(), border.ravel(), 4 * np.arange(len(first) + 1)
    return _buffers(flora, branches, ring[first], corners, velocity, uv.reshape(-1, 2), topology)


def _buffers(
    flora: Flora,
    branches: Branches,
    owner: Integers,
    corners: Floats,
    velocity: Floats | None,
    uv: Floats,
    topology: tuple[Integers, ...],
) -> MeshBuffers:
    """Buffers of faces (f,) of branches (f,), with vertices (v, 3) that move at velocities (v, 3).

    ``topology`` are the four arrays of `MeshBuffers`, in their order.
    """
    color, girth = branch_colors(flora.rows, branches.row, branches.key), base_girth(branches)
    light = (None if of is None else of.astype(np.float32) for of in (uv, color[owner], girth[owner], velocity))
    whole = (of.astype(np.int32) for of in topology)
    return MeshBuffers(corners.astype(np.float32), *whole, wood_attributes(*light), smooth=True)


def _turned(branches: Branches, frame: Floats) -> Floats:
    """Unit vectors (n, 3) across lines with frames (n, 3, 3), turned about these at random."""
    turn = 2.0 * np.pi * uniform(branches.key, Draw.TWIG_TURN)[:, None]
    return np.cos(turn) * frame[:, :, 0] + np.sin(turn) * frame[:, :, 1]


def _height(branches: Branches) -> Floats:
    """Length (n,) of the texture along branches, in girths."""
    return branches.length / np.maximum(base_girth(branches), 1e-9)


def _ends(lines: Axes) -> tuple[Floats, Floats]:
    """First and last knots (n, 3) of lines."""
    every = np.arange(len(lines.segments))
    return lines.knot(every, np.zeros(len(every), np.int64)), lines.knot(every, lines.segments)
