# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist asks of a population of plants: how many, of which species, where, how large, next to what."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi


@dataclass(frozen=True)
class Companion:
    """How plants of one species stand to those of another.

    Attributes
    ----------
    species, other : int
        Indices into the shares. Plants of ``other`` may also be older than the population.
    strength : float
        -1: none grows within the distance of any of the others; 0: they do not care; 1: they grow only there.
    distance : float
        Metres on the map.
    """

    species: int
    other: int
    strength: float
    distance: float


@dataclass(frozen=True)
class Rules:
    """Rules of one population; the defaults leave everything open.

    Attributes
    ----------
    count : int
        Plants wanted, where ``by_density`` is off.
    by_density : bool
    density : float
        Plants for each square metre of the map that is wholly suitable; fewer where it is suitable in part.
    seed : int
    min_distance : float
        Least distance of two trunks on the map, metres.
    slope_min, slope_max : float
        Inclination of the ground, radians.
    altitude_min, altitude_max : float
        World z of the ground, metres; ``altitude_falloff`` metres inside of both ends plants become rarer.
    altitude_falloff : float
    aspect : float
        Direction in which the slope should face, radians clockwise from +Y (north) on the map.
    aspect_spread : float
        Largest angle from ``aspect``, radians; π lets it face anywhere. Level ground faces everywhere.
    edge_falloff : float
        Metres from the border of the ground within which plants become rarer; 0 for none.
    clumping : float
        0: even; 1: in clumps, with bare ground between.
    clump_size : float
        Metres from clump to clump.
    scale_min, scale_max : float
    scale_at_top : float
        By what plants are scaled at the highest suitable altitude, relative to the lowest; linear between.
    tilt : float
        0: upright; 1: along the normal of the ground.
    shares : tuple of float
        Relative frequency of each species.
    companions : tuple of Companion
    """

    count: int = 100
    by_density: bool = False
    density: float = 0.01
    seed: int = 0
    min_distance: float = 0.0
    slope_min: float = 0.0
    slope_max: float = pi / 2
    altitude_min: float = -inf
    altitude_max: float = inf
    altitude_falloff: float = 0.0
    aspect: float = 0.0
    aspect_spread: float = pi
    edge_falloff: float = 0.0
    clumping: float = 0.0
    clump_size: float = 20.0
    scale_min: float = 1.0
    scale_max: float = 1.0
    scale_at_top: float = 1.0
    tilt: float = 0.0
    shares: tuple[float, ...] = (1.0,)
    companions: tuple[Companion, ...] = ()
