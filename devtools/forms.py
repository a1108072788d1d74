# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forms of plants measured as foresters and botanists measure them, to hold species against published figures.

``tests/data/published.json`` holds the figures with their sources; `measured` grows plants by the engine and measures
the same, `compared` puts both side by side. Numpy only: the benchmark ``forms_published``, the tests and the table of
docs/species.md are all made from this.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tetflora_addon.arrays import gathered, spread
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.growth.foliage import leaf_forms, leaf_keys, leaf_places, place_leaves, settled
from tetflora_addon.growth.growth import WholeBranches, leaf_counts, radius_at, trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.ecology import one_sided
from tetflora_addon.species.species import LEAF_KINDS
from tetflora_addon.subplants.pieces import expand

from .house import ROOT

DATA = ROOT / "tests" / "data" / "published.json"
SEEDS = 5
BREAST_HEIGHT = 1.3
#: Directions in which a crown is measured across, and the share of its leaf area that is below its base.
DIRECTIONS, BELOW_BASE = 8, 0.02
#: How a figure is told: title, unit, decimals.
FIGURES: dict[str, tuple[str, str, int]] = {
    "height": ("height", "m", 1),
    "slenderness": ("height to diameter", "m/m", 0),
    "crown_width": ("crown width", "m", 1),
    "crown_spread": ("crown width to height", "m/m", 2),
    "crown_width_for_diameter": ("crown width to that of open-grown trees of its diameter", "m/m", 2),
    "crown_base": ("crown base to height", "m/m", 2),
    "angle_low": ("angle of the lowest limbs", "°", 0),
    "angle_high": ("angle of the highest limbs", "°", 0),
    "leaf_length": ("leaf length", "cm", 1),
    "leaf_slimness": ("leaf width to length", "cm/cm", 2),
    "leaf_area_index": ("leaf area to crown projection", "m²/m²", 1),
    "leaf_area_density": ("leaf area to crown volume", "m²/m³", 2),
    "leaf_inclination": ("mean leaf inclination", "°", 0),
    "leaf_inclination_spread": ("standard deviation of leaf inclination", "°", 0),
}


@dataclass(frozen=True)
class Figure:
    """One published figure of one species beside what is measured.

    Attributes
    ----------
    species, figure : str
        Identifier, and key of `FIGURES`.
    habit : float
        Of the species that is measured: 0 stands free, 1 in a dense stand.
    low, high : float
        Published range, in the figure's unit.
    source : str
        Author, title, year, and of what the range was worked out.
    value : float
        Mean of `SEEDS` plants.
    """

    species: str
    habit: float
    figure: str
    low: float
    high: float
    source: str
    value: float

    @property
    def within(self) -> bool:
        """Whether the plants are as published."""
        return self.low <= self.value <= self.high


@cache
def published() -> dict[str, Any]:
    """The published figures, as they are kept."""
    return json.loads(DATA.read_text(encoding="utf-8"))


def ranges(identifier: str, habit: float = 0.0) -> Iterator[tuple[str, float, float, str]]:
    """Figures of a species that stands free, or of habit 1: key of `FIGURES`, lowest, highest, source."""
    data = published()
    forms = data["forms"]
    kept = forms["stands"] if habit else forms
    for figure, (low, high, source, of) in kept["species"].get(identifier, {}).items():
        yield figure, low, high, f"{forms['sources'][source]}. Of {of}"
    if habit:
        return
    law = forms["open_grown"]
    if identifier in law["species"]:
        spread = float(np.exp(1.96 * np.sqrt(law["species"][identifier][2])))
        yield "crown_width_for_diameter", 1 / spread, spread, forms["sources"][law["source"]]
    one = data["species"].get(identifier, {"inclination": None, "density": None})
    if one["inclination"]:
        kept = data["leaf_inclination"]
        mean, number, deviation = np.array(kept["species"][one["inclination"]], float).T
        middle, margin = float(np.average(mean, weights=number)), kept["margin"]
        source = f"{kept['source'].rstrip('.')}. Of {one['inclination']}"
        yield "leaf_inclination", middle - margin, middle + margin, source
        yield "leaf_inclination_spread", deviation.min() - margin, deviation.max() + margin, source
    if one["density"]:
        kept = data["leaf_area_density"]
        source = f"{kept['source'].rstrip('.')}. Of {one['density']}"
        low, _, high = kept["genera"][one["density"]]["p10_p50_p90"]
        yield (
            "leaf_area_density",
            low / kept["widened"],
            high * kept["widened"],
            f"{kept['source'].rstrip('.')}. Of {one['density']}",
        )


def compared(identifier: str) -> list[Figure]:
    """All published figures of a shipped species beside what is measured, standing free and in a stand."""
    habits = [habit for habit in (0.0, 1.0) if any(ranges(identifier, habit))]
    return [
        Figure(identifier, habit, *row, measured(identifier, habit)[row[0]])
        for habit in habits
        for row in ranges(identifier, habit)
    ]


def species() -> list[str]:
    """Shipped species of which figures are published."""
    return [name for name in sorted(published()["species"]) if any(ranges(name))]


@cache
def measured(identifier: str, habit: float = 0.0) -> dict[str, float]:
    """Means of `SEEDS` plants of a shipped species of a habit, in the units of `FIGURES`."""
    flora = compile_species([replace(load_species(identifier), habit=habit)])
    plants = [measures(flora, seed) for seed in range(SEEDS)]
    values = {name: float(np.mean([one[name] for one in plants])) for name in plants[0]}
    law = published()["forms"]["open_grown"]["species"].get(identifier)
    if law:
        expected = np.exp(law[0] + law[1] * np.log(100 * values["diameter"]))
        values["crown_width_for_diameter"] = values["crown_width"] / float(expected)
    return values


def measures(flora: Flora, seed: int) -> dict[str, float]:
    """Measures of one plant of a flora's only species, in meters but for those of `FIGURES`."""
    plant = trunks(flora.rows, _alone(flora, seed))
    parts = list(expand(flora, plant))
    leaves = [group for part in parts for group in _leaves(flora, part)]
    knots = np.concatenate([part.knots(flora.rows)[2] for part in parts])
    place = np.concatenate([group[0] for group in leaves])
    of_leaf = np.concatenate([group[1].sum(axis=0) for group in leaves])
    area, angle = (np.concatenate([group[i].ravel() for group in leaves]) for i in (1, 2))
    length, width, number = (np.array(values) for values in list(zip(*leaves, strict=True))[3:])
    height = float(max(place[:, 2].max(), knots[:, 2].max()))
    at = np.minimum(BREAST_HEIGHT / plant.length, 1.0)
    diameter = 2.0 * float(radius_at(flora.rows, plant, at)[0])
    crown_width = _across(place)
    depth = float(np.ptp(place[:, 2]))
    mean = float(np.average(angle, weights=area))
    low, high = _limb_angles(flora, parts)
    longest = float(np.average(length, weights=number))
    leaf_area = one_sided(flora.species[0]) * float(area.sum())
    return {
        "height": height,
        "diameter": diameter,
        "slenderness": height / diameter,
        "crown_width": crown_width,
        "crown_spread": crown_width / height,
        "crown_base": _base(place[:, 2], of_leaf) / height,
        "angle_low": low,
        "angle_high": high,
        "leaf_length": 100.0 * longest,
        "leaf_slimness": float(np.average(width, weights=number)) / longest,
        "leaf_area_index": leaf_area / (np.pi / 4 * crown_width**2),
        "leaf_area_density": leaf_area / (np.pi / 6 * crown_width**2 * depth),
        "leaf_inclination": mean,
        "leaf_inclination_spread": float(np.sqrt(np.average((angle - mean) ** 2, weights=area))),
    }


def _alone(flora: Flora, seed: int) -> Seeds:
    one = np.zeros(1)
    return Seeds(
        (flora.species[0].identifier,),
        np.zeros(1, np.int32),
        np.array([seed], np.int64),
        np.zeros((1, 3)),
        np.eye(3)[None],
        one + 1.0,
    )


def _leaves(flora: Flora, whole: WholeBranches) -> Iterator[tuple[NDArray, NDArray, NDArray, float, float, int]]:
    """Of the green leaves on branches, form by form: places (n, 3), areas and angles (faces, n) to the sky of their
    faces, in m² and degrees, mean length, width, and number.
    """
    rows = flora.rows
    green = rows["leaf_kind"][whole.branches.row] == LEAF_KINDS.index("leaf")
    for row in np.unique(whole.branches.row[green]):
        some = whole.take(np.flatnonzero(whole.branches.row == row))
        counts = leaf_counts(rows, some.branches)
        owner, index = spread(counts)
        if not len(owner):
            continue
        key = leaf_keys(some.branches, owner, index)
        t = leaf_places(rows, some.branches, owner, index, counts, key)
        leaves = place_leaves(rows, some.branches, some.lines, owner, index, key, t)
        frame = settled(rows, np.array([row]), leaves.frame, leaves.light, leaves.sky)
        forms = flora.forms[0][LEAF_KINDS.index("leaf")]
        which = leaf_forms(len(forms), key)
        for number, model in enumerate(forms):
            own = np.flatnonzero(which == number)
            if not len(own):
                continue
            size, faces = leaves.size[own], model.face_vectors
            areas = np.linalg.norm(faces, axis=1)
            turned, middle = gathered(frame, own), np.mean(model.positions, axis=0)
            up = np.abs(faces / np.maximum(areas, 1e-30)[:, None] @ turned[:, 2].T)
            place = gathered(leaves.position, own) + size[:, None] * (turned @ middle)
            long, wide = model.positions[:, 1].max(), np.ptp(model.positions[:, 0])
            angle = np.degrees(np.arccos(np.clip(up, 0.0, 1.0)))
            yield place, areas[:, None] * size**2, angle, size.mean() * long, size.mean() * wide, len(own)


def _across(place: NDArray[np.float64]) -> float:
    """Mean extent in the plane of places (n, 3), meters."""
    turn = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return float(np.mean([np.ptp(place[:, 0] * np.cos(a) + place[:, 1] * np.sin(a)) for a in turn]))


def _base(height: NDArray[np.float64], area: NDArray[np.float64]) -> float:
    """Height that has `BELOW_BASE` of the area (n,) at heights (n,) below it."""
    order = np.argsort(height)
    below = np.cumsum(area[order])
    return float(height[order][np.searchsorted(below, BELOW_BASE * below[-1])])


def _limb_angles(flora: Flora, parts: list[WholeBranches]) -> tuple[float, float]:
    """Mean angles from the vertical, degrees, at which the lowest and the highest third of the limbs set out."""
    limbs = [p.branches.take(np.flatnonzero(flora.rows["order"][p.branches.row] == 1)) for p in parts]
    foot = np.concatenate([one.position[:, 2] for one in limbs])
    if not len(foot):
        return np.nan, np.nan
    up = np.concatenate([one.frame[:, 2, 2] for one in limbs])
    angle = np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))[np.argsort(foot)]
    third = max(len(angle) // 3, 1)
    return float(angle[:third].mean()), float(angle[-third:].mean())
