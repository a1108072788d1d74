# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf area of the shipped species against what is published: through the year, and by the size of the tree.

``tests/data/leaf_area_by_day.json`` holds courses with their sources, and dates of phases besides;
``tests/data/leaf_area_by_size.json`` leaf area by the diameter of trunks. The benchmarks ``year`` and ``leaf_area`` and
the tests are made from this.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.sizes import measured
from tetflora_addon.growth.growth import radius_at, trunks
from tetflora_addon.growth.seasons import AREA, expected, leaf_table
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.ages import ages_of, with_age
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.ecology import one_sided
from tetflora_addon.species.species import LeafYear, Species, Year

from .forms import BREAST_HEIGHT
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


SIZES = ROOT / "tests" / "data" / "leaf_area_by_size.json"
#: Ages at which trees are measured, over that at which they are as described; plants of each.
PARTS, SEEDS = (0.5, 1.0, 1.8), 32


class TreeArea(NamedTuple):
    """Leaf area of a shipped species at one size beside what is published for its trunk."""

    species: str
    habit: float
    years: float
    diameter: float  # of the trunk at 1.3 m, cm
    height: float  # m
    width: float  # of the crown, m
    area: float  # one-sided, m²
    published: float

    @property
    def ratio(self) -> float:
        """What it has over what is published."""
        return self.area / self.published


@cache
def allometry() -> dict[str, Any]:
    """Published leaf area by diameter as the file has it."""
    return json.loads(SIZES.read_text(encoding="utf-8"))


def by_size(identifier: str) -> Iterator[TreeArea]:
    """Means of plants at three ages, standing free and in a dense stand, whose trunks are thick enough to compare."""
    species, data = load_species(identifier), allometry()
    for habit, law in ((0.0, data["open"][identifier]), (1.0, data["stand"][identifier])):
        for part in PARTS:
            years = part * ages_of(species).full
            one = with_age(replace(species, habit=habit), years)
            diameter, height, width, shown = tree(one)
            if diameter >= data["least_diameter"]:
                area = shown * (1.0 if law.get("shown") else one_sided(species))
                a, b = law["law"]
                published = np.exp(a + b * np.log(width if law.get("by") == "crown_width" else diameter))
                yield TreeArea(identifier, habit, years, diameter, height, width, area, float(published))


def tree(species: Species) -> tuple[float, float, float, float]:
    """Means over plants: diameter of the trunk in cm, height and width of the crown in m, and shown leaf area in m²."""
    flora = compile_species([species])
    seeds = Seeds.upright(SEEDS)
    plants = trunks(flora.rows, seeds)
    height, width = measured(flora, seeds)
    radius = radius_at(flora.rows, plants, np.minimum(BREAST_HEIGHT / plants.length, 1.0))
    row = int(plants.row[0])
    kinds = flora.averages.leaf_area[row, 1]
    leaves = float(kinds[flora.rows["leaf_kind"] == 0].sum() / kinds.sum())  # without blossoms and cones
    area = leaves * float(flora.leaf_areas(plants).mean())
    return 200.0 * float(radius.mean()), float(height.mean()), float(width.mean()), area
