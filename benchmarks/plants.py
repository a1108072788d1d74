# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Throughput of plants: from seeds to finished Blender meshes, for every species of the catalog.

Seconds are processor time of the whole process, with one thread, so that they are those of one core; on two cores they
are those of the clock, with many blocks and processes that have begun. Memory is what numpy holds at most, by
`tracemalloc`, plus the meshes that Blender holds by then, for the plants of about one block: with more blocks, what is
held beside the meshes stays the same and the ratio falls.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from statistics import median
from typing import Any

import bpy
import numpy as np

from tetflora_addon import parallel
from tetflora_addon.blender.results import meshes
from tetflora_addon.compiled.flora import _compiled
from tetflora_addon.emission.plants import BLOCK_POLYGONS, expanded_blocks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species import catalog

from .report import Targets

#: Polygons of each species that are made to measure speed.
POLYGONS, QUICK_POLYGONS = 600_000, 200_000
REPEATS, QUICK_REPEATS = 5, 2
#: Maximum number of plants of a species: keeps grass and flowers from being all seeds.
MOST_PLANTS = 20_000
#: Species that two cores make, and blocks of each.
TWO_CORES, BLOCKS = ("oak", "birch", "spruce", "maple", "fern"), 12

TARGETS: Targets = {
    "mtri_per_s_median": {"min": 8.0},
    "mtri_per_s_two_cores": {"min": 14.0},
    "peak_over_mesh": {"max": 2.5},
    "compile_ms_max": {"max": 50.0},
}
QUICK_TARGETS: Targets = TARGETS


def plants_of(flora: Any, polygons: float) -> Any:
    """Upright plants of a flora's only species that have about a number of polygons together, all different."""
    count = int(np.clip(round(polygons / flora.polygons[0]), 1, MOST_PLANTS))
    side = int(np.ceil(np.sqrt(count)))
    index = np.arange(count)
    return Seeds(
        (flora.species[0].identifier,),
        np.zeros(count, np.int32),
        index.astype(np.int64),
        np.stack([index % side, index // side, np.zeros(count)], axis=1) * 5.0,
        np.tile(np.eye(3), (count, 1, 1)),
        np.ones(count),
    )


def made(flora: Any, seeds: Any) -> list[Any]:
    """Write all plants as meshes, as the job does; returns the buffers, whose meshes are still there."""
    written = []
    for block in expanded_blocks(flora, seeds):
        meshes.write_mesh("measured", block.buffers)
        written.append(block.buffers)
    return written


def sampled(flora: Any) -> tuple[Any, Any]:
    """What proxies need of a compiled species beyond its bounds and averages."""
    return flora.samples, flora.orientation


def removed() -> None:
    """Remove all meshes."""
    bpy.data.batch_remove(list(bpy.data.meshes))


def seconds(task: Callable[[], object], repeats: int, after: Callable[[], object] = lambda: None) -> float:
    """Least processor time of a task, which is the one least disturbed by others; what comes after is not counted."""
    taken = []
    for _ in range(repeats):
        start = time.process_time()
        task()
        taken.append(time.process_time() - start)
        after()
    return min(taken)


def copied(buffers: list[Any]) -> list[np.ndarray]:
    """Plain copies of all arrays."""
    return [array.copy() for one in buffers for array in arrays(one)]


def arrays(buffers: Any) -> list[np.ndarray]:
    """All arrays of one mesh."""
    topology = [buffers.edge_verts, buffers.corner_verts, buffers.corner_edges, buffers.face_offsets]
    return [buffers.positions, *topology, *(values for _, values in buffers.attributes.values())]


def peak_over_mesh(flora: Any) -> float:
    """Largest memory while about one block is made and written, over the bytes of its meshes."""
    seeds = plants_of(flora, BLOCK_POLYGONS)
    written = peak = 0
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        for block in expanded_blocks(flora, seeds):
            peak = max(peak, written + tracemalloc.get_traced_memory()[1] - before)
            tracemalloc.reset_peak()
            meshes.write_mesh("measured", block.buffers)
            written += block.buffers.nbytes
            peak = max(peak, written + tracemalloc.get_traced_memory()[1] - before)
            del block
            tracemalloc.reset_peak()
    finally:
        tracemalloc.stop()
        removed()
    return peak / written


def run(quick: bool) -> dict[str, float]:
    """Measure all species; see the table in ``docs/results.md`` for what the figures mean."""
    found = _on_one_core(QUICK_REPEATS if quick else REPEATS, QUICK_POLYGONS if quick else POLYGONS)
    parallel.set_threads(2)
    try:
        found["mtri_per_s_two_cores"] = median(on_two_cores(name) for name in TWO_CORES)
    finally:
        parallel.set_threads(0)
    return found


def on_two_cores(name: str) -> float:
    """Million triangles a second of a species, by the clock, least of three; many blocks, and the first has begun."""
    flora = _compiled((catalog.load_species(name),))
    seeds = plants_of(flora, BLOCKS * BLOCK_POLYGONS)
    triangles, taken = 0, []
    for _ in range(4):
        start = time.perf_counter()
        buffers = made(flora, seeds)
        taken.append(time.perf_counter() - start)
        triangles = sum(len(b.corner_verts) - 2 * b.polygons for b in buffers)
        removed()
    return triangles / min(taken[1:]) / 1e6


def _on_one_core(repeats: int, polygons: float) -> dict[str, float]:
    parallel.set_threads(1)
    compile_species = _compiled.__wrapped__  # never from the cache
    speed, memory, compiling, sampling, copying = {}, {}, {}, {}, {}
    triangles_in_all = bytes_in_all = 0
    for name in catalog.list_species():
        species = [catalog.load_species(name)]
        flora = compile_species(species)
        compiling[name] = 1e3 * seconds(lambda s=species: compile_species(s), repeats)
        sampling[name] = 1e3 * seconds(lambda s=species: sampled(compile_species(s)), repeats) - compiling[name]
        seeds = plants_of(flora, polygons)
        buffers = made(flora, seeds)
        removed()
        triangles = sum(len(b.corner_verts) - 2 * b.polygons for b in buffers)
        triangles_in_all += triangles
        bytes_in_all += sum(b.nbytes for b in buffers)
        plain = seconds(lambda b=buffers: copied(b), repeats)
        del buffers
        taken = seconds(lambda f=flora, s=seeds: made(f, s), repeats, removed)
        speed[name], copying[name] = triangles / taken / 1e6, taken / plain
        memory[name] = peak_over_mesh(flora)
    return {
        "mtri_per_s_median": median(speed.values()),
        "mtri_per_s_min": min(speed.values()),
        "peak_over_mesh": max(memory.values()),
        "bytes_per_triangle": bytes_in_all / triangles_in_all,
        "memcpy_ratio": median(copying.values()),
        "compile_ms_max": max(compiling.values()),
        "sample_ms_max": max(sampling.values()),
        **{f"mtri_per_s_{name}": value for name, value in speed.items()},
        **{f"peak_over_mesh_{name}": value for name, value in memory.items()},
    }
