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

from .averages import RowLeaves
from .foliage import leaf_frames, leaf_keys, leaf_places, outwardness, place_leaves, settled
from .growth import Branches, axes, branch_counts, chosen_children, leaf_counts, radius_at
from .hashing import key_of_seed, mix, uniform
from .leaf_models import LeafModel
from .rows import FORK, LATERAL, SPUR

SAMPLES = 1024
_PATHS = 2 * SAMPLES
_TILTS = np.linspace(-1, 1, 9)  # cosines of the angle between a branch and the sky at which moments are tabulated
_ROLLS = 4  # ways in which a branch may lie on its side, for sub-plants whose shape depends on it
_CLASSES = len(_TILTS) * _ROLLS
_OF_CLASS = 64  # samples of each class of tilt and roll
_PICK, _ALONG, _LEVEL, _SORT, _TILT, _ROLL = range(101, 107)  # draws of this module, beyond those of growth


@dataclass(frozen=True)
class Points:
    """Sample points of one sub-plant after the other; each row has one run of them, or one for each class of stand.

    Attributes
    ----------
    first, number : (r, c) int64
        Run of each row and class (tilt of the branch, and how it lies); rows that do not care have the same for all.
    position : (k, 3) float32
        In units of the branch's length, in its own axes.
    frame : (k, 3, 3) float32
        Of leaves, before they turn to the light; of wood the axis is the third column.
    row : (k,) int32
        Row that describes the leaf (its size, colour and turn to the light) or the branch.
    outward : (k,) float32
        Place between the inside and the outside of the crown.
    light : (k,) float32
        How far a leaf turns to the sky.
    """

    first: NDArray[np.int64]
    number: NDArray[np.int64]
    position: NDArray[np.float32]
    frame: NDArray[np.float32]
    row: NDArray[np.int32]
    outward: NDArray[np.float32]
    light: NDArray[np.float32]

    def runs(self, subplants: Branches) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First sample and number of samples (n,), (n,) that stand for sub-plants as they are turned to the sky."""
        stand = _stand_classes(subplants.frame[:, 2, :])
        return self.first[subplants.row, stand], self.number[subplants.row, stand]


@dataclass(frozen=True)
class Samples:
    """Points on sub-plants whose branch has length 1, and moments of how their surfaces are turned.

    Attributes
    ----------
    leaves, wood : Points
    leaf_moment, own_leaf_moment, wood_moment : (r, T, 4) float64
        Mean of n nᵀ for the tilts of `leaf_moments`: xx, yy, zz, xz with z up and the branch in xz. Over all leaves,
        over those of the branch itself where it is straight, and over the wood.
    """

    leaves: Points
    wood: Points
    leaf_moment: NDArray[np.float64]
    own_leaf_moment: NDArray[np.float64]
    wood_moment: NDArray[np.float64]


def _stand_classes(sky: NDArray[np.float64]) -> NDArray[np.int64]:
    """Class (n,) of how branches stand, from the direction (n, 3) of the sky in their own axes."""
    tilt = np.rint((sky[:, 2].clip(-1, 1) + 1) / 2 * (len(_TILTS) - 1)).astype(np.int64)
    turn = np.arctan2(sky[:, 1], sky[:, 0]) / (2 * np.pi)
    return tilt * _ROLLS + (np.floor((turn % 1.0) * _ROLLS).astype(np.int64) % _ROLLS)


def _turned_to(sky: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frames (n, 3, 3) whose axes have the sky in given directions (n, 3), leaning along the world's x."""
    cos = sky[:, 2]
    sin = np.sqrt(np.clip(1 - cos * cos, 0, 1))
    zero = np.zeros_like(cos)
    lean = np.stack([-cos, zero, sin], axis=1)
    side = np.broadcast_to([0.0, -1.0, 0.0], lean.shape)
    along = np.stack([sin, zero, cos], axis=1)
    turn = np.arctan2(sky[:, 1], sky[:, 0])[:, None]
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * lean - s * side, s * lean + c * side, along], axis=2)


def _paths(row: int, worldly: bool, length: float) -> tuple[Branches, NDArray[np.int64]]:
    """Unit branches of one row at the origin, one for each path, and the class of each."""
    n = _CLASSES * 2 * _OF_CLASS if worldly else _PATHS
    # Keys from fixed seeds, so that what is compiled never depends on what was compiled before.
    key = mix(key_of_seed(np.arange(n)) ^ np.uint64(0x7E7F10A5))
    stand = np.zeros(n, np.int64)
    frame = np.broadcast_to(np.eye(3), (n, 3, 3))
    if worldly:
        stand = np.arange(n) % _CLASSES
        half = (_TILTS[1] - _TILTS[0]) / 2
        cos = np.clip(_TILTS[stand // _ROLLS] + half * (2 * uniform(key, _TILT) - 1), -1, 1)
        turn = 2 * np.pi * (stand % _ROLLS + uniform(key, _ROLL)) / _ROLLS
        sin = np.sqrt(1 - cos * cos)
        frame = _turned_to(np.stack([sin * np.cos(turn), sin * np.sin(turn), cos], axis=1))
    one, none = np.ones(n), np.zeros(n)
    # Short shoots have lengths of their own: the plant is scaled until the branch has its typical length.
    scale = np.full(n, 1 / length)
    branches = Branches(
        np.full(n, row, np.int32),
        np.arange(n, dtype=np.int32),
        key,
        np.zeros((n, 3)),
        frame,
        one,
        one,
        scale,
        one,
        none,
    )
    return branches, stand


def _systematic(weights: NDArray[np.float64], number: int) -> NDArray[np.int64]:
    """Indices drawn with probability proportional to the weights, by systematic resampling."""
    edges = np.cumsum(weights) / weights.sum()
    return np.minimum(np.searchsorted(edges, (np.arange(number) + 0.5) / number), len(weights) - 1)


def _at_least_some(counts: NDArray[np.int64], possible: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The same counts; one each where things are so rare that no path has met any, but some are expected."""
    return counts if counts.any() else possible.astype(np.int64)


def _interleave(index: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same indices in an order in which any run of them is spread over all (a fixed permutation)."""
    return index[np.argsort(mix(np.arange(len(index)).astype(np.uint64)), kind="stable")]


def draw_samples(
    rows: NDArray[np.void],
    leaf: RowLeaves,
    forms: Sequence[Sequence[Sequence[LeafModel]]],
    leaf_share: NDArray[np.float64],
    wood_share: NDArray[np.float64],
    polygons: NDArray[np.float64],
    length: NDArray[np.float64],
) -> Samples:
    """Sample every row.

    Parameters
    ----------
    rows : (r,) parameter table
    leaf : RowLeaves
    forms : by species and kind
        Models of leaves.
    leaf_share, wood_share : (r, r) float64
        Expected area in a sub-plant by the row that contributes it.
    polygons : (r,) float64
        Expected faces of a sub-plant; paths lead where there are many.
    length : (r,) float64
        Typical length of a branch, metres.
    """
    turn = _model_moments(rows, forms)
    leaves, wood = _Collector(len(rows)), _Collector(len(rows))
    moments = np.zeros((3, len(rows), len(_TILTS), 4))
    for row in range(len(rows)):
        leaf_points, wood_points, stand = _walked(rows, row, polygons, float(length[row]))
        worldly = bool(rows["worldly"][row])
        for kind, points, share, out in ((0, leaf_points, leaf_share, leaves), (2, wood_points, wood_share, wood)):
            if share[row].sum() <= 0:
                continue
            points.share_out(share[row])
            if kind == 0:
                moments[0, row] = _moments(
                    rows, points, stand, worldly, lambda p, f, s: _leaf_normals(rows, p, f, s, turn)
                )
            else:
                moments[2, row] = _moments(rows, points, stand, worldly, lambda p, f, s: _wood_normals(f))
            out.add(row, points, stand if worldly else None)
        if leaf_share[row, row] > 0:
            moments[1, row] = _own_moments(rows, row, turn[row])
    return Samples(leaves.points(), wood.points(), *moments)


def _model_moments(rows: NDArray[np.void], forms: Sequence[Sequence[Sequence[LeafModel]]]) -> NDArray[np.float64]:
    """Orientation moment (r, 3, 3) of the leaf that each row bears, in the leaf's own axes."""
    table = np.zeros((len(forms), max(len(one) for one in forms), 3, 3))
    for s, one in enumerate(forms):
        for k, models in enumerate(one):
            if models:
                areas = np.array([m.area for m in models])
                table[s, k] = np.einsum("f,fij->ij", areas / areas.sum(), np.array([m.moment for m in models]))
    return table[rows["species"], rows["leaf_kind"]]


@dataclass
class _Walk:
    """Points that paths have met: leaves, or places on wood."""

    path: NDArray[np.int64]
    position: NDArray[np.float64]
    frame: NDArray[np.floating]
    row: NDArray[np.int32]
    outward: NDArray[np.float64]
    light: NDArray[np.float64]
    area: NDArray[np.float64]

    @classmethod
    def joined(cls, parts: list[_Walk]) -> _Walk:
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__annotations__))

    def share_out(self, share: NDArray[np.float64]) -> None:
        """Scale areas so that each row has its expected share; paths only say how it is spread."""
        met = np.bincount(self.row, self.area, len(share))
        self.area *= (share / np.where(met > 0, met, 1))[self.row]


class _Collector:
    """Samples of one row after the other."""

    def __init__(self, rows: int) -> None:
        self.first, self.number = np.zeros((2, rows, _CLASSES), np.int64)
        self.parts: list[tuple[NDArray, ...]] = []
        self.done = 0

    def add(self, row: int, points: _Walk, stand: NDArray[np.int64] | None) -> None:
        """Samples of a row, drawn by area; ``stand`` (paths,) where each class has its own."""
        picks = [_interleave(_systematic(points.area, SAMPLES))] if stand is None else []
        if stand is None:
            self.first[row], self.number[row] = self.done, SAMPLES
        else:
            of_class = stand[points.path]
            for c in range(_CLASSES):
                own = np.flatnonzero((of_class == c) & (points.area > 0))
                self.first[row, c] = self.done + _OF_CLASS * c
                if len(own) == 0:  # so rare that no path of this class has met any
                    own = np.flatnonzero(points.area > 0)
                self.number[row, c] = _OF_CLASS
                picks.append(own[_interleave(_systematic(points.area[own], _OF_CLASS))])
        pick = np.concatenate(picks)
        self.done += len(pick)
        values = (points.position, points.frame, points.row, points.outward, points.light)
        self.parts.append(tuple(value[pick] for value in values))

    def points(self) -> Points:
        """All of them."""
        kinds = (np.float32, np.float32, np.int32, np.float32, np.float32)
        shapes = ((0, 3), (0, 3, 3), (0,), (0,), (0,))
        joined = [
            np.concatenate([np.zeros(shape, kind), *(part[i].astype(kind) for part in self.parts)])
            for i, (kind, shape) in enumerate(zip(kinds, shapes, strict=True))
        ]
        return Points(self.first, self.number, *joined)


def _walked(rows: NDArray[np.void], row: int, polygons: NDArray, length: float) -> tuple[_Walk, _Walk, NDArray]:
    """Leaves and places on wood that random paths from a branch meet, in its own axes, and the class of each path."""
    branches, stand = _paths(row, bool(rows["worldly"][row]), max(length, 1e-9))
    base = branches.frame
    path, weight = np.arange(len(branches)), np.ones(len(branches))
    leaves, wood = [], []
    while True:
        lines = axes(rows, branches)
        along = uniform(branches.key, _ALONG)
        every = np.arange(len(branches))
        position, frame = lines.at(every, along)
        area = weight * branches.length * radius_at(rows, branches, along)
        outward, none = outwardness(rows, branches, every, along), np.zeros(len(every))
        wood.append(_Walk(path, position, frame, branches.row, outward, none, area))
        counts = leaf_counts(rows, branches)
        counts = _at_least_some(counts, rows["leaves"][branches.row, 0] > 0)
        picked = np.flatnonzero(counts)
        if len(picked):
            index = (uniform(branches.key, _PICK) * counts).astype(np.int64)[picked]
            key = leaf_keys(branches, picked, index)
            t = leaf_places(rows, branches, picked, index, counts, key)
            one = place_leaves(rows, branches, lines, picked, index, key, t)
            outward = outwardness(rows, branches, picked, t)
            area = (weight * counts)[picked] * one.size**2
            leaves.append(_Walk(path[picked], one.position, one.frame, branches.row[picked], outward, one.light, area))
        alive, branches, factor = _next_steps(rows, branches, lines, polygons)
        if len(alive) == 0:
            break
        path, weight = path[alive], weight[alive] * factor
    out = []
    for parts in (leaves, wood):
        one = _Walk.joined(parts) if parts else None
        if one is not None:  # from the world, in which worldly branches are turned, to the branch's own axes
            local = base[one.path]
            one.position = np.einsum("nji,nj->ni", local, one.position)
            one.frame = np.einsum("nji,njk->nik", local, one.frame)
        out.append(one)
    return out[0], out[1], stand


def _next_steps(
    rows: NDArray[np.void], branches: Branches, lines: object, polygons: NDArray[np.float64]
) -> tuple[NDArray[np.int64], Branches, NDArray[np.float64]]:
    """One child of each branch that has any: index of its parent, the children, and how many each stands for."""
    n = len(branches)
    counts, gain = np.zeros((2, 3, n))
    for sort in (LATERAL, FORK, SPUR):
        child = rows["next"][branches.row, sort]
        if (child >= 0).any():
            possible = (child >= 0) & (rows["count"][branches.row, sort, 0] > 0)
            counts[sort] = _at_least_some(branch_counts(rows, branches, sort), possible)
            gain[sort] = counts[sort] * np.maximum(polygons[child], 1)
    total = gain.sum(axis=0)
    which = (uniform(branches.key, _SORT) * total < np.cumsum(gain, axis=0)).argmax(axis=0)
    parts, owners, factors = [], [], []
    for sort in (LATERAL, FORK, SPUR):
        alive = np.flatnonzero((which == sort) & (total > 0) & (counts[sort] > 0))
        if len(alive):
            number = counts[sort].astype(np.int64)
            index = (uniform(branches.key, _LEVEL) * number).astype(np.int64)[alive]
            parts.append(chosen_children(rows, branches, lines, alive, index, number, sort))
            owners.append(alive)
            factors.append(number[alive] * total[alive] / gain[sort, alive])
    if not parts:
        return np.zeros(0, np.int64), Branches.empty(), np.zeros(0)
    return np.concatenate(owners), Branches.concatenate(parts), np.concatenate(factors)


def _moments(
    rows: NDArray[np.void], points: _Walk, stand: NDArray[np.int64], worldly: bool, normals: object
) -> NDArray[np.float64]:
    """Moments (T, 4) at each tilt of the branch, averaged over how it lies; ``normals`` gives n nᵀ of points by frame."""
    table = np.zeros((len(_TILTS), 4))
    drawn_ = None if worldly else _interleave(_systematic(points.area, SAMPLES))
    for k, cos in enumerate(_TILTS):
        if worldly:
            own = np.flatnonzero((stand[points.path] // _ROLLS == k) & (points.area > 0))
            pick = own[_systematic(points.area[own], SAMPLES // 2)] if len(own) else own
            turn = 2 * np.pi * (stand[points.path[pick]] % _ROLLS + 0.5) / _ROLLS
        else:
            pick = drawn_
            turn = np.arange(len(pick)) * np.pi * (3 - np.sqrt(5))  # golden angle: even for any number of samples
        if len(pick) == 0:
            continue
        sin = np.sqrt(max(1 - cos * cos, 0.0))
        base = _turned_to(np.stack([sin * np.cos(turn), sin * np.sin(turn), np.full(len(turn), cos)], axis=1))
        moment = normals(points, base @ points.frame[pick], pick).mean(axis=0)
        table[k] = moment[0, 0], moment[1, 1], moment[2, 2], moment[0, 2]
    return table


def _leaf_normals(
    rows: NDArray[np.void], points: _Walk, frame: NDArray, pick: NDArray[np.int64], turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    row = points.row[pick]
    lit = settled(rows, row, frame, points.light[pick], np.array([0.0, 0.0, 1.0]))
    return np.einsum("nij,njk,nlk->nil", lit, turn[row], lit)


def _wood_normals(frame: NDArray) -> NDArray[np.float64]:
    axis = frame[:, :, 2]
    return (np.eye(3) - axis[:, :, None] * axis[:, None, :]) / 2


def _own_moments(rows: NDArray[np.void], row: int, turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moments (T, 4) of the leaves of a straight branch at each tilt."""
    n = SAMPLES // 2
    key = mix(key_of_seed(np.arange(n)) ^ np.uint64(0x1EAF))
    only, index = np.array([row]), np.arange(n)
    roll = uniform(key, _ROLL)
    around = 2 * np.pi * uniform(key, _TILT)
    light = rows["leaf_light"][row, 0] + rows["leaf_light"][row, 1] * (2 * uniform(key, _PICK) - 1)
    table = np.zeros((len(_TILTS), 4))
    for k, cos in enumerate(_TILTS):
        sin = np.sqrt(max(1 - cos * cos, 0.0))
        base = _turned_to(np.stack([sin * np.cos(around), sin * np.sin(around), np.full(n, cos)], axis=1))
        frame = leaf_frames(rows, only, base.astype(np.float32), roll, index, key)
        lit = settled(rows, only, frame, light, np.array([0.0, 0.0, 1.0]))
        moment = np.einsum("nij,jk,nlk->il", lit, turn, lit) / n
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
    return _at_tilt(samples.own_leaf_moment if own else samples.leaf_moment, row, axis)


def wood_moments(samples: Samples, row: NDArray[np.integer], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of n nᵀ over the branches of sub-plants; shapes as in `leaf_moments`."""
    return _at_tilt(samples.wood_moment, row, axis)


def _at_tilt(table: NDArray[np.float64], row: NDArray[np.integer], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moments (n, 3, 3) of a table (r, T, 4), turned to where branches lean."""
    at = (axis[:, 2].clip(-1, 1) + 1) / 2 * (len(_TILTS) - 1)
    low = np.minimum(at.astype(int), len(_TILTS) - 2)
    part = (at - low)[:, None]
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
