# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf area of the trees of the catalog: against published allometry, in the light of stands, and as gaps of crowns.

Published figures are in ``tests/data/leaf_area_by_size.json``. ``drawn_against_grid`` is how far the leaf area of what
is drawn of a grown stand is from what takes its light; ``expanded`` how far single plants are from what is expected of
them. Gaps of crowns are seen from the side, within the outline that the crown has at each height, which is wider than
that of a photograph by what lies between its limbs: they tell more from each other than from what is published.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import forms, session
from devtools.leaf_area import allometry, by_size
from examples import stage
from tetflora_addon.blender.job.plant_mesh import plant_mesh, plant_parts, single_seed
from tetflora_addon.blender.scene.ages import kind_species
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.recorded_sizes import Sizes, measure_of, sized
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalog import load_species
from tetflora_addon.species.ecology import ecology_of, one_sided
from tetflora_addon.stands.grow import Plants, StandSettings, begun
from tetflora_addon.stands.site import StandSite, StandSpecies, StandTraits

from .pictures import coverage
from .report import Targets

#: Years after which stands are looked at; side of the ground, meters; plants on a hectare at the beginning.
YEARS, SIDE, DENSITY = (15, 40, 80), 40.0, 2000.0
#: Plants that are expanded of each species; height of pictures in pixels, and samples.
EXPANDED, PIXELS, SAMPLES = 3, 480, 8
#: Share of a row's coverage on each side that lies outside of the crown's outline.
_OUTSIDE = 0.02

TARGETS: Targets = {"out_of_range": {"max": 0}, "drawn_against_grid_max": {"max": 0.05}}
QUICK_SPECIES = ("beech", "spruce", "scots_pine")


def run(quick: bool) -> dict[str, object]:
    """Measure all; ``table`` has a row for each tree: species, habit, years, sizes, leaf area, published, ratio."""
    names = QUICK_SPECIES if quick else tuple(allometry()["open"])
    rows = [row for name in names for row in by_size(name)]
    most = allometry()["tolerance"]
    off = {name: {years: drawn_against_grid(name, years) for years in YEARS} for name in names}
    gaps = {name: crown_gap(name) for name in allometry()["gaps"]["species"] if name in names}
    apart = [abs(gap - allometry()["gaps"]["species"][name][0]) for name, gap in gaps.items()]
    return {
        "species": len(names),
        "sizes": len(rows),
        "out_of_range": sum(abs(row.ratio - 1.0) > most for row in rows),
        "drawn_against_grid_max": max(value for one in off.values() for value in one.values()),
        "expanded_off_max": max(expanded_off(name) for name in names),
        "gaps_off_max": max(apart),
        "table": [
            {
                key: round(v, 3) if isinstance(v, float) else v
                for key, v in {**row._asdict(), "ratio": row.ratio}.items()
            }
            for row in rows
        ],
        "stands": [
            {"species": name, "off": {str(y): round(v, 4) for y, v in one.items()}} for name, one in off.items()
        ],
        "gaps": [
            {"species": name, "gap": round(gap, 3), "published": allometry()["gaps"]["species"][name][0]}
            for name, gap in gaps.items()
        ],
    }


def drawn_against_grid(identifier: str, years: int) -> float:
    """How far the leaf area of what is drawn of a stand is from that of its crowns in the light, of all plants."""
    taken, drawn = stand_leaves(identifier, years)
    return float(np.abs(drawn.sum() / taken.sum() - 1.0)) if len(taken) else 0.0


def stand_leaves(identifier: str, years: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Leaf area (n,) of the plants of a grown stand as it takes light, and as it is expected of what is drawn; m²."""
    species = load_species(identifier)
    anywhere = replace(ecology_of(species), degree_days=0.0, coldest_month=-70.0, fertility=0.0, drought=5.0)
    member = StandSpecies(replace(species, ecology=anywhere))
    traits, cells = StandTraits([member]), round(SIDE / 5.0)
    site = StandSite(0.0, 0.0, SIDE / cells, np.zeros((cells, cells)))
    stand = begun(site, [member], StandSettings(density=DENSITY, recruits=0.0, years=years, interval=0))
    for year in range(years):
        stand.step(year)
    plants = stand.plants.take(np.flatnonzero(stand.plants.height >= 1.0))
    taken = plants.crowns(traits).leaves / traits.extinction[plants.species]
    return taken, drawn_leaves(identifier, plants, traits, site)


def drawn_leaves(identifier: str, plants: Plants, traits: StandTraits, site: StandSite) -> NDArray[np.float64]:
    """Expected leaf area (n,) of what is drawn of plants of a stand, m²."""
    records, one = plants.records(0.0, traits, site), np.ones(len(plants))
    names = ("height", "diameter", "crown_width", "crown_base")
    known = (np.asarray(getattr(records, name), np.float64) for name in names)
    sizes = Sizes(*known, 0.0 * one, np.asarray(records.offset, np.float64), np.ones((len(plants), 2)))
    seeds = replace(Seeds.upright(len(plants)), identifiers=(identifier,), seed=records.seed.astype(np.int64))
    kinds, _ = sized(seeds, None, sizes, load_species)
    out = np.zeros(len(plants))
    for number, kind in enumerate(kinds.identifiers):
        own = np.flatnonzero(kinds.species == number)
        if len(own):
            flora = measure_of(kind_species(load_species(identifier), kind)).flora
            some = replace(kinds.take(own), identifiers=(kind,), species=np.zeros(len(own), np.int32))
            out[own] = one_sided(load_species(identifier)) * flora.leaf_areas(trunks(flora.rows, some))
    return out


def expanded_off(identifier: str) -> float:
    """How far the mean leaf area of grown plants is from what is expected of these plants."""
    flora = compile_species([load_species(identifier)])
    found = [forms.measures(flora, seed) for seed in range(EXPANDED)]
    grown = sum(one["leaf_area_index"] * np.pi / 4 * one["crown_width"] ** 2 for one in found)
    plants = trunks(flora.rows, replace(Seeds.upright(EXPANDED), identifiers=(identifier,)))
    kinds = flora.averages.leaf_area[int(plants.row[0]), 1]
    leaves = float(kinds[flora.rows["leaf_kind"] == 0].sum() / kinds.sum())
    expected = leaves * one_sided(flora.species[0]) * float(flora.leaf_areas(plants).sum())
    return abs(grown / expected - 1.0)


def crown_gap(identifier: str) -> float:
    """Share of the sky that is seen through the crown of a full-grown tree."""
    session.clean_file()
    scene, species = bpy.context.scene, load_species(identifier)
    parts = plant_parts(compile_species([species]), single_seed(identifier, 0))
    o = bpy.data.objects.new("Tree", plant_mesh(scene, identifier, species, parts))
    o["tetflora_kind"] = "bark"
    scene.collection.objects.link(o)
    height = max(corner[2] for corner in o.bound_box)
    middle = 0.5 * height
    stage.camera(scene, (0.0, -200.0, middle), (0.0, 0.0, middle), (PIXELS, PIXELS), far=400.0, across=3.0 * middle)
    with tempfile.TemporaryDirectory() as folder:
        seen = coverage(scene, Path(folder) / "crown.png", SAMPLES)
    base = forms.measured(identifier)["crown_base"] * height
    rows = seen[: int(PIXELS * (0.5 + (0.5 * height - base) / (1.5 * height)))]
    summed = np.cumsum(rows, axis=1)
    whole = summed[:, -1:]
    inside = (summed > _OUTSIDE * whole) & (summed < (1.0 - _OUTSIDE) * whole) & (whole > 1.0)
    return 1.0 - float(rows[inside].mean())
