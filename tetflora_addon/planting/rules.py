# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist asks of a population of plants: how many, of which species, where, how large, next to what.

Rules that nothing can follow are refused, with the setting's name and what to do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import degrees, floor, inf, isfinite, log10, pi, radians, sqrt

import numpy as np

from ..arrays import Floats, Integers32
from ..errors import SceneError
from ..parameters import FACTOR, LENGTH, meters, setting, within

#: Most plants that are placed at once.
MOST_PLANTS = 10_000_000
_ANGLE = {"subtype": 'ANGLE'}
_SLOPE = {"min": 0.0, "max": pi / 2, **_ANGLE}
_ALTITUDE = {"soft_min": -1000.0, "soft_max": 5000.0, **LENGTH}
_SCALE = {"min": 0.01, "soft_max": 4.0}


@dataclass(frozen=True)
class Companion:
    """How plants of one species stand to those of another."""

    #: species and other: indices into the weights. Plants of ``other`` may also be older than the population.
    species: int
    other: int
    #: -1: none grows within the distance of any of the others; 0: indifferent; 1: they grow only there.
    strength: float = setting(
        -1.0,
        "Attraction",
        "-1: never within the distance of the companion; 0: indifferent; 1: only within it. Strong values leave room "
        "for fewer plants",
        **FACTOR | {"min": -1.0},
    )
    #: Meters on the map.
    distance: float = setting(
        5.0, "Reach", "How far the companion's influence extends, measured on the map", **meters(0.0, 100.0)
    )


@dataclass(frozen=True)
class GroundLimits:
    """Between which values of the ground something grows.

    Altitudes are z in the world, meters; slopes are angles in radians.
    """

    slope_min: float = setting(0.0, "Min Slope", "Flatter ground is left out", **_SLOPE)
    slope_max: float = setting(pi / 2, "Max Slope", "Steeper ground is left out", **_SLOPE)
    altitude_min: float = setting(-inf, "Min Altitude", "Lower ground is left out", default=0.0, **_ALTITUDE)
    altitude_max: float = setting(
        inf, "Max Altitude", "Higher ground is left out, as above the tree line", default=100.0, **_ALTITUDE
    )
    wetness_min: float = setting(
        0.0,
        "Min Wetness",
        "Drier ground is left out. 0 is the driest, as on ridges, and 1 the wettest, as at brooks and in hollows: it "
        "follows from where water runs on the ground",
        **FACTOR,
    )
    wetness_max: float = setting(
        1.0, "Max Wetness", "Wetter ground is left out; 1 is the wettest, as at brooks and in hollows", **FACTOR
    )
    wetness_softness: float = setting(
        0.0,
        "Wetness Softness",
        "Range around both limits over which plants become sparser; half of them grow at a limit. 0 for a sharp line",
        default=0.2,
        **FACTOR,
    )

    @property
    def ask_for_water(self) -> bool:
        """Whether the wetness of the ground matters."""
        return self.wetness_min > 0.0 or self.wetness_max < 1.0


@dataclass(frozen=True)
class Rules(GroundLimits):
    """Rules of one population; the defaults leave everything open, those of panels are for a forest.

    Fields with a label are properties of a population with tooltips. Meters, radians; altitudes are z in the world.
    """

    count: int = setting(
        100,
        "Plants",
        "Number of plants to place. Fewer are placed if no more fit, which the report mentions",
        **within(1, 10_000, MOST_PLANTS),
    )
    by_density: bool = setting(False, "By Density", "Set the number of plants per hectare instead of in total")
    #: Plants for each square meter of the map that is wholly suitable; fewer where it is suitable in part.
    density: float = 0.01
    seed: int = setting(0, "Seed", "A different seed gives a different arrangement and different plants")
    min_distance: float = setting(
        0.0,
        "Min Distance",
        "Minimum distance between two trunks, measured on the map; existing plants count",
        default=2.0,
        **meters(0.0, 50.0),
    )
    slope_max: float = setting(pi / 2, "Max Slope", "Steeper ground is left out", default=radians(40.0), **_SLOPE)
    altitude_falloff: float = setting(
        0.0,
        "Altitude Falloff",
        "Distance inside both altitudes over which plants become sparser; 0 for a sharp line",
        **meters(0.0, 500.0),
    )
    #: Clockwise from +Y (north) on the map.
    aspect: float = setting(
        0.0,
        "Facing",
        "Direction that slopes should face: 0° is north (+Y), 90° is east (+X). Level ground faces everywhere",
        **_ANGLE,
    )
    aspect_spread: float = setting(
        pi,
        "Facing Spread",
        "Maximum angle between that direction and the one a slope faces; 180° allows any",
        **_SLOPE | {"max": pi},
    )
    edge_falloff: float = setting(
        0.0, "Edge Falloff", "Distance from the border within which plants thin out; 0 for none", **meters(0.0, 100.0)
    )
    clumping: float = setting(
        0.0,
        "Clumping",
        "0: evenly spread; 1: in clumps with bare ground between them. The number of plants stays the same while "
        "there is room",
        **FACTOR,
    )
    clump_size: float = setting(
        20.0, "Clump Size", "Approximate distance from one clump to the next", **meters(0.1, 500.0)
    )
    scale_min: float = setting(
        1.0, "Min Scale", "Scale of the smallest plants; 1 is the size in the species file", default=0.8, **_SCALE
    )
    scale_max: float = setting(
        1.0, "Max Scale", "Scale of the largest plants; 1 is the size in the species file", default=1.2, **_SCALE
    )
    scale_at_top: float = setting(
        1.0, "Scale at Top", "Scale factor at the highest ground, relative to the lowest; 1 for no change", **_SCALE
    )
    tilt: float = setting(
        0.0, "Follow Ground", "0: upright, as trees grow; 1: perpendicular to the ground, as moss and grass", **FACTOR
    )
    weights: tuple[float, ...] = (1.0,)  # relative frequency of each species
    companions: tuple[Companion, ...] = ()


def species_by_weight(weights: tuple[float, ...], draws: Floats) -> Integers32:
    """Species as indices into the weights, which are their relative frequencies, by draws from [0, 1), (n,) each."""
    weights = np.maximum(np.asarray(weights, dtype=np.float64), 0.0)
    limits = np.cumsum(weights) / weights.sum()
    # Rounding may leave the last limit below a draw that is just under 1.
    return np.minimum(np.searchsorted(limits, draws, side="right"), len(weights) - 1).astype(np.int32)


#: Fields that have to be 0 or greater, in the order in which they are looked at.
_NOT_NEGATIVE = (
    "density", "min_distance", "altitude_falloff", "wetness_softness", "edge_falloff", "clumping", "scale_at_top",
    "aspect_spread",
)  # fmt: skip


def check_rules(rules: Rules) -> None:
    """Look through all rules.

    Raises
    ------
    SceneError
        The first that cannot be.
    """
    labels = {one.name: one.metadata.get("name", "Density") for one in fields(rules)}
    for name in _NOT_NEGATIVE:
        value = getattr(rules, name)
        if not isfinite(value) or value < 0.0:
            raise SceneError(f"{labels[name]} must be 0 or greater, not {value:g}")
    if not sum(max(weight, 0.0) for weight in rules.weights) > 0.0:
        raise SceneError("No species has a weight above 0; raise a weight in the species list")
    if rules.by_density and rules.density == 0.0:
        raise SceneError("Density must be greater than 0; raise it, or turn off By Density")
    if not rules.by_density and rules.count < 1:
        raise SceneError(f"Count must be at least 1, not {rules.count}")
    if not rules.slope_min <= rules.slope_max:
        raise SceneError(
            f"Min Slope ({degrees(rules.slope_min):.3g}°) is greater than Max Slope ({degrees(rules.slope_max):.3g}°); "
            "lower Min Slope or raise Max Slope"
        )
    if not rules.altitude_min <= rules.altitude_max:
        raise SceneError(
            f"Min Altitude ({rules.altitude_min:.5g} m) is greater than Max Altitude ({rules.altitude_max:.5g} m); "
            "lower Min Altitude or raise Max Altitude"
        )
    if not 0.0 <= rules.wetness_min <= rules.wetness_max <= 1.0:
        raise SceneError(
            f"Min Wetness is {rules.wetness_min:.3g} and Max Wetness {rules.wetness_max:.3g}; both must be between 0 "
            "and 1, and Min not greater than Max"
        )
    if not rules.clumping <= 1.0:
        raise SceneError(f"Clumping must be between 0 and 1, not {rules.clumping:g}")
    if rules.clumping and not rules.clump_size > 0.0:
        raise SceneError(f"Clump Size must be greater than 0, not {rules.clump_size:g} m; or set Clumping to 0")
    if not min(rules.scale_min, rules.scale_max) > 0.0:
        raise SceneError(
            f"Scale must be greater than 0, not {rules.scale_min:g} to {rules.scale_max:g}; raise Min and Max Scale"
        )
    for rule in rules.companions:
        species = len(rules.weights)
        if not (0 <= rule.species < species and 0 <= rule.other < species):
            raise SceneError(
                f"A companion rule refers to species {rule.species + 1} and {rule.other + 1}, but the list has "
                f"{species}; choose species from the list, or remove the rule"
            )
        if not -1.0 <= rule.strength <= 1.0 or not rule.distance >= 0.0:
            raise SceneError(
                f"A companion rule has Attraction {rule.strength:g} and Reach {rule.distance:g} m; "
                "Attraction must be between -1 and 1, and Reach 0 or greater"
            )


#: Distance of neighbors in crown radii: a birch forest at 3 to 4 m is closed, and light still falls between the crowns.
CROWN_RADII = 1.2
#: The same in sides of the square that each plant has where a density is asked for: nine in ten then find a place.
SQUARE_SIDES = 0.25


def suggested_distance(
    radii: Sequence[float], weights: Sequence[float], scale: float = 1.0, density: float | None = None
) -> float:
    """Distance in meters that suits a mixture, in two digits.

    Each plant has the area that its crown needs; the distance is that of plants with the mean area.

    Parameters
    ----------
    radii : sequence of float
        Of the crowns of the species, meters.
    weights : sequence of float
        Relative frequency of each species; negative ones count as 0.
    scale : float
        Mean scale of the plants.
    density : float, optional
        Plants for each square meter that the artist asks for: then not so far that they do not fit.
    """
    shares = [max(weight, 0.0) for weight in weights]
    whole = sum(shares)
    if whole == 0.0:
        return 0.0
    area = sum(share * radius**2 for share, radius in zip(shares, radii, strict=True)) / whole
    distance = CROWN_RADII * scale * sqrt(area)
    if density is not None and density > 0.0:
        distance = min(distance, SQUARE_SIDES / sqrt(density))
    return round(distance, 1 - floor(log10(distance))) if distance > 0.0 else 0.0  # as an artist would write it
