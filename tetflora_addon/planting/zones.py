# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones: which part of the ground one kind of land takes, 0 to 1, so that kinds blend where it falls from 1 to 0.

A zone is a mask times limits along slope, altitude, wetness and the distance from lines. Where others come first, it
gets what these leave: shares of all zones of a ground add up to 1 at most.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi, radians

import numpy as np

from ..arrays import Floats, Floats32, Integers
from ..parameters import meters, setting
from .plane import Lines, lines_along
from .rules import GroundLimits
from .terrain import sampled
from .wetness import WetGround

_ANGLE = {"subtype": 'ANGLE', "min": 0.0, "max": pi / 2}
_WIDTH = "Range around both limits over which one kind of land gives way to the next; 0 for a sharp line"


@dataclass(frozen=True)
class Limits(GroundLimits):
    """Between which values of the ground a zone lies; each limit is in the middle of its soft edge.

    Distances are those from lines on the map, meters.
    """

    slope_softness: float = setting(0.0, "Slope Softness", _WIDTH, default=radians(10.0), **_ANGLE)
    altitude_softness: float = setting(0.0, "Altitude Softness", _WIDTH, default=10.0, **meters(0.0, 500.0))
    path_min: float = setting(0.0, "From", "Ground nearer to the paths is not part of the biome", **meters(0.0, 100.0))
    path_max: float = setting(
        inf, "To", "Ground farther from the paths is not part of the biome", default=10.0, **meters(0.0, 500.0)
    )
    path_softness: float = setting(0.0, "Path Softness", _WIDTH, default=2.0, **meters(0.0, 100.0))

    @property
    def open(self) -> bool:
        """Whether all ground is within them."""
        level = self.slope_min <= 0.0 and self.slope_max >= pi / 2 - 1e-6
        high = (self.altitude_min, self.altitude_max) == (-inf, inf)
        wet = self.wetness_min <= 0.0 and self.wetness_max >= 1.0
        return level and high and wet and self.path_min <= 0.0 and self.path_max == inf


@dataclass(frozen=True)
class Spots:
    """Places on the ground, as zones ask for them."""

    triangle: Integers  # (n,): of the ground
    barycentric: Floats  # (n, 3)
    position: Floats  # (n, 3): meters
    normal: Floats  # (n, 3): of the ground, upwards


@dataclass(frozen=True)
class Zone:
    """One zone of a ground of t triangles."""

    limits: Limits
    weight: Floats | None = None  # (t, 3): mask at the corners, 0 to 1; linear between
    uv: Floats | None = None  # (t, 3, 2): where the corners are in the image
    image: Floats32 | None = None  # (h, w): mask in texels, 0 to 1; the first row is at the bottom
    lines: Lines | None = None  # what distances are measured from: see `distance_lines`
    inverse: bool = False  # all but the zone, as what gives way to it has

    @property
    def asks_for_water(self) -> bool:
        """Whether the wetness of the ground matters."""
        return self.limits.wetness_min > 0.0 or self.limits.wetness_max < 1.0

    def share(self, spots: Spots, wet: WetGround | None) -> Floats:
        """How much of each place is the zone's, (n,) from 0 to 1."""
        one = self.limits
        slope = np.arccos(np.clip(spots.normal[:, 2], 0.0, 1.0))
        share = soft_between(slope, one.slope_min, one.slope_max, one.slope_softness, 0.0, pi / 2)
        z = spots.position[:, 2]
        share *= soft_between(z, one.altitude_min, one.altitude_max, one.altitude_softness, -inf, inf)
        if self.weight is not None:
            own = np.clip(np.nan_to_num(self.weight[spots.triangle]), 0.0, 1.0)
            share *= np.einsum("ij,ij->i", own, spots.barycentric)
        if self.image is not None:
            uv = np.einsum("ijk,ij->ik", self.uv[spots.triangle], spots.barycentric)
            share *= np.clip(np.nan_to_num(sampled(self.image, uv)), 0.0, 1.0)
        if self.lines is not None:
            away = self.lines.nearness(spots.position[:, :2]) * _reach(one)
            share *= soft_between(away, one.path_min, one.path_max, one.path_softness, 0.0, inf)
        if wet is not None and self.asks_for_water:
            share *= by_wetness(wet.at(spots.position), one)
        return 1.0 - share if self.inverse else share


def distance_lines(lines: tuple[Floats, ...], limits: Limits) -> Lines | None:
    """Lines on the map, (k, 2) each, to measure the distances that limits ask for; None without any."""
    return lines_along(lines, [_reach(limits)] * len(lines)) if np.isfinite(_reach(limits)) else None


def _reach(limits: Limits) -> float:
    """Meters beyond which distances do not matter."""
    return limits.path_max + 0.5 * limits.path_softness + 1e-3


def by_wetness(wet: Floats, limits: GroundLimits) -> Floats:
    """How well ground of a wetness (n,), 0 to 1, fits ``wetness_min``, ``wetness_max`` and ``wetness_softness``."""
    return soft_between(wet, limits.wetness_min, limits.wetness_max, limits.wetness_softness, 0.0, 1.0)


def soft_between(values: Floats, low: float, high: float, softness: float, least: float, most: float) -> Floats:
    """1 between two limits, 0 beyond them, a half at each where there is softness, (n,).

    Limits at the ``least`` and the ``most`` that a value can be have no edge. What ends at a limit and what begins
    there, with the same softness, make 1 together.
    """
    share = np.ones(len(values))
    for inside, used in ((values - low, low > least), (high - values, high < most)):
        if used and softness > 1e-9:
            share *= np.clip(inside / softness + 0.5, 0.0, 1.0)
        elif used:
            share *= inside >= 0.0
    return share
