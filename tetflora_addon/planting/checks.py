# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules that nothing can follow are refused, with the setting's name and what to do."""

from __future__ import annotations

from math import degrees, isfinite

from ..errors import SceneError
from .rules import Companion, Rules


def check_rules(rules: Rules) -> None:
    """Look through all rules.

    Raises
    ------
    SceneError
        The first that cannot be.
    """
    _check_numbers(rules)
    if not sum(max(share, 0.0) for share in rules.shares) > 0.0:
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
    if not rules.clumping <= 1.0:
        raise SceneError(f"Clumping must be between 0 and 1, not {rules.clumping:g}")
    if rules.clumping and not rules.clump_size > 0.0:
        raise SceneError(f"Clump Size must be greater than 0, not {rules.clump_size:g} m; or set Clumping to 0")
    if not min(rules.scale_min, rules.scale_max) > 0.0:
        raise SceneError(
            f"Scale must be greater than 0, not {rules.scale_min:g} to {rules.scale_max:g}; raise Min and Max Scale"
        )
    for rule in rules.companions:
        _check_companion(rule, len(rules.shares))


def _check_numbers(rules: Rules) -> None:
    numbers = {
        "Density": rules.density,
        "Min Distance": rules.min_distance,
        "Altitude Falloff": rules.altitude_falloff,
        "Edge Falloff": rules.edge_falloff,
        "Clumping": rules.clumping,
        "Scale at Top": rules.scale_at_top,
        "Facing Spread": rules.aspect_spread,
    }
    for name, value in numbers.items():
        if not isfinite(value) or value < 0.0:
            raise SceneError(f"{name} must be 0 or greater, not {value:g}")


def _check_companion(rule: Companion, species: int) -> None:
    if not (0 <= rule.species < species and 0 <= rule.other < species):
        raise SceneError(
            f"A companion rule refers to species {rule.species + 1} and {rule.other + 1}, but the list has {species}; "
            "choose species from the list, or remove the rule"
        )
    if not -1.0 <= rule.strength <= 1.0 or not rule.distance >= 0.0:
        raise SceneError(
            f"A companion rule has Attraction {rule.strength:g} and Reach {rule.distance:g} m; "
            "Attraction must be between -1 and 1, and Reach 0 or greater"
        )
