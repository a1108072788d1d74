# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalogue as a picture (the paper's figure 4): one plant of each species, fully expanded."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session

from .row80 import add_daylight
from .terrain import ground_material

PER_ROW = 7
STEP, TERRACE = 8.0, 11.5


def build(scene: bpy.types.Scene, seed: int = 11) -> list[str]:
    """Place one plant of each species of the catalogue on terraces, as large as there is room; returns their names."""
    catalogue = session.part("tetflora_addon.plants.catalogue")
    known = catalogue.list_species()
    flora = session.part("tetflora_addon.plants.compiled").compile_species([catalogue.load_species(i) for i in known])
    trunk_rows = flora.first_row
    samples, length = flora.samples, flora.rows["length"][trunk_rows, 0]
    wood = np.array([samples.wood.position[f : f + 64].max(axis=0) for f in samples.wood.first[trunk_rows, -1]])
    height, reach = length * wood[:, 2], length * np.abs(wood[:, :2]).max(axis=1)
    reach += np.where(flora.leaf_count[trunk_rows] > 0, 0.5 * flora.leaf_reach[trunk_rows], 0.0)
    terraces = math.ceil(len(known) / PER_ROW)
    for i, identifier in enumerate(known):
        line, place = divmod(i, PER_ROW)
        empty = bpy.data.objects.new(identifier, None)
        empty.tetflora.is_plant, empty.tetflora.species, empty.tetflora.seed = True, identifier, seed + i
        empty.scale = (min(10.6 / float(height[i]), 4.2 / float(reach[i])),) * 3
        empty.location = place * STEP, 20.0 * (terraces - 1 - line), TERRACE * (terraces - 1 - line)
        scene.collection.objects.link(empty)
    width = (min(PER_ROW, len(known)) - 1) * STEP
    material = ground_material()
    for line in range(terraces):
        y, z = 20.0 * line, TERRACE * line
        mesh = bpy.data.meshes.new("Terrace")
        corners = [(-200, y - 10, z), (200, y - 10, z), (200, y + 10, z), (-200, y + 10, z)]
        wall = [(-200, y + 10, z), (200, y + 10, z), (200, y + 10, z + TERRACE), (-200, y + 10, z + TERRACE)]
        faces = [(0, 1, 2, 3), (4, 5, 6, 7)] if line < terraces - 1 else [(0, 1, 2, 3)]
        mesh.from_pydata(corners + wall, [], faces)
        mesh.materials.append(material)
        scene.collection.objects.link(bpy.data.objects.new("Terrace", mesh))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    rise = TERRACE * terraces
    camera.data.type, camera.data.ortho_scale, camera.data.clip_end = 'ORTHO', width + 10.0, 500.0
    camera.location = Vector((width / 2, -100.0, rise / 2 - 0.4))
    camera.rotation_euler = (math.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    add_daylight(scene, elevation=48.0, azimuth=25.0)
    scene.view_settings.exposure = 0.6
    scene.render.resolution_x = 1400
    scene.render.resolution_y = math.floor(1400 * (rise + 0.8) / (width + 10.0))
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
