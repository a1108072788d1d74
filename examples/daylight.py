# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A clear day: what lights the scenes of examples and benchmarks."""

from __future__ import annotations

import math

import bpy


def add_daylight(scene: bpy.types.Scene, elevation: float, azimuth: float) -> None:
    """Sun, and a sky that is blue above and pale at the horizon; angles in degrees; light goes to the azimuth."""
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.data.energy, sun.data.angle, sun.data.color = 5.0, math.radians(0.6), (1.0, 0.94, 0.85)
    sun.rotation_euler = (math.radians(90 - elevation), 0, math.radians(-azimuth))
    scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    if not world.node_tree:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    place = nodes.new("ShaderNodeTexCoord")
    split = nodes.new("ShaderNodeSeparateXYZ")
    ramp = nodes.new("ShaderNodeValToRGB")
    stops = ramp.color_ramp.elements
    stops[0].position, stops[0].color = 0.0, (0.62, 0.76, 0.92, 1)
    stops[1].position, stops[1].color = 0.5, (0.08, 0.24, 0.70, 1)
    links.new(place.outputs["Generated"], split.inputs[0])
    links.new(split.outputs["Z"], ramp.inputs[0])
    background = next(n for n in nodes if n.type == 'BACKGROUND')
    background.inputs["Strength"].default_value = 0.55
    links.new(ramp.outputs["Color"], background.inputs["Color"])
