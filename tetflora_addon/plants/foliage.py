# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves on branches: where each sits, which way it grows and faces, its size and colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .growth import Axes, Branches, turned
from .hashing import Draw, child_key, signed, uniform
from .rows import ranged
from .vectors import columns, cross, dot, gathered, unit

_LEAF_PATH = 1 << 32  # child indices of leaves start here, so that they never meet those of branches
_PLACE_JITTER = 0.4


@dataclass(frozen=True)
class Leaves:
    """Leaves as a structure of arrays.

    Attributes
    ----------
    branch : (n,) int64
        Index of the branch that bears the leaf.
    key : (n,) uint64
    position : (n, 3) float64
        Base of the leaf, metres.
    frame : (n, 3, 3) float64
        Columns: across, along the midrib, upper side; before it turns to the light.
    size : (n,) float64
        Metres by which the leaf model is scaled.
    """

    branch: NDArray[np.int64]
    key: NDArray[np.uint64]
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    size: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.key)


def leaf_keys(branches: Branches, owner: NDArray[np.int64], index: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Hash keys (m,) of leaves given by branch and index."""
    return child_key(branches.key[owner], index + _LEAF_PATH)


def leaf_places(
    rows: NDArray[np.void], branches: Branches, owner: NDArray, index: NDArray, counts: NDArray, key: NDArray[np.uint64]
) -> NDArray[np.float64]:
    """Fractions (m,) of the branches' axes at which leaves sit."""
    share = (index + 0.5 + _PLACE_JITTER * signed(key, Draw.PLACE)) / counts[owner]
    start = rows["leaf_start"][branches.row[owner]]
    return start + (1 - start) * share


def place_leaves(
    rows: NDArray[np.void],
    branches: Branches,
    lines: Axes,
    owner: NDArray[np.int64],
    index: NDArray[np.int64],
    key: NDArray[np.uint64],
    t: NDArray[np.float64],
) -> Leaves:
    """Leaves at given fractions of their branches; call `face_light` to turn them to the sky.

    Parameters
    ----------
    rows : parameter table
    branches, lines : Branches of n and their Axes
    owner, index : (m,) int
        Branch, and index of the leaf on it.
    key : (m,) uint64
        From `leaf_keys`.
    t : (m,) float64
        From `leaf_places`.
    """
    row = branches.row[owner]
    position, frame = lines.at(owner, t)
    step, jitter = rows["leaf_azimuth"][row].T
    azimuth = 2 * np.pi * uniform(branches.key[owner], Draw.ROLL) + index * step + jitter * signed(key, Draw.AZIMUTH)
    tilted = turned(frame, azimuth, ranged(rows, "leaf_angle", row, key, Draw.ANGLE))
    # The upper side of a leaf faces the tip of its branch: against the tilt, whose first column leads away from it.
    along, up = tilted[:, :, 2], -tilted[:, :, 0]
    leaf_frame = columns(-tilted[:, :, 1], along, up)
    size = branches.scale[owner] * ranged(rows, "leaf_size", row, key, Draw.LEAF_SIZE)
    return Leaves(owner, key, position, leaf_frame, size)


def face_light(frame: NDArray[np.float64], light: NDArray[np.float64], sky: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn leaves to the sky by the shares that their orders ask for.

    Parameters
    ----------
    frame : (n, 3, 3) float64
        Leaf frames (across, along, upper side).
    light : (n,) float64
        0 leaves them as they are, 1 makes them level.
    sky : (3,) or (n, 3) float64
        Unit vector towards the sky.

    Returns
    -------
    (n, 3, 3) float64
        Right-handed frames; the upper side is turned, the midrib follows by the least turn.
    """
    along, up = frame[:, :, 1], frame[:, :, 2]
    light = light[:, None]
    normal = (1 - light) * up + light * sky
    normal += 1e-9 * up  # a leaf that hangs upside down half way has no direction left; it keeps its own
    normal = unit(normal)
    level = along - dot(along, normal) * normal
    lost = np.flatnonzero(
        dot(level, level)[:, 0] <= 1e-12
    )  # the midrib points straight up or down: turn about the blade
    if len(lost):
        across, facing = gathered(frame[:, :, 0], lost), gathered(normal, lost)
        level[lost] = cross(facing, across - dot(across, facing) * facing)
    along = unit(level)
    return columns(cross(along, normal), along, normal)


def leaf_colours(rows: NDArray[np.void], row: NDArray[np.integer], key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Linear RGB (n, 3) of leaves."""
    colour = rows["leaf_colour"][row]
    return np.clip(colour[:, 0] + colour[:, 1] * signed(key, Draw.LEAF_COLOUR)[:, None], 0, 1)


def branch_colours(rows: NDArray[np.void], row: NDArray[np.integer], key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Linear RGB (n, 3) of branches."""
    colour = rows["branch_colour"][row]
    return np.clip(colour[:, 0] + colour[:, 1] * signed(key, Draw.BRANCH_COLOUR)[:, None], 0, 1)
