# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shell materials: a proxy tetrahedron drawn as a cloud of constant density (paper, section 7).

The scene's lights illuminate "TetFlora shell"; "TetFlora baked shell" emits baked light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from ..compat import blend_in_mesh_order, disable_bump_correction, loses_summed_lobes
from .microsphere import ENGINES, LOBE_INPUTS, UNIT, microsphere_group
from .nodes import Graph, Term, node_group, surface_material

SHELL = "TetFlora Shell"
SHELL_MATERIAL = "TetFlora shell"
BAKED_SHELL = "TetFlora Baked Shell"
BAKED_SHELL_MATERIAL = "TetFlora baked shell"

# With the group within.
_GROUP_VERSION = 2 + loses_summed_lobes()
_MATERIAL_VERSION = 2 + loses_summed_lobes()
_BAKED_VERSION = 1

# Longer than any cell, for faces that the ray runs away from, metres.
_NEVER = 1e9
# A slope under which the ray runs along a face, 1/m.
_ALONG = 1e-9
# An eye nearer to the exit face than this fraction of the way through the cell is inside of the cell.
_INSIDE = 0.999
# Optical depth under which the weights of both ends are taken from their series; both forms are within 1e-5 there.
_THIN = 0.05


def shell_group() -> bpy.types.NodeTree:
    """The group "TetFlora Shell": everything between the attributes of ``shell_buffers`` and a shader."""
    inputs = (
        *LOBE_INPUTS,
        ("Roundness", 'Float', 1.0, UNIT, "0: particles face the viewer; 1: they are round"),
        ("Variation", 'Float', 0.05, UNIT, "Variation of lightness between cells"),
        ("Stochastic", 'Float', 1.0, UNIT, "1: samples are opaque or clear, much faster"),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        geometry = graph.outputs("ShaderNodeNewGeometry")
        inputs = {name: given[name] for name in ("p", "s", "spear", "Through Tint", "Roundness")}
        inputs["Colour"] = _varied_colour(graph, given["Variation"])
        inputs["Transmission"] = graph.attribute("tf_transmission", "Fac")
        inputs["Normal"] = graph.attribute("tf_normal", "Vector")
        inputs["Plane"] = graph.attribute("tf_plane", "Fac")
        spheres = graph.outputs("ShaderNodeGroup", inputs, node_tree=microsphere_group())
        clear = graph.node("ShaderNodeBsdfTransparent")
        shaders = {}
        for engine, path in _paths(graph, geometry).items():
            opacity = 1.0 - path.transmittance
            # EEVEE blends opacity as it is; what it draws by chance, it draws so by itself.
            alpha = _decided(graph, opacity, geometry, given["Stochastic"]) if engine == "Cycles" else opacity
            shaders[engine] = graph.mix(alpha, clear, spheres[engine])
        return shaders

    return node_group(SHELL, _GROUP_VERSION, inputs, ENGINES, build)


def baked_shell_group() -> bpy.types.NodeTree:
    """The group "TetFlora Baked Shell": light that a cell gives off, and how much of what is behind passes through.

    Notes
    -----
    With constant density, and the scattered radiance J linear between where the ray enters (J₀) and leaves (J₁), a
    cell of optical depth τ = κℓ adds B = w₀ J₀ + w₁ J₁ to T = e^{−τ} times what is behind it (paper, section 7), where
    w₁ = (1 − e^{−τ}(1 + τ)) / τ and w₀ = 1 − (1 − e^{−τ}) / τ.
    """
    inputs = [("Strength", 'Float', 1.0, (0.0, 1000.0), "Multiplies the baked light")]

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        geometry = graph.outputs("ShaderNodeNewGeometry")
        lights = [graph.attribute(f"tf_light{k}", "Vector") for k in range(4)]
        shaders = {}
        for engine, path in _paths(graph, geometry).items():
            first, last = _end_weights(graph, path.depth)
            parts = []
            for light, level, slope in zip(lights, path.levels, path.slopes, strict=True):
                # λ at the hit and at the other end, each with its weight; the near end is where the ray came from.
                there = path.length * slope * -1.0 + level
                change = (there - level) * path.leaving
                near, far = level + change, there - change
                parts.append(light * (far * last + near * first))
            total = sum(parts[1:], parts[0])
            emission = graph.node("ShaderNodeEmission", {"Color": total, "Strength": given["Strength"]})
            grey = graph.xyz(*[path.transmittance] * 3)
            clear = graph.node("ShaderNodeBsdfTransparent", {"Color": grey})
            # Not a mix, which would make the emission weaker by the opacity that it contains already.
            added = graph.node("ShaderNodeAddShader", {"Shader": emission, "Shader_001": clear})
            shaders[engine] = added.outputs[0]
        return shaders

    return node_group(BAKED_SHELL, _BAKED_VERSION, inputs, ENGINES, build)


def shell_material() -> bpy.types.Material:
    """Material "TetFlora shell" of the mesh that `emission.shells.shell_buffers` describes, for Cycles and EEVEE.

    A ray meets two faces a cell: the scene's ``cycles.transparent_max_bounces`` has to allow for that. EEVEE blends
    faces in their order in the mesh: give ``shell_buffers`` the cells' ranks.
    """
    return surface_material(SHELL_MATERIAL, _MATERIAL_VERSION, _builder(shell_group))


def baked_shell_material() -> bpy.types.Material:
    """Material "TetFlora baked shell": the light of ``shell_buffers(light=...)``, without noise, unlit."""
    return surface_material(BAKED_SHELL_MATERIAL, _BAKED_VERSION, _builder(baked_shell_group))


def _builder(group: Any) -> Any:
    """What leads a group's two outputs to those of a material."""

    def build(graph: Graph, material: bpy.types.Material) -> None:
        shell = graph.outputs("ShaderNodeGroup", node_tree=group())
        # EEVEE otherwise takes the whole mesh's extent for the thickness of each cell, and halves what passes through.
        thin = graph.value(0.0)
        for engine, name in (('CYCLES', "Cycles"), ('EEVEE', "EEVEE")):
            graph.node("ShaderNodeOutputMaterial", {"Surface": shell[name], "Thickness": thin}, target=engine)
        disable_bump_correction(material)
        blend_in_mesh_order(material)

    return build


@dataclass(frozen=True)
class _Path:
    """The ray's way through the cell, from the face that was hit.

    Attributes
    ----------
    length : Term
        Metres inside the cell that count at this face.
    transmittance, depth : Term
        e^{−κℓ}, and κℓ.
    levels, slopes : list of Term
        The four barycentric coordinates at the hit, in the order of the vertices, and what they lose a metre.
    leaving : Term
        1 on the faces where the ray leaves.
    """

    length: Term
    transmittance: Term
    depth: Term
    levels: list[Term]
    slopes: list[Term]
    leaving: Term


def _paths(graph: Graph, geometry: dict[str, Term]) -> dict[str, _Path]:
    """The ray's way through the cell for each engine, which differ in how they tell how far the eye is.

    Along ω = −incoming a barycentric coordinate falls by ∇λ·incoming a metre; the ray leaves where the first reaches
    zero. The coordinate of the entry face itself rises and never counts. On exit faces the same backwards gives where
    the ray has entered. Faces where it enters carry the whole way; faces where it leaves carry none, unless the ray
    began in the cell: then all of its length counts.
    """
    incoming, leaving = geometry["Incoming"], geometry["Backfacing"]
    direction = incoming * (leaving * -2.0 + 1.0)
    levels = list(graph.parts(graph.attribute("tf_bary", "Vector")))
    slopes = [graph.vector('DOT_PRODUCT', graph.attribute(f"tf_g{k}", "Vector"), direction) for k in (1, 2, 3)]
    levels.insert(0, 1.0 - (levels[0] + levels[1] + levels[2]))
    slopes.insert(0, -(slopes[0] + slopes[1] + slopes[2]))
    exits = []
    for level, slope in zip(levels, slopes, strict=True):
        distance = graph.math('MAXIMUM', level, 0.0) / graph.math('MAXIMUM', slope, _ALONG)
        exits.append((slope < _ALONG) * _NEVER + distance)
    whole = graph.math('MINIMUM', graph.math('MINIMUM', *exits[:2]), graph.math('MINIMUM', *exits[2:]))
    # Where nothing was hit but by rounding, no length is better than an endless one.
    whole = whole * (whole < _NEVER)
    extinction = _extinction(graph, incoming)
    entering = 1.0 - leaving
    paths = {}
    for engine, eye in (("Cycles", _ray_length(graph)), ("EEVEE", _eye_distance(graph, incoming))):
        length = entering * whole + (eye < whole * _INSIDE) * leaving * eye
        # A flat cell has no gradients and thus no exit; it has no extinction either.
        depth = length * extinction
        paths[engine] = _Path(length, graph.math('EXPONENT', -depth), depth, levels, slopes, leaving)
    return paths


def _ray_length(graph: Graph) -> Term:
    """Length of Cycles's ray since the eye, or since what scattered it; passing through shells does not end it."""
    return graph.outputs("ShaderNodeLightPath")["Ray Length"]


def _eye_distance(graph: Graph, incoming: Term) -> Term:
    """Distance from the eye along the ray; from the camera's plane if it is orthographic. Endless in shadow maps."""
    camera = graph.outputs("ShaderNodeCameraData")
    ways = {"vector_type": 'VECTOR', "convert_from": 'CAMERA', "convert_to": 'WORLD'}
    towards = graph.node("ShaderNodeVectorTransform", {"Vector": camera["View Vector"]}, **ways)
    distance = abs(graph.vector('DOT_PRODUCT', towards, incoming)) * camera["View Distance"]
    return graph.outputs("ShaderNodeLightPath")["Is Shadow Ray"] * _NEVER + distance


def _extinction(graph: Graph, incoming: Term) -> Term:
    """κ(ω) = √(ωᵀSω), 1/m (SGGX; Heitz et al. 2015)."""
    x, y, z = graph.parts(incoming)
    diagonal = graph.vector('DOT_PRODUCT', graph.attribute("tf_s0", "Vector"), incoming * incoming)
    mixed = graph.vector('DOT_PRODUCT', graph.attribute("tf_s1", "Vector"), graph.xyz(x * y, x * z, y * z))
    return graph.math('SQRT', graph.math('MAXIMUM', mixed * 2.0 + diagonal, 0.0))


def _end_weights(graph: Graph, depth: Term) -> tuple[Term, Term]:
    """Weights w₀ and w₁ of the light at the near and the far end; by series where τ is small."""
    thin, some = depth < _THIN, graph.math('MAXIMUM', depth, _THIN)
    clear = graph.math('EXPONENT', -some)
    mean = (1.0 - clear) / some
    weights = []
    # τ/2 − τ²/6 + τ³/24 and τ/2 − τ²/3 + τ³/8
    for value, (second, third) in zip((1.0 - mean, mean - clear), ((-1 / 6, 1 / 24), (-1 / 3, 1 / 8)), strict=True):
        series = (depth * (depth * third + second) + 0.5) * depth
        weights.append((series - value) * thin + value)
    return weights[0], weights[1]


def _varied_colour(graph: Graph, amount: Term) -> Term:
    """The cell's colour, lighter or darker by up to `amount`; over many cells the mean stays."""
    factor = (graph.attribute("tf_random", "Fac") * 2.0 + -1.0) * amount + 1.0
    return graph.scaled(graph.attribute("tf_colour", "Color"), factor)


def _decided(graph: Graph, opacity: Term, geometry: dict[str, Term], stochastic: Term) -> Term:
    """Opacity, or all or nothing by chance with the same mean.

    Opacity between 0 and 1 makes Cycles trace shadows through the whole stack at every hit. A decision by white noise
    of the position that was hit has the same mean, since no two samples hit the same point, and costs a twelfth.
    """
    noise = graph.outputs("ShaderNodeTexWhiteNoise", {"Vector": geometry["Position"]}, noise_dimensions='3D')
    # This form of the mean is exactly 0 or 1 where stochastic is 1.
    return (noise["Value"] < opacity) * stochastic + opacity * (1.0 - stochastic)
