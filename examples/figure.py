# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Someone beside plants, who tells how large these are."""

from __future__ import annotations

from itertools import pairwise

import bpy
from mathutils import Vector

from . import stage

HEIGHT = 1.7
#: Joints of the figure, in its heights: x, y, z and radius, of the spine, and of a leg and an arm; and what it wears.
_SPINE = (
    (0.0, 0.0, 0.53, 0.085),
    (0.0, -0.005, 0.64, 0.072),
    (0.0, 0.0, 0.79, 0.088),
    (0.0, 0.0, 0.875, 0.03),
)
_LIMBS = (
    ((0.052, 0.0, 0.53, 0.058), (0.056, 0.0, 0.29, 0.042), (0.058, 0.008, 0.045, 0.026), (0.066, -0.07, 0.015, 0.02)),
    ((0.10, 0.0, 0.815, 0.04), (0.135, 0.012, 0.66, 0.03), (0.145, -0.03, 0.53, 0.022), (0.145, -0.05, 0.51, 0.018)),
)
#: Middle and half axes of the head.
_HEAD = (0.0, -0.008, 0.928), (0.046, 0.056, 0.072)
#: Colors from a fraction of the height on, of the body and of the head.
_CLOTHES = (
    (0.0, (0.03, 0.025, 0.02)),
    (0.05, (0.05, 0.06, 0.10)),
    (0.54, (0.30, 0.05, 0.035)),
    (0.93, (0.45, 0.26, 0.18)),
)
_FACE = (0.0, (0.45, 0.26, 0.18)), (0.62, (0.07, 0.04, 0.02))


def add_figure(scene: bpy.types.Scene, place: stage.Place) -> bpy.types.Object:
    """Someone of 1.70 m who stands at a place (3,) and looks along −y, as a skeleton with a skin."""
    points, edges = list(_SPINE), [(i, i + 1) for i in range(len(_SPINE) - 1)]
    for side in (-1.0, 1.0):
        for row, joint in zip(_LIMBS, (0, 2), strict=True):
            numbers = range(len(points), len(points) + len(row))
            points += [(side * x, y, z, r) for x, y, z, r in row]
            edges += [(joint, numbers[0]), *pairwise(numbers)]
    mesh = bpy.data.meshes.new("Figure")
    mesh.from_pydata([tuple(HEIGHT * c for c in p[:3]) for p in points], edges, [])
    figure = bpy.data.objects.new("Figure", mesh)
    skin = figure.modifiers.new("Skin", 'SKIN')
    skin.branch_smoothing = 0.6
    for vertex, point in zip(mesh.skin_vertices[0].data, points, strict=True):
        vertex.radius = (HEIGHT * point[3],) * 2
    mesh.skin_vertices[0].data[0].use_root = True
    figure.modifiers.new("Smooth", 'SUBSURF').render_levels = 2
    figure.location = place
    scene.collection.objects.link(figure)
    mesh.materials.append(_bands("Clothes", _CLOTHES))
    bpy.ops.mesh.primitive_uv_sphere_add()
    head = bpy.context.object
    head.location, head.scale, head.parent = Vector(_HEAD[0]) * HEIGHT, Vector(_HEAD[1]) * HEIGHT, figure
    head.data.shade_smooth()
    head.data.materials.append(_bands("Face", _FACE))
    return figure


def _bands(name: str, stops: tuple[tuple[float, tuple[float, float, float]], ...]) -> bpy.types.Material:
    """Colors by the height in the object, without steps between."""
    material = bpy.data.materials.new(name)
    nodes, links = stage.cleared(material)
    new, link = nodes.new, links.new
    place, split, ramp = new("ShaderNodeTexCoord"), new("ShaderNodeSeparateXYZ"), new("ShaderNodeValToRGB")
    ramp.color_ramp.interpolation = 'CONSTANT'
    elements = ramp.color_ramp.elements
    elements.remove(elements[1])
    for position, color in stops:
        (elements.new(position) if position else elements[0]).color = (*color, 1.0)
    surface, output = new("ShaderNodeBsdfDiffuse"), new("ShaderNodeOutputMaterial")
    link(place.outputs["Generated"], split.inputs[0])
    link(split.outputs["Z"], ramp.inputs[0])
    link(ramp.outputs["Color"], surface.inputs["Color"])
    link(surface.outputs[0], output.inputs["Surface"])
    return material
