# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One case of the benchmark `forest`, measured in the process that it is called in."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import bpy
import numpy as np

from tetflora_addon import memory
from tetflora_addon.blender import worker
from tetflora_addon.blender.job import refine
from tetflora_addon.emission.budget import Detail
from tetflora_addon.jobs import Progress
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.refinement.statistics import Statistics

from .report import forget_peak, peak_mb
from .row80 import timed_render

#: Steps of the job that are named, longest first.
_NAMED = 5
#: Seconds that Blender may stand still.
STILL = 0.2
#: Samples of the whole image to which seconds are extrapolated.
SAMPLES = 64


@contextmanager
def watching(look: Callable[[Refinement, Detail], Detail | None]) -> Iterator[None]:
    """While it lasts, jobs show what the loop left and the detail they can afford, and take what it returns."""
    fit_to_budget = refine.fit_to_budget

    def watched(refinement: Refinement, *rest: object) -> Detail:
        detail = fit_to_budget(refinement, *rest)
        return look(refinement, detail) or detail

    refine.fit_to_budget = watched
    try:
        yield
    finally:
        refine.fit_to_budget = fit_to_budget


def detail_of(scene: bpy.types.Scene) -> Detail:
    """How finely a scene would be drawn; nothing is made."""
    kept: list[Detail] = []

    def begun() -> Generator[Progress, None, None]:
        with closing(refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get())) as steps:
            yield from takewhile(lambda _: not kept, steps)

    with watching(lambda _, detail: kept.append(replace(detail, refinement=None))):
        worker.run_to_end(begun())
    return kept[0]


def as_fine_as(detail: Detail) -> AbstractContextManager:
    """While it lasts, everything is drawn as finely as something else, whatever could be afforded."""
    return watching(lambda _, own: replace(detail, refinement=own.refinement))


def refined(scene: bpy.types.Scene, run_to_end: bool = False) -> dict:
    """Refine as the operator does; figures of the job and of what the loop left.

    run_to_end: as scripts and renders do, without a thread; steps are then those of the engine, which nobody waits for.
    """
    kept: list[Refinement] = []
    taken: list[tuple[float, str]] = []
    forget_peak()  # of what planted the wood
    with watching(lambda refinement, _: kept.append(refinement)):
        start, processor = time.perf_counter(), time.process_time()
        steps = _timed(refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get()), taken)
        statistics = worker.run_to_end(steps) if run_to_end else worker.run(steps)
        seconds, processor = time.perf_counter() - start, time.process_time() - processor
    peak = peak_mb()
    found = left_open(kept.pop()) if kept else {}
    memory.give_back()  # as the job has done, but for what was kept here to be counted
    forget_peak()  # counting made copies
    longest = sorted(taken, reverse=True)[:_NAMED]
    return {
        "plants": statistics.plants,
        "refine_emit_s": seconds,
        "refine_emit_cpu_s": processor,
        "peak_mb": peak,
        "longest_step_s": longest[0][0],
        "steps": len(taken),
        "steps_too_long": sum(one > STILL for one, _ in taken),
        "polygons_meshed": statistics.polygons_meshed,
        "polygons_proxy": statistics.polygons_proxy,
        "polygons": statistics.polygons_meshed + statistics.polygons_proxy,
        "polygons_full": statistics.polygons_full,
        "facet_pixels": statistics.facet_pixels,
        "passes": statistics.passes,
        "tetrahedra_made": statistics.tetrahedra_made,
        "complete": statistics.complete,
        "mesh_mb": statistics.memory_mb,
        **found,
        "seconds": {stage: round(value, 3) for stage, value in statistics.seconds.items()},
        "longest_steps": [f"{one:.2f} s  {what}" for one, what in longest],
    }


def _timed(steps: Iterator[Progress], taken: list[tuple[float, str]]) -> Generator[Progress, None, Statistics]:
    """A job that notes the seconds of each step, between which messages."""
    before = "begin"
    while True:
        begun = time.perf_counter()
        try:
            progress = next(steps)
        except StopIteration as stop:
            taken.append((time.perf_counter() - begun, f"{before} > end"))
            return stop.value
        taken.append((time.perf_counter() - begun, f"{before} > {progress.message}"))
        before = progress.message
        yield progress


def left_open(refinement: Refinement) -> dict[str, float]:
    """How many parts of plants are open, by what was decided on the tetrahedra that they are in.

    A part that several tetrahedra share counts in each by the fraction of its area there. Whole plants are not open.
    """
    nodes = np.zeros(len(refinement.tree), np.int8)
    nodes[refinement.nodes] = refinement.decision
    parts, points = refinement.plants.parts, refinement.plants.points
    # Plants grow from the first row of their species.
    trunks = np.flatnonzero(np.diff(refinement.plants.flora.rows["species"], prepend=-1))
    whole = ~parts.branch_only & np.isin(parts.branches.row, trunks)
    area = points.optical_area.astype(np.float64)
    share = area / np.maximum(np.bincount(points.part, area, len(parts)), 1e-300)[points.part]
    share[whole[points.part]] = 0.0
    found = np.bincount(nodes[points.cell], share, minlength=len(Decision))
    cells = np.bincount(refinement.decision, minlength=len(Decision))
    seen = float(found[Decision.EXPLICIT] + found[Decision.PROXY])
    return {
        "open_hidden": float(found[Decision.HIDDEN]),
        "open_seen": seen,
        "hidden_open": float(found[Decision.HIDDEN] / max(seen, 1.0)),
        **{
            f"cells_{one.name.lower()}": int(cells[one]) for one in (Decision.HIDDEN, Decision.EXPLICIT, Decision.PROXY)
        },
    }


def rendered(scene: bpy.types.Scene, folder: Path, samples: int) -> dict[str, float]:
    """Render twice; seconds before the first sample (sync and BVH), of each, and of an image with `SAMPLES`.

    The same in processor seconds, which others that run beside it hardly change. With a single sample: render once, for
    the memory.
    """
    taken = {number: _render_seconds(scene, folder / "picture.png", number) for number in sorted({1, samples})}
    figures = {}
    for place, clock in enumerate(("", "cpu_")):
        first, last = taken[1][place], taken[samples][place]
        each = max(last - first, 0.0) / max(samples - 1, 1)
        setup = max(first - each, 0.0)
        figures |= {
            f"render_{clock}s": last,
            f"render_setup_{clock}s": setup,
            f"render_sample_{clock}s": each,
            f"render_{SAMPLES}_{clock}s": setup + SAMPLES * each,
        }
    return figures | {"peak_render_mb": peak_mb()}


def _render_seconds(scene: bpy.types.Scene, path: Path, samples: int) -> tuple[float, float]:
    """Seconds of a render by the clock, and of all processors."""
    processor = time.process_time()
    seconds = timed_render(scene, path, samples)
    return seconds, time.process_time() - processor
