# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time of a refinement goes: each stage beside a plain copy of the bytes that it leaves behind.

No stage can be faster than a copy of its results; how far it is from that is `times_<stage>`. Seconds are processor
time, which other programs disturb less than they do the clock.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import Any

import bpy
import numpy as np

from examples import landscape
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.job.contents import compile_for
from tetflora_addon.blender.results import meshes
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.emission.drawing import drawing
from tetflora_addon.emission.emitters import EmissionInput, as_triangles, facet_blocks
from tetflora_addon.emission.plants import Transition
from tetflora_addon.proxies.facet_weights import facet_weights
from tetflora_addon.refinement.settings import RefinementSettings

from .report import Targets

PLANTS, QUICK_PLANTS = landscape.PLANTS, landscape.PLANTS // 10
_COPIED = 64 << 20  # bytes that the speed of copying is measured with
_REPEATS = 5

TARGETS: Targets = {}
QUICK_TARGETS: Targets = TARGETS


def held(thing: Any) -> int:
    """Bytes of all arrays in a thing made of dataclasses, dictionaries and arrays."""
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    if is_dataclass(thing):
        return sum(held(getattr(thing, f.name)) for f in fields(thing))
    if isinstance(thing, dict):
        return held(list(thing.values()))
    return sum(held(one) for one in thing) if isinstance(thing, Iterable) and not isinstance(thing, str) else 0


def copy_speed() -> float:
    """Bytes a second of a plain copy of an array that fits no cache."""
    source, target = np.ones(_COPIED, np.uint8), np.zeros(_COPIED, np.uint8)
    best = np.inf
    for _ in range(_REPEATS):
        start = time.process_time()
        np.copyto(target, source)
        best = min(best, time.process_time() - start)
    return _COPIED / best


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    scene = bpy.context.scene
    landscape.build(scene, QUICK_PLANTS if quick else PLANTS)
    seconds: dict[str, float] = {}
    left: dict[str, float] = {}
    begun = time.process_time()

    def lap(stage: str, size: int) -> None:
        nonlocal begun
        now = time.process_time()
        seconds[stage], left[stage] = seconds.get(stage, 0.0) + now - begun, left.get(stage, 0) + size
        begun = time.process_time()

    depsgraph = bpy.context.evaluated_depsgraph_get()
    seeds = read_plants(scene, depsgraph, depsgraph.view_layer)[0]
    lap("read", held(seeds))
    flora = compile_for(seeds.identifiers, scene, depsgraph)
    lap("compile", held([flora.rows, flora.bound]))
    lap("sample", held([flora.samples, flora.orientation]))
    wall = time.perf_counter()
    camera, result = refine.partition(scene, depsgraph)
    wall = time.perf_counter() - wall
    taken, begun = time.process_time() - begun, time.process_time()
    shared = result.plants.nbytes + result.cell_polygons.nbytes
    sizes = {"update": shared, "visibility": held(result.cells), "refinement": result.tree.nbytes}
    for stage, wall_s in result.seconds.items():  # wall clock, scaled to processor time
        seconds[stage], left[stage] = wall_s / wall * taken, sizes[stage]
    begun = time.process_time()
    settings = RefinementSettings()
    transition, weights = Transition(flora, camera, settings.leaf_limit), facet_weights(flora)
    given = drawing(flora, result, camera, transition, settings.facet, weights, form=as_triangles)
    refined = EmissionInput(flora, result, camera, given)
    for block in refined.mesh_blocks():
        lap("polygons", block.buffers.nbytes)
        meshes.write_mesh("block", block.buffers)
        lap("write", block.buffers.nbytes)
    for facets in facet_blocks(refined):
        lap("facets", facets.nbytes)
        meshes.write_mesh("facets", facets)
        lap("write", facets.nbytes)
    speed = copy_speed()
    figures = {"copy_gb_per_s": speed / 1e9, "total_s": sum(seconds.values())}
    for stage, took in seconds.items():
        figures |= {f"{stage}_s": took, f"{stage}_mb": left[stage] / 1e6, f"{stage}_times": took * speed / left[stage]}
    return figures
