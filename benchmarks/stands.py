# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grown stands against nature: thinning, heights, crowns, diameters, leaves; and time and memory by plants.

Each species grows alone for 100 years from 10,000 plants on a hectare, on two hectares whose sides meet. Curves by
diameter are of trees of many ages, so trees of all years together count. ``beside`` are each year by itself, where few
trees are as thick as the curve begins, and means of trees that were measured in other countries.
"""

from __future__ import annotations

import sys

import numpy as np

from tetflora_addon.species.ages import ages_of, with_age
from tetflora_addon.species.catalog import load_species
from tetflora_addon.stands.grow import StandSettings, begun
from tetflora_addon.stands.site import StandSite
from tetflora_addon.stands.traits import StandSpecies, StandTraits

from .report import Targets, records_of
from .stands_published import Figure, Trees, curves, figures, published

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
                float(traits.masses(plants.species, plants.basal, plants.height).mean()),
                float(np.sqrt((diameter**2).mean())),
            )
        )
        if year + 1 in YEARS and year < _OLD * ages_of(member.species).lifespan:
            leaves = float(plants.leaf_area(traits).sum())
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
    from tetflora_addon.compiled.crowns import crown_of

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


def run(quick: bool) -> dict[str, object]:
    """Grow all; rows for each figure: species, years, what, range, value."""
    names = QUICK_SPECIES if quick else SPECIES
    rows, slopes = [], {}
    for name in names:
        found, slopes[name] = stand(name)
        rows += found
        print(name, *(f"{v:.2f}" for v in slopes[name]), [f for f in found if not f.within], flush=True)
    timed = records_of(["benchmarks.stands_time", *map(str, QUICK_PLANTS if quick else PLANTS)])
    by_plants = {one["plants"]: one for one in timed}
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
             "published": published()["thinning"]["reineke"].get(name)}
            for name, (a, b) in slopes.items()
        ],
        "timed": timed,
        "leaves": [{"species": name, **row} for name in names for row in leaves_drawn(name)],
        "table": [{**row._asdict(), "within": row.within} for row in rows],
    }  # fmt: skip


def _kept(rows: list[Figure], figure: str) -> int:
    """Species of which a figure is within its range at all years."""
    own = [row for row in rows if row.figure == figure]
    return len({row.species for row in own} - {row.species for row in own if not row.within})


if __name__ == "__main__":
    sys.exit("python -m benchmarks stands")
