# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf area by day against published courses, and height and diameter by age against published ranges.

The leaf area of a species on a day is what its compiled form expects of `PLANTS` plants, each early or late as its key
has it, over what they have in summer. Courses of a near relative tell how fast leaves come and go, not when: there the
species has the relative's dates (`devtools.leaf_area`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devtools import leaf_area, sizes
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalog import load_species

PLANTS = 256


def run() -> dict[str, float]:
    """Figures of leaf area and of sizes."""
    return leaf_areas() | heights_and_diameters()


def leaf_areas() -> dict[str, float]:
    """Largest and mean errors of leaf area over that in summer, of all courses and of each."""
    figures: dict[str, float] = {}
    for course in leaf_area.published()["curves"]:
        error = np.abs(area_by_day(course) - course["area"])
        name = course["species"]
        figures |= {f"leaf_area_error_max_{name}": float(error.max()), f"leaf_area_error_mean_{name}": error.mean()}
    worst = [value for name, value in figures.items() if "_max_" in name]
    mean = [value for name, value in figures.items() if "_mean_" in name]
    return {
        "leaf_area_courses": len(worst),
        "leaf_area_error_max": max(worst),
        "leaf_area_error_mean": float(np.mean(mean)),
    } | {name: float(value) for name, value in figures.items()}


def heights_and_diameters() -> dict[str, float]:
    """Whether sizes are within the published ranges, and how far from the middle of these, as a fraction."""
    figures: dict[str, float] = {}
    every = [one for name in sizes.published()["species"] for one in sizes.compared(name)]
    for quantity, plural in (("height", "heights"), ("diameter", "diameters")):
        own = [one for one in every if one.quantity == quantity]
        off = np.array([one.measured / one.middle - 1.0 for one in own])
        figures |= {
            f"{plural}_within": float(all(one.low <= one.measured <= one.high for one in own)),
            f"{plural}_compared": len(own),
            f"{plural}_outside": sum(not one.low <= one.measured <= one.high for one in own),
            f"{plural}_from_middle_mean": float(np.abs(off).mean()),
            f"{plural}_from_middle_max": float(np.abs(off).max()),
        }
        for one in own:
            if not one.low <= one.measured <= one.high:
                print(f"  outside: {one}", flush=True)
    return {"sizes_species": len(sizes.published()["species"])} | figures


def area_by_day(course: dict[str, Any]) -> NDArray[np.float64]:
    """Leaf area (n,) on the days of a course over that in summer."""
    species = load_species(course["species"])
    year, latitude = species.year, course.get("latitude", species.year.latitude)
    if course["kin"]:
        leaf = replace(year.leaf, **{phase: course[phase] for phase in ("appear", "turn", "fall")})
        species = replace(species, year=replace(year, leaf=leaf))
    flora = compile_species([species])
    none = np.zeros(PLANTS)
    upright = np.tile(np.eye(3), (PLANTS, 1, 1))
    seeds = Seeds(("",), none.astype(np.int32), np.arange(PLANTS), np.zeros((PLANTS, 3)), upright, none + 1.0)
    summer = flora.leaf_areas(trunks(flora.rows, seeds)).sum()
    found = []
    for day in course["days"]:
        then = flora.in_year(Season(day=float(day), latitude=float(latitude)))
        found.append(then.leaf_areas(trunks(then.rows, seeds)).sum() / summer)
    return np.array(found)
