# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grown stands against nature: thinning, heights, crowns, diameters, leaves; and time and memory by plants.

Each species grows alone for 100 years from 10,000 plants on a hectare, on two hectares whose sides meet. Curves by
diameter are of trees of many ages, so trees of all years together count. ``beside`` are each year by itself, where few
trees are as thick as the curve begins, and means of trees that were measured in other countries. Published numbers and
their sources are in ``tests/data/stands_published.json``.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tetflora_addon.compiled.sizes import crown_of
from tetflora_addon.growth.hashing import key_of_seed, uniform
from tetflora_addon.species.ages import ages_of, with_age
from tetflora_addon.species.catalog import load_species
from tetflora_addon.stands.grow import StandSettings, begun
from tetflora_addon.stands.site import StandSite, StandSpecies, StandTraits

from .report import Targets, apart, forget_peak, peak_mb, published

SPECIES = (
    "beech", "spruce", "scots_pine", "oak", "birch", "ash", "hornbeam", "maple", "larch", "silver_fir", "linden",
)  # fmt: skip
QUICK_SPECIES = ("beech", "scots_pine")
YEARS, SIDE, DENSITY = (30, 60, 100), 141.4, 10_000.0
#: Thinning counts from where so many are left, until plants die of age, in lifespans; so do figures.
_THINNED, _OLD = 0.75, 0.75
#: Plants at the beginning of the stands that are timed, 5,000 on a hectare.
PLANTS = (25_000, 100_000, 1_000_000)
QUICK_PLANTS = (5_000, 25_000)
#: Of these: a mixed stand, into which others come from seed.
_TIMED, _PLANTED, _TIME = ("beech", "oak", "birch", "scots_pine"), 5000.0, 100
DATA = "stands_published"
#: Trees on a hectare whose mean is the height of a stand; diameters that count, cm; hectares of a plot.
_TOP, _COUNTED, _PLOT = 100, 7.0, 0.1

TARGETS: Targets = {
    "thinning_slope": {"min": -1.7, "max": -1.3},
    "thinning_slope_least": {"min": -1.7},
    "thinning_slope_most": {"max": -1.3},
    "out_of_range": {"max": 0},
    "species_height": {"min": 6},
    "species_crown": {"min": 6},
    "species_height_each_year": {"min": 6},
    "species_crown_each_year": {"min": 6},
    "s_100k": {"max": 60},
    "s_1m": {"max": 600},
    "peak_mb_1m": {"max": 6000},
}
QUICK_TARGETS: Targets = {"thinning_slope": {"min": -1.7, "max": -1.3}}


def stand(species: str) -> tuple[list[Figure], tuple[float, float]]:
    """Figures of a species at some years, and its slopes: biomass to density, and density to diameter."""
    member = StandSpecies(load_species(species))
    traits, settings = StandTraits([member]), StandSettings(density=DENSITY, recruits=0.0, years=max(YEARS), interval=0)
    cells = round(SIDE / 5.0)
    site = StandSite(0.0, 0.0, SIDE / cells, np.zeros((cells, cells)))
    grown, area = begun(site, [member], settings), SIDE**2 / 1e4
    found, thinned, stands = [], [], []
    for year in range(settings.years):
        grown.step(year)
        plants = grown.plants
        diameter = 100.0 * traits.diameters(plants.species, plants.basal)
        thinned.append(
            (
                len(plants) / area,
                float((traits.mass_factor[plants.species] * plants.basal**2 * plants.height).mean()),
                float(np.sqrt((diameter**2).mean())),
            )
        )
        if year + 1 in YEARS and year < _OLD * ages_of(member.species).lifespan:
            leaves = float((plants.crowns(traits).leaves / traits.extinction[plants.species]).sum())
            trees = Trees(diameter, plants.height, plants.base, 2.0 * plants.radius, area, leaves)
            found += figures(species, year + 1, trees)
            stands.append(trees)
    found += curves(species, stands)
    number, mass, mean = np.log(np.maximum(np.array(thinned), 1e-9)).T
    counts = (number < np.log(_THINNED * DENSITY)) & (np.arange(len(number)) < _OLD * ages_of(member.species).lifespan)
    slopes = (
        float(np.polyfit(number[counts], mass[counts], 1)[0]),
        float(np.polyfit(mean[counts], number[counts], 1)[0]),
    )
    return found, slopes


def leaves_drawn(species: str) -> list[dict[str, float]]:
    """Leaf area of free plants of some heights: as the stand has it, and as the compiled species has it."""
    own, traits = load_species(species), StandTraits([StandSpecies(load_species(species))])
    rows = []
    for part in (0.5, 1.0, 2.0):
        years = part * ages_of(own).full
        crown = crown_of(with_age(own, years))
        zero = np.zeros(4000, np.int64)
        basal = np.linspace(0.01, 1.0, len(zero))
        nearest = int(np.abs(0.8 * traits.heights(zero, basal) - crown.height).argmin())
        width = 2.0 * float(traits.radii(zero, basal)[nearest])
        rows.append(
            {
                "years": years,
                "height": crown.height,
                "width_drawn": 2.0 * crown.radius,
                "width_stand": width,
                "leaves_drawn": crown.leaves / (np.pi * crown.radius**2),
                "leaves_stand": float(traits.leaves[0]),
            }
        )
    return [{key: round(value, 2) for key, value in row.items()} for row in rows]


def timed(plants: int) -> dict[str, float]:
    """Time and memory of growing a stand for 100 years; ``alive`` counts those that were there, over all years."""
    forget_peak()
    side = 100.0 * (plants / _PLANTED) ** 0.5
    cells = max(round(side / 5.0), 1)
    site = StandSite(0.0, 0.0, side / cells, np.zeros((cells, cells)))
    start, alive = time.perf_counter(), 0
    grown = begun(
        site, [StandSpecies(load_species(n)) for n in _TIMED], StandSettings(density=_PLANTED, years=_TIME, interval=20)
    )
    for year in range(_TIME):
        grown.step(year)
        alive += len(grown.plants)
    records = grown.finished()
    return {
        "plants": plants,
        "hectares": round(site.area / 1e4, 2),
        "s": round(time.perf_counter() - start, 2),
        "alive": alive,
        "records": len(records),
        "peak_mb": round(peak_mb()),
    }


def run(quick: bool) -> dict[str, object]:
    """Grow all; rows for each figure: species, years, what, range, value."""
    names = QUICK_SPECIES if quick else SPECIES
    rows, slopes = [], {}
    for name in names:
        found, slopes[name] = stand(name)
        rows += found
        print(name, *(f"{v:.2f}" for v in slopes[name]), [f for f in found if not f.within], flush=True)
    number = QUICK_PLANTS if quick else PLANTS
    by_plants = {plants: apart(timed, plants) for plants in number}
    biomass = [slope for slope, _ in slopes.values()]
    outside = [row for row in rows if row.counts and not row.within]
    out: dict[str, object] = {
        "thinning_slope": float(np.mean(biomass)),
        "thinning_slope_least": min(biomass),
        "thinning_slope_most": max(biomass),
        "reineke_slope": float(np.mean([slope for _, slope in slopes.values()])),
        "out_of_range": len(outside),
        "beside_out_of_range": sum(not row.within for row in rows if not row.counts),
        "figures": len(rows),
        "species_height": _kept(rows, "height by diameter, all years"),
        "species_crown": _kept(rows, "crown width by diameter, all years"),
        "species_height_each_year": _kept(rows, "height by diameter"),
        "species_crown_each_year": _kept(rows, "crown width by diameter"),
    }
    if not quick:
        out |= {
            "s_100k": by_plants[100_000]["s"],
            "s_1m": by_plants[1_000_000]["s"],
            "peak_mb_1m": by_plants[1_000_000]["peak_mb"],
            "times_linear": by_plants[1_000_000]["s"] / (10.0 * by_plants[100_000]["s"]),
        }
    return out | {
        "slopes": [
            {"species": name, "biomass": round(a, 3), "reineke": round(b, 3),
             "published": published(DATA)["thinning"]["reineke"].get(name)}
            for name, (a, b) in slopes.items()
        ],
        "timed": list(by_plants.values()),
        "leaves": [{"species": name, **row} for name in names for row in leaves_drawn(name)],
        "table": [{**row._asdict(), "within": row.within} for row in rows],
    }  # fmt: skip


def _kept(rows: list[Figure], figure: str) -> int:
    """Species of which a figure is within its range at all years."""
    own = [row for row in rows if row.figure == figure]
    return len({row.species for row in own} - {row.species for row in own if not row.within})


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


def height(species: str, diameter: NDArray, trees: Trees) -> NDArray:
    """Published height, m, of trees of diameters (n,) in a stand like the one that is given."""
    data = published(DATA)["height"]
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
    a, b, *rest = published(DATA)["crown_width"]["species"][species]
    return (a + b * diameter) * (1.0 - np.exp(-((diameter / rest[0]) ** rest[1])) if rest else 1.0)


def crown_ratio(species: str, trees: Trees) -> float:
    """Published length of the crown over the height, for the mean tree of a stand."""
    a, b, c, e = published(DATA)["crown_base"]["species"][species]
    mean, tall = trees.mean, float(np.interp(trees.mean, *_by_diameter(trees)))
    return float(np.exp(-abs(a + b * tall / mean + c * mean + e * np.log(trees.top))))


def _by_diameter(trees: Trees) -> tuple[NDArray, NDArray]:
    edges = np.unique(np.quantile(trees.diameter, np.linspace(0, 1, 21)))
    of = np.clip(np.searchsorted(edges, trees.diameter, side="right") - 1, 0, len(edges) - 2)
    number = np.maximum(np.bincount(of, minlength=len(edges) - 1), 1)
    return tuple(np.bincount(of, v, len(edges) - 1) / number for v in (trees.diameter, trees.height))


def spread_of_diameters(species: str, trees: Trees) -> float:
    """Published standard deviation of the diameters over 7 cm, over their mean."""
    a, b, c, e, f = published(DATA)["diameters"]["species"][species]
    largest = np.quantile(trees.diameter, 1.0 - trees.area / (_PLOT * len(trees.diameter)))
    scale, shape = a + b * trees.mean, c + e * trees.mean + f * float(largest)
    least = (_COUNTED - 0.1) / scale
    drawn = scale * (least**shape - np.log1p(-uniform(key_of_seed(np.arange(20_000)), 1))) ** (1.0 / shape)
    return float(drawn.std() / drawn.mean())


def figures(species: str, years: int, trees: Trees) -> list[Figure]:
    """All figures of a stand that something is published for."""
    data, found = published(DATA), []

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
    least, most = data["leaf_area"]["range"]
    low, high = data["leaf_area"]["species"].get(species, (least, most))
    add("leaf area index", max(least, low), high, trees.leaves / (1e4 * trees.area))
    return found


def curves(species: str, stands: list[Trees]) -> list[Figure]:
    """Height and crown width over published ones, of the trees of all years together, as they were measured.

    Each class of 5 cm counts once, where it has ten trees.
    """
    data, found = published(DATA), []
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
