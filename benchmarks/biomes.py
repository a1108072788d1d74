# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes: seconds to add each of the shipped ones to a hectare of its own land, and how many plants its layers have.

Nothing is known from the biome before: species are compiled anew, as in a session that has just begun.
"""

from __future__ import annotations

import time

import bpy

from devtools import session
from tetflora_addon.blender.biomes import adding, files, ground, library
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.compiled import crowns, flora
from tetflora_addon.species import ages

from .report import Targets

QUICK = ("beech_fern", "meadow")

TARGETS: Targets = {
    **{f"seconds_{path.stem}": {"max": 5.0} for path in sorted(library.builtin_folder().glob("*.json"))},
    "biomes": {"min": 12.0},
    "layers_without_plants": {"max": 0.0},
}
QUICK_TARGETS: Targets = {f"seconds_{name}": {"max": 5.0} for name in QUICK}


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    figures: dict[str, float] = {}
    paths = sorted(library.builtin_folder().glob("*.json"))
    bare = 0
    for path in paths:
        if quick and path.stem not in QUICK:
            continue
        session.clean_file()
        crowns._known.clear()
        flora._compiled.cache_clear()
        ages.with_age.cache_clear()
        scene, biome = bpy.context.scene, files.read_biome(path)
        land = ground.make_land(scene, biome.ground)
        bpy.context.view_layer.update()
        begin = time.perf_counter()
        added = run_to_end(adding.add_biome_steps(scene, bpy.context.evaluated_depsgraph_get(), biome, [land]))
        figures[f"seconds_{path.stem}"] = time.perf_counter() - begin
        for name, number in added.layers:
            figures[f"plants_{path.stem}: {name}"] = float(number)
            bare += not number
    return figures | {"biomes": float(len(paths)), "layers_without_plants": float(bare)}
