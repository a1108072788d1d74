# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of blades from what botanists measure: a curve for each half, as fine as one asks for.

A blade lies flat with its base at the origin and its tip at (0, 1). Each point of the margin belongs to a *ray* from a
*foot* on the midrib, along which side veins would run: obliquely upwards in blades with pinnate veins, from the base in
palmate ones. Lobes and teeth only move points along their rays, which never meet: so no outline crosses itself.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Integers
from ..parameters import limited, named

#: Exponents p and q of the half width 1 - (1 - u)^p, to the power of q, on the way from the end to the widest place. Of
#: bases, besides, how far palmate ones reach behind their last lobe, 0 to 1.
BASES = {
    "attenuate": (2.0, 1.7, 0.1),
    "cuneate": (2.0, 1.0, 0.15),
    "rounded": (2.0, 0.55, 0.2),
    "truncate": (4.0, 0.5, 0.25),
    "cordate": (3.0, 0.5, 0.7),
}
APEXES = {
    "rounded": (2.4, 0.5),
    "obtuse": (2.0, 0.7),
    "acute": (1.8, 1.0),
    "acuminate": (2.2, 1.75),
    "emarginate": (2.6, 0.5),
}
LOBINGS = ("pinnate", "palmate")
TEETH = ("serrate", "doubly serrate", "crenate", "sinuate")

#: How far a cordate base reaches behind the petiole, and both sides of an emarginate tip beyond it, in half widths.
_CORDATE, _EMARGINATE = 0.5, 0.7
#: How far feet of rays lie below their points of the margin, at most a quarter of it in lengths.
_OBLIQUE = 0.45
#: Fraction of a tooth that rises, and teeth on a tooth of a doubly serrate margin, and their size.
_RISE, _DOUBLE, _SECOND = 0.8, 3, 0.45
#: Angle between lobes of palmate blades, in circles over their number, and at most.
_PALM, _PALM_MOST = 0.61, np.radians(52)
_START = 33  # points that a half begins with
_ROUNDS = 12


@dataclass(frozen=True)
class Blade:
    """A simple leaf; lengths are in those of the blade, which lies from the end of the petiole to the tip."""

    width: float = limited(0.5, 0.005, 2, "greatest width, fraction of the length")
    widest: float = limited(0.45, 0.1, 0.9, "where it is widest: 0 base, 1 tip")
    base: str = named("rounded", BASES, "shape of the base")
    apex: str = named("acute", APEXES, "shape of the tip")
    lobing: str = named("pinnate", LOBINGS, "how lobes and veins are arranged")
    lobes: int = limited(0, 0, 12, "lobes: per side if pinnate, in total if palmate (0, or 3 and more)")
    lobe_depth: float = limited(0.4, 0, 0.9, "depth of the sinuses between lobes, fraction of the way to the midrib")
    lobe_round: float = limited(1.0, 0, 1, "0: pointed lobes, 1: rounded lobes")
    teeth: int = limited(0, 0, 60, "teeth per side")
    tooth: str = named("serrate", TEETH, "kind of teeth")
    tooth_size: float = limited(0.015, 0, 0.15, "height of teeth, fraction of the length")
    fold: float = limited(0.1, -1, 2, "rise of both halves from the midrib, fraction of the distance from it")
    curl: float = limited(0.1, -1, 1, "how far the tip bends down, fraction of the length")
    wave: float = limited(0.01, 0, 0.1, "height of waves along the margin, fraction of the length")
    waves: float = limited(4.0, 0, 20, "waves along the margin")
    twist: float = limited(0.0, -180, 180, "turn of the tip about the midrib, degrees")
    petiole: float = limited(0.0, 0, 0.6, "length of the petiole, fraction of the whole leaf")
    turn: float = limited(0.0, -180, 180, "turn of the whole leaf about its midrib, degrees")

    @property
    def palmate(self) -> bool:
        """Whether rays lead from the base."""
        return self.lobing == "palmate"

    @property
    def _rise(self) -> float:
        """Fraction of a tooth that rises: teeth point to the tip, or along the lobe that they are on."""
        return 0.5 if self.palmate else _RISE

    def knots(self, side: int) -> Floats:
        """Parameters (n,) of one half's tips, notches and ends, in order; between them it is smooth."""
        knots = [np.linspace(0.0, 1.0, _START)]
        if self.teeth:
            steps = np.arange(self.teeth)[:, None]
            within = np.array([0.0, self._rise])
            if self.tooth == "doubly serrate":
                small = (np.arange(_DOUBLE) + np.array([[0.0], [self._rise]])).ravel() / _DOUBLE
                within = np.concatenate([within, small])
            elif self.tooth != "serrate":
                within = np.arange(4) / 4
            y = ((steps + within) / self.teeth).ravel()
            knots.append(y if self.palmate else np.arccos(np.clip(1.0 - 2.0 * y, -1.0, 1.0)) / np.pi)
        if self.palmate and self.lobes:
            tips, _ = self._palm()
            knots.append(1.0 - np.concatenate([tips, (tips[1:] + tips[:-1]) / 2]) / self._most_angle())
        elif self.lobes:
            fine = np.linspace(0.0, 1.0, 2049)
            phase = self._lobe_phase(self._height(fine), side)
            knots.append(np.interp(np.arange(2, 2 * self.lobes + 2) / 2, phase, fine))
        every = np.sort(np.clip(np.concatenate(knots), 0.0, 1.0))
        return every[np.diff(every, prepend=-1.0) > 1e-9]

    def feet(self, s: Floats) -> Floats:
        """Heights (n,) on the midrib where rays of parameters s (n,) begin; 0 base, 1 tip."""
        if self.palmate:
            return np.zeros_like(s)
        y = self._height(s)
        return y - _OBLIQUE * y * (1.0 - y)

    def margin(self, s: Floats, side: int) -> Floats:
        """Points (n, 2) of one half's margin; s (n,) leads from the base, 0, to the tip, 1; side is 1 or -1."""
        s = np.asarray(s, dtype=np.float64)
        foot = np.stack([np.zeros_like(s), self.feet(s)], axis=1)
        if self.palmate:
            reach, ray = self._palmate(s)
        else:
            reach, ray = self._pinnate(s, foot[:, 1], side)
        reach = reach + self._teeth(s) * np.minimum(reach * 4.0, 1.0)
        points = foot + np.maximum(reach, 0.0)[:, None] * ray
        points[s >= 1.0] = [0.0, 1.0]
        return points * [side, 1.0]

    def _height(self, s: Floats) -> Floats:
        """Heights (n,) of unlobed margins; close together at both ends, where they may be round."""
        return (1.0 - np.cos(np.pi * s)) / 2.0

    def envelope(self, y: Floats) -> Floats:
        """Half widths (n,) of the blade without lobes and teeth at heights y (n,)."""
        (p, q, _), (r, t) = BASES[self.base], APEXES[self.apex]
        low = np.clip(y / self.widest, 0.0, 1.0)
        high = np.clip((1.0 - y) / (1.0 - self.widest), 0.0, 1.0)
        lower, upper = (1.0 - (1.0 - low) ** p) ** q, (1.0 - (1.0 - high) ** r) ** t
        return self.width / 2.0 * np.where(y < self.widest, lower, upper)

    def _pinnate(self, s: Floats, foot: Floats, side: int) -> tuple[Floats, Floats]:
        """Lengths (n,) and directions (n, 2) of rays to the margin without teeth."""
        y = self._height(s)
        wide, height = self.envelope(y), y
        if self.base == "cordate":
            near = np.clip(1.0 - y / self.widest, 0.0, 1.0)
            height = y - _CORDATE * wide * near**2
        if self.apex == "emarginate":
            near = np.clip((y - self.widest) / (1.0 - self.widest), 0.0, 1.0)
            height = height + _EMARGINATE * wide * near
        ray = np.stack([wide, height - foot], axis=1)
        length = np.linalg.norm(ray, axis=1)
        ray /= np.maximum(length, 1e-12)[:, None]
        if self.lobes:
            phase = self._lobe_phase(y, side)
            rounded = np.clip((1.0 + np.cos(2.0 * np.pi * phase)) / 2.0, 0.0, 1.0) ** 0.45
            lobe = self.lobe_round * rounded + (1.0 - self.lobe_round) * np.abs(2.0 * (phase % 1.0) - 1.0)
            length = length * (1.0 - self.lobe_depth * (1.0 - lobe) * np.clip(4.0 * y, 0.25, 1.0))
        return length, ray

    def _lobe_phase(self, y: Floats, side: int) -> Floats:
        """Number (n,) of the lobe, whole at its tip: the last is that of the leaf. Lobes of both sides alternate."""
        return 0.5 + (self.lobes + 0.5) * y * (1.25 - 0.25 * y) + 0.13 * (1 + side) * np.sin(np.pi * y)

    def _most_angle(self) -> float:
        """Angle between the midrib and the base of a palmate margin."""
        tips, _ = self._palm()
        return float(tips[-1] + (np.pi * 0.94 - tips[-1]) * BASES[self.base][2])

    def _palm(self) -> tuple[Floats, Floats]:
        """Angles from the midrib and lengths of the lobes of one half of a palmate blade, that of the tip first."""
        number = np.arange(max(self.lobes - 1, 2) // 2 + 1)
        step = min(2.0 * np.pi * _PALM / max(self.lobes, 3), _PALM_MOST)
        first = min(self.width / 2.0 / np.sin(step), 1.2)
        return number * step, np.maximum(1.0 + (first - 1.0) * number**1.2, 0.25 * first)

    def _in_lobe(self, angle: Floats) -> tuple[Integers, Floats]:
        """Lobe (n,) of a palmate blade on whose far side angles (n,) lie, and how far it is to the next, 0 to 1."""
        ends = np.append(self._palm()[0], self._most_angle())
        i = np.clip(np.searchsorted(ends, angle, side="right") - 1, 0, len(ends) - 2)
        return i, (angle - ends[i]) / (ends[i + 1] - ends[i])

    def _palmate(self, s: Floats) -> tuple[Floats, Floats]:
        """As `_pinnate`, of rays from the base."""
        most = self._most_angle()
        angle = (1.0 - s) * most
        tips, lengths = self._palm()
        ends, length = np.append(tips, most), np.append(lengths, 0.45 * lengths[-1])
        i, place = self._in_lobe(angle)
        low, high, a, b = ends[i], ends[i + 1], length[i], length[i + 1]
        middle = (1.0 - self.lobe_depth) * (a + b) / 2.0
        last = i == len(ends) - 2  # from the last lobe to the base there is no sinus
        near = np.where(place < 0.5, a, b)
        flank = _straight(near, middle, (high - low) / 2, 2 * np.minimum(place, 1 - place))
        pointed = np.where(last, _straight(a, b, high - low, place), flank)
        lobe = (1.0 + np.cos(2.0 * np.pi * place)) / 2.0
        rounded = np.where(last, a + (b - a) * place**2, middle + (a + (b - a) * place - middle) * lobe**0.8)
        bulge = np.where(last, 0.0, 0.35 * self.lobe_depth * np.sin(2.0 * np.pi * np.minimum(place, 1 - place)) ** 2)
        length = (self.lobe_round * rounded + (1.0 - self.lobe_round) * pointed) * (1.0 + bulge * (place % 0.5))
        if not self.lobes:
            length = lengths[0] + (lengths[-1] * 0.8 - lengths[0]) * np.sin(angle / most * np.pi / 2) ** 2
        return length * np.clip(s / 0.05, 0.0, 1.0), np.stack([np.sin(angle), np.cos(angle)], axis=1)

    def _teeth(self, s: Floats) -> Floats:
        """Heights (n,) of teeth over the mean margin, lower toward both ends."""
        if not self.teeth:
            return np.zeros_like(s)
        along = s if self.palmate else self._height(s)
        phase = self.teeth * along
        if self.tooth in ("serrate", "doubly serrate"):
            height = _saw(phase, self._rise) - 0.5
            if self.tooth == "doubly serrate":
                height = height + _SECOND * (_saw(_DOUBLE * phase, self._rise) - 0.5)
        elif self.tooth == "crenate":
            height = np.sqrt(np.clip((1.0 - np.cos(2.0 * np.pi * phase)) / 2.0, 0.0, 1.0)) - 0.6
        else:
            height = -0.5 * np.cos(2.0 * np.pi * phase)
        height = height * np.clip(12.0 * np.minimum(along, 1.0 - along), 0.0, 1.0)
        if self.palmate and self.lobes:  # on the flanks of lobes
            place = self._in_lobe((1.0 - s) * self._most_angle())[1]
            height = height * np.clip(1.4 * np.abs(np.sin(2.0 * np.pi * place)), 0.0, 1.0)
        return self.tooth_size * height


def _saw(phase: Floats, rise: float) -> Floats:
    """Teeth, 0 to 1, that rise over a fraction of their length and fall over the rest."""
    u = phase % 1.0
    return np.where(u < rise, u / rise, (1.0 - u) / (1.0 - rise))


def _straight(a: Floats, b: Floats, angle: Floats, place: Floats) -> Floats:
    """Distances (n,) from the base of a straight line between ends at distances a and b, an angle apart."""
    first, second = np.sin(angle * place), np.sin(angle * (1.0 - place))
    return a * b * np.sin(angle) / np.maximum(a * first + b * second, 1e-12)


def traced(blade: Blade, side: int, tolerance: float) -> Floats:
    """Parameters (n,) of points of one half's margin whose straight links keep within a tolerance of the curve."""
    s = blade.knots(side)
    checked = np.arange(1, 4) / 4.0
    for _ in range(_ROUNDS):
        ends = blade.margin(s, side)
        between = s[:-1, None] + np.diff(s)[:, None] * checked
        points = blade.margin(between.ravel(), side).reshape(*between.shape, 2)
        split = distance_to_links(points, ends[:-1, None], ends[1:, None]).max(axis=1) > tolerance / 2.0
        if not split.any():
            break
        s = np.sort(np.concatenate([s, between[split, 1]]))
    return s


def distance_to_links(points: Floats, first: Floats, last: Floats) -> Floats:
    """Distances (...) of points (..., d) from straight links between ends (..., d)."""
    link = last - first
    place = np.clip(((points - first) * link).sum(-1) / np.maximum((link * link).sum(-1), 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - first - place[..., None] * link, axis=-1)


def simplified(lines: Floats, tolerance: float) -> Integers:
    """Indices (m,) of points of lines (n, k, d) whose straight links pass all others within a tolerance.

    The same points of all k lines (Douglas and Peucker). What is kept for one tolerance is kept for every smaller one.
    """
    number = np.arange(len(lines))
    kept = number[[0, -1]]
    while True:
        link = np.minimum(np.searchsorted(kept, number, side="right") - 1, len(kept) - 2)
        off = distance_to_links(lines, lines[kept[link]], lines[kept[link + 1]]).max(axis=1)
        worst = np.maximum.reduceat(off, kept[:-1])[link]
        far = np.flatnonzero((off >= worst) & (worst > tolerance))
        if not len(far):
            return kept
        _, first = np.unique(link[far], return_index=True)
        kept = np.sort(np.concatenate([kept, far[first]]))
