# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds, noise and memory of a view of proxies in Cycles: a forest 40 to 12 pixels high, refined against expanded."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from examples import stands

from .compare import plant_mask, read_picture, render
from .row80 import timed_refine

#: Fully expanded, the larger forest takes 13 GB, most of it in Cycles.
PLANTS, QUICK_PLANTS = 40, 12
SAMPLES, QUICK_SAMPLES = 64, 16


@dataclass(frozen=True)
class Cost:
    """What a form costs.

    Attributes
    ----------
    refine_s : float
        Seconds of refining (of expanding), meshes written.
    seconds : float
        Rendering, synchronisation and building of the BVH included.
    start_s : float
        What of it does not depend on the number of samples.
    variance : float
        Mean variance of the pixels where plants are, as stored (sRGB, 0 to 1), from two seeds.
    mesh_mb : float
        Megabytes of what was handed to Blender.
    renderer_mb : float
        Peak allocation that Cycles reported: its textures, meshes and BVH.
    """

    refine_s: float
    seconds: float
    start_s: float
    variance: float
    mesh_mb: float
    renderer_mb: float


def run(folder: Path, chosen: tuple[str, ...], quick: bool) -> dict[str, float]:
    """Costs of expanded plants and of each form, and ratios ``time_ratio_…``, ``equal_noise_time_ratio_…``, ….

    Seconds at equal noise are t₀ + r n σ²/σ²₀, with t₀ the seconds before the first sample, r the seconds of a sample,
    n samples, and σ² the variance of the form, σ²₀ that of the expanded plants. Baked light counts as a form.
    """
    scene = bpy.context.scene
    samples = QUICK_SAMPLES if quick else SAMPLES
    stands.forest(scene, QUICK_PLANTS if quick else PLANTS, "side", 256 if quick else 512)
    scene.cycles.transparent_max_bounces = 256  # two hits a shell
    mask: np.ndarray | None = None
    costs: dict[str, Cost] = {}
    for name, settings in variants(scene, chosen, baked=not quick).items():
        statistics, refine_s = timed_refine(scene, **settings)
        if mask is None:
            mask = plant_mask(scene, folder / "mask.png")
        costs[name] = _cost(scene, folder, name, samples, mask, refine_s, statistics.memory_mb)
        print(f"  forest, {name}: {costs[name]}", flush=True)
    return _ratios(costs, samples)


def variants(scene: bpy.types.Scene, chosen: tuple[str, ...], baked: bool) -> dict[str, dict[str, object]]:
    """Settings by name: expanded plants first, the forms, and each of them with baked light if that is asked for."""
    out: dict[str, dict[str, object]] = {"expanded": {"expand_everything": True}}
    out |= {f.lower(): {"expand_everything": False, "proxy_kind": f, "baked_light": 'OFF'} for f in chosen}
    choices = scene.tetflora.bl_rna.properties["baked_light"].enum_items.keys()
    for bake in [c for c in choices if c != 'OFF'] if baked else ():
        out |= {f"{form.lower()}_baked_{bake.lower()}": out[form.lower()] | {"baked_light": bake} for form in chosen}
    return out


def _cost(
    scene: bpy.types.Scene, folder: Path, name: str, samples: int, mask: np.ndarray, refine_s: float, mesh_mb: float
) -> Cost:
    paths = [folder / f"forest-{name}-{seed}.png" for seed in range(2)]
    with most_memory() as peak:
        # In turns, and the less of two: others may use the machine meanwhile.
        both = [
            (_seconds(scene, folder / "first.png", 1, 0), _seconds(scene, path, samples, seed))
            for seed, path in enumerate(paths)
        ]
    first, seconds = (min(every) for every in zip(*both, strict=True))
    a, b = (read_picture(path)[:, :, :3][mask] for path in paths)
    start = float(np.clip((samples * first - seconds) / (samples - 1), 0.0, seconds))
    return Cost(refine_s, seconds, start, float(((a - b) ** 2).mean() / 2.0), mesh_mb, peak[0])


def _seconds(scene: bpy.types.Scene, path: Path, samples: int, seed: int) -> float:
    start = time.perf_counter()
    render(scene, path, samples, seed)
    return time.perf_counter() - start


def _ratios(costs: dict[str, Cost], samples: int) -> dict[str, float]:
    mesh = costs["expanded"]
    figures: dict[str, float] = {}
    for name, cost in costs.items():
        figures[f"seconds_{name}"] = cost.seconds
        figures[f"memory_mb_{name}"] = cost.mesh_mb
        figures[f"renderer_mb_{name}"] = cost.renderer_mb
        if name == "expanded":
            continue
        figures[f"time_ratio_{name}"] = cost.seconds / mesh.seconds
        equal = cost.start_s + (cost.seconds - cost.start_s) * cost.variance / mesh.variance
        figures[f"equal_noise_time_ratio_{name}"] = equal / mesh.seconds
        figures[f"memory_ratio_{name}"] = cost.mesh_mb / mesh.mesh_mb
        figures[f"renderer_memory_ratio_{name}"] = cost.renderer_mb / mesh.renderer_mb
        figures[f"whole_time_ratio_{name}"] = (cost.refine_s + cost.seconds) / (mesh.refine_s + mesh.seconds)
    return figures


@contextmanager
def most_memory() -> Iterator[list[float]]:
    """Most megabytes that the renderer tells of in its status while the context lasts, in a list of one."""
    most = [0.0]

    def listen(*words: object) -> None:
        for text in words:
            found = re.search(r"Mem:\s*([\d.,]+)\s*([KMG])", text) if isinstance(text, str) else None
            if found:
                size = float(found[1].replace(",", "")) * {"K": 1e-3, "M": 1.0, "G": 1e3}[found[2]]
                most[0] = max(most[0], size)

    bpy.app.handlers.render_stats.append(listen)
    try:
        yield most
    finally:
        bpy.app.handlers.render_stats.remove(listen)
