# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What plants are changes where a commit says so, and not by accident.

Sums over all numbers that make up plants of everything that a species may ask for, of no shipped one. After a change
of results that is meant, ``python -m tests.engine.test_figures`` writes them anew.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.engine import support
from tests.engine.growth.test_drawn import flora as drawn_flora
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seasons import Season
from tetflora_addon.growth.seeds import crown_shapes
from tetflora_addon.growth.wind import Wind
from tetflora_addon.leaves.kites import leaf_kites
from tetflora_addon.leaves.levels import leaf_levels
from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.refinement.contents import bounding_capsules, subplant_totals
from tetflora_addon.species.ages import with_age
from tetflora_addon.species.litter import leaves_page, litter_page
from tetflora_addon.species.quality import with_quality
from tetflora_addon.species.schema import species_from_dict
from tetflora_addon.species.species import LEAF_ENVELOPES, Species
from tetflora_addon.subplants.leaf_meshes import leaf_meshes
from tetflora_addon.subplants.pieces import expand
from tetflora_addon.subplants.rings import Pixels
from tetflora_addon.subplants.tubes import tube_buffers

KEPT = Path(__file__).parents[1] / "data" / "figures.json"
#: By which part of itself a sum may differ: machines add up in another order.
ROUNDING = 1e-9

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


def numbers(one: Any) -> list[np.ndarray]:
    """All numbers of arrays, dataclasses, tables, and lists and dictionaries of them, one after another."""
    if isinstance(one, np.ndarray) and one.dtype.names:
        return [part for name in one.dtype.names for part in numbers(one[name])]
    if isinstance(one, np.ndarray | int | float | np.generic):
        value = np.asarray(one)
        # Keys are random bits: as floats they would drown all else.
        bits = value.dtype.kind == "u" and value.dtype.itemsize == 8
        return [] if value.dtype.kind in "SUO" or bits else [value.astype(float).ravel()]
    if isinstance(one, Mapping):
        return [part for value in one.values() for part in numbers(value)]
    if isinstance(one, list | tuple):
        return [part for value in one for part in numbers(value)]
    if is_dataclass(one):
        return [part for field in fields(one) for part in numbers(getattr(one, field.name))]
    return []


def summary(one: Any) -> list[float]:
    """How many arrays there are, and numbers in all; how large they are, and where in its array each is.

    Both are sums of parts of each array, so that one of small numbers is not drowned by one of large ones.
    """
    every = [array[np.isfinite(array)] for array in numbers(one)]
    large, placed = 0.0, 0.0
    for k, array in enumerate(every):
        magnitude = np.abs(array).sum()
        if magnitude > 0:
            large += (2.0 + np.sin(k)) * np.log(magnitude)
            placed += (2.0 + np.sin(k)) * (array @ np.sin(1.0 + np.arange(len(array)))) / magnitude
    return [len(every), sum(map(len, every)), float(large), float(placed)]


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


FIGURES: dict[str, Callable[[], Any]] = {
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
    kept, found = json.loads(KEPT.read_text(encoding="utf-8"))[name], summary(FIGURES[name]())
    assert found[:2] == kept[:2]
    assert found[2:] == pytest.approx(kept[2:], rel=0.0, abs=ROUNDING * kept[0])


if __name__ == "__main__":
    KEPT.write_text(json.dumps({name: summary(one()) for name, one in FIGURES.items()}, indent=1) + "\n", "utf-8")
