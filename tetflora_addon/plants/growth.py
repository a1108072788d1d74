# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Growing branches: trunks from seeds, axes of branches, children of branches, all as arrays (paper, section 5).

A branch is also a *sub-plant*: it and all that grows on it. Every function takes any mix of species and orders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from .crown_shapes import crown_ratio
from .hashing import Draw, child_key, key_of_seed, signed, uniform
from .rows import ranged
from .seeds import Seeds
from .species import MAX_ORDERS
from .vectors import by_component, columns, gathered

_PLACE_JITTER = 0.5  # of the distance from one child to the next: together children lie evenly along the whole parent


@dataclass(frozen=True)
class Branches:
    """Branches (or sub-plants) as a structure of arrays.

    Attributes
    ----------
    row : (n,) int32
        Row of the parameter table: species and order.
    plant : (n,) int32
        Index of the plant that it belongs to.
    key : (n,) uint64
        Hash of the plant's seed and the path of child indices.
    position : (n, 3) float64
        Base, metres, world space.
    frame : (n, 3, 3) float64
        Columns are the local axes at the base; the branch sets out along the third, the first points away from the
        parent.
    length, radius : (n,) float64
        Length of the axis and radius at its base, metres.
    scale : (n,) float64
        Scale of the plant, which leaves take as well.
    vigour : (n,) float64
        Length as the crown's shape has it here, relative to the longest; numbers of branches and leaves may follow it.
    """

    row: NDArray[np.int32]
    plant: NDArray[np.int32]
    key: NDArray[np.uint64]
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    length: NDArray[np.float64]
    radius: NDArray[np.float64]
    scale: NDArray[np.float64]
    vigour: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.row)

    def take(self, index: NDArray | slice) -> Branches:
        """Selection by indices, mask or slice."""
        return Branches(*(gathered(getattr(self, f.name), index) for f in fields(self)))

    @classmethod
    def concatenate(cls, parts: Sequence[Branches]) -> Branches:
        """All branches of several in one."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    @classmethod
    def empty(cls) -> Branches:
        """No branches."""
        floats = [np.zeros(s) for s in ((0, 3), (0, 3, 3), 0, 0, 0, 0)]
        return cls(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, np.uint64), *floats)


@dataclass(frozen=True)
class Axes:
    """Centre lines of branches: straight segments.

    Attributes
    ----------
    knots : (n, S + 1, 3) float64
        Ends of the segments; a branch with fewer than S segments repeats its last knot.
    frames : (n, S, 3, 3) float64
        Local axes along each segment.
    segments : (n,) int64
        Number of segments.
    """

    knots: NDArray[np.float64]
    frames: NDArray[np.float64]
    segments: NDArray[np.int64]

    def at(self, branch: NDArray[np.integer], t: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
        """Positions (m, 3) and frames (m, 3, 3) at the fractions t (m,) of the axes of branches (m,)."""
        number = self.segments[branch]
        along = t * number
        segment = np.minimum(along.astype(np.int64), number - 1)
        start = self.knot(branch, segment)
        step = self.knot(branch, segment + 1) - start
        return start + (along - segment)[:, None] * step, self.frame(branch, segment)

    def knot(self, branch: NDArray[np.integer], number: NDArray[np.integer]) -> NDArray[np.float64]:
        """Positions (m, 3) of knots given by branch (m,) and number (m,)."""
        return _picked(self.knots, branch, number)

    def frame(self, branch: NDArray[np.integer], segment: NDArray[np.integer]) -> NDArray[np.float64]:
        """Frames (m, 3, 3) of segments given by branch (m,) and number (m,)."""
        return _picked(self.frames, branch, segment)


def _picked(array: NDArray, first: NDArray[np.integer], second: NDArray[np.integer]) -> NDArray:
    """``array[first, second]`` of an array whose first axis is the last in memory and whose second the one before."""
    flat = np.moveaxis(array, (1, 0), (-2, -1))
    flat = flat.reshape(*flat.shape[:-2], -1)
    return np.moveaxis(np.take(flat, second * len(array) + first, axis=-1), -1, 0)


def turned(frame: NDArray[np.float64], azimuth: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frames turned by an azimuth about their z and then tilted by an angle away from it.

    Parameters
    ----------
    frame : (n, 3, 3) float64
    azimuth, angle : (n,) float64
        Radians.

    Returns
    -------
    (n, 3, 3) float64
        Third column leans by ``angle``; first column is the same lean a right angle further.
    """
    x, y, z = frame[:, :, 0], frame[:, :, 1], frame[:, :, 2]
    ca, sa, cd, sd = (f(v)[:, None] for v in (azimuth, angle) for f in (np.cos, np.sin))
    radial = ca * x + sa * y
    return columns(cd * radial - sd * z, ca * y - sa * x, sd * radial + cd * z)


def trunks(rows: NDArray[np.void], seeds: Seeds) -> Branches:
    """Trunks of plants (order 0)."""
    row = (seeds.species * MAX_ORDERS).astype(np.int32)
    key = key_of_seed(seeds.seed)
    length = seeds.scale * ranged(rows, "length", row, key, Draw.LENGTH)
    radius = length * ranged(rows, "thickness", row, key, Draw.THICKNESS)
    roll = 2 * np.pi * uniform(key, Draw.ROLL)
    frame = turned(seeds.frame, roll, ranged(rows, "angle", row, key, Draw.ANGLE))
    plant = np.arange(len(seeds), dtype=np.int32)
    scale = np.asarray(seeds.scale, dtype=np.float64)
    return Branches(row, plant, key, seeds.position, frame, length, radius, scale, np.ones(len(seeds)))


def axes(rows: NDArray[np.void], branches: Branches) -> Axes:
    """Centre lines; each joint bends by its share of the order's curvature."""
    segments = rows["segments"][branches.row]
    most = int(segments.max(initial=1))
    n = len(branches)
    # Branches last in memory, see `vectors`. Zeros, not empty: padding must be finite.
    knots = np.moveaxis(np.zeros((3, most + 1, n)), (1, 2), (1, 0))
    frames = np.moveaxis(np.zeros((3, 3, most, n)), (2, 3), (1, 0))
    step = (branches.length / segments)[:, None]
    bend = rows["curvature"][branches.row] / segments[:, None]
    outer_bend = rows["curvature_tip"][branches.row] / segments
    frame, knot = by_component(branches.frame), by_component(branches.position)
    knots[:, 0] = knot
    for s in range(most):
        if s:
            # The joint in the middle of an even number of segments belongs to the outer half.
            back = np.where(2 * s < segments, bend[:, 0], outer_bend) + bend[:, 1] * signed(
                branches.key, Draw.BEND + 2 * s
            )
            aside = bend[:, 1] * signed(branches.key, Draw.BEND + 2 * s + 1)
            frame = _bent(frame, -back, aside)
        knot = np.where((s < segments)[:, None], knot + step * frame[:, :, 2], knot)
        frames[:, s], knots[:, s + 1] = frame, knot
    return Axes(knots, frames, segments)


def _bent(frame: NDArray[np.float64], pitch: NDArray[np.float64], yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotate about the local y by pitch, then about the new local x by yaw."""
    x, y, z = frame[:, :, 0], frame[:, :, 1], frame[:, :, 2]
    cp, sp, cy, sy = (f(v)[:, None] for v in (pitch, yaw) for f in (np.cos, np.sin))
    forward = sp * x + cp * z
    return columns(cp * x - sp * z, cy * y + sy * forward, cy * forward - sy * y)


def fullness(rows: NDArray[np.void], branches: Branches) -> NDArray[np.float64]:
    """Factor (n,) on the numbers of branches and leaves: 1 for the longest branches of a crown, less for others."""
    share = rows["count_by_length"][branches.row]
    return 1 - share + share * branches.vigour


def branch_counts(rows: NDArray[np.void], branches: Branches) -> NDArray[np.int64]:
    """Number of children of each branch, in whole whorls; its expectation is exactly the range's mean."""
    wanted = ranged(rows, "branches", branches.row, branches.key, Draw.BRANCHES) * fullness(rows, branches)
    # The last row of the table has no children, and no row after it.
    whorl = np.maximum(rows["whorl"][np.minimum(branches.row + 1, len(rows) - 1)], 1)
    return np.floor(wanted / whorl + uniform(branches.key, Draw.BRANCHES_ROUND)).astype(np.int64) * whorl


def leaf_counts(rows: NDArray[np.void], branches: Branches) -> NDArray[np.int64]:
    """Number of leaves on each branch's own axis; its expectation is exactly the range's mean."""
    wanted = ranged(rows, "leaves", branches.row, branches.key, Draw.LEAVES) * fullness(rows, branches)
    return np.floor(wanted + uniform(branches.key, Draw.LEAVES_ROUND)).astype(np.int64)


def radius_at(rows: NDArray[np.void], branches: Branches, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Radius at fractions t (n,) of the branches (n,), metres."""
    return branches.radius * (1 - (1 - rows["taper"][branches.row]) * t)


def spread(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Owner (m,) and running index within the owner (m,) for ``counts`` things each; m is their sum."""
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return owner, np.arange(len(owner)) - first[owner]


def chosen_children(
    rows: NDArray[np.void],
    parents: Branches,
    lines: Axes,
    owner: NDArray[np.int64],
    index: NDArray[np.int64],
    counts: NDArray[np.int64],
) -> Branches:
    """Some children of branches.

    Parameters
    ----------
    rows : parameter table
    parents : Branches of n
    lines : Axes of the same n
    owner : (m,) int
        Which parent.
    index : (m,) int
        Which of its children.
    counts : (n,) int
        Number of children of each parent.

    Returns
    -------
    Branches of m
    """
    parent = parents.take(owner)
    key = child_key(parent.key, index)
    row = parent.row + np.int32(1)
    # Branches of a whorl share their place: that of the first of them.
    whorl = rows["whorl"][row]
    node, within = index // whorl, index % whorl
    place = signed(np.where(within > 0, child_key(parent.key, node * whorl), key), Draw.PLACE)
    share = (node + 0.5 + _PLACE_JITTER * place) / (counts[owner] // whorl)
    start = rows["branch_start"][parent.row]
    t = start + (1 - start) * share
    position, frame = lines.at(owner, t)
    angle_base, angle_spread = rows["angle"][row].T
    angle = angle_base + (rows["angle_tip"][row] - angle_base) * share + angle_spread * signed(key, Draw.ANGLE)
    step, jitter = rows["azimuth"][row].T
    azimuth = 2 * np.pi * (uniform(parent.key, Draw.AZIMUTH) + within / whorl) + node * step
    azimuth += jitter * signed(key, Draw.AZIMUTH)
    vigour = crown_ratio(rows["crown"][parent.row], 1 - share)
    length = parent.length * ranged(rows, "length", row, key, Draw.LENGTH) * vigour
    radius = radius_at(rows, parent, t) * ranged(rows, "thickness", row, key, Draw.THICKNESS)
    frame = turned(frame, azimuth, angle)
    return Branches(row, parent.plant, key, position, frame, length, radius, parent.scale, vigour)


def children(
    rows: NDArray[np.void], parents: Branches, lines: Axes | None = None
) -> tuple[Branches, NDArray[np.int64]]:
    """All children of branches, and the index of each one's parent."""
    lines = axes(rows, parents) if lines is None else lines
    counts = branch_counts(rows, parents)
    owner, index = spread(counts)
    return chosen_children(rows, parents, lines, owner, index, counts), owner
