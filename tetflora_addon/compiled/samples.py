# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample points on the leaves and the wood of sub-plants, drawn by following random paths from the trunk outwards.

They stand for a sub-plant that is not grown: where its surfaces are within its bound, and how they are turned. All rows
of a species share one set of paths: what lies beyond a branch that a path has followed is a sample of what grows on
branches of its kind. Each row takes the paths of its parents on, as many as it needs (splitting and thinning of paths;
Kahn and Harris, "Estimation of particle transmission by random sampling", 1951).

Those of trunks know which limbs they are on, so that they can be moved as the crown shape of a plant moves its limbs.
"""

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Table, column, dot, gathered
from ..growth.axes import Axes, axes
from ..growth.foliage import leaf_keys, leaf_places, outwardness, place_leaves, youth
from ..growth.growth import branch_counts, chosen_children, chosen_drawn, leaf_counts, radius_at
from ..growth.hashing import child_key, evenly, key_of_seed, mix, systematic, thinned
from ..growth.rows import DEAD, FORK, LATERAL, SPUR, SPUR_ORDER
from ..growth.seeds import Branches

SAMPLES = 1024
_PATHS = 1536  # branches of each row that are followed
_TILTS = np.linspace(-1, 1, 9)  # cosines of the angle between a branch and the sky, for those that heed it
_ROLLS = 4  # ways in which such a branch may lie on its side
_CLASSES = len(_TILTS) * _ROLLS
_UPRIGHT = np.isin(np.arange(_CLASSES) // _ROLLS, (0, len(_TILTS) - 1))  # or hanging: these lie on no side,
_GROUPS = np.where(_UPRIGHT, np.arange(_CLASSES) // _ROLLS * _ROLLS, np.arange(_CLASSES))  # and share samples
_OF_CLASS = 64  # samples of each class of tilt and roll
_OF_UPRIGHT = 512  # of upright ones, as trunks are
_CLASS_PATHS = 48  # paths for each class
_DRAWN = 4  # more rows drawn by hand than this share the paths and samples of so many,
_LEAST_DRAWN = 1 / 16  # but each has this fraction of another row's
_BANDS = 8  # in which samples are spread evenly
_LEAVES = 2  # of each branch that a path comes to
_PICK, _ALONG, _TILT, _ROLL, _CHILD = range(101, 106)  # draws of this module, beyond those of growth


@dataclass(frozen=True)
class Points:
    """Sample points of one sub-plant after the other; each row has one run of them, or one for each class of stand."""

    #: first and number, (r, c): run of each row and class (tilt of the branch, and how it lies); rows that do not care
    #: have the same for all.
    first: Integers
    number: Integers
    position: Floats32  # (k, 3): in units of the branch's length, in its own axes
    frame: Floats32  # (k, 3, 3): of leaves, before they turn to the light; of wood the axis is the third column
    row: Integers32  # (k,): row that describes the leaf (its size, color and turn to the light) or the branch
    outward: Floats32  # (k,): place between the inside and the outside of the crown
    light: Floats32  # (k,): how far a leaf turns to the sky
    young: Floats32  # (k,): how young it is, see `growth.foliage.youth`
    limbs: "Limbs"  # of k
    shares: "Shares"  # of r

    def runs(self, subplants: Branches) -> tuple[Integers, Integers]:
        """First sample and number of samples (n,), (n,) that stand for sub-plants as they are turned to the sky."""
        stand = _stand_classes(subplants.frame[:, 2, :])
        return self.first[subplants.row, stand], self.number[subplants.row, stand]


@dataclass(frozen=True)
class Samples:
    """Points on the leaves and on the wood of sub-plants whose branch has length 1."""

    leaves: Points
    wood: Points


def draw_samples(
    rows: Table, leaf_area: Floats, wood_area: Floats, length: Floats, sampled: Container[int], *times: int
) -> list[Samples]:
    """Sample rows; one `Samples` for each of several numbers.

    Parameters
    ----------
    rows : (r,) parameter table
    leaf_area, wood_area : (r, r) float64
        Expected area in a sub-plant by the row that contributes it.
    length : (r,) float64
        Typical length of a branch, meters.
    sampled : container of int
        Which rows.
    *times : int
        So many times as many as proxies need, each once.
    """
    drawn = {number: ([], []) for number in times}
    trunk = np.flatnonzero(np.diff(rows["species"], prepend=-1))
    for first, end in zip(trunk, [*trunk[1:], len(rows)], strict=True):
        walk = _Walk(rows, int(first), int(end), leaf_area, length)
        for row, number in product(filter(sampled.__contains__, range(first, end)), times):
            leaves, wood = drawn[number]
            for points, area, out in ((walk.leaves, leaf_area, leaves), (walk.wood, wood_area, wood)):
                if area[row].sum() > 0:
                    out.append((row, *walk.sampled(points, row, area[row], number)))
    return [Samples(_joined(leaves, len(rows)), _joined(wood, len(rows))) for leaves, wood in drawn.values()]


def _turned(cos: Floats, azimuth: Floats) -> Floats:
    """Frames (n, 3, 3) at tilts of given cosines (n,) that lean along the world's x, with the sky at azimuths (n,)."""
    sin, c, s = np.sqrt(np.clip(1 - cos * cos, 0, 1)), np.cos(azimuth), np.sin(azimuth)
    zero = np.zeros_like(cos)
    return np.stack([[-c * cos, -s * cos, sin], [s, -c, zero], [c * sin, s * sin, cos]]).transpose(2, 0, 1)


def _stand_classes(sky: NDArray[np.floating]) -> Integers:
    """Class (n,) of how branches stand, from the direction (n, 3) of the sky in their own axes."""
    tilt = np.rint((sky[:, 2].clip(-1, 1) + 1) / 2 * (len(_TILTS) - 1)).astype(np.int64)
    turn = np.arctan2(sky[:, 1], sky[:, 0]) / (2 * np.pi)
    return tilt * _ROLLS + (np.floor((turn % 1.0) * _ROLLS).astype(np.int64) % _ROLLS)


def _at_least_some(counts: Integers) -> Integers:
    """The same counts; one each where things are so rare that no path has met any, but some are expected."""
    return counts if counts.any() else np.ones_like(counts)


@dataclass
class _Points(Arrays):
    """Sample points on branches of one row or several; shapes as in `Points`."""

    line: Integers32  # (n, slots): the branches that it is on, see `_Walk`
    position: Floats
    offset: Floats  # (n, 3): of the position, the way along a short shoot, which follows no branch's length
    frame: NDArray[np.floating]
    row: Integers32
    outward: Floats
    light: Floats
    young: Floats
    area: Floats
    limbs: "Limbs | None" = None

    @classmethod
    def on(cls, rows: Table, one: "_Arrived", branch: Integers, place: NDArray, frame: NDArray, *rest: NDArray) -> Self:
        """Points on branches, given by number."""
        row = one.branches.row[branch]
        short = rows["order"][row[:1]] == SPUR_ORDER
        offset = place - gathered(one.branches.position, branch) if short.all() else np.zeros_like(place)
        return cls(one.line[:, branch].T, place, offset, frame, row, *rest)


@dataclass
class _Arrived:
    """Branches of one row that paths have come to."""

    branches: Branches
    weight: Floats  # (n,): how many branches each stands for
    line: Integers32  # (slots, n): those it grows on, see `_Walk`


class _Walk:
    """Paths through one species; rows are counted from its trunk.

    Each path keeps a line of ancestors: the number of the branch of each row that it has come through, or −1. Rows that
    are drawn by hand share a slot of it, as none grows on another, and their branches are numbered on. ``branches`` are
    those of each row that paths have followed, ``leaves`` and ``wood`` what they have met.
    """

    def __init__(self, rows: Table, first: int, end: int, leaf_area: Floats, length: Floats) -> None:
        self.rows, self.first = rows, first
        self.length = np.where(length[first:end] > 0, length[first:end], 1.0) / max(length[first], 1e-9)
        self.scale = 1 / max(length[first], 1e-9)
        drawn = rows["drawn"][first:end]
        self.fraction = np.where(drawn, np.clip(_DRAWN / max(drawn.sum(), 1), _LEAST_DRAWN, 1), 1)
        self.slot = np.cumsum(~drawn | (np.diff(drawn, prepend=False) & drawn)) - 1
        self.start = np.where(drawn, self._number(int(drawn.argmax()) + first) * (np.cumsum(drawn) - 1), 0)
        arrived: list[list[_Arrived]] = [[] for _ in range(first, end)]
        self.branches: list[Branches] = []
        leaves, wood = [], []
        for row in range(first, end):
            one = self._gathered(row, arrived[row - first])
            one.line[self.slot[row - first]] = self.start[row - first] + np.arange(len(one.weight))
            self.branches.append(one.branches)
            lines = axes(rows, one.branches)
            wood.append(_wood_points(rows, one, lines))
            if leaf_area[row, row] > 0:
                leaves.append(_leaf_points(rows, one, lines))
            for sort in (LATERAL, FORK, SPUR, DEAD):
                child = int(rows["next"][row, sort])
                if child >= 0 and rows["count"][row, sort, 0] > 0:
                    # A child of one sort of each branch that has any.
                    counts = _at_least_some(branch_counts(rows, one.branches, sort))
                    alive = np.flatnonzero(counts)
                    index = (evenly(one.branches.key, _CHILD + sort) * counts).astype(np.int64)[alive]
                    children = chosen_children(rows, one.branches, lines, alive, index, counts, sort)
                    arrived[child - first].append(_Arrived(children, (one.weight * counts)[alive], one.line[:, alive]))
            for number, child in enumerate(range(*rows["drawn_rows"][row])):
                places = self._number(child)
                owner = thinned(len(one.weight), places)
                weight = one.weight[owner] * (len(one.weight) / places)
                drawn = chosen_drawn(rows, one.branches, owner, np.full(places, number))
                arrived[child - first].append(_Arrived(drawn, weight, one.line[:, owner]))
        self.wood = _Points.concatenate(wood)
        self.leaves = _Points.concatenate(leaves) if leaves else None

    def _number(self, row: int) -> int:
        return int((_CLASSES * _CLASS_PATHS if self.rows["tropic"][row] else _PATHS) * self.fraction[row - self.first])

    def _gathered(self, row: int, arrived: list[_Arrived]) -> _Arrived:
        """Branches of a row: as many from each row that bears them, and always the same number."""
        if not arrived:
            return self._begun(row)
        number = self._number(row)
        ends = np.linspace(0, number, len(arrived) + 1).astype(np.int64)
        branches, weights, lines = [], [], []
        for one, places in zip(arrived, np.diff(ends), strict=True):
            pick = thinned(len(one.weight), places)
            branches.append(one.branches.take(pick))
            weights.append(one.weight[pick] * (len(one.weight) / places))
            lines.append(one.line[:, pick])
        joined = Branches.concatenate(branches)
        # Paths that have been split part here.
        joined = replace(joined, key=child_key(joined.key, np.arange(number)))
        return _Arrived(joined, np.concatenate(weights), np.concatenate(lines, axis=1))

    def _begun(self, row: int) -> _Arrived:
        """Trunks at the origin; of length 1, with the plant scaled to fit."""
        n = self._number(row)
        # Keys from fixed seeds, so that what is compiled never depends on what was compiled before.
        key = mix(key_of_seed(np.arange(n)) ^ np.uint64(0x7E7F10A5))
        frame = np.broadcast_to(np.eye(3), (n, 3, 3))
        if self.rows["tropic"][row]:
            # Half of them upright, as most are.
            half_n = np.arange(n) // 2
            stand = np.where(np.arange(n) % 2, _CLASSES - _ROLLS + half_n % _ROLLS, half_n % _CLASSES)
            half = (_TILTS[1] - _TILTS[0]) / 2
            cos = np.clip(_TILTS[stand // _ROLLS] + half * (2 * evenly(key, _TILT) - 1), -1, 1)
            frame = _turned(cos, 2 * np.pi * (stand % _ROLLS + evenly(key, _ROLL)) / _ROLLS)
        branches = Branches.apart(row, key, frame, self.length[row - self.first], self.scale)
        return _Arrived(branches, np.ones(n), np.full((self.slot[-1] + 1, n), -1, np.int32))

    def sampled(
        self, points: _Points | None, row: int, expected: Floats, times: int
    ) -> tuple[_Points, Integers, Integers]:
        """Samples of what grows on branches of a row, and first sample and number of samples for each class (c,), (c,).

        They are drawn by area from points on leaves or wood, in the axes of the branches. ``expected`` (r,) is the
        expected area in a sub-plant by the row that contributes it.
        """
        i = row - self.first
        number = np.zeros(0) if points is None else points.line[:, self.slot[i]] - self.start[i]
        borne = np.flatnonzero((number >= 0) & (number < len(self.branches[i])))
        if len(borne) == 0 or expected[points.row[borne]].sum() == 0:
            # So rare that no path has met any: they are taken to be where the branches of the row itself are.
            points = replace(self.wood, row=np.full_like(self.wood.row, expected.argmax()))
            borne = np.flatnonzero(self.wood.row == row)
        # Each row has its expected area; paths only give its distribution.
        met = np.bincount(points.row[borne], points.area[borne], len(expected))
        area = points.area[borne] * (expected / np.where(met > 0, met, 1))[points.row[borne]]
        base, under = self.branches[i], points.line[borne, self.slot[i]] - self.start[i]
        place = _in_bands(points, borne, base, under)
        group, numbers = np.zeros(len(borne), np.int64), np.full(_CLASSES, int(times * SAMPLES * self.fraction[i]))
        first = np.zeros(_CLASSES, np.int64)
        if self.rows["tropic"][row]:
            group = _GROUPS[_stand_classes(base.frame[:, 2, :])][under]
            numbers = (times * np.where(_UPRIGHT, _OF_UPRIGHT, _OF_CLASS) * self.fraction[i]).astype(np.int64)
            distinct = np.where(np.arange(_CLASSES) == _GROUPS, numbers, 0)
            first = (np.cumsum(distinct) - distinct)[_GROUPS]
            pick = systematic(area, group, place, distinct)
        else:
            pick = systematic(area, group, place, numbers[:1])
        picked, base = points.take(borne[pick]), base.take(under[pick])
        on = picked.line[:, self.slot] - self.start
        limbs = _limbs_of(self.rows, self.first, i, on, self.branches, picked.row, base)
        return replace(self._local(picked, base, i), limbs=limbs), first, numbers

    def _local(self, points: _Points, base: Branches, i: int) -> _Points:
        """Points (n,) in the axes of branches (n,) of a row, in units of their length."""
        spur = self.rows["order"][self.first + i] == SPUR_ORDER
        length = np.maximum(base.length, 1e-12)[:, None]
        way = (points.position - points.offset - base.position) / length
        # Short shoots do not follow the length of what bears them: they are as large as on one of typical length.
        way += points.offset / (length if spur else self.length[i])
        axis, frame = base.frame.transpose(1, 2, 0), points.frame.transpose(1, 2, 0)
        frame = (axis[:, :, None] * frame[:, None]).sum(axis=0).transpose(2, 0, 1)
        return replace(points, position=(axis * way.T[:, None]).sum(axis=0).T, frame=frame)


def _in_bands(points: _Points, borne: Integers, base: Branches, under: Integers) -> Floats:
    """Where points are (n,), 0 to 1: bands along the branch, and within each from the axis outwards."""
    way = gathered(points.position, borne) - gathered(base.position, under)
    along = dot(way, gathered(base.frame[:, :, 2], under))
    across = np.sqrt(np.maximum(dot(way, way) - along * along, 0))[:, 0]
    length = np.maximum(base.length[under], 1e-12)
    along, across = along[:, 0] / length, across / length
    band = np.floor(_BANDS * (along - along.min()) / max(np.ptp(along), 1e-12)).clip(0, _BANDS - 1)
    return (band + across / max(across.max(), 1e-12)) / _BANDS


def _wood_points(rows: Table, one: _Arrived, lines: Axes) -> _Points:
    """A place on the wood of each branch."""
    branches, every = one.branches, np.arange(len(one.branches))
    along = evenly(branches.key, _ALONG)
    position, frame = lines.at(every, along)
    area = one.weight * branches.length * radius_at(rows, branches, along)
    none = np.zeros(len(every))
    return _Points.on(rows, one, every, position, frame, outwardness(rows, branches, every, along), none, none, area)


def _leaf_points(rows: Table, one: _Arrived, lines: Axes) -> _Points:
    """Some leaves of each branch that bears any, spread along it: how they are turned differs most on one branch."""
    branches = one.branches
    counts = _at_least_some(leaf_counts(rows, branches))
    picked = np.flatnonzero(counts)
    place = (evenly(branches.key, _PICK)[picked] + np.arange(_LEAVES)[:, None] / _LEAVES).ravel() % 1.0
    picked = np.tile(picked, _LEAVES)
    index = (place * counts[picked]).astype(np.int64)
    key = leaf_keys(branches, picked, index)
    t = leaf_places(rows, branches, picked, index, counts, key)
    leaves = place_leaves(rows, branches, lines, picked, index, key, t)
    outward = outwardness(rows, branches, picked, t)
    area = (one.weight * counts)[picked] * leaves.size**2
    light = np.broadcast_to(leaves.light, len(leaves))  # may be one number for all
    young = youth(rows, branches.row[:1], t)
    return _Points.on(rows, one, picked, leaves.position, leaves.frame, outward, light, young, area)


def _joined(samples: list[tuple[int, _Points, Integers, Integers]], rows: int) -> Points:
    """Samples of one row after the other: row, points, and first sample and number of each class."""
    first, number = np.zeros((2, rows, _CLASSES), np.int64)
    of_row: list[int] = []
    for row, points, begins, counts in samples:
        first[row], number[row] = len(of_row) + begins, counts
        of_row += [row] * len(points.row)
    parts = [points for _, points, *_ in samples]

    def whole(name: str, shape: tuple[int, ...] = (), kind: type = np.float32) -> NDArray:
        return np.concatenate([np.zeros((0, *shape)), *(getattr(p, name) for p in parts)]).astype(kind, "C")

    limbs = Limbs.concatenate([p.limbs for p in parts])
    numbers = (whole(name) for name in ("outward", "light", "young"))
    columns = whole("position", (3,)), whole("frame", (3, 3)), whole("row", (), np.int32), *numbers
    return Points(first, number, *columns, limbs, Shares.of(limbs, np.array(of_row, np.int64), rows))


#: Classes of samples: on the trunk itself, on stems beyond forks, on limbs of the one and of the others.
TRUNK, STEM, LIMB, STEM_LIMB = range(4)


@dataclass(frozen=True)
class Limbs(Arrays):
    """The limbs that samples (k) are on."""

    #: (k, 3): where the limb leaves the trunk, in the axes and units of samples; 0 where there is none.
    root: Floats32 = column(3, dtype=np.float32)
    kind: NDArray[np.int8] = column(dtype=np.int8)  # (k,): class of the sample; `TRUNK` on all that is not a trunk
    follows: Floats32 = column(dtype=np.float32)  # (k,): fraction of what is there that follows the limb's length


@dataclass(frozen=True)
class Shares:
    """What samples of each row stand for."""

    kinds: Floats  # (r, 4): fractions of each class
    follows: Floats  # (r,): mean over those on limbs

    @classmethod
    def of(cls, limbs: Limbs, row: Integers, rows: int) -> Self:
        """Of samples (k,) of rows (k,), of which there are so many."""
        on = limbs.kind >= LIMB
        kinds = np.bincount(row.astype(np.int64) * 4 + limbs.kind, minlength=4 * rows).reshape(rows, 4)
        follows = np.bincount(row[on], limbs.follows[on], rows) / np.maximum(np.bincount(row[on], minlength=rows), 1)
        return cls(kinds / np.maximum(kinds.sum(axis=1, keepdims=True), 1), follows)


def _limbs_of(
    rows: Table, first: int, i: int, number: Integers, branches: Sequence[Branches], row: Integers, base: Branches
) -> Limbs:
    """The limbs of samples (k,) of row ``i`` of the species that begins at row ``first``.

    ``number`` (k, s) are those of the ``branches`` of each row of the species that samples are on, ``row`` (k,)
    describes each sample, and ``base`` are the branches (k) of row ``i`` that they are on.
    """
    species, out = rows[first : first + number.shape[1]], Limbs.zeros(len(row))
    trunks = np.flatnonzero((species["order"] == 0) & ~species["drawn"] & ~species["phantom"])
    if i not in trunks:
        return out
    within = (number >= 0) & (number < [len(group) for group in branches])
    out.kind[within[:, trunks[trunks > i]].any(axis=1)] = STEM
    for limb in np.unique(species["next"][trunks][:, (LATERAL, DEAD)]) - first:
        # What is on a dead branch of a limb is on that limb: rows of living branches come first.
        group = np.flatnonzero(within[:, limb] & (out.kind < LIMB)) if limb >= 0 else np.zeros(0, np.intp)
        if len(group):
            limbs = branches[limb].take(number[group, limb])
            way = limbs.position - base.position[group]
            out.root[group] = np.einsum("nji,nj->ni", base.frame[group], way) / base.length[group, None]
            out.kind[group] += LIMB
            weight = rows["count_by_length"][limbs.row]
            longer = weight * limbs.vigor
            follows = longer / np.maximum(1 - weight + longer, 1e-12)
            out.follows[group] = np.where(row[group] == limbs.row, 0.0, follows)
    return out
