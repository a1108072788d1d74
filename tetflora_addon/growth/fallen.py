# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether plants that are nothing but fallen leaves are there on a day of the year."""

from __future__ import annotations

from ..species.species import Species
from .seasons import PRESENT, Season, expected_of, plant_days


def is_gone(species: Species, season: Season | None) -> bool:
    """Whether no plant of a species is there in a season, because its leaves have not fallen yet or are rotten.

    Without seasons it is summer, when there are none.
    """
    if species.year is None or species.year.leaf is None or not species.year.fallen:
        return False
    if season is None:
        return True
    year = species.year.at_latitude(abs(season.latitude))
    days = plant_days(season.northern_day, season.spread * max(year.spring, year.autumn))
    return not expected_of(year.leaf, days, PRESENT).any()
