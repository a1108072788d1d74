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
from .nodes import Graph, find_socket, shader_group, surface_material

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
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        spheres = graph.node("ShaderNodeGroup", node_tree=microsphere_group())
        inputs = {name: given[name] for name in ("p", "s", "spear", "Through Tint", "Roundness")}
        inputs["Colour"] = _varied_colour(graph, given["Variation"])
        inputs["Transmission"] = graph.attribute("tf_transmission", "Fac")
        inputs["Normal"] = graph.attribute("tf_normal", "Vector")
        inputs["Plane"] = graph.attribute("tf_plane", "Fac")
        for name, value in inputs.items():
            graph.feed(find_socket(spheres.inputs, name), value)
        clear = graph.node("ShaderNodeBsdfTransparent")
        shaders = {}
        for engine, path in _paths(graph, geometry).items():
            opacity = graph.math('SUBTRACT', 1.0, path.transmittance)
            # EEVEE blends opacity as it is; what it draws by chance, it draws so by itself.
            alpha = _decided(graph, opacity, geometry, given["Stochastic"]) if engine == "Cycles" else opacity
            shaders[engine] = graph.mix(alpha, clear, find_socket(spheres.outputs, engine))
        return shaders

    return shader_group(SHELL, _GROUP_VERSION, inputs, ENGINES, build)


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
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        lights = [graph.attribute(f"tf_light{k}", "Vector") for k in range(4)]
        shaders = {}
        for engine, path in _paths(graph, geometry).items():
            first, last = _end_weights(graph, path)
            total = None
            for light, level, slope in zip(lights, path.levels, path.slopes, strict=True):
                # λ at the hit and at the other end, each with its weight; the near end is where the ray came from.
                there = graph.math('MULTIPLY_ADD', graph.math('MULTIPLY', path.length, slope), -1.0, level)
                near, far = path.ordered(graph, level, there)
                weight = graph.math('MULTIPLY_ADD', far, last, graph.math('MULTIPLY', near, first))
                part = graph.vector('SCALE', light, weight)
                total = part if total is None else graph.vector('ADD', total, part)
            emission = graph.node("ShaderNodeEmission", {"Color": total, "Strength": given["Strength"]})
            grey = graph.node("ShaderNodeCombineXYZ", dict.fromkeys("XYZ", path.transmittance))
            clear = graph.node("ShaderNodeBsdfTransparent", {"Color": grey})
            # Not a mix, which would make the emission weaker by the opacity that it contains already.
            added = graph.node("ShaderNodeAddShader", {"Shader": emission, "Shader_001": clear})
            shaders[engine] = added.outputs[0]
        return shaders

    return shader_group(BAKED_SHELL, _BAKED_VERSION, inputs, ENGINES, build)


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
        shell = graph.node("ShaderNodeGroup", node_tree=group())
        # EEVEE otherwise takes the whole mesh's extent for the thickness of each cell, and halves what passes through.
        thin = graph.value(0.0)
        for engine, name in (('CYCLES', "Cycles"), ('EEVEE', "EEVEE")):
            surface = find_socket(shell.outputs, name)
            graph.node("ShaderNodeOutputMaterial", {"Surface": surface, "Thickness": thin}, target=engine)
        disable_bump_correction(material)
        blend_in_mesh_order(material)

    return build


@dataclass(frozen=True)
class _Path:
    """The ray's way through the cell, from the face that was hit.

    Attributes
    ----------
    length : NodeSocket
        Metres inside the cell that count at this face.
    transmittance : NodeSocket
        e^{−κℓ}.
    depth : NodeSocket
        κℓ.
    levels, slopes : list of NodeSocket
        The four barycentric coordinates at the hit, in the order of the vertices, and what they lose a metre.
    leaving : NodeSocket
        1 on the faces where the ray leaves.
    """

    length: Any
    transmittance: Any
    depth: Any
    levels: list[Any]
    slopes: list[Any]
    leaving: Any

    def ordered(self, graph: Graph, here: Any, there: Any) -> tuple[Any, Any]:
        """Values of the near and of the far end of the way, given those at the hit and at the other end."""
        change = graph.math('MULTIPLY', graph.math('SUBTRACT', there, here), self.leaving)
        return graph.math('ADD', here, change), graph.math('SUBTRACT', there, change)


def _paths(graph: Graph, geometry: Any) -> dict[str, _Path]:
    """The ray's way through the cell for each engine, which differ in how they tell how far the eye is.

    Along ω = −incoming a barycentric coordinate falls by ∇λ·incoming a metre; the ray leaves where the first reaches
    zero. The coordinate of the entry face itself rises and never counts. On exit faces the same backwards gives where
    the ray has entered. Faces where it enters carry the whole way; faces where it leaves carry none, unless the ray
    began in the cell: then all of its length counts.
    """
    incoming, leaving = geometry["Incoming"], geometry["Backfacing"]
    onwards = graph.math('MULTIPLY_ADD', leaving, -2.0, 1.0)
    direction = graph.vector('SCALE', incoming, onwards)
    inside = graph.node("ShaderNodeSeparateXYZ", {"Vector": graph.attribute("tf_bary", "Vector")}).outputs
    levels = list(inside)
    slopes = [graph.vector('DOT_PRODUCT', graph.attribute(f"tf_g{k}", "Vector"), direction) for k in (1, 2, 3)]
    others = graph.math('ADD', graph.math('ADD', levels[0], levels[1]), levels[2])
    levels.insert(0, graph.math('SUBTRACT', 1.0, others))
    steepness = graph.math('ADD', graph.math('ADD', slopes[0], slopes[1]), slopes[2])
    slopes.insert(0, graph.math('MULTIPLY', steepness, -1.0))
    exits = []
    for level, slope in zip(levels, slopes, strict=True):
        distance = graph.math('DIVIDE', graph.math('MAXIMUM', level, 0.0), graph.math('MAXIMUM', slope, _ALONG))
        away = graph.math('LESS_THAN', slope, _ALONG)
        exits.append(graph.math('MULTIPLY_ADD', away, _NEVER, distance))
    whole = graph.math('MINIMUM', graph.math('MINIMUM', *exits[:2]), graph.math('MINIMUM', *exits[2:]))
    # Where nothing was hit but by rounding, no length is better than an endless one.
    whole = graph.math('MULTIPLY', whole, graph.math('LESS_THAN', whole, _NEVER))
    extinction = _extinction(graph, incoming)
    entering = graph.math('SUBTRACT', 1.0, leaving)
    paths = {}
    for engine, eye in (("Cycles", _ray_length(graph)), ("EEVEE", _eye_distance(graph, incoming))):
        begun = graph.math('LESS_THAN', eye, graph.math('MULTIPLY', whole, _INSIDE))
        since = graph.math('MULTIPLY', graph.math('MULTIPLY', begun, leaving), eye)
        length = graph.math('MULTIPLY_ADD', entering, whole, since)
        # A flat cell has no gradients and thus no exit; it has no extinction either.
        depth = graph.math('MULTIPLY', length, extinction)
        clear = graph.math('EXPONENT', graph.math('MULTIPLY', depth, -1.0))
        paths[engine] = _Path(length, clear, depth, levels, slopes, leaving)
    return paths


def _ray_length(graph: Graph) -> bpy.types.NodeSocket:
    """Length of Cycles's ray since the eye, or since what scattered it; passing through shells does not end it."""
    return find_socket(graph.node("ShaderNodeLightPath").outputs, "Ray Length")


def _eye_distance(graph: Graph, incoming: Any) -> bpy.types.NodeSocket:
    """Distance from the eye along the ray; from the camera's plane if it is orthographic. Endless in shadow maps."""
    camera = graph.node("ShaderNodeCameraData").outputs
    towards = graph.node(
        "ShaderNodeVectorTransform",
        {"Vector": camera["View Vector"]},
        vector_type='VECTOR',
        convert_from='CAMERA',
        convert_to='WORLD',
    )
    along = graph.math('ABSOLUTE', graph.vector('DOT_PRODUCT', towards, incoming))
    distance = graph.math('MULTIPLY', along, camera["View Distance"])
    shadow = find_socket(graph.node("ShaderNodeLightPath").outputs, "Is Shadow Ray")
    return graph.math('MULTIPLY_ADD', shadow, _NEVER, distance)


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


def _end_weights(graph: Graph, path: _Path) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
    """Weights w₀ and w₁ of the light at the near and the far end; by series where τ is small."""
    depth = path.depth
    thin = graph.math('LESS_THAN', depth, _THIN)
    some = graph.math('MAXIMUM', depth, _THIN)
    clear = graph.math('EXPONENT', graph.math('MULTIPLY', some, -1.0))
    mean = graph.math('DIVIDE', graph.math('SUBTRACT', 1.0, clear), some)
    exact = (graph.math('SUBTRACT', 1.0, mean), graph.math('SUBTRACT', mean, clear))
    weights = []
    # τ/2 − τ²/6 + τ³/24 and τ/2 − τ²/3 + τ³/8
    for value, (second, third) in zip(exact, ((-1 / 6, 1 / 24), (-1 / 3, 1 / 8)), strict=True):
        series = graph.math('MULTIPLY_ADD', depth, third, second)
        series = graph.math('MULTIPLY', graph.math('MULTIPLY_ADD', depth, series, 0.5), depth)
        rest = graph.math('SUBTRACT', series, value)
        weights.append(graph.math('MULTIPLY_ADD', rest, thin, value))
    return weights[0], weights[1]


def _varied_colour(graph: Graph, amount: Any) -> bpy.types.NodeSocket:
    """The cell's colour, lighter or darker by up to `amount`; over many cells the mean stays."""
    signed = graph.math('MULTIPLY_ADD', graph.attribute("tf_random", "Fac"), 2.0, -1.0)
    factor = graph.math('MULTIPLY_ADD', signed, amount, 1.0)
    return graph.scaled(graph.attribute("tf_colour", "Color"), factor)


def _decided(graph: Graph, opacity: Any, geometry: Any, stochastic: Any) -> bpy.types.NodeSocket:
    """Opacity, or all or nothing by chance with the same mean.

    Opacity between 0 and 1 makes Cycles trace shadows through the whole stack at every hit. A decision by white noise
    of the position that was hit has the same mean, since no two samples hit the same point, and costs a twelfth.
    """
    noise = graph.node("ShaderNodeTexWhiteNoise", {"Vector": geometry["Position"]}, noise_dimensions='3D')
    decision = graph.math('LESS_THAN', find_socket(noise.outputs, "Value"), opacity)
    # This form of the mean is exactly 0 or 1 where stochastic is 1.
    smooth = graph.math('MULTIPLY', opacity, graph.math('SUBTRACT', 1.0, stochastic))
    return graph.math('MULTIPLY_ADD', decision, stochastic, smooth)
