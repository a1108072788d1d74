# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Branches drawn by hand as lines of even segments with frames, from which rows of the table are made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Integers, perpendicular
from ..errors import SpeciesError
from ..species.skeletons import DrawnBranches

MAX_SEGMENTS = 24
"""Straight pieces of a drawn branch at most; more are made even."""
_FINER = 3  # segments for one that is drawn: even ones must not cut the corners of uneven ones
MAX_DRAWN = 1000
"""Drawn branches of a plant at most: higher orders are for the computer."""


@dataclass(frozen=True)
class DrawnLines:
    """Drawn branches as arrays of one width, meters in the plant's space; parents come before children."""

    order: Integers  # (b,)
    segments: Integers  # (b,)
    knots: Floats  # (b, MAX_SEGMENTS + 1, 3): evenly spaced along the branch; beyond its segments the last one again
    radii: Floats  # (b, MAX_SEGMENTS + 1)
    #: (b, MAX_SEGMENTS, 3, 3): columns are local axes; the third leads along the segment, the others are carried along
    #: without twist.
    frames: Floats
    #: length, radius and outward, (b,): of the whole line; at its base; and where between inside and outside of the
    #: crown it leaves its limb.
    length: Floats
    radius: Floats
    outward: Floats


def drawn_lines(branches: DrawnBranches) -> DrawnLines:
    """Drawn branches with even segments, as many as they have themselves, at most `MAX_SEGMENTS`.

    Raises
    ------
    SpeciesError
        More than `MAX_DRAWN` branches.
    """
    number = len(branches)
    if number > MAX_DRAWN:
        raise SpeciesError(
            f"The form has {number:,} branches, the limit is {MAX_DRAWN:,}; "
            "remove the thinnest ones, the species grows them"
        )
    segments = np.clip(_FINER * (np.diff(branches.first) - 1), 1, MAX_SEGMENTS)
    # Fractions of the length at which knots lie, one row a branch; the last one is repeated.
    wanted = np.minimum(np.arange(MAX_SEGMENTS + 1) / segments[:, None], 1.0)
    # One rising scale for all branches: that of branch b runs from 2 b to 2 b + 1.
    place = 2 * branches.owner + branches.arc / np.maximum(branches.length, 1e-300)[branches.owner]
    at = (2 * np.arange(number)[:, None] + wanted).ravel()
    values = [np.interp(at, place, v).reshape(number, -1) for v in (*branches.knots.T, branches.radius)]
    knots, radii = np.stack(values[:3], axis=-1), np.maximum(values[3], 1e-6)
    chords = np.linalg.norm(np.diff(knots, axis=1), axis=2).sum(axis=1)
    return DrawnLines(
        branches.order.astype(np.int64), segments, knots, radii, _frames(knots, segments), chords, radii[:, 0],
        np.asarray(branches.outward, dtype=np.float64),
    )  # fmt: skip


def _frames(knots: Floats, segments: Integers) -> Floats:
    """Frames along lines, each turned from the one before by the least rotation (Bishop, 1975)."""
    step = np.diff(knots, axis=1)
    size = np.linalg.norm(step, axis=2, keepdims=True)
    last = np.minimum(np.arange(step.shape[1]), segments[:, None] - 1)[..., None]
    direction = np.take_along_axis(step / np.maximum(size, 1e-12), last, axis=1)
    z = np.where(np.linalg.norm(direction[:, 0], axis=1, keepdims=True) > 0.5, direction[:, 0], [0.0, 0.0, 1.0])
    x = perpendicular(z)
    out = np.empty((*direction.shape, 3))
    for s in range(direction.shape[1]):
        ahead = direction[:, s]
        z = np.where(np.linalg.norm(ahead, axis=1, keepdims=True) > 0.5, ahead, z)
        x = x - (x * z).sum(axis=1, keepdims=True) * z
        lost = np.linalg.norm(x, axis=1) < 1e-6  # a line that turns back upon itself
        x[lost] = np.cross(z[lost], [0.3, 0.5, 0.8])
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        out[:, s] = np.stack([x, np.cross(z, x), z], axis=2)
    return out
