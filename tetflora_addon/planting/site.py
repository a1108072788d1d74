# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which ground suits a population: places are drawn evenly on the map, and kept as often as they are suitable.

Zones tell which part of the ground one kind of land takes, 0 to 1, so that kinds blend where it falls from 1 to 0. One
is a mask times limits along slope, altitude, wetness and the distance from lines. Where others come first, it
gets what these leave: shares of all zones of a ground add up to 1 at most.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf, pi, radians

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Keys, Mask
from ..errors import SceneError
from ..growth.hashing import child_key, key_of_seed, uniform
from ..parameters import meters, setting
from .cover import Suits
from .plane import NO_DISTANCE, Lines, Path, Terrain, border_of, clumps, inside_any, lines_along, map_areas, sampled
from .rules import GroundLimits, Rules
from .wetness import WetGround, wet_ground

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
        return level and high and not self.ask_for_water and self.path_min <= 0.0 and self.path_max == inf


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

    def share(self, spots: Spots, wet: WetGround | None) -> Floats:
        """How much of each place is the zone's, (n,) from 0 to 1."""
        one = self.limits
        slope = np.arccos(np.clip(spots.normal[:, 2], 0.0, 1.0))
        share = soft_between(slope, one.slope_min, one.slope_max, one.slope_softness, 0.0, pi / 2)
        z = spots.position[:, 2]
        share *= soft_between(z, one.altitude_min, one.altitude_max, one.altitude_softness, -inf, inf)
        if self.weight is not None:
            weights = np.clip(np.nan_to_num(self.weight[spots.triangle]), 0.0, 1.0)
            share *= np.einsum("ij,ij->i", weights, spots.barycentric)
        if self.image is not None:
            uv = np.einsum("ijk,ij->ik", self.uv[spots.triangle], spots.barycentric)
            share *= np.clip(np.nan_to_num(sampled(self.image, uv)), 0.0, 1.0)
        if self.lines is not None:
            away = self.lines.nearness(spots.position[:, :2]) * _reach(one)
            share *= soft_between(away, one.path_min, one.path_max, one.path_softness, 0.0, inf)
        if wet is not None and one.ask_for_water:
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

    Limits at the ``least`` and ``most`` of a value have no edge. What ends and what begins at a limit make 1 together.
    """
    share = np.ones(len(values))
    for inside, used in ((values - low, low > least), (high - values, high < most)):
        if used and softness > 1e-9:
            share *= np.clip(inside / softness + 0.5, 0.0, 1.0)
        elif used:
            share *= inside >= 0.0
    return share


CHUNK = 131_072  # places looked at together: what fits into a cache
_CLUMPS = 2**33  # the key of clumps, away from those of plants
_MOST_TRIANGLES = 300_000  # when ground is divided near areas
_DIVISIONS = 16
_ROUNDING = 1e-6  # a hair of tolerance: level ground passes a slope limit of 0 although positions are single precision


class SiteDraw(IntEnum):
    """What a number is drawn for."""

    TRIANGLE, SIDE, ALONG, AZIMUTH, SCALE, SPECIES, SEED, SUITABLE, FOUNDER = range(1, 10)
    COMPANION = 16  # one for each rule from here on


#: Why a place was not suitable, and what to do, in the order in which rules are asked.
REMEDIES = {
    "weight": "the vertex group leaves almost no ground; paint more weight, or invert or clear the vertex group",
    "image": "the image is black on almost all of the ground; paint it brighter, or invert or clear it",
    "altitude": "almost no ground lies between Min and Max Altitude; widen the range or lower Altitude Falloff",
    "wetness": "almost no ground is as wet as Min and Max Wetness ask for; widen the range",
    "zone": "the biome's mask and limits, or biomes that come before it, leave almost no ground; widen its limits",
    "areas": "the Areas curves contain almost no suitable ground; enlarge them, or clear Areas",
    "paths": "the Paths curves leave almost no ground; lower Path Distance, or clear Paths",
    "edge": "all ground is close to the border; lower Edge Falloff",
    "clumping": "clumping leaves too little ground; lower Clumping, or change Clump Size",
    "habitat": "no ground has the light or the plants above that the species ask for; change Grows in the species list",
}


@dataclass(frozen=True)
class Sample:
    """Suitable places among those that were drawn."""

    position: Floats  # (n, 3)
    up: Floats  # (n, 3): normals of the ground, upwards
    key: Keys  # (n,)
    drawn: int  # places looked at
    lost: dict[str, int]  # how many of them each of `REMEDIES` refused


class Site:
    """Ground that suits the rules, ready to draw places on."""

    def __init__(self, ground: Terrain, rules: Rules, zones: Sequence[Zone] = ()) -> None:
        """Leave out triangles where nothing can grow; plants get what all of the zones of the ground leave.

        Raises
        ------
        SceneError
            Nothing is left; names the setting that leaves nothing.
        """
        self.ground, self.rules, self.zones = ground, rules, tuple(zones)
        self._key = child_key(key_of_seed(rules.seed), _CLUMPS)
        triangles, normal, chosen = _by_inclination(ground.triangles, rules)
        weight = None
        if ground.weight is not None:
            weight = np.clip(np.nan_to_num(np.asarray(ground.weight, dtype=np.float64)[chosen]), 0.0, 1.0)
            triangles, normal, chosen, weight = _kept(weight.max(axis=1) > 0.0, triangles, normal, chosen, weight)
            if not len(chosen):
                raise SceneError(
                    "The vertex group has no weight within the slope limits; paint some, or invert or clear it"
                )
        low, high = triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)
        at_altitude = (high >= rules.altitude_min) & (low <= rules.altitude_max)
        if not at_altitude.any():
            raise SceneError(
                f"No suitable ground lies between altitudes {rules.altitude_min:.5g} and {rules.altitude_max:.5g} m; "
                f"the ground extends from {low.min():.5g} to {high.max():.5g} m. Change Min and Max Altitude"
            )
        self.lowest = max(float(low[at_altitude].min()), rules.altitude_min)
        self.highest = min(float(high[at_altitude].max()), rules.altitude_max)
        triangles, normal, chosen, weight = _kept(at_altitude, triangles, normal, chosen, weight)
        uv = None if ground.uv is None else np.asarray(ground.uv, dtype=np.float64)[chosen]
        self.within = None
        if ground.areas:
            source, triangles, weight, uv, self.within = _near_areas(ground.areas, triangles, weight, uv, bool(zones))
            normal, chosen = normal[source], chosen[source]
            if not len(source):
                raise SceneError("No suitable ground lies inside the Areas curves; move them over it, or clear Areas")
        self.triangles, self.weight, self.uv = triangles, weight, uv
        self.normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        self.most = np.ones(len(triangles)) if weight is None else weight.max(axis=1)
        area = map_areas(triangles) if ground.areas else 0.5 * np.abs(normal[:, 2])
        self.cumulative = np.cumsum(area * self.most if weight is not None else area)
        if not self.cumulative[-1] > 0.0:
            raise SceneError("The suitable ground is vertical and has no area seen from above; select another mesh")
        self.border = None
        if rules.edge_falloff > NO_DISTANCE:
            border = (border_of(ground.triangles) if ground.border is None else ground.border)[..., :2]
            if len(border):
                self.border = Lines(border[:, 0], border[:, 1], np.full(len(border), float(rules.edge_falloff)))
        self.paths = lines_of_paths(ground.paths)
        self.chosen = chosen
        wet = any(limits.ask_for_water for limits in (rules, *(zone.limits for zone in zones)))
        self.wet = wet_ground(ground.triangles) if wet else None

    @property
    def area(self) -> float:
        """Square meters of the map on which places are drawn; each counts as much as it is suitable at most."""
        return float(self.cumulative[-1])

    def draw(self, key: Keys, first: int, count: int, enough: int | None = None, suits: Suits | None = None) -> Sample:
        """Suitable ones among the places of children ``first`` to ``first + count - 1`` of a key, in their order.

        Stops when ``enough`` are found, with at least as many. ``suits`` is what one species asks for besides.
        """
        parts, drawn, suitable = [], 0, 0
        lost = dict.fromkeys(REMEDIES, 0)
        while drawn < count and (enough is None or suitable < enough):
            chunk = min(count - drawn, CHUNK)
            keys = child_key(key, np.arange(first + drawn, first + drawn + chunk))
            parts.append(self._suitable(keys, lost, suits))
            drawn += chunk
            suitable += len(parts[-1][2])
        position, up, keys = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Sample(position, up, keys, drawn, lost)

    def _suitable(self, keys: Keys, lost: dict[str, int], suits: Suits | None) -> tuple[NDArray, NDArray, Keys]:
        index = np.searchsorted(self.cumulative, uniform(keys, SiteDraw.TRIANGLE) * self.cumulative[-1], side="right")
        index = np.minimum(index, len(self.cumulative) - 1)
        # One row of nine numbers at a time: places are in no order, and each row is a wait for memory.
        corners = np.take(self.triangles.reshape(-1, 9), index, axis=0)
        root = np.sqrt(uniform(keys, SiteDraw.SIDE))
        along = uniform(keys, SiteDraw.ALONG)
        barycentric = np.stack([1.0 - root, root * (1.0 - along), root * along], axis=1)
        points = _mean(corners, barycentric)
        left = np.arange(len(keys))
        wanted = uniform(keys, SiteDraw.SUITABLE) * self.most[index]
        suitable = np.ones(len(keys))
        for name, factor in self._factors(index, barycentric, points, suits):
            suitable[left] *= factor(left)
            stay = wanted[left] < suitable[left]
            lost[name] += len(left) - int(stay.sum())
            left = left[stay]
        return points[left], self.normal[index[left]], keys[left]

    def _factors(
        self, index: Integers, barycentric: NDArray, points: NDArray, suits: Suits | None
    ) -> Iterator[tuple[str, object]]:
        """Rules by name, each a function from indices of places to how suitable they are; cheap ones first."""
        rules, ground = self.rules, self.ground
        if self.weight is not None:
            yield "weight", lambda i: np.einsum("ij,ij->i", np.take(self.weight, index[i], axis=0), barycentric[i])
        limits = rules.altitude_min, rules.altitude_max
        if np.isfinite(limits).any():
            yield "altitude", lambda i: _between(points[i, 2], *limits, rules.altitude_falloff)
        if rules.ask_for_water:
            yield "wetness", lambda i: by_wetness(self.wet.at(points[i]), rules)
        if self.zones:
            yield "zone", lambda i: self._zone_share(index[i], barycentric[i], points[i])
        if self.uv is not None:
            yield "image", lambda i: self._image_value(index[i], barycentric[i])
        if ground.areas:
            yield "areas", lambda i: inside_any(points[i, :2], ground.areas)
        if self.paths is not None:
            yield "paths", lambda i: self.paths.nearness(points[i, :2]) >= 1.0
        if self.border is not None:
            yield "edge", lambda i: self.border.nearness(points[i, :2])
        if rules.clumping > 0.0:
            yield "clumping", lambda i: clumps(points[i, :2], rules.clump_size, rules.clumping, self._key)
        if suits is not None:
            yield "habitat", lambda i: suits(points[i, :2])

    def _zone_share(self, index: Integers, barycentric: NDArray, points: NDArray) -> Floats:
        if self.within is not None:
            barycentric = np.einsum("ij,ijk->ik", barycentric, self.within[index])
        spots = Spots(self.chosen[index], barycentric, points, self.normal[index])
        return np.prod([zone.share(spots, self.wet) for zone in self.zones], axis=0)

    def _image_value(self, index: Integers, barycentric: Floats) -> Floats:
        uv = _mean(np.take(self.uv.reshape(-1, 6), index, axis=0), barycentric)
        return np.clip(np.nan_to_num(sampled(self.ground.image, uv)), 0.0, 1.0)


def lines_of_paths(paths: Sequence[Path]) -> Lines | None:
    """Paths as what points can be asked for their nearness to; None if they keep nothing free."""
    kept_free = [p for p in paths if p.half_width > NO_DISTANCE and len(p.points)]
    return lines_along([p.points for p in kept_free], [p.half_width for p in kept_free])


def _mean(corners: Floats, barycentric: Floats) -> Floats:
    """Values between three corners, (n, 3 k) one after the other, at barycentric coordinates (n, 3): (n, k)."""
    a, b, c = np.split(corners, 3, axis=1)
    return barycentric[:, :1] * a + barycentric[:, 1:2] * b + barycentric[:, 2:] * c


def _between(z: Floats, low: float, high: float, falloff: float) -> Floats:
    """1 well between the limits, 0 beyond them, linear over the falloff inside of each."""
    inside = ((z >= low) & (z <= high)).astype(np.float64)
    if falloff > NO_DISTANCE:
        inside *= np.clip(np.minimum(z - low, high - z) / falloff, 0.0, 1.0)
    return inside


def _by_inclination(triangles: Floats, rules: Rules) -> tuple[NDArray, NDArray, Integers]:
    """Triangles of the right slope and aspect, their normals (upwards, twice as long as they are large), and which."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal *= np.where(normal[:, 2:] < 0.0, -1.0, 1.0)
    upright, length = normal[:, 2], np.linalg.norm(normal, axis=1)
    flat = (length > 0.0) & (upright > 0.0) & (upright >= length * (np.cos(rules.slope_max) - _ROUNDING))
    if not flat.any():
        raise SceneError(
            f"No face of the ground is flatter than Max Slope ({np.degrees(rules.slope_max):.0f}°); "
            "raise Max Slope or select another mesh"
        )
    if rules.slope_min > 0.0:
        flat &= upright <= length * (np.cos(rules.slope_min) + _ROUNDING)
        if not flat.any():
            raise SceneError(
                f"No face of the ground has a slope between {np.degrees(rules.slope_min):.0f}° and "
                f"{np.degrees(rules.slope_max):.0f}°; lower Min Slope or raise Max Slope"
            )
    if rules.aspect_spread < np.pi:
        away = np.abs((np.arctan2(normal[:, 0], normal[:, 1]) - rules.aspect + np.pi) % (2.0 * np.pi) - np.pi)
        level = np.hypot(normal[:, 0], normal[:, 1]) <= _ROUNDING * length
        flat &= level | (away <= rules.aspect_spread + _ROUNDING)
        if not flat.any():
            raise SceneError(
                f"No slope faces within {np.degrees(rules.aspect_spread):.0f}° of {np.degrees(rules.aspect):.0f}° "
                "(clockwise from north, +Y); raise Facing Spread or change Facing"
            )
    chosen = np.flatnonzero(flat)
    return triangles[chosen], normal[chosen], chosen


def _kept(mask: Mask, *arrays: NDArray | None) -> tuple:
    if mask.all():
        return arrays
    return tuple(None if array is None else array[mask] for array in arrays)


def _near_areas(
    areas: tuple[Floats, ...], triangles: Floats, weight: Floats | None, uv: Floats | None, located: bool
) -> tuple[Integers, NDArray, NDArray | None, NDArray | None, NDArray | None]:
    """Parts (n,) of triangles near areas: large ones are divided, so that few places are drawn in vain.

    Triangle (n,) of each part; triangles, weights and texture of the parts; and where their corners are in their
    triangles, barycentric (n, 3, 3), if they shall be ``located``.
    """
    boxes = [(area.min(axis=0), area.max(axis=0)) for area in areas]
    columns = [triangles, *([] if weight is None else [weight[..., None]]), *([] if uv is None else [uv])]
    columns += [np.broadcast_to(np.eye(3), (len(triangles), 3, 3))] if located else []
    corners, source = np.concatenate(columns, axis=2), np.arange(len(triangles))
    for _ in range(_DIVISIONS):
        low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
        allowed = np.full(len(corners), -np.inf)  # size that needs no division, meters
        for box_low, box_high in boxes:
            touched = ((low <= box_high) & (high >= box_low)).all(axis=1)
            size = float((box_high - box_low).max()) / 8.0
            allowed[touched] = np.where(np.isneginf(allowed[touched]), size, np.minimum(allowed[touched], size))
        near = ~np.isneginf(allowed)
        large = near & ((high - low).max(axis=1) > allowed)
        if not large.any() or near.sum() + 3 * large.sum() > _MOST_TRIANGLES:
            corners, source = corners[near], source[near]
            break
        small = near & ~large
        a, b, c = (corners[large, corner] for corner in range(3))
        ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
        quarters = [np.stack(q, axis=1) for q in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        corners = np.concatenate([corners[small], *quarters])
        source = np.concatenate([source[small], *[source[large]] * 4])
    weighted, within = None if weight is None else corners[..., 3], None
    if located:
        corners, within = corners[..., :-3], corners[..., -3:]
    return source, corners[..., :3], weighted, None if uv is None else corners[..., -2:], within
