# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample points on the leaves and the wood of sub-plants, drawn by following random paths from the branch outwards.

They stand for a sub-plant that is not grown: where its surfaces are within its bound, and how they are turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .foliage import face_light, leaf_keys, leaf_places, place_leaves
from .growth import Branches, axes, branch_counts, chosen_children, leaf_counts
from .hashing import key_of_seed, mix, uniform
from .species import MAX_ORDERS

SAMPLES = 1024
_PATHS = 2 * SAMPLES
_TILTS = np.linspace(-1, 1, 9)  # cosines of the angle between a branch and the sky at which moments are tabulated
_PICK, _ALONG, _LEVEL = 101, 102, 103  # draws of this module, beyond those of growth


@dataclass(frozen=True)
class Samples:
    """Points on sub-plants whose branch has length 1 and stands at the origin along +z; arrays by row.

    Attributes
    ----------
    leaf_position : (r, SAMPLES, 3) float32
        Bases of leaves, in units of the branch's length.
    leaf_frame : (r, SAMPLES, 3, 3) float32
        Leaf frames before they turn to the light.
    leaf_row : (r, SAMPLES) int32
        Row that describes the leaf (its size, colour and turn to the light).
    leaf_moment : (r, T, 4) float64
        Mean of n nᵀ over the leaves, sky up, for the tilts of `leaf_moments`: xx, yy, zz, xz with z up and the branch
        in xz.
    own_leaf_moment : (r, T, 4) float64
        The same over the leaves of the branch itself, without those of its children.
    wood_position : (r, SAMPLES, 3) float32
        Points on axes of branches, as many as there is surface.
    wood_axis : (r, SAMPLES, 3) float32
        Direction of the branch there.
    wood_row : (r, SAMPLES) int32
        Row that describes the branch.
    wood_moment : (r, 2) float64
        Mean of n nᵀ over the wood, turned about the branch: across and along it.
    """

    leaf_position: NDArray[np.float32]
    leaf_frame: NDArray[np.float32]
    leaf_row: NDArray[np.int32]
    leaf_moment: NDArray[np.float64]
    own_leaf_moment: NDArray[np.float64]
    wood_position: NDArray[np.float32]
    wood_axis: NDArray[np.float32]
    wood_row: NDArray[np.int32]
    wood_moment: NDArray[np.float64]


def _paths(row: int) -> Branches:
    """Unit branches of one row at the origin, one for each path."""
    n = _PATHS
    # Keys from fixed seeds, so that what is compiled never depends on what was compiled before.
    key = mix(key_of_seed(np.arange(n)) ^ np.uint64(0x7E7F10A5))
    frame = np.broadcast_to(np.eye(3), (n, 3, 3))
    one = np.ones(n)
    return Branches(
        np.full(n, row, np.int32), np.arange(n, dtype=np.int32), key, np.zeros((n, 3)), frame, one, one, one, one
    )


def _systematic(weights: NDArray[np.float64], number: int) -> NDArray[np.int64]:
    """Indices drawn with probability proportional to the weights, by systematic resampling."""
    edges = np.cumsum(weights) / weights.sum()
    return np.minimum(np.searchsorted(edges, (np.arange(number) + 0.5) / number), len(weights) - 1)


def _at_least_some(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same counts; one each where things are so rare that no path has met any, but some are expected."""
    return counts if counts.any() else np.ones_like(counts)


def _interleave(index: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same indices in an order in which any run of them is spread over all (a fixed permutation)."""
    return index[np.argsort(mix(np.arange(len(index)).astype(np.uint64)), kind="stable")]


def draw_samples(
    rows: NDArray[np.void],
    leaf_moments: Sequence[NDArray[np.float64]],
    leaf_share: NDArray[np.float64],
    wood_share: NDArray[np.float64],
) -> Samples:
    """Sample every row.

    Parameters
    ----------
    rows : (r,) parameter table
    leaf_moments : by species, (3, 3) float64
        Orientation moment of the leaf model in its own axes.
    leaf_share, wood_share : (r, MAX_ORDERS) float64
        Expected area in a sub-plant by relative order.
    """
    total = len(rows)
    out = Samples(
        np.zeros((total, SAMPLES, 3), np.float32),
        np.zeros((total, SAMPLES, 3, 3), np.float32),
        np.zeros((total, SAMPLES), np.int32),
        np.zeros((total, len(_TILTS), 4)),
        np.zeros((total, len(_TILTS), 4)),
        np.zeros((total, SAMPLES, 3), np.float32),
        np.zeros((total, SAMPLES, 3), np.float32),
        np.zeros((total, SAMPLES), np.int32),
        np.tile([0.5, 0.0], (total, 1)),
    )
    for row in np.flatnonzero(rows["used"]):
        _sample_row(rows, int(row), leaf_moments[row // MAX_ORDERS], leaf_share[row], wood_share[row], out)
    return out


def _sample_row(
    rows: NDArray[np.void], row: int, leaf_moment: NDArray, leaf_share: NDArray, wood_share: NDArray, out: Samples
) -> None:
    branches, weight = _paths(row), np.ones(_PATHS)
    leaf_parts, wood_parts = [], []
    while True:
        lines = axes(rows, branches)
        depth = int(branches.row[0]) - row
        along = uniform(branches.key, _ALONG)
        every = np.arange(len(branches))
        if wood_share[depth] > 0:
            position, frame = lines.at(every, along)
            taper = rows["taper"][branches.row]
            area = weight * branches.length * branches.radius * (1 - (1 - taper) * along)
            wood_parts.append((position, frame[:, :, 2], branches.row, area * (wood_share[depth] / area.sum())))
        if leaf_share[depth] > 0:
            counts = _at_least_some(leaf_counts(rows, branches))
            picked = np.flatnonzero(counts)
            index = (uniform(branches.key, _PICK) * counts).astype(np.int64)[picked]
            key = leaf_keys(branches, picked, index)
            t = leaf_places(rows, branches, picked, index, counts, key)
            leaves = place_leaves(rows, branches, lines, picked, index, key, t)
            area = (weight * counts)[picked] * leaves.size**2
            leaf_parts.append(
                (leaves.position, leaves.frame, branches.row[picked], area * (leaf_share[depth] / area.sum()))
            )
        if rows["branches"][branches.row[0], 0] <= 0:
            break
        counts = _at_least_some(branch_counts(rows, branches))
        alive = np.flatnonzero(counts)
        index = (uniform(branches.key, _LEVEL) * counts).astype(np.int64)[alive]
        weight = (weight * counts)[alive]
        branches = chosen_children(rows, branches, lines, alive, index, counts)
    if leaf_parts:
        position, frame, kind, area = (np.concatenate(p) for p in zip(*leaf_parts, strict=True))
        pick = _interleave(_systematic(area, SAMPLES))
        out.leaf_position[row], out.leaf_frame[row], out.leaf_row[row] = position[pick], frame[pick], kind[pick]
        if leaf_share[0] > 0:
            _, own, _, area = leaf_parts[0]
            own = own[_systematic(area, SAMPLES)]
            light = np.full(SAMPLES, rows["leaf_light"][row])
            out.own_leaf_moment[row] = _moments_by_tilt(own, light, leaf_moment)
        out.leaf_moment[row] = _moments_by_tilt(frame[pick], rows["leaf_light"][kind[pick]], leaf_moment)
    position, axis, kind, area = (np.concatenate(p) for p in zip(*wood_parts, strict=True))
    pick = _interleave(_systematic(area, SAMPLES))
    out.wood_position[row], out.wood_axis[row], out.wood_row[row] = position[pick], axis[pick], kind[pick]
    along = float((axis[pick][:, 2] ** 2).mean())  # of the axes; normals are perpendicular to them
    out.wood_moment[row] = (1 + along) / 4, (1 - along) / 2


def _moments_by_tilt(frame: NDArray, light: NDArray, leaf_moment: NDArray) -> NDArray[np.float64]:
    """Moments (T, 4) of leaves turned to the sky, for branches at each tilt, averaged over rolls of the branch."""
    n = len(frame)
    roll = np.arange(n) * np.pi * (3 - np.sqrt(5))  # golden angle: even for any number of samples
    table = np.zeros((len(_TILTS), 4))
    for k, cos in enumerate(_TILTS):
        sin = np.sqrt(1 - cos * cos)
        # The world's axes seen from the branch: sky, the level direction in which the branch leans, and their cross
        # product.
        radial = np.stack([np.cos(roll), np.sin(roll), np.zeros(n)], axis=1)
        sky = -sin * radial + [0, 0, cos]
        lean = cos * radial + [0, 0, sin]
        lit = face_light(frame, light, sky)
        world = np.stack([lean, np.cross(sky, lean), sky], axis=1) @ lit
        moment = np.einsum("nij,jk,nlk->il", world, leaf_moment, world) / n
        table[k] = moment[0, 0], moment[1, 1], moment[2, 2], moment[0, 2]
    return table


def leaf_moments(
    samples: Samples, row: NDArray[np.integer], axis: NDArray[np.float64], own: bool = False
) -> NDArray[np.float64]:
    """Mean of n nᵀ over the leaves of sub-plants.

    Parameters
    ----------
    row : (n,) int
    axis : (n, 3) float64
        Unit direction of each sub-plant's branch; the sky is +z.
    own : bool
        Only the leaves of the branches themselves, as pieces of branches bear them.

    Returns
    -------
    (n, 3, 3) float64, of trace 1 (0 for rows without leaves)
    """
    at = (axis[:, 2].clip(-1, 1) + 1) / 2 * (len(_TILTS) - 1)
    low = np.minimum(at.astype(int), len(_TILTS) - 2)
    part = (at - low)[:, None]
    table = samples.own_leaf_moment if own else samples.leaf_moment
    xx, yy, zz, xz = ((1 - part) * table[row, low] + part * table[row, low + 1]).T
    level = np.hypot(axis[:, 0], axis[:, 1])
    ex = np.where(level > 1e-9, axis[:, 0] / np.maximum(level, 1e-9), 1.0)
    ey = np.where(level > 1e-9, axis[:, 1] / np.maximum(level, 1e-9), 0.0)
    out = np.empty((len(row), 3, 3))
    out[:, 0, 0] = xx * ex * ex + yy * ey * ey
    out[:, 1, 1] = xx * ey * ey + yy * ex * ex
    out[:, 2, 2] = zz
    out[:, 0, 1] = out[:, 1, 0] = (xx - yy) * ex * ey
    out[:, 0, 2] = out[:, 2, 0] = xz * ex
    out[:, 1, 2] = out[:, 2, 1] = xz * ey
    return out


def wood_moments(samples: Samples, row: NDArray[np.integer], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of n nᵀ over the branches of sub-plants; shapes as in `leaf_moments`."""
    across, along = samples.wood_moment[row].T
    outer = axis[:, :, None] * axis[:, None, :]
    return across[:, None, None] * np.eye(3) + (along - across)[:, None, None] * outer
