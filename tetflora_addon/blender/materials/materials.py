# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of leaves, bark, microsurfaces, microspheres and baked light.

All share one scattering group, so that proxies match what they replace.
"""

from __future__ import annotations

from typing import Any

import bpy

from ...emission.light import BACK, FRONT
from ...light.scattering import GLOSS
from ..compat import disable_bump_correction
from .bark import bark_group, bark_version, smooth_step
from .microsphere import scatter_group
from .nodes import LEAF_GREEN, Graph, find_socket, shader_group, surface_material

BLADE = "TetFlora Leaf Blade"
PROXY = "TetFlora proxy"
SPHERE = "TetFlora microsphere"
BAKED = "TetFlora baked"

# Raise these when what they count changes: existing files then get the new nodes beside the old ones.
_LEAF_VERSION = 2
_BLADE_VERSION = 1
_PROXY_VERSION = 2
_SPHERE_VERSION = 1
_BAKED_VERSION = 1

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
    inputs = (
        ("Colour", 'Color', LEAF_GREEN, None, "Mean color"),
        ("Transmission", 'Float', 0.4, (0.0, 1.0), "Thick leaves show no veins"),
        ("Midrib", 'Float', MIDRIB, (0.0, 2.0), "How much lighter the midrib is"),
        ("Veins", 'Float', VEINS, (0.0, 1.0), "How much lighter the veins are"),
        ("Paler Underside", 'Float', 1.0, (0.0, 4.0)),
    )

    def build(graph: Graph, given: Any) -> dict[str, Any]:
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
        return {"Colour": graph.scaled(given["Colour"], factor), "Reflected Tint": tint}

    outputs = ("Colour", 'Color'), ("Reflected Tint", 'Color')
    return shader_group(BLADE, _BLADE_VERSION, inputs, outputs, build)


def leaf_material(species_name: str) -> bpy.types.Material:
    """Material "TetFlora <species> leaf": reads ``tf_colour`` and ``tf_transmission`` of each face, veins by ``UVMap``.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it; each species has a material of its own to edit.
    """

    def build(graph: Graph, _material: bpy.types.Material) -> None:
        normal = graph.node("ShaderNodeNewGeometry").outputs["Normal"]
        inputs = {"Colour": graph.attribute("tf_colour", "Color")}
        inputs["Transmission"] = graph.attribute("tf_transmission", "Fac")
        blade = graph.node("ShaderNodeGroup", inputs, node_tree=blade_group()).outputs
        looks = {name: blade[name] for name in ("Colour", "Reflected Tint")}
        _lead_out(graph, _scattered(graph, {**inputs, **looks, "Normal": normal}))

    return surface_material(f"TetFlora {species_name} leaf", _LEAF_VERSION, build)


def bark_material(species_name: str, character: str = "ridged") -> bpy.types.Material:
    """Material "TetFlora <species> bark": ``tf_colour`` with a pattern that shows when the camera is close.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it.
    character : str
        One of `bark.BARKS`. A species whose character changed gets a new material; the old one stays beside it.

    Raises
    ------
    SpeciesError
        There is no such bark.

    Notes
    -----
    The pattern varies the colour around its mean, so that bark and its microsurfaces agree from afar.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
        colour = graph.attribute("tf_colour", "Color")
        bark = graph.node("ShaderNodeGroup", {"Colour": colour}, node_tree=bark_group(character)).outputs
        looks = {name: bark[name] for name in ("Colour", "Normal")}
        _lead_out(graph, _scattered(graph, {**looks, "Transmission": 0.0, "Gloss": 0.0}))
        # The correction takes up to a tenth of the light away from what is rough, unlike for proxies.
        disable_bump_correction(material)
        material.diffuse_color = (0.18, 0.12, 0.08, 1.0)

    return surface_material(f"TetFlora {species_name} bark", bark_version(character), build)


def proxy_material() -> bpy.types.Material:
    """Material "TetFlora proxy" of all microsurfaces: as a leaf where ``tf_transmission`` is above 0, else as bark."""

    def build(graph: Graph, _material: bpy.types.Material) -> None:
        normal = graph.node("ShaderNodeNewGeometry").outputs["Normal"]
        _lead_out(graph, _scattered(graph, _proxy_looks(graph, normal)))

    return surface_material(PROXY, _PROXY_VERSION, build)


def sphere_material() -> bpy.types.Material:
    """Material "TetFlora microsphere" of all microspheres: that of microsurfaces with the sphere's own normal.

    Cycles meets spheres of a point cloud only from outside. So light that falls on a sphere is reflected by the half
    that it falls on or, for the fraction ``tf_transmission``, comes out of the other half, and nothing is lost within.
    EEVEE does the same for a slab as thick as the sphere; without that the sphere would shade its own other half.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
        looks = _proxy_looks(graph, graph.node("ShaderNodeNewGeometry").outputs["Normal"])
        thickness = graph.math('MULTIPLY', graph.attribute("radius", "Fac"), 2.0)
        _lead_out(graph, _scattered(graph, looks), thickness)
        material.thickness_mode = 'SLAB'

    return surface_material(SPHERE, _SPHERE_VERSION, build)


def baked_material() -> bpy.types.Material:
    """Material "TetFlora baked": `FRONT` and `BACK` to the camera, the material of proxies to all other rays.

    Both are FLOAT_VECTOR attributes on FACE or on POINT, of meshes or point clouds: linear radiance as a pixel shows
    it. What has no front and back has the same in both, see `emission.light.baked_attributes`. Other rays see the
    proxies' material so that ground and meshes get the usual light and shadows of plants.

    Notes
    -----
    Rays are distinguished by Light Path: Is Camera Ray. EEVEE has only camera rays and shadows; its light probes and
    reflections see the emission. Cycles must not sample the faces as lights, which they are not.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
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
        seen = graph.node("ShaderNodeEmission", {"Color": find_socket(side.outputs, "Result_Color"), "Strength": 1.0})
        camera = graph.node("ShaderNodeLightPath").outputs["Is Camera Ray"]
        scattered = _scattered(graph, _proxy_looks(graph, geometry["Normal"]))
        _lead_out(graph, graph.mix(camera, scattered, seen))
        cycles = getattr(material, "cycles", None)  # there only while the Cycles add-on is enabled
        if cycles is not None and hasattr(cycles, "emission_sampling"):
            cycles.emission_sampling = 'NONE'

    return surface_material(BAKED, _BAKED_VERSION, build)


def _proxy_looks(graph: Graph, normal: Any) -> dict[str, Any]:
    """What proxies feed the scatter group with: gloss where light goes through, as in leaves."""
    colour, transmission = graph.attribute("tf_colour", "Color"), graph.attribute("tf_transmission", "Fac")
    gloss = graph.math('MULTIPLY', graph.math('GREATER_THAN', transmission, 0.0), GLOSS)
    return {"Colour": colour, "Transmission": transmission, "Gloss": gloss, "Normal": normal}


def _scattered(graph: Graph, looks: dict[str, Any]) -> bpy.types.Node:
    return graph.node("ShaderNodeGroup", looks, node_tree=scatter_group())


def _lead_out(graph: Graph, shader: Any, thickness: Any = None) -> None:
    """Link a shader to the output. EEVEE would take the extent of the whole mesh for a thickness that is not linked."""
    thickness = graph.value(0.0) if thickness is None else thickness
    graph.node("ShaderNodeOutputMaterial", {"Surface": shader, "Thickness": thickness})
