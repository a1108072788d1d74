# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ecology of a species: what it needs, how it grows beside others, and how it spreads. It changes no plant.

Tolerances are those of Niinemets and Valladares ("Tolerance to shade, drought, and waterlogging of temperate northern
hemisphere trees and shrubs", Ecological Monographs 76, 2006), from 0, none, to 5.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..parameters import described, limited


@dataclass(frozen=True)
class Ecology:
    """What a species needs and does; where a number is from is said in ``source``."""

    shade: float = limited(2.7, 0, 5, "tolerance of shade, 0 none to 5")
    drought: float = limited(2.7, 0, 5, "tolerance of drought")
    waterlogging: float = limited(1.7, 0, 5, "tolerance of waterlogging")
    degree_days: float = limited(700.0, 0, 8000, "sum of daily mean temperatures over 5 °C that it needs at least")
    coldest_month: float = limited(-15.0, -70, 30, "coldest mean of a month that it survives", "°C")
    fertility: float = limited(0.4, 0, 1, "fertility of the soil below which it grows less")
    fecundity: float = limited(30.0, 0, 1e6, "seeds that can germinate, for each square meter of crown and year")
    dispersal: float = limited(25.0, 0.1, 1e5, "mean distance that seeds travel", "m")
    height: float = limited(32.0, 0.01, 130, "height of the largest on a good site", "m")
    diameter: float = limited(1.2, 0.001, 12, "diameter of the largest on a good site", "m")
    height_curve: tuple[float, float] = limited(
        (4.0, 0.9), 0.1, 1000, "b and c of heights in closed stands, 1.3 + (height − 1.3)(1 − exp(−b diameter))^c, in m"
    )
    crown_width: tuple[float, float] = limited(
        (1.2, 20.0), 0, 300, "width of the crown of a tree that stands free, first + second × diameter", "m"
    )
    crown_conicity: float = limited(0.3, 0, 1, "shape of the crown: 0 a dome, 1 a cone")
    leaves: float = limited(6.0, 0.05, 20, "leaf area over the ground below a crown that is free to its foot")
    extinction: float = limited(0.5, 0.1, 1, "fraction of the light that a thin layer of leaves takes, over its area")
    light_compensation: float = limited(0.08, 0.001, 0.9, "light at which the lowest limbs die, over that in the open")
    wood_density: float = limited(530.0, 20, 1400, "dry mass of the wood over its fresh volume", "kg/m³")
    form_factor: float = limited(0.6, 0.05, 3, "wood above ground, with limbs, over diameter² × π/4 × height")
    light_use_efficiency: float = limited(
        0.9, 0.001, 10, "dry wood that all light on a square meter makes in a year on a good site", "kg"
    )
    diameter_increment: float = limited(0.012, 1e-5, 0.1, "most by which the diameter grows in a year", "m")
    source: str = described("", "where the numbers are from")
