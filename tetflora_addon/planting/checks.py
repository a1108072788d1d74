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
        raise SceneError("No species has a share above 0; raise one in the list of species to populate with")
    if rules.by_density and rules.density == 0.0:
        raise SceneError("The density is 0; raise it, or give a number of plants")
    if not rules.by_density and rules.count < 1:
        raise SceneError(f"{rules.count} plants are none; ask for at least one")
    if not rules.slope_min <= rules.slope_max:
        raise SceneError(
            f"The least slope, {degrees(rules.slope_min):.3g}°, is steeper than the largest, "
            f"{degrees(rules.slope_max):.3g}°; lower the one or raise the other"
        )
    if not rules.altitude_min <= rules.altitude_max:
        raise SceneError(
            f"The lowest altitude, {rules.altitude_min:.5g} m, is above the highest, {rules.altitude_max:.5g} m; "
            "lower the one or raise the other"
        )
    if not rules.clumping <= 1.0:
        raise SceneError(f"The clumping is {rules.clumping:g}; it goes from 0 to 1")
    if rules.clumping and not rules.clump_size > 0.0:
        raise SceneError(f"Clumps of {rules.clump_size:g} m cannot be; give a size above 0, or set the clumping to 0")
    if not min(rules.scale_min, rules.scale_max) > 0.0:
        raise SceneError(
            f"Scales from {rules.scale_min:g} to {rules.scale_max:g} leave plants without a size; give more than 0"
        )
    for rule in rules.companions:
        _check_companion(rule, len(rules.shares))


def _check_numbers(rules: Rules) -> None:
    numbers = {
        "density": rules.density,
        "least distance": rules.min_distance,
        "altitude falloff": rules.altitude_falloff,
        "edge falloff": rules.edge_falloff,
        "clumping": rules.clumping,
        "size at the top": rules.scale_at_top,
        "spread of the aspect": rules.aspect_spread,
    }
    for name, value in numbers.items():
        if not isfinite(value) or value < 0.0:
            raise SceneError(f"The {name} is {value:g}; give 0 or more")


def _check_companion(rule: Companion, species: int) -> None:
    if not (0 <= rule.species < species and 0 <= rule.other < species):
        raise SceneError(
            f"A companion rule names species {rule.species + 1} and {rule.other + 1} of {species}; "
            "choose species of the list, or remove the rule"
        )
    if not -1.0 <= rule.strength <= 1.0 or not rule.distance >= 0.0:
        raise SceneError(
            f"A companion rule has strength {rule.strength:g} and distance {rule.distance:g} m; "
            "strengths go from -1 to 1, and distances are not negative"
        )
