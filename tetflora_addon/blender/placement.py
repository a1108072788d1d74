# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plants go on a terrain: on ground that is flat enough, and at a distance from each other.

Arrays only; `plant_objects` makes objects of them. Chance comes from the same hash as in the plants themselves, so that
a seed means the same arrangement in every version of Blender.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..plants.hashing import child_key, key_of_seed, uniform

_ROUNDS = 24
_NO_DISTANCE = 1e-4  # metres; less is none, and its cells could not be counted
_SMALLEST_ROUND = 512
_LARGEST_ROUND = 2_000_000


class _Draw(IntEnum):
    TRIANGLE = 1
    SIDE = 2
    ALONG = 3
    AZIMUTH = 4
    SCALE = 5
    SPECIES = 6
    SEED = 7


@dataclass(frozen=True)
class Placement:
    """Plants to make.

    Attributes
    ----------
    position : (n, 3) float64
        Metres, world space.
    azimuth : (n,) float64
        Rotation about the vertical, radians.
    scale : (n,) float64
    species : (n,) int32
        Index into the shares that were asked for.
    seed : (n,) int32
        Zero or positive.
    wanted : int
        How many were asked for.
    reason : str
        Why there are fewer, empty if there are not.
    """

    position: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    scale: NDArray[np.float64]
    species: NDArray[np.int32]
    seed: NDArray[np.int32]
    wanted: int
    reason: str = ""

    def __len__(self) -> int:
        return len(self.seed)


def place(
    triangles: NDArray[np.float64],
    *,
    count: int,
    seed: int,
    slope_limit: float,
    min_distance: float,
    scale_range: tuple[float, float],
    shares: Sequence[float] = (1.0,),
    occupied: NDArray[np.float64] | None = None,
) -> Placement:
    """Scatter plants over triangles, evenly as seen on a map.

    Parameters
    ----------
    triangles : (t, 3, 3) float64
        The ground, metres; either side may be up.
    count : int
        Plants wanted.
    seed : int
    slope_limit : float
        Steepest ground in radians.
    min_distance : float
        Least horizontal distance of two plants, metres; 0 for none.
    scale_range : (float, float)
        Smallest and largest scale; uniform between.
    shares : sequence of float
        Relative frequency of each species.
    occupied : (m, 2) or (m, 3) float64, optional
        Where plants stand already.

    Raises
    ------
    SceneError
        No ground is flat enough, or no species has a share.
    """
    weights = np.maximum(np.asarray(shares, dtype=np.float64), 0.0)
    if not weights.sum() > 0.0:
        raise SceneError("No species has a share above 0; raise one in the list of species to populate with")
    area, triangles = _map_area(triangles, slope_limit)
    if not area.sum() > 0.0:
        raise SceneError(
            f"The surface has no face flatter than the slope limit of {np.degrees(slope_limit):.0f}°; raise the limit "
            "or select another mesh"
        )
    key = key_of_seed(seed)
    taken = _Spacing(min_distance, np.zeros((0, 2)) if occupied is None else np.asarray(occupied)[:, :2])
    kept_points, kept_keys, kept = [np.zeros((0, 3))], [np.zeros(0, np.uint64)], 0
    drawn = 0
    for _ in range(_ROUNDS):
        batch = min(max(2 * (count - kept), _SMALLEST_ROUND), _LARGEST_ROUND)
        keys = child_key(key, np.arange(drawn, drawn + batch))
        drawn += batch
        points = _sample(triangles, area, keys)
        chosen = taken.admit(points[:, :2], count - kept)
        kept_points.append(points[chosen])
        kept_keys.append(keys[chosen])
        kept += len(chosen)
        if kept >= count:
            break
    reason = ""
    if kept < count:
        reason = f"no room for more at a distance of {min_distance:.3g} m; lower the distance or take a larger surface"
    keys = np.concatenate(kept_keys)
    low, high = min(scale_range), max(scale_range)
    limits = np.cumsum(weights) / weights.sum()
    # Rounding may leave the last limit below a draw that is just under 1.
    species = np.minimum(np.searchsorted(limits, uniform(keys, _Draw.SPECIES), side="right"), len(weights) - 1)
    return Placement(
        position=np.concatenate(kept_points),
        azimuth=2.0 * np.pi * uniform(keys, _Draw.AZIMUTH),
        scale=low + (high - low) * uniform(keys, _Draw.SCALE),
        species=species.astype(np.int32),
        seed=_positive(keys),
        wanted=count,
        reason=reason,
    )


def new_seeds(seeds: NDArray[np.int64], roll: int = 0) -> NDArray[np.int32]:
    """Other seeds for plants with the given ones, (n,), zero or positive; another ``roll`` gives yet others."""
    return _positive(child_key(key_of_seed(seeds), roll & 0xFFFFFFFF))


def _positive(keys: NDArray[np.uint64]) -> NDArray[np.int32]:
    return (uniform(keys, _Draw.SEED) * 2**31).astype(np.int32)


def _map_area(triangles: NDArray[np.float64], slope_limit: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Areas on the map of triangles that are flat enough, (k,), and these triangles, (k, 3, 3)."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    upright, length = np.abs(normal[:, 2]), np.linalg.norm(normal, axis=1)
    # A hair of tolerance: level ground passes a limit of 0 although positions are single precision.
    flat = np.isfinite(length) & (length > 0.0) & (upright >= length * (np.cos(slope_limit) - 1e-6))
    return 0.5 * upright[flat], triangles[flat]


def _sample(triangles: NDArray[np.float64], area: NDArray[np.float64], keys: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Points on triangles, as dense as their weights ask for, (n, 3)."""
    cumulative = np.cumsum(area)
    index = np.searchsorted(cumulative, uniform(keys, _Draw.TRIANGLE) * cumulative[-1], side="right")
    a, b, c = np.moveaxis(triangles[np.minimum(index, len(area) - 1)], 1, 0)
    root = np.sqrt(uniform(keys, _Draw.SIDE))[:, None]
    along = uniform(keys, _Draw.ALONG)[:, None]
    return (1.0 - root) * a + root * (1.0 - along) * b + root * along * c


class _Spacing:
    """Keeps points apart with a grid whose cells hold one point at most.

    Cells are as large as the distance is on their diagonal, so two points of a cell are always too close, and points
    that are too close lie at most two cells apart.
    """

    _NEAR = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) < 4]

    def __init__(self, distance: float, occupied: NDArray[np.float64]) -> None:
        self.distance = distance
        self.cell = distance / np.sqrt(2.0)
        self.points = occupied

    def admit(self, candidates: NDArray[np.float64], most: int) -> NDArray[np.int64]:
        """Indices of candidates, (k,) and at most ``most``, that keep their distance; earlier ones go first."""
        if self.distance < _NO_DISTANCE:
            return np.arange(min(most, len(candidates)))
        undecided = np.flatnonzero(~self._near(candidates, self.points))
        chosen = np.zeros(0, np.int64)
        while len(undecided):
            # One speaker a cell, the earliest; those with no earlier speaker nearby are in.
            _, first = np.unique(self._cells(candidates[undecided]), return_index=True)
            speakers = np.sort(undecided[first])
            winners = speakers[~self._outranked(candidates[speakers])]
            chosen = np.concatenate([chosen, winners])
            undecided = undecided[~self._near(candidates[undecided], candidates[winners])]
        chosen = np.sort(chosen)[:most]
        self.points = np.concatenate([self.points, candidates[chosen]])
        return chosen

    def _cells(self, points: NDArray[np.float64], step: tuple[int, int] = (0, 0)) -> NDArray[np.int64]:
        place = np.floor(points / self.cell).astype(np.int64) + np.array(step)
        return place[:, 0] * np.int64(2**32) + place[:, 1]

    def _near(self, points: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points are too close to any of the others, which may crowd cells (plants set by hand)."""
        near = np.zeros(len(points), bool)
        order = np.argsort(self._cells(others), kind="stable")
        others, cells = others[order], self._cells(others)[order]
        for step in self._NEAR:
            wanted = self._cells(points, step)
            place, end = np.searchsorted(cells, wanted), np.searchsorted(cells, wanted, side="right")
            asking = np.flatnonzero((place < end) & ~near)
            while len(asking):  # as often as the fullest cell holds points
                gap = np.linalg.norm(points[asking] - others[place[asking]], axis=1)
                near[asking] = gap < self.distance
                place[asking] += 1
                asking = asking[(place[asking] < end[asking]) & ~near[asking]]
        return near

    def _outranked(self, speakers: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which speakers, one a cell and in order of rank, have an earlier one too close."""
        outranked = np.zeros(len(speakers), bool)
        own = self._cells(speakers)
        order = np.argsort(own)
        cells = own[order]
        for step in self._NEAR:
            wanted = self._cells(speakers, step)
            place = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
            other = order[place]
            met = (cells[place] == wanted) & (other < np.arange(len(speakers)))
            gap = np.linalg.norm(speakers - speakers[other], axis=1)
            outranked |= met & (gap < self.distance)
        return outranked
