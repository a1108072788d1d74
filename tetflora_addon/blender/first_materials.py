# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground and sky of the first forest; plain node trees that an artist can read and change."""

from __future__ import annotations

import bpy

from .compat import shader_tree


def meadow(name: str) -> bpy.types.Material:
    """Moss and litter by noise, and trodden earth where the attribute ``aside`` (metres from the path) is small."""
    material = bpy.data.materials.new(name)
    tree = shader_tree(material)
    tree.nodes.clear()
    new, link = tree.nodes.new, tree.links.new
    place = new("ShaderNodeTexCoord")
    patches = _ramp(tree, place, 0.35, 6.0, ((0.38, (0.055, 0.085, 0.02)), (0.62, (0.16, 0.13, 0.055))))
    grain = _ramp(tree, place, 5.0, 8.0, ((0.3, (0.35, 0.35, 0.35)), (0.7, (1.5, 1.4, 1.3))))
    floor = _mixed(tree, 'MULTIPLY', 1.0, patches, grain)
    earth = _ramp(tree, place, 9.0, 6.0, ((0.35, (0.11, 0.08, 0.05)), (0.65, (0.26, 0.2, 0.13))))
    aside = new("ShaderNodeAttribute")
    aside.attribute_name = "aside"
    edge = new("ShaderNodeTexNoise")
    edge.inputs["Scale"].default_value, edge.inputs["Detail"].default_value = 1.2, 5.0
    link(place.outputs["Object"], edge.inputs["Vector"])
    ragged = new("ShaderNodeMath")
    ragged.operation = 'MULTIPLY_ADD'
    ragged.inputs[1].default_value = 1.8
    link(edge.outputs[0], ragged.inputs[0])
    link(aside.outputs["Fac"], ragged.inputs[2])
    share = new("ShaderNodeMapRange")
    share.interpolation_type = 'SMOOTHSTEP'
    for socket, value in (("From Min", 1.3), ("From Max", 2.6), ("To Min", 0.0), ("To Max", 1.0)):
        share.inputs[socket].default_value = value
    link(ragged.outputs[0], share.inputs["Value"])
    colour = _mixed(tree, 'MIX', share.outputs[0], earth, floor)
    bump = new("ShaderNodeBump")
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.6, 0.05
    link(grain, bump.inputs["Height"])
    surface = new("ShaderNodeBsdfDiffuse")
    link(colour, surface.inputs["Color"])
    link(bump.outputs["Normal"], surface.inputs["Normal"])
    output = new("ShaderNodeOutputMaterial")
    link(surface.outputs[0], output.inputs["Surface"])
    return material


def sky(name: str) -> bpy.types.World:
    """Blue above, pale at the horizon."""
    world = bpy.data.worlds.new(name)
    tree = shader_tree(world)
    tree.nodes.clear()
    new, link = tree.nodes.new, tree.links.new
    place, split, ramp = (new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "ValToRGB"))
    _set_stops(ramp, ((0.0, (0.75, 0.84, 0.93)), (0.45, (0.12, 0.3, 0.75))))
    link(place.outputs["Generated"], split.inputs[0])
    link(split.outputs["Z"], ramp.inputs[0])
    background, output = new("ShaderNodeBackground"), new("ShaderNodeOutputWorld")
    background.inputs["Strength"].default_value = 0.7
    link(ramp.outputs["Color"], background.inputs["Color"])
    link(background.outputs[0], output.inputs["Surface"])
    return world


Stops = tuple[tuple[float, tuple[float, float, float]], ...]


def _set_stops(ramp: bpy.types.ShaderNode, stops: Stops) -> None:
    for element, (position, colour) in zip(ramp.color_ramp.elements, stops, strict=True):
        element.position, element.color = position, (*colour, 1.0)


def _ramp(
    tree: bpy.types.NodeTree, place: bpy.types.ShaderNode, scale: float, detail: float, stops: Stops
) -> bpy.types.NodeSocket:
    """Colours by noise over the object's coordinates."""
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, detail
    tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    _set_stops(ramp, stops)
    return ramp.outputs["Color"]


def _mixed(
    tree: bpy.types.NodeTree,
    blend: str,
    factor: float | bpy.types.NodeSocket,
    a: bpy.types.NodeSocket,
    b: bpy.types.NodeSocket,
) -> bpy.types.NodeSocket:
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = 'RGBA', blend
    # A mix node has sockets of each name for each type of data; those of colours are found by their type.
    colours = [s for s in mix.inputs if s.type == 'RGBA']
    share = next(s for s in mix.inputs if s.type == 'VALUE' and s.name == "Factor")
    if isinstance(factor, float):
        share.default_value = factor
    else:
        tree.links.new(factor, share)
    tree.links.new(a, colours[0])
    tree.links.new(b, colours[1])
    return next(s for s in mix.outputs if s.type == 'RGBA')
