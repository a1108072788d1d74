# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether plants that are nothing but fallen leaves are there on a day of the year."""

from __future__ import annotations

import numpy as np

from ..species.species import Species
from ..species.year import DAYS
from .seasons import PRESENT, Season, expected, leaf_table

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
    day = season.day + (DAYS / 2 if season.latitude < 0 else 0.0)
    return _number(species, day, abs(season.latitude), season.spread) == 0.0


def _number(species: Species, day: float, latitude: float, spread: float) -> float:
    """The most leaves, over all that there are ever, that a plant of the species has on a day of its place."""
    year = species.year.at_latitude(latitude)
    most = spread * max(year.spring, year.autumn)
    days = day + np.linspace(-most, most, 2 * int(most) + 3)
    table, origin = leaf_table(year.leaf)[None], np.array([year.leaf.middle - DAYS / 2])
    return float(expected(table, origin, np.zeros(len(days), np.int64), days, [PRESENT])[0].max())
