# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much ground a birch stand covers seen from above, in summer and in winter, against a published stand.

The stand is that of Järvselja (Estonia), the birch canopies HET09_JBS_SUM and HET15_JBS_WIN of the Radiation Transfer
Model Intercomparison. Its plots have 654 trees of the upper layer on a hectare, with a basal area of 23.3 m² (A. Lang
et al., "Changes during twelve years in three mature hemiboreal stands", 2021, doi 10.2478/fsmu-2021-0007, figures of
2007). Trees here are birches of a dense stand, all of one layer. Expanded plants are seen, as instances of a few
variants: no proxy takes part.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import forms
from examples import stage
from tetflora_addon.blender.job.plant_mesh import plant_mesh, plant_parts, single_seed
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.species.catalog import load_species

from .pictures import coverage
from .report import Targets

#: Trees on a hectare, their basal area on it, m², and the share of ground that they cover.
STEMS, BASAL_AREA = 654.0, 23.3
PUBLISHED = {"summer": 0.557, "winter": 0.28}
#: Side of what is planted and of what is seen, meters; the least distance of trees.
LAND, SEEN, APART = 100.0, 60.0, 2.0
#: Different birches; sizes of them vary by so much.
VARIANTS, SPREAD = 6, 0.15
PIXELS, SAMPLES, QUICK_SAMPLES = 1500, 16, 4
HABIT = 1.0

TARGETS: Targets = {"summer_off": {"max": 0.04}, "winter_off": {"max": 0.04}}


def run(quick: bool) -> dict[str, float]:
    """Cover of the ground in both seasons, leaf and wood area index of the stand, and how far cover is off."""
    scene = bpy.context.scene
    meshes, area = _variants(scene)
    diameter = forms.measured("birch", HABIT)["diameter"]
    scale = np.sqrt(4.0 * BASAL_AREA / (np.pi * STEMS)) / diameter
    stage.camera(scene, (0.0, 0.0, 100.0), (0.0, 0.0, 0.0), (PIXELS, PIXELS), far=200.0, across=SEEN)
    size = SPREAD * np.random.default_rng(2).uniform(-1.0, 1.0, len(places := _places())) + 1.0
    size *= scale / np.sqrt(np.mean(size**2))
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for season, own in meshes.items():
            objects = _plant(scene, own, places, size)
            picture = coverage(scene, Path(folder) / f"{season}.png", QUICK_SAMPLES if quick else SAMPLES)
            found[season] = float(picture.mean())
            for o in objects:
                bpy.data.objects.remove(o)
    on_ground = (size**2).sum() / LAND**2
    return {
        "trees": len(places),
        "scale": float(scale),
        "leaf_area_index": float(area["leaf"] * on_ground),
        "wood_area_index": float(area["bark"] * on_ground),
        **found,
        **{f"{season}_off": abs(found[season] - published) for season, published in PUBLISHED.items()},
    }


def _variants(scene: bpy.types.Scene) -> tuple[dict[str, list[bpy.types.Mesh]], dict[str, float]]:
    """Birches with and without leaves, and the mean area of what one has: one side of leaves, half of wood, m²."""
    species = replace(load_species("birch"), habit=HABIT)
    flora = compile_species([species])
    meshes: dict[str, list[bpy.types.Mesh]] = {"summer": [], "winter": []}
    area = {"leaf": 0.0, "bark": 0.0}
    for number in range(VARIANTS):
        parts = plant_parts(flora, single_seed("birch", number))
        bare = [part for part in parts if part[0] == "bark"]
        for season, own in (("summer", parts), ("winter", bare)):
            meshes[season].append(plant_mesh(scene, f"{season} {number}", species, own))
        wood = _area(meshes["winter"][-1])
        area["bark"] += 0.5 * wood / VARIANTS
        area["leaf"] += (_area(meshes["summer"][-1]) - wood) / VARIANTS
    return meshes, area


def _area(mesh: bpy.types.Mesh) -> float:
    found = np.empty(len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get("area", found)
    return float(found.sum(dtype=np.float64))


def _places() -> NDArray[np.float64]:
    """Places (n, 2) at random, none of them nearer to another than trees stand; at the border they meet again."""
    wanted, rng = round(STEMS * LAND**2 / 1e4), np.random.default_rng(1)
    found = np.zeros((0, 2))
    while len(found) < wanted:
        one = rng.uniform(0.0, LAND, 2)
        away = np.abs(found - one)
        if not len(found) or np.hypot(*np.minimum(away, LAND - away).T).min() >= APART:
            found = np.vstack([found, one])
    return found - LAND / 2


def _plant(
    scene: bpy.types.Scene, meshes: list[bpy.types.Mesh], places: NDArray[np.float64], size: NDArray[np.float64]
) -> list[bpy.types.Object]:
    """Objects that share meshes, turned at random; they count as plants."""
    rng, objects = np.random.default_rng(3), []
    for number, (place, scale) in enumerate(zip(places, size, strict=True)):
        one = bpy.data.objects.new("Birch", meshes[number % len(meshes)])
        one.location, one.scale, one.rotation_euler[2] = (*place, 0.0), (scale,) * 3, rng.uniform(0.0, 2.0 * np.pi)
        one["tetflora_kind"] = "bark"
        scene.collection.objects.link(one)
        objects.append(one)
    return objects
