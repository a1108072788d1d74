# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves on branches: where each sits, which way it grows and faces, its size and colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .growth import Axes, Branches
from .hashing import Draw, child_key, signed, uniform
from .rows import ranged
from .vectors import cross, dot, gathered

_LEAF_PATH = 1 << 32  # child indices of leaves start here, so that they never meet those of branches
_PLACE_JITTER = 0.4  # below a half, so that leaves keep their order along the branch


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
    frame : (n, 3, 3) float32
        Columns: across, along the midrib, upper side; before it turns to the light. Single precision is off by some
        nanometres at the tip of a leaf, and its cosines are ten times as fast.
    size : (n,) float64
        Metres by which the leaf model is scaled.
    """

    branch: NDArray[np.int64]
    key: NDArray[np.uint64]
    position: NDArray[np.float64]
    frame: NDArray[np.float32]
    size: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.key)


def leaf_keys(branches: Branches, owner: NDArray[np.int64], index: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Hash keys (m,) of leaves given by branch and index."""
    return child_key(np.take(branches.key, owner), index + _LEAF_PATH)


def leaf_places(
    rows: NDArray[np.void], branches: Branches, owner: NDArray, index: NDArray, counts: NDArray, key: NDArray[np.uint64]
) -> NDArray[np.float64]:
    """Fractions (m,) of the branches' axes at which leaves sit."""
    share = (index + 0.5 + _PLACE_JITTER * signed(key, Draw.PLACE)) / np.take(counts, owner)
    start = rows["leaf_start"][_rows_of(branches, owner)]
    return start + (1 - start) * share


def leaf_range(
    rows: NDArray[np.void],
    branches: Branches,
    counts: NDArray[np.int64],
    t0: NDArray[np.float64],
    t1: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which leaves sit on a part of each branch: those with t0 ≤ t < t1, and at the tip with t = 1 as well.

    Leaves are numbered from base to tip, so that they are a range of numbers, and only one leaf at each end of the
    part has to be looked at.

    Parameters
    ----------
    rows : parameter table
    branches : Branches of n
    counts : (n,) int
        Number of leaves of each whole branch.
    t0, t1 : (n,) float64
        Ends of the parts as fractions of the branches' axes.

    Returns
    -------
    low, high : (n,) int64
        Number of the first leaf, and of the first one beyond.
    """

    def below(t: NDArray[np.float64]) -> NDArray[np.int64]:
        out = np.where(t >= 1, counts, 0)
        near = np.flatnonzero((t > 0) & (t < 1) & (counts > 0))
        number, start = counts[near], rows["leaf_start"][branches.row[near]]
        share = (t[near] - start) / (1 - start)
        # Each leaf keeps to its own part of the branch, one of `number`.
        index = np.clip(np.floor(share * number), 0, number - 1).astype(np.int64)
        place = leaf_places(rows, branches, near, index, counts, leaf_keys(branches, near, index))
        out[near] = index + (place < t[near])
        return out

    return below(t0), below(t1)


def _rows_of(branches: Branches, owner: NDArray[np.int64]) -> NDArray[np.int32]:
    """Row (m,) of each branch's parameters, or the only one (1,), which is as good and need not be gathered."""
    row = branches.row
    return row[:1] if len(row) and (row == row[0]).all() else np.take(row, owner)


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
        Fastest where all are of one row, because parameters are then the same for all.
    owner, index : (m,) int
        Branch, and index of the leaf on it.
    key : (m,) uint64
        From `leaf_keys`.
    t : (m,) float64
        From `leaf_places`.
    """
    row = _rows_of(branches, owner)
    light = Axes(lines.knots, lines.frames.astype(np.float32), lines.segments)
    position, frame = light.at(owner, t)
    step, jitter = rows["leaf_azimuth"][row].T
    turns = np.take(uniform(branches.key, Draw.ROLL), owner) + (index * step + jitter * signed(key, Draw.AZIMUTH)) / (
        2 * np.pi
    )
    turns -= np.rint(turns)  # whole turns would cost single precision its last digits
    azimuth = (turns * (2 * np.pi)).astype(np.float32)
    angle = ranged(rows, "leaf_angle", row, key, Draw.ANGLE).astype(np.float32)
    size = np.take(branches.scale, owner) * ranged(rows, "leaf_size", row, key, Draw.LEAF_SIZE)
    return Leaves(owner, key, position, _leaf_frames(frame, azimuth, angle), size)


def _leaf_frames(
    frame: NDArray[np.float32], azimuth: NDArray[np.float32], angle: NDArray[np.float32]
) -> NDArray[np.float32]:
    """As `growth.turned`, with columns in the order of a leaf.

    The upper side of a leaf faces the tip of its branch: against the tilt, whose first column leads away from it.
    """
    x, y, z = frame.transpose(2, 1, 0)
    ca, sa, cd, sd = (f(v) for v in (azimuth, angle) for f in (np.cos, np.sin))
    out = np.zeros((3, 3, len(azimuth)), np.float32)
    across, along, up = out.swapaxes(0, 1)
    radial = ca * x
    radial += sa * y
    np.multiply(sa, x, out=across)
    across -= ca * y
    np.multiply(sd, radial, out=along)
    along += cd * z
    np.multiply(sd, z, out=up)
    up -= cd * radial
    return out.transpose(2, 0, 1)


def face_light(frame: NDArray[np.floating], light: NDArray[np.float64], sky: NDArray[np.float64]) -> NDArray:
    """Turn leaves to the sky by the shares that their orders ask for.

    Parameters
    ----------
    frame : (n, 3, 3) float64 or float32
        Leaf frames (across, along, upper side).
    light : (n,) or (1,) float64
        0 leaves them as they are, 1 makes them level.
    sky : (3,) or (n, 3) float64
        Unit vector towards the sky.

    Returns
    -------
    (n, 3, 3), type of frame
        Right-handed frames; the upper side is turned, the midrib follows by the least turn.
    """
    kind = frame.dtype
    light, sky = light.astype(kind), sky.astype(kind).T
    along, up = frame[:, :, 1].T, frame[:, :, 2].T
    out = np.zeros((3, 3, len(frame)), kind)
    across_out, along_out, normal = out.swapaxes(0, 1)
    np.multiply(1 - light, up, out=normal)
    normal += light * sky if sky.ndim == 2 else light * sky[:, None]
    normal += kind.type(1e-9) * up  # a leaf that hangs upside down half way has no direction left; it keeps its own
    normal /= _length(normal)
    np.multiply(_inner(along, normal), normal, out=along_out)
    np.subtract(along, along_out, out=along_out)
    length = _length(along_out)
    # The midrib points straight up or down: turn about the blade. What is left of it must stand above rounding.
    lost = np.flatnonzero(length <= (1e-6 if kind == np.float64 else 1e-3))
    if len(lost):
        across, facing = gathered(frame[:, :, 0], lost), normal[:, lost].T
        along_out[:, lost] = cross(facing, across - dot(across, facing) * facing).T
        length = _length(along_out)
    along_out /= length
    np.multiply(along_out[[1, 2, 0]], normal[[2, 0, 1]], out=across_out)
    across_out -= along_out[[2, 0, 1]] * normal[[1, 2, 0]]
    return out.transpose(2, 0, 1)


def _inner(a: NDArray, b: NDArray) -> NDArray:
    """Scalar products (n,) of vectors given by component (3, n)."""
    out = a[0] * b[0]
    out += a[1] * b[1]
    out += a[2] * b[2]
    return out


def _length(a: NDArray) -> NDArray:
    """Lengths (n,) of vectors given by component (3, n), never quite zero."""
    return np.maximum(np.sqrt(_inner(a, a)), np.finfo(a.dtype).tiny)


def leaf_colours(rows: NDArray[np.void], row: NDArray[np.integer], key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Linear RGB (n, 3) of leaves of the rows (n,), or all of one row (1,)."""
    return _colours(rows["leaf_colour"][row], signed(key, Draw.LEAF_COLOUR))


def branch_colours(rows: NDArray[np.void], row: NDArray[np.integer], key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Linear RGB (n, 3) of branches of the rows (n,), or all of one row (1,)."""
    return _colours(rows["branch_colour"][row], signed(key, Draw.BRANCH_COLOUR))


def _colours(colour: NDArray[np.float64], draw: NDArray[np.float64]) -> NDArray[np.float64]:
    mean, variation = colour.transpose(1, 2, 0)
    out = variation * draw
    out += mean
    return np.clip(out, 0, 1, out=out).T
