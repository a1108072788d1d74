# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether *Max Memory* holds: the sum of what Blender and its other processes hold, refinement and render together.

    python -m benchmarks limits [--quick]                        # everything, with targets
    python -m benchmarks limits --call measure '["birch", 2]'    # one case, as a line of JSON

Each case is a process of its own with a camera at the height of eyes in the middle of its plants. Memory is looked at
fifty times a second; pages that processes share count for each of them. At the end *Expand Everything* has to be
refused before anything of it is made.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from .report import Targets, Watch, apart

#: Plants of a stand of each species on a square of so many meters, or the name of a biome.
STANDS = {"birch": 300, "spruce": 200}
BIOME, SIDE, EYES = "beech_fern", 50.0, 1.7
#: Gigabytes of the limits, of which the lower one is near to what plants would like to have.
LIMITS, QUICK_LIMITS = (1.5, 3.0), (2.0,)
SIZE = 1280, 720

TARGETS: Targets = {"limit_ratio_max": {"max": 1.0}, "expanded_refused": {"min": 6}, "expanded_growth_mb": {"max": 200}}
QUICK_TARGETS: Targets = {**TARGETS, "expanded_refused": {"min": 3}}


def run(quick: bool) -> dict[str, float]:
    """Measure all cases."""
    found: dict[str, float] = {"limit_ratio_max": 0.0, "expanded_refused": 0, "expanded_growth_mb": 0.0}
    for name in (*STANDS, BIOME):
        for limit in QUICK_LIMITS if quick else LIMITS:
            case = apart(measure, name, limit)
            found[f"{name}_{limit:g}_ratio"] = case["ratio"]
            found["limit_ratio_max"] = max(found["limit_ratio_max"], case["ratio"])
            found["expanded_refused"] += case["refused"]
            found["expanded_growth_mb"] = max(found["expanded_growth_mb"], case["growth_mb"])
    return found


def measure(name: str, gigabytes: float) -> dict[str, float]:
    """Refine and render, and try to expand everything; megabytes and their ratio to the limit."""
    import bpy

    from tetflora_addon.blender.job import refine
    from tetflora_addon.errors import SceneError

    from .endurance import resident_mb

    scene = bpy.context.scene
    _plant(scene, name)
    scene.tetflora.max_memory, scene.tetflora.refine_at_render = gigabytes, False
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = 'CYCLES', 1, False
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    watch = Watch()
    statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
    most, refused = watch.most, 0
    watch.most = 0.0
    begin = resident_mb()
    scene.tetflora.expand_everything = True
    try:
        refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    except SceneError:
        refused = 1
    return {
        "plants": statistics.plants,
        "most_mb": most,
        "ratio": most / (1e3 * gigabytes),
        "refused": refused,
        "growth_mb": resident_mb() - begin,
    }


def _plant(scene, name: str) -> None:
    """Plants around a camera."""
    import bpy

    from examples import biomes
    from tests.blender.scenes import add_camera, add_plant
    from tetflora_addon.blender.biomes import adding

    if name in STANDS:
        place = np.random.default_rng(1).uniform(-SIDE / 2, SIDE / 2, (STANDS[name], 2))
        for number, (x, y) in enumerate(place):
            add_plant(f"plant {number}", name, seed=number, location=(x, y, 0.0))
        add_camera(location=(0.0, 0.0, EYES))
        return
    biome = biomes.read(name)
    land = adding.make_land(scene, biome.ground)
    biomes.add(scene, biome, land)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    middle = sum((np.array(land.matrix_world @ land.data.vertices[i].co) for i in (0, -1)), np.zeros(3)) / 2.0
    _, at, *_ = scene.ray_cast(depsgraph, (*middle[:2], 1e4), (0.0, 0.0, -1.0))
    add_camera(location=(at[0], at[1], at[2] + EYES))
