# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light under grown woods at the height of the eye, at noon, beside what is published of such stands.

    python -m benchmarks light_inside [--quick]
    python -m benchmarks light_inside --call measure '["beech", "refined", false]'    # one, as a line of JSON

A pure stand grows on a square whose sides meet; with copies of it on all sides it goes on as far as light comes from.
Cycles renders what arrives from above at a dark plane at the height of the eye, over what arrives there without plants:
sun and sky, bounces included, mean of red, green and blue, which stands for photosynthetically active light. *Expanded*
are all leaves of the square, as instances in its copies; *refined* is what the same plants become for a camera that
stands on the plane and looks ahead. ``model`` is the light that seedlings have there in the simulation. Each is
measured in a process of its own. Published ranges are in ``tests/data/light_inside.json``; what is within ``tolerance``
beyond their ends is in range. Their sources, there beside each: for beech and oak M. Hagemeier and C. Leuschner
(Forests, 2019), for spruce T. Johansson (Forest Ecology and Management, 1987), for Scots pine J.-M. N. Walter and
C. G. Himmler (Canadian Journal of Forest Research, 1996).

A square that is small for want of memory has few trees, and the light varies from stand to stand: it is the mean of
`SQUARES`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from examples import stage
from tetflora_addon.blender.attributes import write
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.placing.first_forest import sky
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.blender.scene.fields import OFFSET, SIZE_ATTRIBUTES, write_field
from tetflora_addon.species.catalog import load_species
from tetflora_addon.stands.grow import Records, StandSettings, begun
from tetflora_addon.stands.site import StandSite, StandSpecies, StandTraits

from .pictures import read_picture, render, timed_refine
from .report import Targets, apart, peak_mb, published

WAYS = ("expanded", "refined")
QUICK_WOODS = ("scots_pine",)
#: Side of the square that grows, meters, and of those whose leaves would not fit into memory; how far copies of it
#: reach on all sides; height of the plane.
SIDE, SMALLER, REACH, EYE = 24.0, {"spruce": 16.0}, 72.0, 1.7
#: Stands of which the mean is taken where the square is smaller.
SQUARES = 4
#: Plants on a hectare at the beginning, as in a new stand; elevation of the sun at noon, degrees.
DENSITY, ELEVATION = 2500.0, 60.0
PIXELS, SAMPLES, QUICK_SAMPLES = 96, 64, 16
#: Part of the light that the plane reflects, as litter does.
_PLANE = 0.1
DATA = "light_inside"

TARGETS: Targets = {"light_out_of_range": {"max": 0}, "refined_off_max": {"max": 0.15}}


def run(quick: bool) -> dict[str, object]:
    """Light under each wood; ``table`` has a row for each: species, years, published, model, expanded, refined."""
    rows = []
    for name in QUICK_WOODS if quick else published(DATA)["woods"]:
        row = {}
        for way in WAYS:
            row |= apart(measure, name, way, quick)
        low, high = published(DATA)["woods"][name]["light"]
        most = published(DATA)["tolerance"]
        row |= {"published": [low, high], "within": low * (1.0 - most) <= row["expanded"] <= high * (1.0 + most)}
        rows.append(row)
    return {
        "light_out_of_range": sum(not row["within"] for row in rows),
        "refined_off_max": max(abs(row["refined"] / row["expanded"] - 1.0) for row in rows),
        **{f"light_{row['species']}": row["expanded"] for row in rows},
        "table": rows,
    }


def measure(name: str, way: str, quick: bool) -> dict[str, Any]:
    """Light under a wood over that in the open, of plants that are expanded or refined; what the simulation has."""
    found = [square(name, way, quick, seed) for seed in range(SQUARES if name in SMALLER else 1)]
    means = {key: float(np.mean([one[key] for one in found])) for key in found[0]}
    return {"species": name, **means, "each": [round(one[way], 4) for one in found]}


def square(name: str, way: str, quick: bool, seed: int) -> dict[str, float]:
    """What is measured of one stand."""
    scene, years = bpy.context.scene, published(DATA)["woods"][name]["years"]
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    side = SMALLER.get(name, SIDE)
    records, model, leaves = wood(name, years, side, seed)
    around = np.arange(-round(REACH / side), round(REACH / side) + 1)
    places = side * np.stack(np.meshgrid(around, around), axis=-1).reshape(-1, 2)
    field = planted(name, records, np.zeros((1, 2)) if way == "expanded" else places)
    scene.collection.objects.link(field)
    stage.sun(scene, ELEVATION, 180.0)
    scene.world = sky("Sky")
    stage.camera(scene, (0.0, 0.0, EYE), (0.0, 10.0, EYE), (640, 360))
    scene.render.engine, scene.tetflora.refine_at_render = 'CYCLES', False
    bpy.context.view_layer.update()
    _, seconds = timed_refine(scene, expand_everything=way == "expanded")
    made = [c for c in result_collections(scene) if c.all_objects]
    if way == "expanded":
        for place in places[places.any(axis=1)]:
            for one in made:
                copy = bpy.data.objects.new("Copy", None)
                copy.instance_type, copy.instance_collection, copy.location = 'COLLECTION', one, (*place, 0.0)
                scene.collection.objects.link(copy)
    samples = QUICK_SAMPLES if quick else SAMPLES
    with tempfile.TemporaryDirectory() as folder:
        plane_below(scene, side)
        under = arriving(scene, Path(folder) / "under.exr", samples)
        direct = arriving(scene, Path(folder) / "direct.exr", samples, 0)
        refine.clear(scene)
        for obj in [o for o in scene.objects if o.name.startswith("Copy")]:
            bpy.data.objects.remove(obj)
        field.hide_render = True
        open_ = arriving(scene, Path(folder) / "open.exr", samples)
    tall = records.height > 0.5 * records.height.max()
    return {
        "years": years,
        "stems": float(tall.sum() / side**2 * 1e4),
        "height": float(records.height[tall].mean()),
        "leaf_area_index": leaves,
        "model": model,
        way: float(under.mean() / open_.mean()),
        f"{way}_direct": float(direct.mean() / open_.mean()),
        f"{way}_darkest": float(np.quantile(under, 0.1) / open_.mean()),
        f"{way}_s": seconds,
        f"{way}_peak_mb": peak_mb(),
    }


def wood(name: str, years: int, side: float, seed: int) -> tuple[Records, float, float]:
    """Plants of a grown stand around the origin, light at the height of the eye in the simulation, leaf area index."""
    member, cells = StandSpecies(load_species(name)), round(side / 4.0)
    site = StandSite(-side / 2.0, -side / 2.0, side / cells, np.zeros((cells, cells)))
    settings = StandSettings(density=DENSITY, recruits=0.0, years=years, interval=0, seed=seed)
    stand = begun(site, [member], settings)
    for year in range(years):
        stand.step(year)
    plants, traits = stand.plants, StandTraits([member])
    crowns = plants.crowns(traits)
    stand.light.fill(crowns)
    place = np.arange(0.5, side, 1.0)
    x, y = (axis.ravel() for axis in np.meshgrid(place, place))
    light = float(stand.light.at(x, y, np.full(len(x), EYE)).mean())
    return plants.records(years, traits, site), light, float(crowns.leaves.sum() / traits.extinction[0] / side**2)


def planted(name: str, records: Records, places: NDArray[np.float64]) -> bpy.types.Object:
    """A field of plants of a stand, once at each of some places (m, 2)."""
    number, copies = len(records), len(places)
    position = np.tile(records.position.astype(np.float64), (copies, 1))
    position[:, :2] += np.repeat(places, number, axis=0)
    upright = np.tile((1.0, 0.0, 0.0, 0.0), (number * copies, 1))
    zero = np.zeros(number * copies, np.int32)
    field = write_field("Wood", position, upright, np.ones(len(zero)), zero, np.tile(records.seed, copies), [name])
    columns = ("height", "diameter", "crown_width", "crown_base")
    for column in columns:
        write(field.data, f"tf_{column}", np.tile(getattr(records, column), copies), data_type='FLOAT')
    offset = np.pad(records.offset, ((0, 0), (0, 1)))
    write(field.data, OFFSET, np.tile(offset, (copies, 1)), data_type=SIZE_ATTRIBUTES[OFFSET])
    return field


def plane_below(scene: bpy.types.Scene, side: float) -> None:
    """A dark plane at the height of the eye below the square, and a camera close above that looks down at it."""
    plane = stage.ground(side, (_PLANE,) * 3)
    plane.location.z = EYE
    stage.camera(scene, (0.0, 0.0, EYE + 0.02), (0.0, 0.0, EYE), (PIXELS, PIXELS), near=0.001, far=0.1, across=side)


def arriving(scene: bpy.types.Scene, path: Path, samples: int, bounces: int = 12) -> NDArray[np.float32]:
    """What each pixel (height, width) of the plane reflects, mean of red, green and blue."""
    scene.cycles.max_bounces = bounces
    render(scene, path, samples, form='OPEN_EXR')
    return read_picture(path)[:, :, :3].mean(axis=2)
