# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What leaves cost in Cycles in a crown that fills the image, and what their pattern does where they are small.

The same crown is rendered with plain materials and with those of leaves, one after the other, and the least time of the
processor of each counts. From afar the pattern must neither alias nor cost more: noise is the spread of pixels between
two renders that differ by their seed.
"""

from __future__ import annotations

import tempfile
import time
from math import pi
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session
from devtools.formats import set_format
from tetflora_addon.blender.attributes import members
from tetflora_addon.blender.job import plant_mesh
from tetflora_addon.blender.materials import materials
from tetflora_addon.jobs import run_to_end

from .looks import plain_material
from .report import Targets

#: Kind of blade by species, and how far away the camera is, in heights of the tree.
CROWNS = {"oak": 0.3, "maple": 0.3, "spruce": 0.25}
FAR = 4.0

TARGETS: Targets = {
    "leaves_worst": {"max": 1.3},
    "leaves_far": {"max": 1.3},
    "bark_in_crown": {"max": 1.3},
    "noise_far_over_plain": {"max": 1.1},
    "mean_far_off": {"max": 0.01},
}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure; `leaves_<species>` is the time over that of plain materials, `leaves_far` that of the oak from afar.

    `leaves_detail_worst` is against a plain material through which as much light comes: what all detail costs.
    `bark_in_crown` is that of the oak's bark, among leaves that keep their material.
    """
    samples = 8 if quick else 32
    species = ("oak",) if quick else tuple(CROWNS)
    found = {one: _ratios(one, CROWNS[one], samples) for one in species}
    ratios = {f"leaves_{one}": ratio for one, (ratio, _) in found.items()}
    far, _ = _ratios("oak", FAR, samples)
    bark, _ = _ratios("oak", CROWNS["oak"], samples, " bark")
    noise, off = _far_noise(samples)
    worst = max(ratios.values())
    return {
        **ratios,
        "leaves_worst": worst,
        "leaves_detail_worst": max(ratio for _, ratio in found.values()),
        "leaves_far": far,
        "bark_in_crown": bark,
        "noise_far_over_plain": noise,
        "mean_far_off": off,
    }


def _crown(identifier: str, distance: float, samples: int, part: str = " leaf") -> tuple[bpy.types.Mesh, int]:
    """A tree as a mesh before a camera, under sun and sky; the mesh and the slot of its leaves or its bark."""
    session.clean_file()
    scene = bpy.context.scene
    empty = bpy.data.objects.new(identifier, None)
    empty.tetflora.is_plant, empty.tetflora.species, empty.tetflora.seed = True, identifier, 3
    scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    (plant,) = run_to_end(plant_mesh.make_plant_mesh_steps(scene, bpy.context.evaluated_depsgraph_get(), [empty]))
    points = members(plant.data.vertices, "co", 3)
    height, middle = float(points[:, 2].max()), points.mean(axis=0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = Vector((float(middle[0]), float(middle[1]) - distance * height, float(middle[2])))
    camera.rotation_euler = (pi / 2, 0.0, 0.0)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.data.energy, sun.rotation_euler = 4.0, (0.9, 0.0, 0.6)
    for made in (camera, sun):
        scene.collection.objects.link(made)
    scene.camera, scene.world = camera, bpy.data.worlds.new("Sky")
    render = scene.render
    render.engine, render.resolution_percentage = 'CYCLES', 100
    render.resolution_x, render.resolution_y = 320, 180
    scene.tetflora.refine_at_render = False
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = samples, False, False
    slot = next(i for i, m in enumerate(plant.data.materials) if m.name.endswith(part))
    return plant.data, slot


def _ratios(identifier: str, distance: float, samples: int, part: str = " leaf") -> tuple[float, float]:
    """Seconds with the real material over those with a plain one, and over one that only scatters as leaves do."""
    mesh, slot = _crown(identifier, distance, samples, part)
    three = mesh.materials[slot], plain_material(), materials.proxy_material()
    seconds = [[_processor_seconds(mesh, slot, material) for material in three] for _ in range(2)]
    real_s, plain_s, scattering_s = (min(column) for column in zip(*seconds, strict=True))
    return real_s / plain_s, real_s / scattering_s


def _processor_seconds(mesh: bpy.types.Mesh, slot: int, material: bpy.types.Material) -> float:
    mesh.materials[slot] = material
    start = time.process_time()
    bpy.ops.render.render()
    return time.process_time() - start


def _far_noise(samples: int) -> tuple[float, float]:
    """Spread between seeds over that with the material of proxies, and how far means are apart, where leaves are small.

    The material of proxies scatters alike but has no pattern.
    """
    mesh, leaves = _crown("oak", FAR, samples)
    spreads, found = [], []
    for material in (mesh.materials[leaves], materials.proxy_material()):
        mesh.materials[leaves] = material
        pictures = [_picture(seed) for seed in (1, 2)]
        spreads.append(float(np.abs(pictures[0] - pictures[1]).mean()))
        found.append(np.mean(pictures, axis=(0, 1, 2)))
    return spreads[0] / spreads[1], float(np.abs(found[0] - found[1]).max())


def _picture(seed: int) -> np.ndarray:
    """Linear radiance (height, width, 3)."""
    scene = bpy.context.scene
    scene.cycles.seed = seed
    with tempfile.TemporaryDirectory() as folder:
        set_format(scene.render.image_settings, 'OPEN_EXR')
        scene.render.filepath = str(Path(folder) / "picture.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.zeros(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        values = pixels.reshape(*reversed(image.size), 4)[..., :3].astype(np.float64)
        bpy.data.images.remove(image)
    return values
