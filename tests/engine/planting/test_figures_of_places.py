# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plants are placed, painted and grown changes where a commit says so, and not by accident."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.engine.figures import Figures, check
from tests.engine.planting.test_ground_cover import SHEET, _wood
from tests.engine.planting.test_planting import RICH, _hills
from tests.engine.stands.test_stands import MIXED, YEARS, half_planted, records
from tetflora_addon.jobs import run_to_end
from tetflora_addon.planting import strokes
from tetflora_addon.planting.cover import Habitat, mapping
from tetflora_addon.planting.places import place, plant_ages
from tetflora_addon.planting.plane import Path, Terrain
from tetflora_addon.planting.rules import Rules, suggested_distance
from tetflora_addon.planting.strokes import Brush
from tetflora_addon.planting.wetness import wet_ground
from tetflora_addon.stands.grow import planted
from tetflora_addon.stands.site import StandTraits

#: By which part of itself a sum may differ: on the border between two places machines round otherwise.
ROUNDING = 1e-4


def placed() -> list[Any]:
    """Plants by many rules, on hills with a path, areas, and plants that stand there."""
    draw = np.random.default_rng(4)
    line, older = draw.uniform(0.0, 20.0, (4, 2)), draw.uniform(0.0, 20.0, (12, 3))
    ground = Terrain(_hills(1), paths=(Path(line, 0.8),))
    rules = replace(RICH, count=60)
    others = (
        Rules(count=60, seed=2),
        replace(rules, by_density=True, density=0.4, slope_max=0.3, altitude_min=0.4, altitude_falloff=0.5),
        replace(rules, aspect=1.0, aspect_spread=1.2, scale_at_top=0.5, edge_falloff=4.0),
    )
    made = [place(ground, one, older) for one in (rules, *others)]
    return [
        made,
        plant_ages(made[0].seed, 40.0, 0.5),
        [suggested_distance((1.5, 0.4), (2.0, 1.0), 1.0, d) for d in (None, 2.0)],
    ]


def painted() -> list[Any]:
    """Dabs of a brush that adds, thins and erases."""
    key, standing, made = strokes.stroke_key(3, 1), np.zeros((0, 2)), []
    brush = Brush(radius=6.0, density=0.8, strength=0.6, min_distance=0.4)
    for dab, center in enumerate(strokes.dabs_along((0.0, 0.0), (15.0, 4.0), 3.0)):
        places, keys = strokes.paint(brush, center, standing, key, dab)
        standing = np.concatenate([standing, places])
        made.append([places, strokes.individuals(brush, keys)])
    thinner = replace(brush, density=0.2, strength=1.0)
    return [made, [of(thinner, (6.0, 2.0), standing, key, 0) for of in (strokes.thin, strokes.erase)]]


def floor() -> list[Any]:
    """Light, litter and habitats under trees; water on hills."""
    under = run_to_end(mapping(SHEET, _wood(), 2))
    return [under, [under.map_of(habitat, kind) for habitat in Habitat for kind in (None, 1)], wet_ground(_hills(2))]


def grown() -> list[Any]:
    """A stand: its first plants, and sixty years."""
    site, traits = half_planted(), StandTraits(MIXED)
    suitability = np.stack([site.suitability(needs) for needs in traits.needs])
    return [traits, suitability, planted(site, traits, suitability, YEARS.density, YEARS.seed), records()]


FIGURES: Figures = {"placed": placed, "painted": painted, "floor": floor, "grown": grown}


@pytest.mark.parametrize("name", FIGURES)
def test_places_are_what_they_were(name: str) -> None:
    check(__name__, name, FIGURES[name](), ROUNDING)
