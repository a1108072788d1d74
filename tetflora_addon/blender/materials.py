# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of leaves, bark and microsurfaces: one scattering group for all, so that they match at a distance."""

from __future__ import annotations

import bpy

from .compat import shader_tree
from .node_tools import Graph, add_socket, find_socket, get_or_create, new_group
from .shell_material import shell_material

__all__ = ["bark_material", "leaf_material", "proxy_material", "scatter_group", "shell_material"]

SCATTER = "TetFlora Scatter"
PROXY = "TetFlora proxy"

# Raise these when what they count changes: existing files then get the new nodes beside the old ones.
_SCATTER_VERSION = 1
_LEAF_VERSION = 1
_BARK_VERSION = 1
_PROXY_VERSION = 1

# Light that has passed through a leaf lost more of its blue than light that was reflected: chlorophyll and carotenoids
# absorb on the whole way. Products over 1 are cut off.
THROUGH_TINT = (1.15, 1.1, 0.55, 1.0)
# Share of the waxy surface's own, colourless reflection (4 % at a refractive index of 1.5), and its roughness.
GLOSS, GLOSS_ROUGHNESS = 0.04, 0.5
WHITE = (1.0, 1.0, 1.0, 1.0)


def scatter_group() -> bpy.types.NodeTree:
    """The group "TetFlora Scatter": a thin sheet that reflects and transmits, lit from both sides.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Transmission, Through Tint, Gloss, Gloss Roughness, Normal; output Shader. Of the light that
        arrives, (1 − Gloss) · Colour is scattered, evenly over the side of the light or, for the share Transmission and
        times the tint, over the other side; Gloss is mirrored. No more comes out than went in.
    """

    def build(tree: bpy.types.NodeTree) -> None:
        unit = (0.0, 1.0)
        add_socket(tree, "Colour", "NodeSocketColor", (0.1, 0.25, 0.05, 1.0))
        add_socket(tree, "Transmission", "NodeSocketFloat", 0.0, unit, "Share of the scattered light passing through")
        add_socket(tree, "Through Tint", "NodeSocketColor", THROUGH_TINT, None, "Multiplies the colour of that light")
        add_socket(tree, "Gloss", "NodeSocketFloat", GLOSS, unit, "Share of the light that the surface mirrors")
        add_socket(tree, "Gloss Roughness", "NodeSocketFloat", GLOSS_ROUGHNESS, unit)
        add_socket(tree, "Normal", "NodeSocketVector", None, None, "Always link it, if only to Geometry")
        tree.interface.new_socket(name="Shader", in_out='OUTPUT', socket_type="NodeSocketShader")
        graph = Graph(tree)
        given = graph.node("NodeGroupInput").outputs
        colour, normal = given["Colour"], given["Normal"]
        reflected = graph.node("ShaderNodeBsdfDiffuse", {"Color": colour, "Normal": normal})
        through = graph.tinted(colour, given["Through Tint"])
        transmitted = graph.node("ShaderNodeBsdfTranslucent", {"Color": through, "Normal": normal})
        sheet = graph.mix(given["Transmission"], reflected, transmitted)
        roughness = given["Gloss Roughness"]
        gloss = graph.node("ShaderNodeBsdfAnisotropic", {"Color": WHITE, "Roughness": roughness, "Normal": normal})
        result = graph.mix(given["Gloss"], sheet, gloss)
        graph.node("NodeGroupOutput", {"Shader": result})
        graph.arrange()

    return get_or_create(bpy.data.node_groups, SCATTER, _SCATTER_VERSION, new_group, build)


def leaf_material(species_name: str) -> bpy.types.Material:
    """Material "TetFlora <species> leaf": reads ``tf_colour`` and ``tf_transmission`` of each face.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it; each species has a material of its own to edit.
    """

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        colour, transmission = graph.attribute("tf_colour", "Color"), graph.attribute("tf_transmission", "Fac")
        _finish(graph, {"Colour": colour, "Transmission": transmission, "Normal": geometry["Normal"]})
        material.diffuse_color = (0.1, 0.25, 0.05, 1.0)

    return get_or_create(
        bpy.data.materials, f"TetFlora {species_name} leaf", _LEAF_VERSION, bpy.data.materials.new, build
    )


def bark_material(species_name: str) -> bpy.types.Material:
    """Material "TetFlora <species> bark": ``tf_colour`` with upright ridges that show when the camera is close.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it.

    Notes
    -----
    The noise varies the colour around its mean, so that bark and its microsurfaces agree from afar. One noise serves
    colour and bump.
    """

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        # Stretched five times along the vertical, the way most wood grows: ridges of about 5 cm by 25 cm.
        stretched = graph.vector('MULTIPLY', geometry["Position"], (1.0, 1.0, 0.2))
        noise = graph.node("ShaderNodeTexNoise", {"Vector": stretched, "Scale": 20.0, "Detail": 3.0, "Roughness": 0.7})
        height = find_socket(noise.outputs, "Fac")
        # Noise lies around .5; the factor around 1.
        factor = graph.math('MULTIPLY_ADD', height, 2.4, -0.2)
        colour = graph.scaled(graph.attribute("tf_colour", "Color"), factor)
        bump = graph.node("ShaderNodeBump", {"Strength": 1.0, "Distance": 0.03, "Height": height})
        _finish(graph, {"Colour": colour, "Transmission": 0.0, "Gloss": 0.0, "Normal": bump})
        material.diffuse_color = (0.18, 0.12, 0.08, 1.0)

    return get_or_create(
        bpy.data.materials, f"TetFlora {species_name} bark", _BARK_VERSION, bpy.data.materials.new, build
    )


def proxy_material() -> bpy.types.Material:
    """Material "TetFlora proxy" of all microsurfaces: as a leaf where ``tf_transmission`` is above 0, else as bark."""

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        colour, transmission = graph.attribute("tf_colour", "Color"), graph.attribute("tf_transmission", "Fac")
        gloss = graph.math('MULTIPLY', graph.math('GREATER_THAN', transmission, 0.0), GLOSS)
        inputs = {"Colour": colour, "Transmission": transmission, "Gloss": gloss, "Normal": geometry["Normal"]}
        _finish(graph, inputs)
        material.diffuse_color = (0.1, 0.25, 0.05, 1.0)

    return get_or_create(bpy.data.materials, PROXY, _PROXY_VERSION, bpy.data.materials.new, build)


def _finish(graph: Graph, inputs: dict) -> None:
    """Feed the scatter group and lead it to the output."""
    scatter = graph.node("ShaderNodeGroup", node_tree=scatter_group())
    for key, value in inputs.items():
        graph.feed(find_socket(scatter.inputs, key), value)
    # EEVEE otherwise takes the whole mesh's extent for the thickness of each leaf.
    thin = graph.node("ShaderNodeValue")
    thin.outputs[0].default_value = 0.0
    graph.node("ShaderNodeOutputMaterial", {"Surface": scatter, "Thickness": thin})
    graph.arrange()
