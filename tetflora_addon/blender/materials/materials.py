# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of leaves, bark, proxies and baked light; all share one scattering group, so that proxies match leaves."""

from typing import Any

import bpy

from ...light.illumination import BACK, FRONT
from ...optics import GLOSS, HAIRY
from ..compat import disable_bump_correction
from .bark import bark_group, bark_version
from .blade import WAXY, blade_group, blade_version, paler, sheen
from .microsphere import WHITE, scatter_group
from .nodes import Graph, Term, surface_material

PROXY = "TetFlora proxy"
SPHERE = "TetFlora microsphere"
ASSET_PROXY = "TetFlora asset proxy"
ASSET_SPHERE = "TetFlora asset microsphere"
BAKED = "TetFlora baked"

# Raise these when what they count changes: existing files then get the new nodes beside the old ones.
_PROXY_VERSION = 4
_SPHERE_VERSION = 2
_BAKED_VERSION = 2


def leaf_material(species_name: str, kind: str = "pinnate", **looks: float) -> bpy.types.Material:
    """Material "TetFlora <species> leaf": reads ``tf_color`` and ``tf_transmission`` of each face, veins by ``UVMap``.

    Parameters
    ----------
    species_name : str
        Name as the artist reads it; each species has a material of its own to edit.
    kind : str
        One of `blade.BLADES`. A species whose kind changed gets a new material; the old one stays beside it.
    **looks
        Values of the group's inputs that a new material begins with, by name with underscores.

    Notes
    -----
    Light that has been scattered before meets the plain leaf, as of proxies: nobody sees veins in it, and Cycles skips
    all nodes of the side of a mix that does not count.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
        color, transmission = graph.attribute("tf_color", "Color"), graph.attribute("tf_transmission", "Fac")
        left = _gloss_left(graph)
        given = {name.replace("_", " ").title(): value for name, value in looks.items()}
        blade = graph.outputs("ShaderNodeGroup", {"Color": color, **given}, node_tree=blade_group(kind))
        near = {
            "Color": WHITE,
            "Transmission": transmission,
            "Reflected Tint": blade["Reflected"],
            "Through Tint": blade["Through"],
            "Gloss": blade["Gloss"] * left,
            "Gloss Roughness": blade["Roughness"],
            "Normal": blade["Normal"],
        }
        normal = graph.outputs("ShaderNodeNewGeometry")["Normal"]
        plain = {"Color": color, "Transmission": transmission, "Gloss": left * GLOSS, "Normal": normal}
        scattered = graph.outputs("ShaderNodeLightPath")["Is Diffuse Ray"]
        _lead_out(graph, graph.mix(scattered, _scattered(graph, near), _scattered(graph, plain)))
        disable_bump_correction(material)

    return surface_material(f"TetFlora {species_name} leaf", blade_version(kind), build)


def bark_material(species_name: str, character: str = "ridged") -> bpy.types.Material:
    """Material "TetFlora <species> bark": ``tf_color`` with a pattern that shows when the camera is close.

    Parameters
    ----------
    character : str
        One of `bark.BARKS`. A species whose character changed gets a new material; the old one stays beside it.

    Raises
    ------
    SpeciesError
        There is no such bark.

    Notes
    -----
    The pattern varies the color around its mean, so that bark and its microsurfaces agree from afar.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
        color = graph.attribute("tf_color", "Color")
        bark = graph.outputs("ShaderNodeGroup", {"Color": color}, node_tree=bark_group(character))
        dull = {"Transmission": 0.0, "Gloss": 0.0}
        young = _scattered(graph, {**dull, "Color": color, "Normal": graph.outputs("ShaderNodeNewGeometry")["Normal"]})
        # Light that was scattered before meets the plain bark: nobody sees a pattern in it.
        shown = bark["Shown"] * (1.0 - graph.outputs("ShaderNodeLightPath")["Is Diffuse Ray"])
        for engine, tone in (('CYCLES', graph.scaled(bark["Color"], bark["Gain"])), ('EEVEE', bark["Color"])):
            old = _scattered(graph, {**dull, "Color": tone, "Normal": bark["Normal"]})
            _lead_out(graph, graph.mix(shown, young, old), engine=engine)
        # The correction takes up to a tenth of the light away from what is rough, unlike for proxies.
        disable_bump_correction(material)
        material.diffuse_color = (0.18, 0.12, 0.08, 1.0)

    return surface_material(f"TetFlora {species_name} bark", bark_version(character), build)


def proxy_material(asset: bool = False) -> bpy.types.Material:
    """Material "TetFlora proxy" of all microsurfaces: as a leaf where ``tf_transmission`` is above 0, else as bark.

    asset: "TetFlora asset proxy", for what stands for the artist's own materials, which mostly are Principled.

    Notes
    -----
    Facets have the sides of leaves: level leaves show their darker side to the sky, hanging ones the paler one to the
    eye. As of leaves, light that was scattered before meets the mean of both.
    """

    def build(graph: Graph, _material: bpy.types.Material) -> None:
        geometry = graph.outputs("ShaderNodeNewGeometry")
        plain = _proxy_looks(graph, geometry["Normal"])
        if asset:
            _lead_out(graph, _principled(graph))
            return
        side = geometry["Backfacing"] * 2.0 + -1.0
        sides = {
            **plain,
            "Reflected Tint": paler(side * (plain["Transmission"] > 0.0)),
            "Gloss": sheen(graph, side, plain["Gloss"]),
            "Gloss Roughness": geometry["Backfacing"] * HAIRY + WAXY,
        }
        scattered = graph.outputs("ShaderNodeLightPath")["Is Diffuse Ray"]
        _lead_out(graph, graph.mix(scattered, _scattered(graph, sides), _scattered(graph, plain)))

    return surface_material(ASSET_PROXY if asset else PROXY, _PROXY_VERSION, build)


def sphere_material(asset: bool = False) -> bpy.types.Material:
    """Material "TetFlora microsphere" of all microspheres: that of microsurfaces with the sphere's own normal.

    Cycles meets spheres of a point cloud only from outside. So light that falls on a sphere is reflected by the half
    that it falls on or, for the fraction ``tf_transmission``, comes out of the other half, and nothing is lost within.
    EEVEE does the same for a slab as thick as the sphere; without that the sphere would shade its own other half.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
        normal = graph.outputs("ShaderNodeNewGeometry")["Normal"]
        shader = _principled(graph) if asset else _scattered(graph, _proxy_looks(graph, normal))
        _lead_out(graph, shader, graph.attribute("radius", "Fac") * 2.0)
        material.thickness_mode = 'SLAB'

    return surface_material(ASSET_SPHERE if asset else SPHERE, _SPHERE_VERSION, build)


def baked_material() -> bpy.types.Material:
    """Material "TetFlora baked": `FRONT` and `BACK` to the camera, the material of proxies to all other rays.

    Both are FLOAT_VECTOR attributes on FACE or on POINT, of meshes or point clouds: linear radiance as a pixel shows
    it. What has no front and back has the same in both, see `light.illumination.baked_attributes`. Other rays see the
    proxies' material so that ground and meshes get the usual light and shadows of plants.

    Notes
    -----
    Rays are distinguished by Light Path: Is Camera Ray. EEVEE has only camera rays and shadows; its light probes and
    reflections see the emission. Cycles must not sample the faces as lights, which they are not.
    """

    def build(graph: Graph, material: bpy.types.Material) -> None:
        geometry = graph.outputs("ShaderNodeNewGeometry")
        front, back = graph.attribute(FRONT, "Color"), graph.attribute(BACK, "Color")
        side = graph.mixed(geometry["Backfacing"], front, back)
        seen = graph.node("ShaderNodeEmission", {"Color": side, "Strength": 1.0})
        camera = graph.outputs("ShaderNodeLightPath")["Is Camera Ray"]
        _lead_out(graph, graph.mix(camera, _scattered(graph, _proxy_looks(graph, geometry["Normal"])), seen))
        cycles = getattr(material, "cycles", None)  # there only while the Cycles add-on is enabled
        if cycles is not None and hasattr(cycles, "emission_sampling"):
            cycles.emission_sampling = 'NONE'

    return surface_material(BAKED, _BAKED_VERSION, build)


def _proxy_looks(graph: Graph, normal: Any) -> dict[str, Any]:
    """What proxies feed the scatter group with: gloss where light goes through, as in leaves, as far as it is seen."""
    color, transmission = graph.attribute("tf_color", "Color"), graph.attribute("tf_transmission", "Fac")
    gloss = (transmission > 0.0) * GLOSS * _gloss_left(graph)
    return {"Color": color, "Transmission": transmission, "Gloss": gloss, "Normal": normal}


def _gloss_left(graph: Graph) -> Term:
    """The part of the gloss of leaves that these do not hide from each other."""
    return graph.attribute("tf_dull", "Fac") * -1.0 + 1.0


def _principled(graph: Graph) -> Term:
    """What stands for the artist's materials: Fresnel's gloss, which is most of what leaves show against the light."""
    color, transmission = graph.attribute("tf_color", "Color"), graph.attribute("tf_transmission", "Fac")
    given = {"Base Color": color, "Roughness": graph.attribute("tf_roughness", "Fac")}
    front = graph.node("ShaderNodeBsdfPrincipled", {**given, "Specular IOR Level": _gloss_left(graph) * 0.5})
    return graph.mix(transmission, front, graph.node("ShaderNodeBsdfTranslucent", {"Color": color}))


def _scattered(graph: Graph, looks: dict[str, Any]) -> bpy.types.Node:
    return graph.node("ShaderNodeGroup", looks, node_tree=scatter_group())


def _lead_out(graph: Graph, shader: Any, thickness: Any = None, engine: str = 'ALL') -> None:
    """Link a shader to the output. EEVEE would take the extent of the whole mesh for a thickness that is not linked."""
    thickness = graph.value(0.0) if thickness is None else thickness
    graph.node("ShaderNodeOutputMaterial", {"Surface": shader, "Thickness": thickness}, target=engine)
