# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of leaves, bark, microsurfaces and microspheres: one scattering group for all, so that they match.

The material of baked light: the camera sees precomputed emission, free of noise.

For all other rays it is the proxies' own material, so that ground and meshes get the light and the shadows of plants as
ever. Nothing that it emits lights anything.
"""

from __future__ import annotations

from typing import Any

import bpy

from ...emission.light import BACK, FRONT
from ...light.scattering import GLOSS
from ..compat import disable_bump_correction, shader_tree
from .bark import BARKS, bark_group, bark_version, smooth_step
from .microsphere import scatter_group
from .nodes import Graph, add_socket, find_socket, get_or_create, new_group

__all__ = [
    "BARKS",
    "bark_material",
    "leaf_material",
    "proxy_material",
    "scatter_group",
    "sphere_material",
]

BLADE = "TetFlora Leaf Blade"
PROXY = "TetFlora proxy"
SPHERE = "TetFlora microsphere"

# Raise these when what they count changes: existing files then get the new nodes beside the old ones.
_LEAF_VERSION = 2
_BLADE_VERSION = 1
_PROXY_VERSION = 2
_SPHERE_VERSION = 1


# How much more than the mean of both sides a leaf's underside reflects, and the upper side less: fewer pigments lie
# under its surface, hence most in blue, of which a leaf has least.
PALER = (0.07, 0.05, 0.22)
# Lightness of the midrib and of the veins that branch off it, over that of the blade.
MIDRIB, VEINS = 0.45, 0.2
# Veins to a leaf's length on either side, and how far along the leaf they run per unit that they run outwards.
_VEIN_COUNT, _VEIN_SLOPE = 9.0, 0.65
# Transmission under which leaves show no veins (needles, scales), and over which they show all.
_OPAQUE, _THIN = 0.15, 0.35


def blade_group() -> bpy.types.NodeTree:
    """The group "TetFlora Leaf Blade": midrib and veins, and a paler underside.

    Returns
    -------
    bpy.types.NodeTree
        Inputs Colour, Transmission, Midrib, Veins, Paler Underside; outputs Colour, and Reflected Tint for the scatter
        group. In the UV map the midrib is expected at u = .5 from v = 0 to 1, in units of the leaf's length, as leaf
        models have it. Over the leaf the mean of Colour is that of the input, and over both sides the mean of the tint
        is 1: light lines lie in darker surroundings.
    """

    def build(tree: bpy.types.NodeTree) -> None:
        add_socket(tree, "Colour", "NodeSocketColor", (0.1, 0.25, 0.05, 1.0), None, "Mean color")
        add_socket(tree, "Transmission", "NodeSocketFloat", 0.4, (0.0, 1.0), "Thick leaves show no veins")
        add_socket(tree, "Midrib", "NodeSocketFloat", MIDRIB, (0.0, 2.0), "How much lighter the midrib is")
        add_socket(tree, "Veins", "NodeSocketFloat", VEINS, (0.0, 1.0), "How much lighter the veins are")
        add_socket(tree, "Paler Underside", "NodeSocketFloat", 1.0, (0.0, 4.0))
        for name in ("Colour", "Reflected Tint"):
            tree.interface.new_socket(name=name, in_out='OUTPUT', socket_type="NodeSocketColor")
        graph = Graph(tree)
        given = graph.node("NodeGroupInput").outputs
        uv = graph.node("ShaderNodeSeparateXYZ", {"Vector": graph.attribute("UVMap", "Vector")}).outputs
        aside = graph.math('ABSOLUTE', graph.math('SUBTRACT', uv["X"], 0.5))
        # The halo is three times as wide as the rib and a third as dark as that is light, so that the mean stays.
        rib, halo = smooth_step(graph, aside, 0.008, 0.002), smooth_step(graph, aside, 0.022, 0.008)
        rib = graph.math('MULTIPLY_ADD', halo, -1.0 / 3.0, rib)
        start = graph.math('MULTIPLY_ADD', aside, -_VEIN_SLOPE, uv["Y"])
        wave = graph.math('PINGPONG', graph.math('MULTIPLY', start, _VEIN_COUNT), 0.5)
        # A step from .02 to .1 covers .06 of each .5.
        vein = graph.math('SUBTRACT', smooth_step(graph, wave, 0.1, 0.02), 0.06 / 0.5)
        vein = graph.math('MULTIPLY', vein, smooth_step(graph, aside, 0.015, 0.05))
        lines = graph.math('MULTIPLY', vein, given["Veins"])
        lines = graph.math('ADD', lines, graph.math('MULTIPLY', rib, given["Midrib"]))
        factor = graph.math('MULTIPLY_ADD', lines, smooth_step(graph, given["Transmission"], _OPAQUE, _THIN), 1.0)
        back = graph.node("ShaderNodeNewGeometry").outputs["Backfacing"]
        side = graph.math('MULTIPLY', graph.math('MULTIPLY_ADD', back, 2.0, -1.0), given["Paler Underside"])
        tint = graph.vector('ADD', graph.vector('SCALE', PALER, side), (1.0, 1.0, 1.0))
        graph.node("NodeGroupOutput", {"Colour": graph.scaled(given["Colour"], factor), "Reflected Tint": tint})
        graph.arrange()

    return get_or_create(bpy.data.node_groups, BLADE, _BLADE_VERSION, new_group, build)


def leaf_material(species_name: str) -> bpy.types.Material:
    """Material "TetFlora <species> leaf": reads ``tf_colour`` and ``tf_transmission`` of each face, veins by ``UVMap``.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it; each species has a material of its own to edit.
    """

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        geometry = graph.node("ShaderNodeNewGeometry").outputs
        colour, transmission = graph.attribute("tf_colour", "Color"), graph.attribute("tf_transmission", "Fac")
        blade = graph.node("ShaderNodeGroup", node_tree=blade_group())
        graph.feed(find_socket(blade.inputs, "Colour"), colour)
        graph.feed(find_socket(blade.inputs, "Transmission"), transmission)
        looks = {name: blade.outputs[name] for name in ("Colour", "Reflected Tint")}
        _finish(graph, {**looks, "Transmission": transmission, "Normal": geometry["Normal"]})
        material.diffuse_color = (0.1, 0.25, 0.05, 1.0)

    return get_or_create(
        bpy.data.materials, f"TetFlora {species_name} leaf", _LEAF_VERSION, bpy.data.materials.new, build
    )


def bark_material(species_name: str, character: str = "ridged") -> bpy.types.Material:
    """Material "TetFlora <species> bark": ``tf_colour`` with a pattern that shows when the camera is close.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it.
    character : str
        One of `BARKS`. A species whose character changed gets a new material; the old one is kept beside it.

    Raises
    ------
    SpeciesError
        There is no such bark.

    Notes
    -----
    The pattern varies the colour around its mean, so that bark and its microsurfaces agree from afar.
    """

    def build(material: bpy.types.Material) -> None:
        graph = Graph(shader_tree(material))
        bark = graph.node("ShaderNodeGroup", node_tree=bark_group(character))
        graph.feed(find_socket(bark.inputs, "Colour"), graph.attribute("tf_colour", "Color"))
        looks = {name: bark.outputs[name] for name in ("Colour", "Normal")}
        _finish(graph, {**looks, "Transmission": 0.0, "Gloss": 0.0})
        # The correction takes up to a tenth of the light away from what is rough, which proxies know nothing of.
        disable_bump_correction(material)
        material.diffuse_color = (0.18, 0.12, 0.08, 1.0)

    return get_or_create(
        bpy.data.materials, f"TetFlora {species_name} bark", bark_version(character), bpy.data.materials.new, build
    )


def proxy_material() -> bpy.types.Material:
    """Material "TetFlora proxy" of all microsurfaces: as a leaf where ``tf_transmission`` is above 0, else as bark."""
    return get_or_create(bpy.data.materials, PROXY, _PROXY_VERSION, bpy.data.materials.new, _build_proxy)


def sphere_material() -> bpy.types.Material:
    """Material "TetFlora microsphere" of all microspheres: what microsurfaces have, with the sphere's own normal.

    Cycles meets spheres of a point cloud from outside alone. So what falls on a sphere is reflected by the half that it
    falls on or, for the share ``tf_transmission``, comes out of the other half, and nothing is lost within. EEVEE does
    the same for a slab as thick as the sphere; without that the sphere would shade its own other half.
    """

    def build(material: bpy.types.Material) -> None:
        _build_proxy(material, "radius")
        material.thickness_mode = 'SLAB'

    return get_or_create(bpy.data.materials, SPHERE, _SPHERE_VERSION, bpy.data.materials.new, build)


def _build_proxy(material: bpy.types.Material, half_thickness: str | None = None) -> None:
    """Nodes of proxies; an attribute says how thick they are."""
    graph = Graph(shader_tree(material))
    geometry = graph.node("ShaderNodeNewGeometry").outputs
    colour, transmission = graph.attribute("tf_colour", "Color"), graph.attribute("tf_transmission", "Fac")
    gloss = graph.math('MULTIPLY', graph.math('GREATER_THAN', transmission, 0.0), GLOSS)
    inputs = {"Colour": colour, "Transmission": transmission, "Gloss": gloss, "Normal": geometry["Normal"]}
    thickness = None
    if half_thickness is not None:
        thickness = graph.math('MULTIPLY', graph.attribute(half_thickness, "Fac"), 2.0)
    _finish(graph, inputs, thickness)
    material.diffuse_color = (0.1, 0.25, 0.05, 1.0)


def _finish(graph: Graph, inputs: dict, thickness: bpy.types.NodeSocket | None = None) -> None:
    """Feed the scatter group and lead it to the output; sheets have no thickness."""
    scatter = graph.node("ShaderNodeGroup", node_tree=scatter_group())
    for key, value in inputs.items():
        graph.feed(find_socket(scatter.inputs, key), value)
    if thickness is None:
        # EEVEE otherwise takes the whole mesh's extent for the thickness of each leaf.
        value = graph.node("ShaderNodeValue")
        value.outputs[0].default_value = 0.0
        thickness = value.outputs[0]
    graph.node("ShaderNodeOutputMaterial", {"Surface": scatter, "Thickness": thickness})
    graph.arrange()


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
