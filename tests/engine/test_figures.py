# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What plants are changes where a commit says so, and not by accident: those of everything that a species may ask for.

None is a shipped one, so that these may change.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.engine import support
from tests.engine.figures import ROUNDING, Figures, check
from tests.engine.growth.test_drawn import flora as drawn_flora
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import crown_shapes
from tetflora_addon.growth.wind import Wind
from tetflora_addon.leaves.levels import leaf_kites, leaf_levels
from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.refinement.contents import bounding_capsules, subplant_totals
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.catalog import species_from_dict
from tetflora_addon.species.litter import leaves_page, litter_page
from tetflora_addon.species.quality import with_quality
from tetflora_addon.species.species import LEAF_ENVELOPES, Species
from tetflora_addon.subplants.leaf_meshes import leaf_meshes
from tetflora_addon.subplants.pieces import expand
from tetflora_addon.subplants.rings import Pixels
from tetflora_addon.subplants.tubes import tube_buffers

#: All that `support.RICH` has, on a day of the year and at an age.
PAGE: dict[str, Any] = support.RICH | {
    "name": "Rich",
    "year": {
        "latitude": 50,
        "leaf": {"appear": 110, "turn": 287, "fall": 301, "fresh": [0.23, 0.37, 0.06],
                 "autumn": [[0.44, 0.31, 0.045], [0.38, 0.135, 0.025]], "kept": 0.05},
        "blossom": {"appear": 120, "turn": 140, "fall": 145},
    },
    "age": {"full": 60, "lifespan": 150, "flowers": 8},
}  # fmt: skip


@cache
def rich() -> Species:
    return species_from_dict(PAGE, "rich", "rich.json")


def meshes(flora: Flora, shapes: np.ndarray | None = None) -> list[Any]:
    """Branches of two plants, their wood from afar and from near, their leaves."""
    seeds = replace(support.plants([3, 4], scale=1.3), crown=shapes)
    whole = list(expand(flora, trunks(flora.rows, seeds)))
    near = Pixels(lambda points, _: np.full(len(points), 0.004))
    leaves = [leaf.buffers for leaf in leaf_meshes(flora, 0, whole)]
    return [[some.branches for some in whole], tube_buffers(flora, whole), tube_buffers(flora, whole, near), leaves]


def compiled(flora: Flora) -> list[Any]:
    """What is known before plants are grown."""
    names = "bound", "raised_bound", "limb_reach", "averages", "sampled_bound", "orientation", "clumping", "samples"
    return [[getattr(flora, name) for name in (*names, "shaped_totals")], known(flora)]


def known(flora: Flora) -> list[Any]:
    """The same of plants of some shapes, and of each of their branches."""
    seeds = replace(support.plants([5, 6]), crown=crown_shapes(2, [1.0, 1.4], [0.0, 0.2], 0.3, -0.2, 1.2))
    some = [trunks(flora.rows, seeds), *(whole.branches for whole in expand(flora, trunks(flora.rows, seeds)))]
    laws = flora.leaf_areas, flora.leaf_colors, flora.wood_areas, flora.face_counts, flora.one_leaf_area
    return [[[law(own) for law in laws], bounding_capsules(flora, own), subplant_totals(flora, own)] for own in some]


def on_day(day: float) -> list[Any]:
    """Plants as they are, and as they are expected to be, on a day of the year."""
    flora = flora_of(rich()).in_year(Season(day=day))
    return [meshes(flora), known(flora)]


def enveloped(name: str) -> Flora:
    """Leaves in a solid of a kind."""
    return support.compiled(support.small(order1={"leaf_envelope": name, "leaf_envelope_radius": 0.4}))


def flora_of(species: Species) -> Flora:
    return compile_species([species])


FIGURES: Figures = {
    "rows": lambda: flora_of(rich()).rows,
    "compiled": lambda: compiled(flora_of(rich())),
    "meshes": lambda: meshes(flora_of(rich())),
    "crown shapes": lambda: meshes(flora_of(rich()), crown_shapes(2, 1.4, 0.2, 0.3, -0.2, 1.2)),
    "dense": lambda: [meshes(flora_of(replace(rich(), habit=1.0))), crown_of(replace(rich(), habit=1.0))],
    "wind": lambda: meshes(flora_of(rich()).in_wind(Wind(speed=11.0, time=3.3))),
    **{f"day {day}": lambda day=day: on_day(day) for day in (20, 118, 293)},
    **{f"{years} years": lambda years=years: meshes(flora_of(with_age(rich(), years))) for years in (4, 35, 145)},
    "envelopes": lambda: [[flora.rows, meshes(flora), compiled(flora)] for flora in map(enveloped, LEAF_ENVELOPES)],
    "drawn": lambda: [drawn_flora().rows, meshes(drawn_flora()), compiled(drawn_flora())],
    "drawn, in the wind": lambda: meshes(drawn_flora().in_wind(Wind(speed=11.0, time=3.3))),
    "quality": lambda: [with_quality(rich(), factor).orders for factor in (0.3, 3.0)],
    "litter": lambda: [litter_page(rich(), PAGE), leaves_page(rich(), PAGE)],
    "leaf models": lambda: [[model, leaf_kites(model)] for model in LEAF_MODELS.values()],
    "leaf levels": lambda: [leaf_levels(model, 3)[:3] for model in LEAF_MODELS.values()],
}


@pytest.mark.parametrize("name", FIGURES)
def test_plants_are_what_they_were(name: str) -> None:
    # Clumping is measured along rays: machines round those otherwise that graze something.
    check(__name__, name, FIGURES[name](), 1e-3 if name == "compiled" else ROUNDING)
