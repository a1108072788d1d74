# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The material of baked light: the camera sees precomputed emission, free of noise.

For all other rays it is the proxies' own material, so that ground and meshes get the light and the shadows of plants as
ever. Nothing that it emits lights anything.
"""

from __future__ import annotations

from typing import Any

import bpy

from ..baked_emission import BACK, FRONT
from ..shading.light_scattering import GLOSS
from .compat import shader_tree
from .microsphere_material import scatter_group
from .node_tools import Graph, find_socket, get_or_create

BAKED = "TetFlora baked"

# Raise this when what it counts changes: existing files then get the new nodes beside the old ones.
_VERSION = 1


def baked_material() -> bpy.types.Material:
    """Material "TetFlora baked": `FRONT` and `BACK` to the camera, to all else as the material of proxies.

    Both are FLOAT_VECTOR attributes on FACE or on POINT, of meshes or point clouds: linear radiance as a pixel shows
    it. What has no front and back carries the same in both, see `baked_emission.baked_attributes`.

    Notes
    -----
    Rays are distinguished by Light Path: Is Camera Ray. EEVEE has only camera rays and shadows; its light probes and
    reflections see the emission. Cycles must not sample the faces as lights, which they are not.
    """

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        side = graph.node(
            "ShaderNodeMix",
            {
                "Factor_Float": geometry["Backfacing"],
                "A_Color": graph.attribute(FRONT, "Color"),
                "B_Color": graph.attribute(BACK, "Color"),
            },
            data_type='RGBA',
        )
        seen = graph.node("ShaderNodeEmission", {"Color": find_socket(side.outputs, "Result_Color")})
        graph.feed(find_socket(seen.inputs, "Strength"), 1.0)
        camera = graph.node("ShaderNodeLightPath").outputs["Is Camera Ray"]
        surface = graph.mix(camera, _scattering(graph, geometry["Normal"]), seen)
        thin = graph.node("ShaderNodeValue")
        thin.outputs[0].default_value = 0.0
        graph.node("ShaderNodeOutputMaterial", {"Surface": surface, "Thickness": thin})
        graph.arrange()
        without_light_sampling(material)
        material.diffuse_color = (0.1, 0.25, 0.05, 1.0)

    return get_or_create(bpy.data.materials, BAKED, _VERSION, bpy.data.materials.new, build)


def _scattering(graph: Graph, normal: Any) -> bpy.types.Node:
    """What the material of proxies does with ``tf_colour`` and ``tf_transmission``."""
    colour, transmission = graph.attribute("tf_colour", "Color"), graph.attribute("tf_transmission", "Fac")
    gloss = graph.math('MULTIPLY', graph.math('GREATER_THAN', transmission, 0.0), GLOSS)
    scatter = graph.node("ShaderNodeGroup", node_tree=scatter_group())
    for key, value in {"Colour": colour, "Transmission": transmission, "Gloss": gloss, "Normal": normal}.items():
        graph.feed(find_socket(scatter.inputs, key), value)
    return scatter


def without_light_sampling(material: bpy.types.Material) -> None:
    """Keep Cycles from sampling an emitting material as a light; the setting is there only while Cycles is enabled."""
    cycles = getattr(material, "cycles", None)
    if cycles is not None and hasattr(cycles, "emission_sampling"):
        cycles.emission_sampling = 'NONE'
