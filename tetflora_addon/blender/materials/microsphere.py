# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that scatter light: the paper's cloud of microspheres and planes (section 7), and a thin sheet.

The cloud has no thickness: whoever uses the group decides what is transparent. It returns exactly as much light as it
takes from uniform surroundings, whatever the renderer samples: lamps, a constant world, an image of the sky, surfaces.
"""

from __future__ import annotations

from typing import Any

import bpy

from ...light import scattering
from ...light.scattering import GLOSS, GLOSS_ROUGHNESS
from ..compat import loses_summed_lobes
from .nodes import LEAF_GREEN, Graph, find_socket, shader_group

MICROSPHERE = "TetFlora Microsphere"
SCATTER = "TetFlora Scatter"

#: Where sums of lobes lose light, the nodes are others.
_VERSION = 1 + loses_summed_lobes()
_SCATTER_VERSION = 2

WHITE = (1.0, 1.0, 1.0, 1.0)
UNIT = (0.0, 1.0)
#: The engine's, as a colour of a socket.
THROUGH_TINT = (*scattering.THROUGH_TINT.tolist(), 1.0)
#: Inputs of the cloud that the shell's group has as well.
LOBE_INPUTS = (
    ("p", 'Float', 1.0, UNIT, "Diffuse weight of the particle and plane terms"),
    ("s", 'Float', 0.04, UNIT, "Specular weight of the plane term"),
    ("spear", 'Float', 7.5, (0.0, 1000.0), "Exponent of the plane term's highlight"),
    ("Through Tint", 'Color', THROUGH_TINT, None, "Multiplies the color of passing light"),
)
#: Outputs of groups whose shader differs between the engines.
ENGINES = ("Cycles", 'Shader'), ("EEVEE", 'Shader')

# Cosines between the highlight's direction and the face: under the first there is no highlight, over the second all.
_GLANCING, _CLEAR = 0.0, 0.35


def microsphere_group() -> bpy.types.NodeTree:
    """The group "TetFlora Microsphere": scattering of a cloud, seen at any surface that stands for it.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Transmission, Normal, Plane, p, s, spear, Through Tint, Roundness, Facing; outputs Cycles and
        EEVEE, one for each engine's material output. Link EEVEE's Thickness to a Value of 0: otherwise EEVEE takes the
        object's extent for it, and half of what is transmitted is lost.

    Notes
    -----
    Particles scatter p cos φ, planes p cos α + s cos^spear β, blended by Plane (paper, section 7; φ is the angle
    between light and viewer, α that between light and plane, β that between viewer and reflection). Of what is
    scattered the fraction Transmission leaves on the other side. Cycles cuts each lobe off at the face's own horizon;
    of a cosine lobe around m the fraction (1 − |m·n|) / 2 lies beyond it, n being the face's normal. That fraction goes
    to an even lobe on the face's far side, so nothing is lost and nothing counts twice. EEVEE has no such horizon.
    Where Cycles loses light of lobes around several normals, each sample has one normal by chance.
    """
    about = "0: particles face the viewer, as in the paper; 1: particles are round from all sides"
    facing = "Normal of particles with their own surface; at zero, particles face the viewer"
    inputs = (
        ("Colour", 'Color', LEAF_GREEN, None, "Mean color of the contents"),
        ("Transmission", 'Float', 0.0, UNIT, "Fraction of scattered light that passes"),
        ("Normal", 'Vector', (0.0, 0.0, 1.0), None, "Axis of the planes, of either sign"),
        ("Plane", 'Float', 0.0, UNIT, "Weight of the plane term; the rest are particles"),
        *LOBE_INPUTS,
        ("Roundness", 'Float', 1.0, UNIT, about),
        ("Facing", 'Vector', (0.0, 0.0, 0.0), None, facing),
    )
    return shader_group(MICROSPHERE, _VERSION, inputs, ENGINES, _shaders)


def _shaders(graph: Graph, given: Any) -> dict[str, bpy.types.NodeSocket]:
    """Both engines' shaders from the same lobes."""
    geometry = graph.node("ShaderNodeNewGeometry").outputs
    incoming, face = geometry["Incoming"], geometry["True Normal"]
    back = graph.scaled(given["Colour"], given["p"])
    transmission = given["Transmission"]
    through = graph.vector('SCALE', graph.tinted(back, given["Through Tint"]), transmission)
    back = graph.vector('SCALE', back, graph.math('SUBTRACT', 1.0, transmission))

    particle = particle_normal(graph, given, geometry)
    axis = graph.vector('NORMALIZE', given["Normal"])
    plane = graph.vector('SCALE', axis, _sign(graph, axis, incoming))
    width = _highlight_width(graph, given)
    gloss, kept = _gloss_weight(graph, given, (plane, incoming, face), width)
    weights = {
        'particle': graph.math('SUBTRACT', 1.0, given["Plane"]),
        'plane': graph.math('SUBTRACT', given["Plane"], kept),
    }
    full, simple, lobes = [], [], []
    beyond: dict[str, list] = {'near': [], 'far': []}
    for name, normal in (('particle', particle), ('plane', plane)):
        reflected, transmitted = (graph.vector('SCALE', colour, weights[name]) for colour in (back, through))
        simple += _sheet(graph, reflected, transmitted, normal)
        # Towards the face's own side; where that turns the plane away from the viewer, both sides change places.
        facing = graph.vector('DOT_PRODUCT', normal, face)
        turned = graph.math('LESS_THAN', facing, 0.0)
        normal = graph.vector('SCALE', normal, graph.math('MULTIPLY_ADD', turned, -2.0, 1.0))
        near, far = _swapped(graph, reflected, transmitted, turned)
        full += _sheet(graph, near, far, normal)
        lost = graph.math('MULTIPLY_ADD', graph.math('ABSOLUTE', facing), -0.5, 0.5)
        beyond['near'].append(graph.vector('SCALE', far, lost))
        beyond['far'].append(graph.vector('SCALE', near, lost))
        lobes.append((near, far, normal, lost))
    highlight = _highlight(graph, plane, gloss, width)
    if loses_summed_lobes():
        sheet, share = _one_of(graph, lobes, given["Plane"])
        seen = _highlight(graph, plane, graph.math('MULTIPLY', gloss, share), width)
        return {"Cycles": _sum(graph, [*sheet, seen]), "EEVEE": _sum(graph, [*simple, highlight])}
    full += _sheet(graph, *(graph.vector('ADD', *beyond[side]) for side in ('near', 'far')), face)
    return {"Cycles": _sum(graph, [*full, highlight]), "EEVEE": _sum(graph, [*simple, highlight])}


def _one_of(graph: Graph, lobes: list[tuple], planes: Any) -> tuple[list[bpy.types.Node], Any]:
    """A sheet around one normal: particle or plane by chance, divided by its probability; and the highlight's factor.

    What the horizon cuts off of one lobe of a normal is added to the other, with which it has no direction in common.
    """
    where = graph.node("ShaderNodeNewGeometry").outputs["Position"]
    noise = graph.node("ShaderNodeTexWhiteNoise", {"Vector": where, "W": 2.0}, noise_dimensions='4D')
    flat = graph.math('LESS_THAN', find_socket(noise.outputs, "Value"), planes)
    near, far, normal, lost = (_chosen(graph, *pair, flat) for pair in zip(*lobes, strict=True))
    chance = graph.math('ABSOLUTE', graph.math('SUBTRACT', graph.math('SUBTRACT', 1.0, flat), planes))
    # Never chosen where it is 0 but for rounding.
    share = graph.math('DIVIDE', 1.0, graph.math('MAXIMUM', chance, 1e-6))
    added = graph.math('DIVIDE', lost, graph.math('SUBTRACT', 1.0, lost))
    both = [
        graph.vector('SCALE', graph.vector('ADD', own, graph.vector('SCALE', other, added)), share)
        for own, other in ((near, far), (far, near))
    ]
    return _sheet(graph, *both, normal), graph.math('MULTIPLY', share, flat)


def _chosen(graph: Graph, first: Any, second: Any, which: Any) -> bpy.types.NodeSocket:
    """The first of two vectors where `which` is 0, the second where it is 1."""
    return graph.vector('ADD', first, graph.vector('SCALE', graph.vector('SUBTRACT', second, first), which))


def particle_normal(graph: Graph, given: Any, geometry: Any) -> bpy.types.NodeSocket:
    """Normal m of the particle that was hit.

    The points of a sphere that a viewer sees have normals with density cos / π around him: those of I + q, with q
    anywhere on a sphere of radius 1 (Roundness times that, to leave some of them turned to the viewer).
    """
    noise = graph.node("ShaderNodeTexWhiteNoise", {"Vector": geometry["Position"], "W": 1.0}, noise_dimensions='4D')
    random = graph.node("ShaderNodeSeparateXYZ", {"Vector": noise.outputs["Color"]}).outputs
    height = graph.math('MULTIPLY_ADD', random[0], 2.0, -1.0)
    radius = graph.math(
        'SQRT',
        graph.math('MAXIMUM', graph.math('MULTIPLY_ADD', height, graph.math('MULTIPLY', height, -1.0), 1.0), 0.0),
    )
    turn = graph.math('MULTIPLY', random[1], 6.283185307179586)
    around = graph.node(
        "ShaderNodeCombineXYZ",
        {
            "X": graph.math('MULTIPLY', radius, graph.math('COSINE', turn)),
            "Y": graph.math('MULTIPLY', radius, graph.math('SINE', turn)),
            "Z": height,
        },
    )
    # A little less than 1, so that the sum is never zero.
    reach = graph.math('MULTIPLY', given["Roundness"], 0.999)
    seen = graph.vector('ADD', geometry["Incoming"], graph.vector('SCALE', around, reach))
    unset = graph.math('LESS_THAN', graph.vector('LENGTH', given["Facing"]), 0.5)
    seen = graph.vector('SCALE', seen, unset)
    own = graph.vector('SCALE', given["Facing"], graph.math('SUBTRACT', 1.0, unset))
    return graph.vector('NORMALIZE', graph.vector('ADD', seen, own))


def _sign(graph: Graph, first: Any, second: Any) -> bpy.types.NodeSocket:
    """1 where two vectors lie on one side, else −1."""
    away = graph.math('LESS_THAN', graph.vector('DOT_PRODUCT', first, second), 0.0)
    return graph.math('MULTIPLY_ADD', away, -2.0, 1.0)


def _swapped(graph: Graph, first: Any, second: Any, turned: Any) -> tuple[Any, Any]:
    """Both colours, in the other order where `turned` is 1."""
    change = graph.vector('SCALE', graph.vector('SUBTRACT', second, first), turned)
    return graph.vector('ADD', first, change), graph.vector('SUBTRACT', second, change)


def _sheet(graph: Graph, near: Any, far: Any, normal: Any) -> list[bpy.types.Node]:
    """Cosine lobes around a normal, of one colour on its side and of another on the other."""
    return [
        graph.node("ShaderNodeBsdfDiffuse", {"Color": near, "Normal": normal}),
        graph.node("ShaderNodeBsdfTranslucent", {"Color": far, "Normal": normal}),
    ]


def _highlight_width(graph: Graph, given: Any) -> bpy.types.NodeSocket:
    """Phong's exponent as the width of a microfacet distribution: α = √(1 / (2 spear + 1))."""
    return graph.math('POWER', graph.math('MULTIPLY_ADD', given["spear"], 2.0, 1.0), -0.5)


def _gloss_weight(graph: Graph, given: Any, directions: tuple[Any, Any, Any], width: Any) -> tuple[Any, Any]:
    """Fraction of all light that the highlight gets, Plane · s, and what of it is left above the face's horizon.

    Planes whose highlight would dip under the face have none. What the horizon cuts off of the others, the plane
    scatters diffusely: .29 e^{−1.3 x α^{−.66}} for a mirrored direction at cosine x from the face's normal, fitted to
    means over planes, faces and viewers of sampled lobes, within .02 for α from .13 to .45.
    """
    plane, incoming, face = directions
    mirrored = graph.vector('SCALE', plane, graph.math('MULTIPLY', graph.vector('DOT_PRODUCT', plane, incoming), 2.0))
    height = graph.vector('DOT_PRODUCT', graph.vector('SUBTRACT', mirrored, incoming), face)
    lowest = graph.math('MINIMUM', height, graph.vector('DOT_PRODUCT', plane, face))
    scale = 1.0 / (_CLEAR - _GLANCING)
    clear = graph.math('MULTIPLY_ADD', lowest, scale, -_GLANCING * scale)
    clear = graph.math('MINIMUM', graph.math('MAXIMUM', clear, 0.0), 1.0)
    weight = graph.math('MULTIPLY', graph.math('MULTIPLY', given["Plane"], given["s"]), clear)
    rate = graph.math('MULTIPLY', graph.math('POWER', width, -0.66), -1.3)
    cut = graph.math('MULTIPLY', graph.math('EXPONENT', graph.math('MULTIPLY', height, rate)), -0.29)
    return weight, graph.math('MULTIPLY_ADD', weight, cut, weight)


def _highlight(graph: Graph, normal: Any, weight: Any, width: Any) -> bpy.types.NodeSocket:
    """White reflection around a normal; light that bounces among facets counts, or up to a third would be lost.

    Its weight is no colour: grey facets would absorb at each bounce.
    """
    inputs = {"Color": (1.0, 1.0, 1.0, 1.0), "Roughness": graph.math('SQRT', width), "Normal": normal}
    shader = graph.node("ShaderNodeBsdfAnisotropic", inputs, distribution='MULTI_GGX')
    # Mixed with nothing.
    return graph.node("ShaderNodeMixShader", {"Fac": weight, "Shader_001": shader}).outputs[0]


def _sum(graph: Graph, shaders: list[Any]) -> bpy.types.NodeSocket:
    """All shaders together; their colours hold the weights."""
    total = shaders[0]
    for shader in shaders[1:]:
        total = graph.node("ShaderNodeAddShader", {"Shader": total, "Shader_001": shader}).outputs[0]
    return total


def scatter_group() -> bpy.types.NodeTree:
    """The group "TetFlora Scatter": a thin sheet that reflects and transmits, lit from both sides.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Transmission, Reflected Tint, Through Tint, Gloss, Gloss Roughness, Normal; output Shader. Of the
        light that arrives, (1 − Gloss) · Colour is scattered, evenly over the side of the light or, for the fraction
        Transmission, over the other side, each times its tint; Gloss is mirrored. No more comes out than went in.
    """
    inputs = (
        ("Colour", 'Color', LEAF_GREEN),
        ("Transmission", 'Float', 0.0, UNIT, "Fraction of scattered light that passes"),
        ("Reflected Tint", 'Color', WHITE, None, "Multiplies the color of reflected light"),
        ("Through Tint", 'Color', THROUGH_TINT, None, "Multiplies the color of passing light"),
        ("Gloss", 'Float', GLOSS, UNIT, "Fraction of light that is reflected"),
        ("Gloss Roughness", 'Float', GLOSS_ROUGHNESS, UNIT),
        ("Normal", 'Vector', None, None, "Must be linked, for example to Geometry"),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        colour, normal = given["Colour"], given["Normal"]
        back = graph.tinted(colour, given["Reflected Tint"])
        reflected = graph.node("ShaderNodeBsdfDiffuse", {"Color": back, "Normal": normal})
        through = graph.tinted(colour, given["Through Tint"])
        transmitted = graph.node("ShaderNodeBsdfTranslucent", {"Color": through, "Normal": normal})
        sheet = graph.mix(given["Transmission"], reflected, transmitted)
        roughness = given["Gloss Roughness"]
        gloss = graph.node("ShaderNodeBsdfAnisotropic", {"Color": WHITE, "Roughness": roughness, "Normal": normal})
        return {"Shader": graph.mix(given["Gloss"], sheet, gloss)}

    return shader_group(SCATTER, _SCATTER_VERSION, inputs, [("Shader", 'Shader')], build)
