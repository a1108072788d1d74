# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What bark costs in Cycles where a trunk fills the image, over a plain material of the same color.

Times are those of the processor, of all threads, which other programs disturb less than they do the clock. Each bark
is rendered next to the plain material, and the least time of each counts.
"""

from __future__ import annotations

import time
from math import pi, tau

import bpy

from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import bark, materials

from .report import Targets

RADIUS, LENGTH = 0.4, 6.0
COLOR = (0.4, 0.3, 0.2)

#: A guard against more: where bark is a few pixels wide, as nearly always, nobody measures any of it.
TARGETS: Targets = {"cycles_worst": {"max": 4.0}}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure all barks; `cycles_<bark>` is its time over that of the plain material."""
    scene = bpy.context.scene
    trunk, plain = _trunk_scene(scene), plain_material()
    scene.cycles.samples = 8 if quick else 32
    ratios = {}
    for character in bark.BARKS:
        pair = (plain, materials.bark_material(f"Trunk of {character} bark", character))
        seconds = [[_processor_seconds(trunk, m) for m in pair] for _ in range(2)]
        plain_s, bark_s = (min(column) for column in zip(*seconds, strict=True))
        ratios[f"cycles_{character}"] = bark_s / plain_s
    return {**ratios, "cycles_worst": max(ratios.values())}


def _trunk_scene(scene: bpy.types.Scene) -> bpy.types.Object:
    """A trunk across the whole image, under a sun and an even sky."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=64, radius=RADIUS, depth=LENGTH, end_fill_type='NOTHING')
    trunk = bpy.context.object
    mesh = trunk.data
    mesh.shade_smooth()
    mesh.uv_layers[0].name = "UVMap"
    for loop, corner in zip(mesh.uv_layers[0].data, mesh.loops, strict=True):
        loop.uv = (loop.uv[0], mesh.vertices[corner.vertex_index].co.z / (tau * RADIUS))
    color = mesh.attributes.new("tf_color", 'FLOAT_VECTOR', 'FACE')
    color.data.foreach_set("vector", COLOR * len(mesh.polygons))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = 'ORTHO', 0.75
    camera.location, camera.rotation_euler = (0.0, -5.0, 0.0), (pi / 2, 0.0, 0.0)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.rotation_euler = (0.9, 0.0, 0.6)
    for made in (camera, sun):
        scene.collection.objects.link(made)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("Sky")
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 320, 180, 100
    render.engine = 'CYCLES'
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    return trunk


def plain_material() -> bpy.types.Material:
    """Principled as Blender gives it, with the color of the faces."""
    material = bpy.data.materials.new("Plain")
    tree = compat.shader_tree(material)
    color = tree.nodes.new("ShaderNodeAttribute")
    color.attribute_name = "tf_color"
    principled = next(node for node in tree.nodes if node.type == 'BSDF_PRINCIPLED')
    tree.links.new(color.outputs["Color"], principled.inputs["Base Color"])
    return material


def _processor_seconds(trunk: bpy.types.Object, material: bpy.types.Material) -> float:
    trunk.data.materials.clear()
    trunk.data.materials.append(material)
    start = time.process_time()
    bpy.ops.render.render()
    return time.process_time() - start
