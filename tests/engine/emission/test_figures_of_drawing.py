# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown and expected of a small wood changes where a commit says so, and not by accident."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.engine import support
from tests.engine.figures import Figures, check
from tests.engine.refinement.test_loop import FAST
from tests.engine.test_figures import rich
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.emission.budget import Stand, estimate
from tetflora_addon.jobs import run_to_end
from tetflora_addon.preview.levels import colors_of, gather, thinned
from tetflora_addon.preview.light_plants import bounds_of_plants, crowns_of, light_plants
from tetflora_addon.refinement.loop import refine
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.species import Species

#: By which part of itself a sum may differ: on the border between two decisions machines round otherwise.
ROUNDING = 1e-4


def species() -> list[Species]:
    return [species_from_dict(support.SMALL, "small", "small.json"), rich()]


@cache
def flora() -> Flora:
    return compile_species(species())


def view(kind: str) -> Camera:
    sides = {"PERSP": 0.8, "ORTHO": 9.0}
    if kind in sides:
        return support.camera((0, -9, 2.5), (0, 0, 1.2), pixels=40, view=sides[kind], kind=kind)
    around = support.camera((0, -9, 2.5), (0, 0, 1.2), pixels=40)
    return replace(around, kind=kind, window=(-np.pi, np.pi, -np.pi / 2, np.pi / 2), width=96, height=48)


def preview() -> list[Any]:
    """Levels of the preview, and light shapes."""
    seeds = support.grove(9, 1.8, np.arange(9) % 2)
    loop = refine(flora(), seeds, view("PERSP"), RefinementSettings(**FAST))
    levels = thinned(run_to_end(gather(loop, flora(), view("PERSP"))).levels)
    modes = "LEVEL", "VISIBILITY", "FORM", "CONTRIBUTION"
    colors = [colors_of(level, mode, len(levels)) for level in levels for mode in modes]
    shapes = [of(flora(), seeds, 9) for of in (light_plants, bounds_of_plants)]
    return [
        [(level.nodes, level.extinction, level.color) for level in levels],
        colors,
        shapes,
        crowns_of(flora(), seeds),
    ]


def expected() -> list[Any]:
    """Crowns, and what is expected before anything is refined."""
    crowns = tuple(map(crown_of, species()))
    which, foot = np.arange(9) % 2, support.grove(9, 1.8).position
    stand = Stand(np.ones(9), foot, np.ones(9), which, crowns)
    figures = [
        estimate(stand, view(kind), RefinementSettings(), 1e9, np.inf, everything)
        for kind in ("PERSP", "ORTHO", "PANO")
        for everything in (False, True)
    ]
    return [crowns, [crown.seen for crown in crowns], figures]


FIGURES: Figures = {"preview": preview, "expected": expected}


@pytest.mark.parametrize("name", FIGURES)
def test_pictures_are_what_they_were(name: str) -> None:
    check(__name__, name, FIGURES[name](), ROUNDING)
