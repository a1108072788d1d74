# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a few pixels, as arrays of linear radiance, for tests of materials."""

from __future__ import annotations

import tempfile
from math import pi, radians
from pathlib import Path

import bpy
import numpy as np

from devtools.formats import set_format
from tetflora_addon.blender import compat

EEVEE_SAMPLES = 4


def small_scene(
    sky: float,
    samples: int,
    sun: float | None = None,
    size: int = 16,
    engine: str = "CYCLES",
    width: float = 2.0,
    shadows: bool = False,
) -> None:
    """Look down from z = 50 on `width` meters, under a gray sky and a sun of π W/m² so many degrees off the zenith.

    EEVEE draws shadows where they are asked for: on a processor they take it two thirds of a second for each picture.
    """
    scene = bpy.context.scene
    render = scene.render
    render.engine = engine
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    render.film_transparent = False
    scene.cycles.samples = samples
    # EEVEE samples in the same order each time, and takes a third of a second for one where a processor draws.
    scene.eevee.taa_render_samples = min(samples, EEVEE_SAMPLES)
    # By itself it empties half a gigabyte for shadows first, needed or not.
    scene.eevee.use_shadows, scene.eevee.shadow_pool_size = shadows, '16'
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.transparent_max_bounces = 64
    scene.cycles.seed = 1
    world = bpy.data.worlds.new("sky")
    world.probe_resolution = '128'  # of EEVEE, which draws the sky so large for each picture
    scene.world = world
    tree = compat.shader_tree(world)
    tree.nodes["Background"].inputs["Color"].default_value = (sky, sky, sky, 1.0)
    camera = bpy.data.cameras.new("camera")
    camera.type = 'ORTHO'
    camera.ortho_scale = width
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0.0, 0.0, 50.0)
    scene.collection.objects.link(scene.camera)
    if sun is not None:
        light = bpy.data.lights.new("sun", 'SUN')
        light.energy, light.angle = pi, 0.0
        made = bpy.data.objects.new("sun", light)
        made.rotation_euler = (0.0, radians(sun), 0.0)
        scene.collection.objects.link(made)


def few_directions(world: bpy.types.World) -> None:
    """A sky of large patches is known from few points: by itself Cycles looks at half a million before it renders."""
    world.cycles.sampling_method, world.cycles.sample_map_resolution = 'MANUAL', 64


def same_samples(engine: str) -> int:
    """Samples for pictures that are compared with each other: EEVEE's are the same ones in each, so one is enough."""
    return 16 if engine == "CYCLES" else 1


def picture() -> np.ndarray:
    """Render; linear radiance ``(height, width, 3)``, bottom row first."""
    settings = bpy.context.scene.render
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "picture.exr")
        set_format(settings.image_settings, 'OPEN_EXR')
        settings.image_settings.color_depth = '32'
        settings.filepath = path
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.zeros(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        values = pixels.reshape(image.size[1], image.size[0], 4)[..., :3].astype(np.float64)
        bpy.data.images.remove(image)
    return values
