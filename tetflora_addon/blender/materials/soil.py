# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Soil by nodes, in the colors of what lies and grows on it: a map of them, and noise for what is finer than its cells.

The map is an image, packed into the file. It is laid on the ground from above by world coordinates, without UV maps.
"""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from bpy.types import Image, Material, Object

from ...arrays import Floats, srgb_of
from ..compat import shader_tree
from .nodes import Graph, Term

#: On materials and images of the soil, so that they may be renamed.
MARK = "tetflora_soil"
#: How bright low plants are together, of how bright one blade is: they shade each other.
SHADED = 0.72
_PLACE, _SIZE, _MAP, _GREEN = "Soil Corner", "Soil Size", "Soil Map", "Soil Green"
_SHOWN = 0.6  # of the brightest channel of soil in Solid shading, at least


def is_soil(material: Material | None) -> bool:
    """Whether a material is one that `soil_material` made and may bring up to date."""
    return material is not None and bool(material.get(MARK)) and material.library is None


def lay_soil(
    name: str, grounds: Sequence[Object], earth: Floats, green: Floats, tint: Floats, low: Floats, cell: float
) -> list[str]:
    """Give grounds a soil, see `soil_material`, of square cells, meters; names of those that keep the artist's own."""
    fits = [obj for obj in grounds if may_have_soil(obj)]
    before = next((slot.material for obj in fits for slot in obj.material_slots if is_soil(slot.material)), None)
    material = soil_material(name, earth, green, tint, low, cell * np.array(green.shape[::-1]), before)
    for obj in fits:
        if obj.material_slots:
            obj.material_slots[0].material = material
        else:
            obj.data.materials.append(material)
    kept = [obj.name for obj in grounds if obj not in fits]
    if kept:
        material.use_fake_user = True  # for the artist to use
    return kept


def may_have_soil(obj: Object) -> bool:
    """Whether a ground is of this file and has no material but soil."""
    local = obj.library is None and obj.data.library is None and obj.override_library is None
    return local and all(slot.material is None or is_soil(slot.material) for slot in obj.material_slots)


def soil_material(
    name: str, colors: Floats, green: Floats, tint: Floats, low: Floats, size: Floats, material: Material | None = None
) -> Material:
    """A material for the ground, or the soil of before with another map; what the artist changed in its nodes stays.

    Parameters
    ----------
    colors : (rows, columns, 3) float64
        Linear RGB of soil and what lies on it; the first row is at the smallest y.
    green : (rows, columns) float64
        Fraction of the ground that plants hide.
    tint : (3,) float64
        Their mean linear RGB.
    low, size : (2,) float64
        Corner and extent of the map, meters in world space.
    """
    image = _image(name, colors, green)
    nodes = None if material is None else shader_tree(material).nodes
    if nodes is None or any(nodes.get(key) is None for key in (_PLACE, _SIZE, _MAP, _GREEN)):
        if material is None:
            material = bpy.data.materials.new(name)
            material[MARK] = True
        # Solid shading has neither sun nor exposure: dark soil, which is nearly black there, is as bright as leaves.
        mean = colors.mean(axis=(0, 1))
        material.diffuse_color = (*(mean * max(_SHOWN / max(float(mean.max()), 1e-6), 1.0)).tolist(), 1.0)
        graph = Graph(shader_tree(material))
        _build(graph)
        graph.arrange()
        nodes = shader_tree(material).nodes
    before = nodes[_MAP].image
    nodes[_MAP].image = image
    for key, value in ((_PLACE, low), (_SIZE, size)):
        for socket, number in zip(nodes[key].inputs, value.tolist(), strict=False):
            socket.default_value = number
    nodes[_GREEN].outputs[0].default_value = (*tint.tolist(), 1.0)
    if before is not None and before.get(MARK) and not before.users:
        bpy.data.images.remove(before)
    return material


def _image(name: str, colors: Floats, green: Floats) -> Image:
    """The map: colors as the display has them, so that eight bits are enough for dark ones, and the green in alpha."""
    rows, columns = green.shape
    image = bpy.data.images.new(name, columns, rows, alpha=True)
    image[MARK] = True
    image.alpha_mode = 'CHANNEL_PACKED'
    pixels = np.concatenate([srgb_of(np.clip(colors, 0.0, 1.0)), np.clip(green, 0.0, 1.0)[..., None]], axis=2)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    image.pack()
    return image


def _build(graph: Graph) -> None:
    """Soil: the map from above, crumbs and old leaves by noise, and green in patches as large as its fraction."""
    place = graph.outputs("ShaderNodeNewGeometry")["Position"]
    low, size = (_named(graph, name, "ShaderNodeCombineXYZ", {"Z": z}) for name, z in ((_PLACE, 0.0), (_SIZE, 1.0)))
    inputs = {"Vector": graph.vector('DIVIDE', place - low["Vector"], size["Vector"])}
    options = {"interpolation": 'Cubic', "extension": 'EXTEND', "projection": 'FLAT'}
    ground = _named(graph, _MAP, "ShaderNodeTexImage", inputs, **options)
    broad, fine = graph.noise(place, 4.0, scale=1.3)[0], graph.noise(place, 6.0, scale=24.0)[0]
    moved = fine * 0.03 + -0.015  # a little, so that cells get ragged outlines
    inputs = {"Vector": place + graph.xyz(moved, moved, moved), "Scale": 26.0, "Randomness": 1.0}
    each = graph.outputs("ShaderNodeSeparateColor", {"Color": graph.outputs("ShaderNodeTexVoronoi", inputs)["Color"]})
    # All factors are 1 on average, so that the mean is that of the map.
    tone = (each["Red"] * 0.9 + 0.55) * (fine * 1.7 + 0.15) * (broad * 0.7 + 0.65)
    warm = each["Green"] * 0.3 + -0.15
    tint = graph.node("ShaderNodeCombineColor", {"Red": warm + 0.9, "Green": 0.9, "Blue": 0.9 - warm})
    brown = graph.scaled(graph.tinted(ground["Color"], tint), tone * 1.1)
    grown = graph.scaled(_named(graph, _GREEN, "ShaderNodeRGB")["Color"], fine * 1.6 + 0.2)
    # Noise is close to normally distributed around a half: from where the fraction says, the ground is green.
    patches = broad * 0.5 + graph.noise(place, 5.0, scale=7.0)[0] * 0.5
    inputs = {"Value": patches - (ground["Alpha"] * -0.4 + 0.7), "From Min": -0.05, "From Max": 0.05, "To Max": 0.85}
    share = graph.outputs("ShaderNodeMapRange", inputs, interpolation_type='SMOOTHSTEP')["Result"]
    bump = graph.node("ShaderNodeBump", {"Strength": 0.8, "Distance": 0.025, "Height": each["Blue"] * 0.6 + fine})
    looks = {"Base Color": graph.mixed(share, brown, grown), "Roughness": 0.95, "Normal": bump}
    surface = graph.node("ShaderNodeBsdfPrincipled", {**looks, "Specular IOR Level": 0.15})
    graph.node("ShaderNodeOutputMaterial", {"Surface": surface})


def _named(graph: Graph, name: str, kind: str, given: dict[str, Any] | None = None, **settings: Any) -> dict[str, Term]:
    """Outputs of a node by which the soil is brought up to date later."""
    return graph.outputs(kind, given, name=name, label=name, **settings)
