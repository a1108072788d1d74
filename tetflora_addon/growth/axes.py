# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Center lines of branches, and how thick branches are along them.

Lines are straight segments that bend at joints, turn to the sky or the ground, and sway. The radius is that of the base
times a profile: linear from 1 to the taper, or by the pipe model, in which r^p is divided among the children (Shinozaki
et al., "A quantitative analysis of plant form: the pipe model theory", 1964; p = 2 is Leonardo's rule). The flare of
Weber and Penn (SIGGRAPH 1995, section 4.4) is added over the first eighth.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Integers, Keys, Table, by_component, columns, cross, gathered
from .hashing import Draw, signed
from .rows import FADED, ranged, varied
from .seeds import Branches
from .wind import axis_and_angle, is_windy, leaned, moment, sway, turned_by, turned_vectors


@dataclass(frozen=True)
class Axes(Arrays):
    """Center lines of branches: straight segments."""

    knots: Floats  # (n, S + 1, 3): ends of the segments; a branch with fewer than S segments repeats its last knot
    frames: Floats  # (n, S, 3, 3): local axes along each segment
    segments: Integers  # (n,): number of segments
    skies: Floats | None = None  # (n, S, 3): in the wind: `seeds.Branches.sky` along each segment
    later: Self | None = None  # the same lines a moment later, where it is asked how plants move

    def at(self, branch: Integers, t: Floats) -> tuple[NDArray, NDArray]:
        """Positions (m, 3) and frames (m, 3, 3) at the fractions t (m,) of the axes of branches (m,)."""
        number = self.segments[branch]
        along = t * number
        segment = np.minimum(along.astype(np.int64), number - 1)
        start = self.knot(branch, segment)
        step = self.knot(branch, segment + 1) - start
        return start + (along - segment)[:, None] * step, self.frame(branch, segment)

    def bend(self) -> Floats:
        """How far (n,) axes are from the straight line between their ends, meters."""
        chord = self.knots[:, -1] - self.knots[:, 0]
        direction = chord / np.maximum(np.linalg.norm(chord, axis=1), 1e-300)[:, None]
        between = self.knots[:, 1:-1] - self.knots[:, :1]
        square = np.einsum("nsi,nsi->ns", between, between) - np.einsum("nsi,ni->ns", between, direction) ** 2
        return np.sqrt(np.maximum(square, 0.0).max(axis=1, initial=0.0))

    def sky_at(self, branch: Integers, t: Floats) -> Floats | None:
        """Sky (m, 3) at the fractions t (m,) of the axes of branches (m,); None without wind."""
        if self.skies is None:
            return None
        number = self.segments[branch]
        return _picked(self.skies, branch, np.minimum((t * number).astype(np.int64), number - 1))

    def knot(self, branch: Integers, number: Integers) -> Floats:
        """Positions (m, 3) of knots given by branch (m,) and number (m,)."""
        return _picked(self.knots, branch, number)

    def frame(self, branch: Integers, segment: Integers) -> Floats:
        """Frames (m, 3, 3) of segments given by branch (m,) and number (m,)."""
        return _picked(self.frames, branch, segment)


def _picked(array: NDArray, first: Integers, second: Integers) -> NDArray:
    """``array[first, second]`` of an array whose first axis is the last in memory and whose second the one before."""
    flat = array.transpose(*range(2, array.ndim), 1, 0)  # (..., S, n), as it lies in memory
    flat = flat.reshape(*flat.shape[:-2], -1)
    picked = np.take(flat, second * len(array) + first, axis=-1)
    return picked.transpose(-1, *range(picked.ndim - 1))


def _to_front(array: NDArray) -> NDArray:
    """(..., S, n) to (n, S, ...)."""
    return array.transpose(-1, -2, *range(array.ndim - 2))


def axes(rows: Table, branches: Branches) -> Axes:
    """Center lines of branches (n,), of as many segments as the row has that has most.

    Each joint bends by its part of the order's curvature and turns to the sky or the ground (Weber and Penn, "Creation
    and rendering of realistic trees", SIGGRAPH 1995, sections 4.1 and 4.8).
    """
    lines = _axes(rows, branches)
    if branches.later is None:
        return lines
    return replace(lines, later=_axes(rows, branches.moved(), moment(rows)))


def _axes(rows: Table, branches: Branches, ahead: float = 0.0) -> Axes:
    """Center lines so many seconds after the moment of the rows."""
    segments = rows["segments"][branches.row]
    most = int(segments.max(initial=1))
    n = len(branches)
    # Branches last in memory, see `arrays`. Zeros, not empty: padding must be finite.
    knots, frames = _to_front(np.zeros((3, most + 1, n))), _to_front(np.zeros((3, 3, most, n)))
    step = (branches.length / segments)[:, None]
    bend = rows["curvature"][branches.row] / segments[:, None]
    outer_bend = rows["curvature_tip"][branches.row] / segments
    attraction = rows["attraction"][branches.row]
    attracted = np.flatnonzero(attraction.any(axis=1))
    pull = varied(attraction[attracted], branches.key[attracted], Draw.ATTRACTION) / segments[attracted]
    frame, knot = by_component(branches.frame), by_component(branches.position)
    knots[:, 0] = knot
    windy = is_windy(rows)
    skies = _to_front(np.zeros((3, most, n))) if windy else None
    if windy:
        axis, angle = axis_and_angle(sway(rows, branches, ahead) / segments[:, None])
    for s in range(most):
        if s:
            # The joint in the middle of an even number of segments belongs to the outer half.
            back, aside = (bend[:, 1] * signed(branches.key, Draw.BEND + 2 * s + turn) for turn in (0, 1))
            back = np.where(2 * s < segments, bend[:, 0], outer_bend) + back
            frame = _bent(frame, -back, aside)
            if len(attracted) == n:
                frame = _pulled(frame, pull, branches.sky)
            elif len(attracted):
                sky = gathered(branches.sky, attracted) if windy else None
                frame[attracted] = _pulled(gathered(frame, attracted), pull, sky)
        shown = frame
        if windy:  # what it does is not passed on to the next joint, or it would change how the branch grows
            shown = turned_by(frame, axis, (s + 1) * angle)
            skies[:, s] = turned_vectors(branches.sky, axis, (s + 1) * angle)
        knot = np.where((s < segments)[:, None], knot + step * shown[:, :, 2], knot)
        frames[:, s], knots[:, s + 1] = shown, knot
    by_hand = np.flatnonzero(rows["drawn"][branches.row])
    if len(by_hand):
        drawn = branches.take(by_hand)
        knots[by_hand], frames[by_hand], turn = _drawn_axes(rows, drawn, most)
        if windy:
            leaned_lines = _leaned(rows, drawn, turn, knots[by_hand], frames[by_hand], ahead)
            knots[by_hand], frames[by_hand], skies[by_hand] = leaned_lines
    return Axes(knots, frames, segments, skies)


def _drawn_axes(rows: Table, branches: Branches, most: int) -> tuple[NDArray, NDArray, NDArray]:
    """Knots (n, most + 1, 3) and frames (n, most, 3, 3) of branches drawn by hand; their plants' frames (n, 3, 3)."""
    local, line = rows["frames"][branches.row], rows["knots"][branches.row]
    turn = branches.frame @ local[:, 0].transpose(0, 2, 1)
    scale = branches.length / rows["size"][branches.row, 0]
    knots = np.einsum("nij,nsj->nsi", turn * scale[:, None, None], line - line[:, :1]) + branches.position[:, None]
    return knots[:, : most + 1], (turn[:, None] @ local)[:, :most], turn


def _leaned(
    rows: Table, branches: Branches, turn: NDArray, knots: NDArray, frames: NDArray, ahead: float
) -> tuple[NDArray, NDArray, NDArray]:
    """Knots, frames and skies of branches drawn by hand in the wind, whose plants have the axes ``turn`` (n, 3, 3)."""
    line = rows["knots"][branches.row, 0]
    ground = branches.position - np.einsum("nij,nj->ni", turn, line) * branches.scale[:, None]
    up = turn[:, :, 2]
    rate = sway(rows, replace(branches, position=ground, frame=turn), ahead) / branches.scale[:, None]
    bent = leaned(knots - ground[:, None], up, rate) + ground[:, None]
    axis, rate = axis_and_angle(rate)
    height = np.maximum(np.einsum("nsi,ni->ns", (knots[:, 1:] + knots[:, :-1]) / 2 - ground[:, None], up), 0.0)
    segments = height.shape[1]
    axis, angle = np.repeat(axis, segments, axis=0), (rate[:, None] * height).ravel()
    skies = turned_vectors(np.repeat(branches.sky, segments, axis=0), axis, angle).reshape(-1, segments, 3)
    return bent, turned_by(frames.reshape(-1, 3, 3), axis, angle).reshape(frames.shape), skies


def _bent(frame: Floats, pitch: Floats, yaw: Floats) -> Floats:
    """Rotate about the local y by pitch, then about the new local x by yaw."""
    x, y, z = frame[:, :, 0], frame[:, :, 1], frame[:, :, 2]
    cp, sp, cy, sy = (f(v)[:, None] for v in (pitch, yaw) for f in (np.cos, np.sin))
    forward = sp * x + cp * z
    return columns(cp * x - sp * z, cy * y + sy * forward, cy * forward - sy * y)


def _pulled(frame: Floats, pull: Floats, sky: Floats | None = None) -> Floats:
    """Turn frames to the sky by an angle (n,) times the sine of their tilt, about the level axis (Rodrigues)."""
    if sky is not None:
        axis, level = axis_and_angle(cross(frame[:, :, 2], sky))
        return turned_by(frame, axis, pull * level)
    level = np.hypot(frame[:, 0, 2], frame[:, 1, 2])
    safe = np.maximum(level, 1e-12)
    kx, ky = frame[:, 1, 2] / safe, -frame[:, 0, 2] / safe  # z × sky
    cos, sin = np.cos(pull * level), np.sin(pull * level)
    out = np.empty_like(frame)
    for column in range(3):
        vx, vy, vz = frame[:, :, column].T
        along = (1 - cos) * (kx * vx + ky * vy)
        out[:, 0, column] = cos * vx + sin * (ky * vz) + kx * along
        out[:, 1, column] = cos * vy - sin * (kx * vz) + ky * along
        out[:, 2, column] = cos * vz + sin * (kx * vy - ky * vx)
    return out


def profile(rows: Table, row: NDArray, key: Keys, t: Floats, summed: bool = False) -> NDArray:
    """Radius (n,) at fractions t (n,) of branches of rows (n,) and keys (n,), divided by that of the base unflared.

    ``summed`` is its integral from 0 to t, of which differences are exact under any sequence of cuts.
    """
    taper = ranged(rows, "taper", row, key, Draw.TAPER)
    out = t - (1 - taper) * t * t / 2 if summed else 1 - (1 - taper) * t
    hand = np.flatnonzero(rows["drawn"][row])
    if len(hand):
        out[hand] = _drawn(rows, row[hand], t[hand])[summed]
    piped = np.flatnonzero(rows["pipe"][row] > 0)
    if len(piped):
        power, start, place = rows["pipe"][row[piped]], rows["start"][row[piped], 0, 0], t[piped]
        # A tip as thick as the base has nothing to distribute; the limit keeps divisions finite.
        tip = np.minimum(taper[piped], 1 - 1e-6) ** power
        left, q = tip + (1 - tip) * (1 - np.clip((place - start) / (1 - start), 0, 1)), summed + 1 / power
        fallen = (1 - start) * (1 - left**q) / (q * np.maximum(1 - tip, 1e-12))
        out[piped] = np.minimum(place, start) + fallen if summed else left**q
    flared = np.flatnonzero(rows["flare"][row] > 0)
    if len(flared):
        fall = rows["fall"][row[flared]]
        end = np.minimum(t[flared], FADED / fall) if summed else t[flared]
        left = np.exp(-fall * end)
        more = (1 - left) / fall - 0.01 * end if summed else np.maximum(left - 0.01, 0)
        out[flared] += rows["flare"][row[flared]] * more
    return out


def _drawn(rows: Table, row: NDArray, t: Floats) -> tuple[NDArray, NDArray]:
    """Profile of branches that are drawn by hand, linear between their knots, and its integral."""
    radii, number = rows["radii"][row], rows["segments"][row]
    along = t * number
    segment = np.minimum(along.astype(np.int64), number - 1)
    part, every = along - segment, np.arange(len(row))
    low, high = radii[every, segment], radii[every, segment + 1]
    whole = np.concatenate([np.zeros((len(row), 1)), np.cumsum((radii[:, 1:] + radii[:, :-1]) / 2, axis=1)], axis=1)
    return low + (high - low) * part, (whole[every, segment] + part * (low + (high - low) * part / 2)) / number
