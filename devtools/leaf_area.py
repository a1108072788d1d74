# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf area through the year of the shipped species against published courses.

``tests/data/leaf_area_by_day.json`` holds the courses with their sources, and dates of phases besides. The benchmark
``year`` and the tests are made from this.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tetflora_addon.growth.seasons import AREA, expected, leaf_table
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.species import LeafYear, Year

from .house import ROOT

DATA = ROOT / "tests" / "data" / "leaf_area_by_day.json"
#: Plants, evenly early and late, over which the mean is taken.
_PLANTS = np.linspace(-1.0, 1.0, 33)


@cache
def published() -> dict[str, Any]:
    """Courses and dates as the file has them."""
    return json.loads(DATA.read_text(encoding="utf-8"))


def leaf_area(year: Year, leaf: LeafYear, day: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leaf area (n,) on days (n,) over that in summer, as the mean of many plants expects it.

    Parameters
    ----------
    year : Year
        Of the species, for how far its plants are apart.
    leaf : LeafYear
        The dates.
    day : (n,) float64
    """
    apart = np.where(day < leaf.middle, year.spring, year.autumn)
    days = (day - apart * _PLANTS[:, None]).ravel()
    tables, origin = leaf_table(leaf)[None], np.array([leaf.middle - 182.5])
    (area,) = expected(tables, origin, np.zeros(len(days), np.int64), days, (AREA,))
    return area.reshape(len(_PLANTS), -1).mean(axis=0)


def errors(course: dict[str, Any]) -> NDArray[np.float64]:
    """Leaf area (n,) on the days of a course, less what is published."""
    year = load_species(course["species"]).year
    if course["kin"]:
        leaf = replace(year.leaf, **{phase: course[phase] for phase in ("appear", "turn", "fall")})
    else:
        leaf = year.at_latitude(course["latitude"]).leaf
    return leaf_area(year, leaf, np.array(course["days"], np.float64)) - course["area"]
