# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights and trunks of plants by age beside published ones, for tests, benchmarks and documentation.

``tests/data/sizes_by_age.json`` holds the figures and their source. Trees were planted when they were some years old,
``planted``, and the years are counted from there. A tree is as high as its trunk and limbs; leaves are left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.growth import children, radius_at, trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.skeletons import MAX_ORDERS

from .forms import BREAST_HEIGHT
from .house import ROOT

DATA = ROOT / "tests" / "data" / "sizes_by_age.json"
SEEDS = 20
QUANTITIES = ("height", "diameter")
"""Meters, and centimeters at 1.3 m above the ground."""


class Size(NamedTuple):
    """One published size beside what is measured; ``years`` since the seed."""

    species: str
    years: float
    quantity: str
    low: float
    middle: float
    high: float
    measured: float


@cache
def published() -> dict[str, Any]:
    """The published sizes, as they are kept."""
    return json.loads(DATA.read_text(encoding="utf-8"))


def compared(identifier: str) -> Iterator[Size]:
    """All published sizes of a shipped species beside the means of plants of that age."""
    data = published()
    for one in data["species"][identifier]["ages"]:
        years = one["years"] + data["planted"]
        for quantity, value in zip(QUANTITIES, measured(identifier, years), strict=True):
            yield Size(identifier, years, quantity, *one[quantity], value)


@cache
def measured(identifier: str, years: float) -> tuple[float, float]:
    """Mean height, meters, and diameter of the trunk, centimeters, of `SEEDS` plants of a shipped species."""
    flora = compile_species([with_age(load_species(identifier), years)])
    zero, one = np.zeros(SEEDS), np.ones(SEEDS)
    upright = np.tile(np.eye(3), (SEEDS, 1, 1))
    seeds = Seeds((identifier,), zero.astype(np.int32), np.arange(SEEDS), np.zeros((SEEDS, 3)), upright, one)
    level = trunk = trunks(flora.rows, seeds)
    high = zero.copy()
    for _ in range(MAX_ORDERS):
        lines = axes(flora.rows, level)
        np.maximum.at(high, level.plant, lines.knots[:, :, 2].max(axis=1))
        level, _ = children(flora.rows, level, lines)
        level = level.take(np.flatnonzero(flora.rows["order"][level.row] <= 1))
        if not len(level):
            break
    there = np.minimum(BREAST_HEIGHT / trunk.length, 1.0)
    return float(high.mean()), float(200.0 * radius_at(flora.rows, trunk, there).mean())
