# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small meshes and materials for tests of what assets look like."""

from __future__ import annotations

import bpy
import numpy as np

from tetflora_addon.blender import compat
from tetflora_addon.blender.assets.places import Target, read_source_steps

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def linear(color):
    """sRGB as light."""
    color = np.asarray(color, np.float64)
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def image(pixels, name="picture", space="sRGB", **settings):
    """An image of pixels (h, w, 3 or 4), row 0 lowest."""
    pixels = np.asarray(pixels, np.float32)
    height, width = pixels.shape[:2]
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.ones((height, width, 1), np.float32)], axis=2)
    made = bpy.data.images.new(name, width, height, alpha=True, **settings)
    made.colorspace_settings.name = space
    made.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
    made.update()
    return made


class Paint:
    """A material with a Principled shader, and shorthand for its tree."""

    def __init__(self, name="paint"):
        self.material = bpy.data.materials.new(name)
        self.tree = compat.shader_tree(self.material)
        self.shader = next(n for n in self.tree.nodes if n.type == 'BSDF_PRINCIPLED')
        self.output = next(n for n in self.tree.nodes if n.type == 'OUTPUT_MATERIAL')

    def node(self, kind, **settings):
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            setattr(node, key, value)
        return node

    def texture(self, picture, alpha=False, **settings):
        """An image node that feeds the base color, and the alpha."""
        node = self.node("TexImage", image=picture, **settings)
        self.link(node.outputs["Color"], self.shader.inputs["Base Color"])
        if alpha:
            self.link(node.outputs["Alpha"], self.shader.inputs["Alpha"])
        return node

    def link(self, output, socket):
        self.tree.links.new(output, socket)


def cards(materials, uvs=(SQUARE,), size=1.0, name="cards", slots=None):
    """An object of loose quads with texture coordinates (n, 4, 2)."""
    uvs = np.asarray(uvs, np.float32)
    count = len(uvs)
    corners = np.zeros((count, 4, 3), np.float32)
    corners[..., :2] = size * np.array(SQUARE)
    corners[..., 0] += 2 * size * np.arange(count)[:, None]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners.reshape(-1, 3).tolist(), [], np.arange(4 * count).reshape(-1, 4).tolist())
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uvs.ravel())
    for material in materials:
        mesh.materials.append(material)
    if slots is not None:
        mesh.polygons.foreach_set("material_index", np.array(slots, np.int32))
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def target_of(datablock):
    return Target(datablock, None, None, datablock.name)


def read(datablock):
    """The source of a datablock, and warnings."""
    bpy.context.view_layer.update()
    steps = read_source_steps(target_of(datablock), bpy.context.evaluated_depsgraph_get())
    before = 0.0
    while True:
        try:
            done = next(steps)
        except StopIteration as stop:
            return stop.value
        assert 0 <= before <= done <= 1
        before = done


def look(paint, uvs=(SQUARE,), **options):
    """Color, transmission and coverage of cards that wear a material."""
    source, warnings = read(cards([paint.material], uvs, **options))
    surface = source.surfaces[0]
    found = (surface.color, surface.transmission, surface.coverage)
    return *(values.astype(np.float64) for values in found), warnings
