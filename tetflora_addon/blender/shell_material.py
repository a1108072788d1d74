# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shell material: a proxy tetrahedron drawn as a cloud of microspheres and planes (paper, section 7)."""

from __future__ import annotations

from typing import Any

import bpy

from .compat import disable_bump_correction, shader_tree
from .node_tools import Graph, add_socket, find_socket, get_or_create, new_group

SHELL = "TetFlora Shell"
SHELL_MATERIAL = "TetFlora shell"

_GROUP_VERSION = 1
_MATERIAL_VERSION = 1

# Longer than any cell, for faces that the ray runs away from, metres.
_NEVER = 1e9
# A slope under which the ray runs along a face, 1/m.
_ALONG = 1e-9


def shell_group() -> bpy.types.NodeTree:
    """The group "TetFlora Shell": everything between the attributes of ``shell_buffers`` and a shader."""

    def build(tree: bpy.types.NodeTree) -> None:
        unit = (0.0, 1.0)
        add_socket(tree, "p", "NodeSocketFloat", 1.0, unit, "Diffuse share of the particle and plane terms")
        add_socket(tree, "s", "NodeSocketFloat", 0.04, unit, "Specular share of the plane term")
        add_socket(tree, "spear", "NodeSocketFloat", 7.5, (0.0, 1000.0), "Exponent of the plane term's highlight")
        add_socket(tree, "Through Tint", "NodeSocketColor", (1.15, 1.1, 0.55, 1.0), None, "Colour of transmitted light")
        add_socket(tree, "Stochastic", "NodeSocketFloat", 1.0, unit, "1: each sample sees all or nothing, far faster")
        for name in ("Cycles", "EEVEE"):
            tree.interface.new_socket(name=name, in_out='OUTPUT', socket_type="NodeSocketShader")
        graph = Graph(tree)
        given = graph.node("NodeGroupInput").outputs
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        incoming = geometry["Incoming"]
        transmittance = _transmittance(graph, incoming)
        alpha = _alpha(graph, transmittance, geometry, given["Stochastic"])
        full, simple = _scattering(graph, incoming, given)
        clear = graph.node("ShaderNodeBsdfTransparent")
        shaders = {"Cycles": graph.mix(alpha, clear, full), "EEVEE": graph.mix(alpha, clear, simple)}
        graph.node("NodeGroupOutput", shaders)
        graph.arrange()

    return get_or_create(bpy.data.node_groups, SHELL, _GROUP_VERSION, new_group, build)


def shell_material() -> bpy.types.Material:
    """Material "TetFlora shell" of the mesh that ``shading.shells.shell_buffers`` describes, for Cycles and EEVEE.

    A ray meets two faces a cell: the scene's ``cycles.transparent_max_bounces`` has to allow for that.
    """

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        shell = graph.node("ShaderNodeGroup", node_tree=shell_group())
        for engine, name in (('CYCLES', "Cycles"), ('EEVEE', "EEVEE")):
            surface = find_socket(shell.outputs, name)
            graph.node("ShaderNodeOutputMaterial", {"Surface": surface}, target=engine)
        graph.arrange()
        disable_bump_correction(material)
        material.diffuse_color = (0.1, 0.25, 0.05, 1.0)

    return get_or_create(bpy.data.materials, SHELL_MATERIAL, _MATERIAL_VERSION, bpy.data.materials.new, build)


def _transmittance(graph: Graph, incoming: Any) -> bpy.types.NodeSocket:
    """T = e^{−κℓ} of the ray through the cell (paper, section 7, with constant density).

    Along ω = −incoming a barycentric coordinate falls by ∇λ·incoming a metre; the ray leaves where the first reaches
    zero. The coordinate of the entry face itself rises and never counts.
    """
    inside = graph.node("ShaderNodeSeparateXYZ", {"Vector": graph.attribute("tf_bary", "Vector")}).outputs
    levels = list(inside)
    slopes = [graph.vector('DOT_PRODUCT', graph.attribute(f"tf_g{k}", "Vector"), incoming) for k in (1, 2, 3)]
    others = graph.math('ADD', graph.math('ADD', levels[0], levels[1]), levels[2])
    levels.append(graph.math('SUBTRACT', 1.0, others))
    steepness = graph.math('ADD', graph.math('ADD', slopes[0], slopes[1]), slopes[2])
    slopes.append(graph.math('MULTIPLY', steepness, -1.0))
    exits = []
    for level, slope in zip(levels, slopes, strict=True):
        distance = graph.math('DIVIDE', graph.math('MAXIMUM', level, 0.0), graph.math('MAXIMUM', slope, _ALONG))
        away = graph.math('LESS_THAN', slope, _ALONG)
        exits.append(graph.math('MULTIPLY_ADD', away, _NEVER, distance))
    nearest = graph.math('MINIMUM', graph.math('MINIMUM', *exits[:2]), graph.math('MINIMUM', *exits[2:]))
    # A flat cell has no gradients and thus no exit; it has no extinction either, and 0 times much is 0.
    depth = graph.math('MULTIPLY', nearest, _extinction(graph, incoming))
    return graph.math('EXPONENT', graph.math('MULTIPLY', depth, -1.0))


def _extinction(graph: Graph, incoming: Any) -> bpy.types.NodeSocket:
    """κ(ω) = √(ωᵀSω), 1/m (SGGX; Heitz et al. 2015)."""
    direction = graph.node("ShaderNodeSeparateXYZ", {"Vector": incoming}).outputs
    squares = graph.vector('MULTIPLY', incoming, incoming)
    products = graph.node(
        "ShaderNodeCombineXYZ",
        {
            "X": graph.math('MULTIPLY', direction["X"], direction["Y"]),
            "Y": graph.math('MULTIPLY', direction["X"], direction["Z"]),
            "Z": graph.math('MULTIPLY', direction["Y"], direction["Z"]),
        },
    )
    diagonal = graph.vector('DOT_PRODUCT', graph.attribute("tf_s0", "Vector"), squares)
    mixed = graph.vector('DOT_PRODUCT', graph.attribute("tf_s1", "Vector"), products)
    square = graph.math('MULTIPLY_ADD', mixed, 2.0, diagonal)
    return graph.math('SQRT', graph.math('MAXIMUM', square, 0.0))


def _alpha(graph: Graph, transmittance: Any, geometry: Any, stochastic: Any) -> bpy.types.NodeSocket:
    """Opacity of the entry face, 0 on the exit face.

    Opacity between 0 and 1 makes Cycles trace shadows through the whole stack at every hit. A decision by white noise
    of the position that was hit has the same mean, since no two samples hit the same point, and costs a twelfth.
    """
    opacity = graph.math('SUBTRACT', 1.0, transmittance)
    noise = graph.node("ShaderNodeTexWhiteNoise", {"Vector": geometry["Position"]}, noise_dimensions='3D')
    decision = graph.math('LESS_THAN', find_socket(noise.outputs, "Value"), opacity)
    # This form of the mean is exactly 0 or 1 where stochastic is 1.
    smooth = graph.math('MULTIPLY', opacity, graph.math('SUBTRACT', 1.0, stochastic))
    either = graph.math('MULTIPLY_ADD', decision, stochastic, smooth)
    entered = graph.math('SUBTRACT', 1.0, geometry["Backfacing"])
    return graph.math('MULTIPLY', either, entered)


def _scattering(graph: Graph, incoming: Any, given: Any) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
    """The paper's blend of p cos φ (particles) and p cos α + s cos^spear β (planes), section 7; for Cycles and EEVEE.

    Particles scatter as if each turned to the viewer; leaves let some of the light from behind through as well.
    Measured on a crown of leaves, Diffuse towards the viewer comes closer in Cycles (masked FLIP .08) than Translucent
    away from the viewer (.14), of which the sky reaches a fifth. In EEVEE the shells' own shadow maps darken what is
    lit from behind, and p cos φ alone comes closest (.08 against .20).
    """
    transmission = graph.attribute("tf_transmission", "Fac")
    colour = graph.scaled(graph.attribute("tf_colour", "Color"), given["p"])
    through = graph.tinted(colour, given["Through Tint"])

    def sheet(normal: Any) -> bpy.types.NodeSocket:
        reflected = graph.node("ShaderNodeBsdfDiffuse", {"Color": colour, "Normal": normal})
        transmitted = graph.node("ShaderNodeBsdfTranslucent", {"Color": through, "Normal": normal})
        return graph.mix(transmission, reflected, transmitted)

    axis = graph.attribute("tf_normal", "Vector")
    away = graph.math('LESS_THAN', graph.vector('DOT_PRODUCT', axis, incoming), 0.0)
    side = graph.math('MULTIPLY_ADD', away, -2.0, 1.0)
    normal = graph.vector('SCALE', axis, side)
    # Phong's exponent as the width of a microfacet distribution: α = √(1 / (2 spear + 1)), roughness = √α.
    width = graph.math('DIVIDE', 1.0, graph.math('MULTIPLY_ADD', given["spear"], 2.0, 1.0))
    roughness = graph.math('POWER', width, 0.25)
    highlight = graph.node(
        "ShaderNodeBsdfAnisotropic", {"Color": (1.0, 1.0, 1.0, 1.0), "Roughness": roughness, "Normal": normal}
    )
    planes = graph.mix(given["s"], sheet(normal), highlight)
    full = graph.mix(graph.attribute("tf_plane", "Fac"), sheet(incoming), planes)
    simple = graph.node("ShaderNodeBsdfDiffuse", {"Color": colour, "Normal": incoming})
    return full, simple.outputs[0]
