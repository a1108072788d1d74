# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of the wood that can be expanded: the plants behind a window in the middle of the image, refined and expanded.

The camera is that of the whole image, and so are the pixels that refinement counts; only the window is rendered.
Facets are as large, and leaves become facets at the same width, as in the whole wood, which has to share out what it
can afford.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from tetflora_addon.blender.job.contents import compile_for, read_scene
from tetflora_addon.blender.placing.plant_objects import add_field
from tetflora_addon.blender.placing.populations import remove_population
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.planting.places import Placement

from .compare import difference, plant_mask
from .forest_case import as_fine_as, detail_of
from .row80 import timed_refine, timed_render

#: Of the width and the height of the image: 320 × 180 of 1920 × 1080 pixels.
WINDOW = 1.0 / 6.0
#: Plants in the part, and polygons that they have when expanded.
MOST, MOST_POLYGONS = 200, 5_000_000
#: Where plants must be seen to count as standing in the window, meters above the ground.
_MIDDLE = 7.0


def measure(scene: bpy.types.Scene, folder: Path, samples: int, noise: bool = True) -> dict[str, float]:
    """Leave only the plants of the part in a wood, and compare images.

    Parameters
    ----------
    scene : bpy.types.Scene
        From `forest_scene.build`.
    folder : Path
        Images are left here.
    samples : int
    noise : bool
        Render the expanded plants with another seed as well.
    """
    detail = detail_of(scene)
    plants = keep(scene)
    render = scene.render
    low, high = (1.0 - WINDOW) / 2.0, (1.0 + WINDOW) / 2.0
    render.use_border = render.use_crop_to_border = True
    render.border_min_x = render.border_min_y = low
    render.border_max_x = render.border_max_y = high
    with as_fine_as(detail):
        refined, _ = timed_refine(scene, expand_everything=False)
    timed_render(scene, folder / "refined.png", samples)
    expanded, _ = timed_refine(scene, expand_everything=True)
    timed_render(scene, folder / "expanded.png", samples)
    mask = plant_mask(scene, folder / "mask.png")
    found = difference(folder / "expanded.png", folder / "refined.png", mask)
    figures = {
        "part_plants": plants,
        "part_polygons": refined.polygons_meshed + refined.polygons_proxy,
        "part_polygons_full": expanded.polygons_meshed,
        "part_facet_pixels": refined.facet_pixels,
        "part_leaf_limit": detail.leaf_limit,
        "part_covered": float(mask.mean()),
        "flip": found.flip,
        "color_error": found.color,
    }
    if noise:
        timed_render(scene, folder / "again.png", samples, seed=1)
        figures["flip_noise"] = difference(folder / "expanded.png", folder / "again.png", mask).flip
    return figures


def keep(scene: bpy.types.Scene) -> int:
    """Replace a scene's population by those of its plants that stand in the window, the nearest first; their number."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seeds = read_scene(scene, depsgraph, depsgraph.view_layer).seeds
    flora = compile_for(seeds.identifiers, scene, depsgraph)
    away, inside = _seen(scene, seeds)
    chosen = np.flatnonzero(inside)[np.argsort(away[inside], kind="stable")][:MOST]
    polygons = np.cumsum(flora.polygons[trunks(flora.rows, seeds).row][chosen])
    chosen = chosen[: max(int((polygons <= MOST_POLYGONS).sum()), 1)]
    kept = seeds.take(chosen)
    remove_population(scene, 0)
    azimuth = np.arctan2(kept.frame[:, 1, 0], kept.frame[:, 0, 0])
    placement = Placement(
        kept.position, azimuth, kept.scale, kept.species, kept.seed.astype(np.int32), len(kept), up=kept.frame[:, :, 2]
    )
    add_field(scene, placement, kept.identifiers)
    bpy.context.view_layer.update()
    return len(kept)


def _seen(scene: bpy.types.Scene, seeds: Seeds) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Distance (n,) of plants from the camera, meters, and whether they are in the window (n,)."""
    camera = scene.camera
    middle = seeds.position + [0.0, 0.0, min(_MIDDLE, camera.location.z)]
    matrix: Matrix = camera.matrix_world.normalized().inverted()
    local = np.column_stack([middle, np.ones(len(middle))]) @ np.array(matrix, np.float64).T
    corners = np.array(camera.data.view_frame(scene=scene))
    half = WINDOW * np.abs(corners[:, :2] / corners[:, 2:]).max(axis=0)
    away = -local[:, 2]
    inside = (np.abs(local[:, :2]) < half * np.maximum(away, 1e-9)[:, None]).all(axis=1) & (away > 0.0)
    return away, inside
