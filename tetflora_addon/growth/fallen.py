# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether plants that are nothing but fallen leaves are there on a day of the year."""

from __future__ import annotations

from ..species.species import Species
from .seasons import PRESENT, Season, expected_of, plant_days

_MIDSUMMER = 196.0


def is_fallen(species: Species) -> bool:
    """Whether a species is leaves that have fallen: they come in their full size, and there are none in midsummer."""
    leaf = None if species.year is None else species.year.leaf
    return leaf is not None and leaf.growth == 0.0 and _number(species, _MIDSUMMER, species.year.latitude, 0.0) == 0.0


def is_gone(species: Species, season: Season | None) -> bool:
    """Whether no plant of a species is there in a season, because its leaves have not fallen yet or are rotten.

    Without seasons it is summer, when there are none.
    """
    if not is_fallen(species):
        return False
    if season is None:
        return True
    return _number(species, season.northern_day, abs(season.latitude), season.spread) == 0.0


def _number(species: Species, day: float, latitude: float, spread: float) -> float:
    """The most leaves, over all that there are ever, that a plant of the species has on a day of its place."""
    year = species.year.at_latitude(latitude)
    days = plant_days(day, spread * max(year.spring, year.autumn))
    return float(expected_of(year.leaf, days, PRESENT).max())
