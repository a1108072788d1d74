# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that scatter light: the paper's cloud of microspheres and planes (section 7), and a thin sheet.

The cloud has no thickness: whoever uses the group decides what is transparent. It returns exactly as much light as it
takes from uniform surroundings, whatever the renderer samples: lamps, a constant world, an image of the sky, surfaces.

Shells are proxy tetrahedra drawn as such a cloud of constant density (paper, section 7). The scene's lights illuminate
"TetFlora shell"; "TetFlora baked shell" emits baked light.
"""

from dataclasses import dataclass
from functools import reduce
from math import tau
from typing import Any

import bpy

from ... import optics
from ...light.scattering import GLOSS_ROUGHNESS
from ...optics import GLOSS
from ..compat import blend_in_mesh_order, disable_bump_correction, loses_summed_lobes
from .nodes import LEAF_GREEN, Graph, Term, node_group, surface_material

MICROSPHERE = "TetFlora Microsphere"
SCATTER = "TetFlora Scatter"

#: Where sums of lobes lose light, the nodes are others.
_VERSION = 1 + loses_summed_lobes()
_SCATTER_VERSION = 2

WHITE = (1.0, 1.0, 1.0, 1.0)
UNIT = (0.0, 1.0)
#: The engine's, as a color of a socket.
THROUGH_TINT = (*optics.THROUGH_TINT.tolist(), 1.0)
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
        Inputs Color, Transmission, Normal, Plane, p, s, spear, Through Tint, Roundness, Facing; outputs Cycles and
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
        ("Color", 'Color', LEAF_GREEN, None, "Mean color of the contents"),
        ("Transmission", 'Float', 0.0, UNIT, "Fraction of scattered light that passes"),
        ("Normal", 'Vector', (0.0, 0.0, 1.0), None, "Axis of the planes, of either sign"),
        ("Plane", 'Float', 0.0, UNIT, "Weight of the plane term; the rest are particles"),
        *LOBE_INPUTS,
        ("Roundness", 'Float', 1.0, UNIT, about),
        ("Facing", 'Vector', (0.0, 0.0, 0.0), None, facing),
    )
    return node_group(MICROSPHERE, _VERSION, inputs, ENGINES, _shaders)


def _shaders(graph: Graph, given: dict[str, Term]) -> dict[str, Term]:
    """Both engines' shaders from the same lobes."""
    geometry = graph.outputs("ShaderNodeNewGeometry")
    incoming, face = geometry["Incoming"], geometry["True Normal"]
    back, transmission = graph.scaled(given["Color"], given["p"]), given["Transmission"]
    through = graph.tinted(back, given["Through Tint"]) * transmission
    back = back * (1.0 - transmission)

    particle = particle_normal(graph, given, geometry)
    axis = graph.vector('NORMALIZE', given["Normal"])
    plane = axis * ((graph.vector('DOT_PRODUCT', axis, incoming) < 0.0) * -2.0 + 1.0)
    # Phong's exponent as the width of a microfacet distribution: α = √(1 / (2 spear + 1)).
    width = (given["spear"] * 2.0 + 1.0) ** -0.5
    gloss, kept = _gloss_weight(graph, given, (plane, incoming, face), width)
    full, simple, lobes = [], [], []
    for normal, weight in ((particle, 1.0 - given["Plane"]), (plane, given["Plane"] - kept)):
        reflected, transmitted = back * weight, through * weight
        simple += _sheet(graph, reflected, transmitted, normal)
        # Toward the face's own side; where that turns the plane away from the viewer, both sides change places.
        facing = graph.vector('DOT_PRODUCT', normal, face)
        turned = facing < 0.0
        normal = normal * (turned * -2.0 + 1.0)
        change = (transmitted - reflected) * turned
        near, far = reflected + change, transmitted - change
        full += _sheet(graph, near, far, normal)
        lobes.append((near, far, normal, abs(facing) * -0.5 + 0.5))
    highlight = _highlight(graph, plane, gloss, width)
    if loses_summed_lobes():
        sheet, share = _one_of(graph, lobes, given["Plane"])
        seen = _highlight(graph, plane, gloss * share, width)
        return {"Cycles": _sum(graph, [*sheet, seen]), "EEVEE": _sum(graph, [*simple, highlight])}
    (near, far, _, lost), (near_too, far_too, _, lost_too) = lobes
    full += _sheet(graph, far * lost + far_too * lost_too, near * lost + near_too * lost_too, face)
    return {"Cycles": _sum(graph, [*full, highlight]), "EEVEE": _sum(graph, [*simple, highlight])}


def _one_of(graph: Graph, lobes: list[tuple[Term, ...]], planes: Term) -> tuple[list[bpy.types.Node], Term]:
    """A sheet around one normal: particle or plane by chance, divided by its probability; and the highlight's factor.

    What the horizon cuts off of one lobe of a normal is added to the other, with which it has no direction in common.
    """
    where = graph.outputs("ShaderNodeNewGeometry")["Position"]
    noise = graph.outputs("ShaderNodeTexWhiteNoise", {"Vector": where, "W": 2.0}, noise_dimensions='4D')
    flat = noise["Value"] < planes
    # A number is chosen as vectors are.
    near, far, normal, lost = (
        graph.vector('ADD', first, graph.vector('SCALE', graph.vector('SUBTRACT', second, first), flat))
        for first, second in zip(*lobes, strict=True)
    )
    # Never chosen where it is 0 but for rounding.
    share = 1.0 / graph.math('MAXIMUM', abs(1.0 - flat - planes), 1e-6)
    added = graph.math('DIVIDE', lost, graph.math('SUBTRACT', 1.0, lost))
    return _sheet(graph, (near + far * added) * share, (far + near * added) * share, normal), share * flat


def particle_normal(graph: Graph, given: dict[str, Any], geometry: dict[str, Term]) -> Term:
    """Normal m of the particle that was hit.

    The points of a sphere that a viewer sees have normals with density cos / π around him: those of I + q, with q
    anywhere on a sphere of radius 1 (Roundness times that, to leave some of them turned to the viewer).
    """
    inputs = {"Vector": geometry["Position"], "W": 1.0}
    random = graph.parts(graph.outputs("ShaderNodeTexWhiteNoise", inputs, noise_dimensions='4D')["Color"])
    height = random[0] * 2.0 + -1.0
    radius = graph.math('SQRT', graph.math('MAXIMUM', height * -height + 1.0, 0.0))
    turn = random[1] * tau
    around = graph.xyz(radius * graph.math('COSINE', turn), radius * graph.math('SINE', turn), height)
    # A little less than 1, so that the sum is never zero.
    seen = geometry["Incoming"] + around * graph.math('MULTIPLY', given["Roundness"], 0.999)
    unset = graph.vector('LENGTH', given["Facing"]) < 0.5
    return graph.vector('NORMALIZE', seen * unset + given["Facing"] * (1.0 - unset))


def _sheet(graph: Graph, near: Term, far: Term, normal: Term) -> list[bpy.types.Node]:
    """Cosine lobes around a normal, of one color on its side and of another on the other."""
    return [
        graph.node("ShaderNodeBsdfDiffuse", {"Color": near, "Normal": normal}),
        graph.node("ShaderNodeBsdfTranslucent", {"Color": far, "Normal": normal}),
    ]


def _gloss_weight(
    graph: Graph, given: dict[str, Term], directions: tuple[Term, Term, Term], width: Term
) -> tuple[Term, Term]:
    """Fraction of all light that the highlight gets, Plane · s, and what of it is left above the face's horizon.

    Planes whose highlight would dip under the face have none. What the horizon cuts off of the others, the plane
    scatters diffusely: .29 e^{−1.3 x α^{−.66}} for a mirrored direction at cosine x from the face's normal, fitted to
    means over planes, faces and viewers of sampled lobes, within .02 for α from .13 to .45.
    """
    plane, incoming, face = directions
    mirrored = plane * (graph.vector('DOT_PRODUCT', plane, incoming) * 2.0)
    height = graph.vector('DOT_PRODUCT', mirrored - incoming, face)
    lowest = graph.math('MINIMUM', height, graph.vector('DOT_PRODUCT', plane, face))
    scale = 1.0 / (_CLEAR - _GLANCING)
    clear = graph.math('MINIMUM', graph.math('MAXIMUM', lowest * scale + -_GLANCING * scale, 0.0), 1.0)
    weight = given["Plane"] * given["s"] * clear
    cut = graph.math('EXPONENT', height * (width**-0.66 * -1.3)) * -0.29
    return weight, weight * cut + weight


def _highlight(graph: Graph, normal: Term, weight: Term, width: Term) -> Term:
    """White reflection with light that bounces among facets; its weight is no color, or gray facets would absorb."""
    inputs = {"Color": (1.0, 1.0, 1.0, 1.0), "Roughness": graph.math('SQRT', width), "Normal": normal}
    shader = graph.node("ShaderNodeBsdfAnisotropic", inputs, distribution='MULTI_GGX')
    # Mixed with nothing.
    return Term(graph, graph.node("ShaderNodeMixShader", {"Fac": weight, "Shader_001": shader}).outputs[0])


def _sum(graph: Graph, shaders: list[Any]) -> Any:
    """All shaders together; their colors hold the weights."""
    return reduce(lambda a, b: graph.node("ShaderNodeAddShader", {"Shader": a, "Shader_001": b}), shaders)


def scatter_group() -> bpy.types.NodeTree:
    """The group "TetFlora Scatter": a thin sheet that reflects and transmits, lit from both sides.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Color, Transmission, Reflected Tint, Through Tint, Gloss, Gloss Roughness, Normal; output Shader. Of the
        light that arrives, (1 − Gloss) · Color is scattered, evenly over the side of the light or, for the fraction
        Transmission, over the other side, each times its tint; Gloss is mirrored. No more comes out than went in.
    """
    inputs = (
        ("Color", 'Color', LEAF_GREEN),
        ("Transmission", 'Float', 0.0, UNIT, "Fraction of scattered light that passes"),
        ("Reflected Tint", 'Color', WHITE, None, "Multiplies the color of reflected light"),
        ("Through Tint", 'Color', THROUGH_TINT, None, "Multiplies the color of passing light"),
        ("Gloss", 'Float', GLOSS, UNIT, "Fraction of light that is reflected"),
        ("Gloss Roughness", 'Float', GLOSS_ROUGHNESS, UNIT),
        ("Normal", 'Vector', None, None, "Must be linked, for example to Geometry"),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        color, normal = given["Color"], given["Normal"]
        back = graph.tinted(color, given["Reflected Tint"])
        reflected = graph.node("ShaderNodeBsdfDiffuse", {"Color": back, "Normal": normal})
        through = graph.tinted(color, given["Through Tint"])
        transmitted = graph.node("ShaderNodeBsdfTranslucent", {"Color": through, "Normal": normal})
        sheet = graph.mix(given["Transmission"], reflected, transmitted)
        roughness = given["Gloss Roughness"]
        gloss = graph.node("ShaderNodeBsdfAnisotropic", {"Color": WHITE, "Roughness": roughness, "Normal": normal})
        return {"Shader": graph.mix(given["Gloss"], sheet, gloss)}

    return node_group(SCATTER, _SCATTER_VERSION, inputs, [("Shader", 'Shader')], build)


SHELL = "TetFlora Shell"
SHELL_MATERIAL = "TetFlora shell"
BAKED_SHELL = "TetFlora Baked Shell"
BAKED_SHELL_MATERIAL = "TetFlora baked shell"

# With the group within.
_GROUP_VERSION = 2 + loses_summed_lobes()
_MATERIAL_VERSION = 2 + loses_summed_lobes()
_BAKED_VERSION = 1

# Longer than any cell, for faces that the ray runs away from, meters.
_NEVER = 1e9
# A slope under which the ray runs along a face, 1/m.
_ALONG = 1e-9
# An eye nearer to the exit face than this fraction of the way through the cell is inside of the cell.
_INSIDE = 0.999
# Optical depth under which the weights of both ends are taken from their series; both forms are within 1e-5 there.
_THIN = 0.05


def shell_group() -> bpy.types.NodeTree:
    """The group "TetFlora Shell": everything between the attributes of `emission.shells` and a shader."""
    inputs = (
        *LOBE_INPUTS,
        ("Roundness", 'Float', 1.0, UNIT, "0: particles face the viewer; 1: they are round"),
        ("Variation", 'Float', 0.05, UNIT, "Variation of lightness between cells"),
        ("Stochastic", 'Float', 1.0, UNIT, "1: samples are opaque or clear, much faster"),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
        geometry = graph.outputs("ShaderNodeNewGeometry")
        inputs = {name: given[name] for name in ("p", "s", "spear", "Through Tint", "Roundness")}
        # Lighter or darker; over many cells the mean stays.
        varied = (graph.attribute("tf_random", "Fac") * 2.0 + -1.0) * given["Variation"] + 1.0
        inputs["Color"] = graph.scaled(graph.attribute("tf_color", "Color"), varied)
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


def _baked_shell_group() -> bpy.types.NodeTree:
    """The group "TetFlora Baked Shell": light that a cell gives off, and how much of what is behind passes through.

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
                other_end = path.length * slope * -1.0 + level
                change = (other_end - level) * path.leaving
                near, far = level + change, other_end - change
                parts.append(light * (far * last + near * first))
            total = sum(parts[1:], parts[0])
            emission = graph.node("ShaderNodeEmission", {"Color": total, "Strength": given["Strength"]})
            clear = graph.node("ShaderNodeBsdfTransparent", {"Color": graph.xyz(*[path.transmittance] * 3)})
            # Not a mix, which would make the emission weaker by the opacity that it contains already.
            added = graph.node("ShaderNodeAddShader", {"Shader": emission, "Shader_001": clear})
            shaders[engine] = added.outputs[0]
        return shaders

    return node_group(BAKED_SHELL, _BAKED_VERSION, inputs, ENGINES, build)


def shell_material() -> bpy.types.Material:
    """Material "TetFlora shell" of the mesh that `emission.shells` makes, for Cycles and EEVEE.

    A ray meets two faces a cell: the scene's ``cycles.transparent_max_bounces`` has to allow for that. EEVEE blends
    faces in their order in the mesh: give it the cells' ranks.
    """
    return surface_material(SHELL_MATERIAL, _MATERIAL_VERSION, _builder(shell_group))


def baked_shell_material() -> bpy.types.Material:
    """Material "TetFlora baked shell": the light of `emission.shells`, without noise, unlit."""
    return surface_material(BAKED_SHELL_MATERIAL, _BAKED_VERSION, _builder(_baked_shell_group))


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
    """The ray's way through the cell, from the face that was hit."""

    length: Term  # meters inside the cell that count at this face
    #: transmittance, depth: e^{−κℓ}, and κℓ
    transmittance: Term
    depth: Term
    #: levels, slopes: The four barycentric coordinates at the hit, in the vertices' order, and what they lose a meter
    levels: list[Term]
    slopes: list[Term]
    leaving: Term  # 1 on the faces where the ray leaves


def _paths(graph: Graph, geometry: dict[str, Term]) -> dict[str, _Path]:
    """The ray's way through the cell for each engine, which differ in how they tell how far the eye is.

    Along ω = −incoming a barycentric coordinate falls by ∇λ·incoming a meter; the ray leaves where the first reaches
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
    # κ(ω) = √(ωᵀSω), 1/m (SGGX; Heitz et al. 2015).
    x, y, z = graph.parts(incoming)
    diagonal = graph.vector('DOT_PRODUCT', graph.attribute("tf_s0", "Vector"), incoming * incoming)
    mixed = graph.vector('DOT_PRODUCT', graph.attribute("tf_s1", "Vector"), graph.xyz(x * y, x * z, y * z))
    extinction = graph.math('SQRT', graph.math('MAXIMUM', mixed * 2.0 + diagonal, 0.0))
    entering = 1.0 - leaving
    paths = {}
    # Cycles's ray begins at the eye, or at what scattered it; passing through shells does not end it.
    ray = graph.outputs("ShaderNodeLightPath")["Ray Length"]
    for engine, eye in (("Cycles", ray), ("EEVEE", _eye_distance(graph, incoming))):
        length = entering * whole + (eye < whole * _INSIDE) * leaving * eye
        # A flat cell has no gradients and thus no exit; it has no extinction either.
        depth = length * extinction
        paths[engine] = _Path(length, graph.math('EXPONENT', -depth), depth, levels, slopes, leaving)
    return paths


def _eye_distance(graph: Graph, incoming: Term) -> Term:
    """Distance from the eye along the ray; from the camera's plane if it is orthographic. Endless in shadow maps."""
    camera = graph.outputs("ShaderNodeCameraData")
    ways = {"vector_type": 'VECTOR', "convert_from": 'CAMERA', "convert_to": 'WORLD'}
    toward = graph.node("ShaderNodeVectorTransform", {"Vector": camera["View Vector"]}, **ways)
    distance = abs(graph.vector('DOT_PRODUCT', toward, incoming)) * camera["View Distance"]
    return graph.outputs("ShaderNodeLightPath")["Is Shadow Ray"] * _NEVER + distance


def _end_weights(graph: Graph, depth: Term) -> tuple[Term, Term]:
    """Weights w₀ and w₁ of the light at the near and the far end; by series where τ is small."""
    thin, thick = depth < _THIN, graph.math('MAXIMUM', depth, _THIN)
    clear = graph.math('EXPONENT', -thick)
    mean = (1.0 - clear) / thick
    weights = []
    # τ/2 − τ²/6 + τ³/24 and τ/2 − τ²/3 + τ³/8
    for value, (second, third) in zip((1.0 - mean, mean - clear), ((-1 / 6, 1 / 24), (-1 / 3, 1 / 8)), strict=True):
        series = (depth * (depth * third + second) + 0.5) * depth
        weights.append((series - value) * thin + value)
    return weights[0], weights[1]


def _decided(graph: Graph, opacity: Term, geometry: dict[str, Term], stochastic: Term) -> Term:
    """Opacity, or all or nothing by chance with the same mean.

    Opacity between 0 and 1 makes Cycles trace shadows through the whole stack at every hit. A decision by white noise
    of the position that was hit has the same mean, since no two samples hit the same point, and costs a twelfth.
    """
    noise = graph.outputs("ShaderNodeTexWhiteNoise", {"Vector": geometry["Position"]}, noise_dimensions='3D')
    # This form of the mean is exactly 0 or 1 where stochastic is 1.
    return (noise["Value"] < opacity) * stochastic + opacity * (1.0 - stochastic)
