# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalogue as a picture (the paper's figure 4): one plant of each species side by side, fully expanded."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session

from .row80 import add_daylight
from .terrain import ground_material


def build(scene: bpy.types.Scene, seed: int = 11) -> list[str]:
    """Place one plant of each species of the catalogue in a row, equally high all of them; returns their names."""
    catalogue = session.part("tetflora_addon.plants.catalogue")
    known = catalogue.list_species()
    flora = session.part("tetflora_addon.plants.compiled").compile_species([catalogue.load_species(i) for i in known])
    trunk_rows = np.arange(len(known)) * (len(flora.rows) // len(known))
    height = flora.rows["length"][trunk_rows, 0] * flora.samples.leaf_position[trunk_rows, :, 2].max(axis=1)
    x = 0.0
    for i, identifier in enumerate(known):
        empty = bpy.data.objects.new(identifier, None)
        empty.tetflora.is_plant, empty.tetflora.species, empty.tetflora.seed = True, identifier, seed + i
        empty.scale = (9.0 / float(height[i]),) * 3  # all equally high on the sheet
        empty.location.x = x
        x += 8.5
        scene.collection.objects.link(empty)
    middle = (x - 8.5) / 2
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata([(-200, -60, 0), (200, -60, 0), (200, 200, 0), (-200, 200, 0)], [], [(0, 1, 2, 3)])
    floor = bpy.data.objects.new("Floor", mesh)
    scene.collection.objects.link(floor)
    mesh.materials.append(ground_material())
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    eye, target = Vector((middle, -60.0, 6.5)), Vector((middle, 0.0, 4.4))
    camera.location, camera.data.lens = eye, 36.0 * 60.0 / (x + 3.0)
    camera.rotation_euler = (target - eye).to_track_quat('-Z', 'Y').to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    add_daylight(scene, elevation=42.0, azimuth=140.0)
    scene.view_settings.exposure = 0.4
    scene.render.resolution_x, scene.render.resolution_y = 1200, math.floor(1200 * 11.5 / (x + 3.0))
    return [info.name for info in known.values()]


def render_sheet(path: Path, samples: int = 64) -> None:
    """Render the sheet as a JPEG."""
    session.clean_file()
    scene = bpy.context.scene
    build(scene)
    scene.tetflora.refine_at_render, scene.tetflora.expand_everything = False, True
    session.part("tetflora_addon.blender.job").refine(scene, bpy.context.evaluated_depsgraph_get())
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.render.image_settings.file_format, scene.render.image_settings.quality = 'JPEG', 88
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
