# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Published curves of trees in stands, and grown stands beside them; ``tests/data/stands_published.json`` has both
their numbers and their sources.
"""

from __future__ import annotations

import json
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tetflora_addon.growth.hashing import key_of_seed, uniform

from .report import ROOT

DATA = ROOT / "tests" / "data" / "stands_published.json"
#: Trees on a hectare whose mean is the height of a stand; diameters that count, cm; hectares of a plot.
_TOP, _COUNTED, _PLOT = 100, 7.0, 0.1


class Figure(NamedTuple):
    """One figure of a grown stand beside what is published."""

    species: str
    years: int
    figure: str
    low: float
    high: float
    value: float
    counts: bool = True

    @property
    def within(self) -> bool:
        """Whether it lies in the range."""
        return self.low <= self.value <= self.high


class Trees(NamedTuple):
    """Trees of a stand: diameter in cm, height, base of the crown and its width in m (n,) each; hectares; leaf area."""

    diameter: NDArray
    height: NDArray
    base: NDArray
    width: NDArray
    area: float
    leaves: float

    @property
    def mean(self) -> float:
        """Quadratic mean diameter."""
        return float(np.sqrt((self.diameter**2).mean()))

    @property
    def basal_area(self) -> float:
        """m²/ha."""
        return float((self.diameter**2).sum() * np.pi / 4e4 / self.area)

    @property
    def top(self) -> float:
        """Mean height of the 100 thickest trees on a hectare."""
        return float(self.height[np.argsort(-self.diameter)[: round(_TOP * self.area)]].mean())


@cache
def published() -> dict[str, Any]:
    """What is published."""
    return json.loads(DATA.read_text(encoding="utf-8"))


def height(species: str, diameter: NDArray, trees: Trees) -> NDArray:
    """Published height, m, of trees of diameters (n,) in a stand like the one that is given."""
    data = published()["height"]
    own = data["species"][species]
    log, social = np.log(diameter + 1.0), diameter / trees.mean
    warm, basal = data["temperature"], trees.basal_area - np.pi / 4e4 * diameter**2 / trees.area
    factors = {
        "basal l2": basal * log**2, "l": log, "basal l": basal * log, "rain l": data["rain"] * log,
        "temperature2 l": warm**2 * log, "temperature l": warm * log, "social l": social * log,
        "social2 l": social**2 * log, "l2": log**2, "social l2": social * log**2,
    }  # fmt: skip
    return 1.3 + data["plot"] * own["plots"] * log + sum(own["terms"][k] * factors[k] for k in own["terms"])


def crown_width(species: str, diameter: NDArray) -> NDArray:
    """Published width, m, of crowns of trees of diameters (n,)."""
    a, b, *rest = published()["crown_width"]["species"][species]
    return (a + b * diameter) * (1.0 - np.exp(-((diameter / rest[0]) ** rest[1])) if rest else 1.0)


def crown_ratio(species: str, trees: Trees) -> float:
    """Published length of the crown over the height, for the mean tree of a stand."""
    a, b, c, e = published()["crown_base"]["species"][species]
    mean, tall = trees.mean, float(np.interp(trees.mean, *_by_diameter(trees)))
    return float(np.exp(-abs(a + b * tall / mean + c * mean + e * np.log(trees.top))))


def _by_diameter(trees: Trees) -> tuple[NDArray, NDArray]:
    edges = np.unique(np.quantile(trees.diameter, np.linspace(0, 1, 21)))
    of = np.clip(np.searchsorted(edges, trees.diameter, side="right") - 1, 0, len(edges) - 2)
    number = np.maximum(np.bincount(of, minlength=len(edges) - 1), 1)
    return tuple(np.bincount(of, v, len(edges) - 1) / number for v in (trees.diameter, trees.height))


def spread_of_diameters(species: str, trees: Trees) -> float:
    """Published standard deviation of the diameters over 7 cm, over their mean."""
    a, b, c, e, f = published()["diameters"]["species"][species]
    largest = np.quantile(trees.diameter, 1.0 - trees.area / (_PLOT * len(trees.diameter)))
    scale, shape = a + b * trees.mean, c + e * trees.mean + f * float(largest)
    least = (_COUNTED - 0.1) / scale
    drawn = scale * (least**shape - np.log1p(-uniform(key_of_seed(np.arange(20_000)), 1))) ** (1.0 / shape)
    return float(drawn.std() / drawn.mean())


def figures(species: str, years: int, trees: Trees) -> list[Figure]:
    """All figures of a stand that something is published for."""
    data, found = published(), []

    def add(figure: str, low: float, high: float, value: float, counts: bool = True) -> None:
        found.append(Figure(species, years, figure, low, high, float(value), counts))

    thick = trees.diameter >= data["crown_width"]["from"]
    diameter = trees.diameter[thick]
    if species in data["height"]["species"] and thick.any():
        tolerance = data["height"]["tolerance"]
        ratio = np.exp(np.log(trees.height[thick] / height(species, diameter, trees)).mean())
        add("height by diameter", 1 - tolerance, 1 + tolerance, ratio, False)
    for mean, tall, _ in data["measured_heights"]["species"].get(species, ()):
        near = np.abs(trees.diameter / mean - 1.0) < 0.1
        if near.sum() >= 10:
            tolerance = data["measured_heights"]["tolerance"]
            ratio = trees.height[near].mean() / tall
            add(f"height at {mean:g} cm, measured", 1 - tolerance, 1 + tolerance, ratio, False)
    if species in data["crown_width"]["species"] and thick.any():
        tolerance = data["crown_width"]["tolerance"]
        ratio = np.exp(np.log(trees.width[thick] / crown_width(species, diameter)).mean())
        add("crown width by diameter", 1 - tolerance, 1 + tolerance, ratio, False)
    if species in data["crown_base"]["species"] and trees.mean >= data["crown_base"]["from"]:
        tolerance, middle = data["crown_base"]["tolerance"], crown_ratio(species, trees)
        near = np.abs(trees.diameter / trees.mean - 1.0) < 0.25
        add("crown ratio", middle - tolerance, middle + tolerance, (1.0 - trees.base / trees.height)[near].mean())
    if species in data["basal_area"]["species"]:
        a, b, c, p = data["basal_area"]["species"][species]
        most = a - b * np.exp(-np.exp(-c) * trees.top**p)
        low, high = data["basal_area"]["within"]
        add("basal area over the largest", low, high, trees.basal_area / most)
    if species in data["diameters"]["species"] and trees.mean >= data["diameters"]["from"]:
        counted = trees.diameter[trees.diameter >= _COUNTED]
        tolerance, middle = data["diameters"]["tolerance"], spread_of_diameters(species, trees)
        add("spread of diameters", middle - tolerance, middle + tolerance, counted.std() / counted.mean())
    low, high = data["leaf_area"]["range"]
    own = data["leaf_area"]["species"].get(species, (low, high))
    add("leaf area index", max(low, own[0]), min(high, own[1]), trees.leaves / (1e4 * trees.area))
    return found


def curves(species: str, stands: list[Trees]) -> list[Figure]:
    """Height and crown width over published ones, of the trees of all years together, as they were measured.

    Each class of 5 cm counts once, where it has ten trees.
    """
    data, found = published(), []
    diameter = np.concatenate([trees.diameter for trees in stands])
    ratios = {}
    if species in data["height"]["species"]:
        own = [trees.height / height(species, trees.diameter, trees) for trees in stands]
        ratios["height by diameter, all years"] = "height", np.concatenate(own)
    if species in data["crown_width"]["species"]:
        width = np.concatenate([trees.width for trees in stands])
        ratios["crown width by diameter, all years"] = "crown_width", width / crown_width(species, diameter)
    thick = diameter >= data["crown_width"]["from"]
    of = (diameter[thick] / 5.0).astype(np.int64)
    number = np.bincount(of)
    for name, (key, ratio) in ratios.items():
        means = np.exp(np.bincount(of, np.log(ratio[thick])) / np.maximum(number, 1))[number >= 10]
        tolerance = data[key]["tolerance"]
        found.append(Figure(species, 0, name, 1 - tolerance, 1 + tolerance, float(np.exp(np.log(means).mean()))))
    return found
