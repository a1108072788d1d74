# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The first picture of an edited species beside that of the shipped one, and how well its facet weights are measured.

A small forest of one species is refined twice in one process, each time as after Blender has started: nothing is in
memory. The cache folder has what the shipped species needs, as after any earlier session, and nothing of the edited
one. Seconds are those of the processor in the one thread that works, which other programs disturb less than the clock.

Weights of the edited species are then measured with all rays; ``share_error`` is the largest difference, as a fraction
of the area.
"""

from __future__ import annotations

import time
from typing import Any

import bpy
import numpy as np

from devtools import session
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.species import edits
from tetflora_addon.compiled import flora as compiled
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies import facet_weights
from tetflora_addon.species.catalog import list_species

from .report import Targets

QUICK_SPECIES = ("birch", "conifer", "fern")
#: What the artist changes, of all orders, and by which factor.
CHANGES = {"leaf_size": 1.2, "leaves": 1.15, "branches": 1.1, "angle": 0.9}
TARGETS: Targets = {
    "extra_s_max": {"max": 3.0},
    "shares_s_max": {"max": 2.0},
    "share_error_max": {"max": 0.02},
}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure each shipped species."""
    figures: dict[str, float] = {}
    for identifier in QUICK_SPECIES if quick else list_species():
        scene = forest(identifier)
        first_picture(scene)  # what the shipped species needs is now in the cache folder
        plain = first_picture(scene)
        edits.change_species(scene, identifier, edit)
        edited = first_picture(scene)
        taken, longest, error = shares(compile_species([edits.species_for(scene, identifier)]))
        figures |= {
            f"plain_s_{identifier}": plain,
            f"edited_s_{identifier}": edited,
            f"extra_s_{identifier}": edited - plain,
            f"shares_s_{identifier}": taken,
            f"longest_step_s_{identifier}": longest,
            f"share_error_{identifier}": error,
        }
    kinds = ("extra_s", "shares_s", "longest_step_s", "share_error")
    return {f"{kind}_max": max(v for k, v in figures.items() if k.startswith(f"{kind}_")) for kind in kinds} | figures


def forest(identifier: str) -> bpy.types.Scene:
    """Plants of one species in a row into the depth, so that there are real ones and facets, from few to many."""
    session.clean_file()
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (0.0, -30.0, 2.0), (np.pi / 2, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 480, 270
    for number, distance in enumerate((0.0, 20.0, 60.0, 180.0, 540.0)):
        plant = bpy.data.objects.new(f"plant {number}", None)
        plant.location = (0.1 * (number % 3 - 1) * (distance + 30.0), distance, 0.0)
        plant.tetflora.is_plant, plant.tetflora.species, plant.tetflora.seed = True, identifier, number
        scene.collection.objects.link(plant)
    bpy.context.view_layer.update()
    return scene


def first_picture(scene: bpy.types.Scene) -> float:
    """Seconds of the first refinement of a session, up to all meshes."""
    compiled._compiled.cache_clear()
    facet_weights._of_states.cache_clear()
    facet_weights._found.clear()
    begun = time.thread_time()
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())
    taken = time.thread_time() - begun
    refine.clear(scene)
    return taken


def edit(data: dict[str, Any]) -> None:
    """Change decoded JSON of a species as an artist does with the sliders."""
    for order in data["orders"]:
        for key, factor in CHANGES.items():
            value = order.get(key)
            if value is not None:
                order[key] = [factor * one for one in value] if isinstance(value, list) else factor * value


def shares(flora: Flora) -> tuple[float, float, float]:
    """Seconds that the weights of a flora's only species take, the longest step of them, and the largest error."""
    steps, longest = facet_weights.fitting(flora, 0, facet_weights.RAYS), 0.0
    begun = before = time.thread_time()
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            found = stop.value
            break
        longest, before = max(longest, time.thread_time() - before), time.thread_time()
    taken = time.thread_time() - begun
    return taken, longest, float(np.abs(found - run_to_end(facet_weights.fitting(flora, 0))).max())
