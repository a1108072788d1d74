# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Soil by nodes, in the colors of what lies and grows on it: a map of them over the ground, and noise for all that is
finer than its cells.

The map is an image that is packed into the file. It is laid on the ground from above by world coordinates, so that it
fits meshes of any resolution, with or without UV maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import srgb_of
from ..compat import shader_tree
from .nodes import Graph, find_socket

#: On materials and images of the soil, so that they may be renamed.
MARK = "tetflora_soil"
#: How bright low plants are together, of how bright one blade is: they shade each other.
SHADED = 0.72
_PLACE, _SIZE, _MAP, _GREEN = "Soil Corner", "Soil Size", "Soil Map", "Soil Green"


def is_soil(material: bpy.types.Material | None) -> bool:
    """Whether a material is one that `soil_material` made and may bring up to date."""
    return material is not None and bool(material.get(MARK)) and material.library is None


def lay_soil(
    name: str,
    grounds: Sequence[bpy.types.Object],
    colours: NDArray[np.float64],
    green: NDArray[np.float64],
    tint: NDArray[np.float64],
    low: NDArray[np.float64],
    cell: float,
) -> list[str]:
    """Give grounds a soil, see `soil_material`, of square cells, meters; names of those that keep the artist's own."""
    fits = [obj for obj in grounds if may_have_soil(obj)]
    before = next((slot.material for obj in fits for slot in obj.material_slots if is_soil(slot.material)), None)
    material = soil_material(name, colours, green, tint, low, cell * np.array(green.shape[::-1]), before)
    for obj in fits:
        if obj.material_slots:
            obj.material_slots[0].material = material
        else:
            obj.data.materials.append(material)
    kept = [obj.name for obj in grounds if obj not in fits]
    if kept:
        material.use_fake_user = True  # for the artist to use
    return kept


def may_have_soil(obj: bpy.types.Object) -> bool:
    """Whether a ground is of this file and has no material but soil."""
    local = obj.library is None and obj.data.library is None and obj.override_library is None
    return local and all(slot.material is None or is_soil(slot.material) for slot in obj.material_slots)


def soil_material(
    name: str,
    colours: NDArray[np.float64],
    green: NDArray[np.float64],
    tint: NDArray[np.float64],
    low: NDArray[np.float64],
    size: NDArray[np.float64],
    material: bpy.types.Material | None = None,
) -> bpy.types.Material:
    """A material for the ground, or the given one with another map.

    Parameters
    ----------
    name : str
    colours : (rows, columns, 3) float64
        Linear RGB of soil and what lies on it; the first row is at the smallest y.
    green : (rows, columns) float64
        Fraction of the ground that plants hide.
    tint : (3,) float64
        Their mean linear RGB.
    low, size : (2,) float64
        Corner and extent of the map, meters in world space.
    material : bpy.types.Material, optional
        Soil of before. What the artist changed in its nodes stays.
    """
    image = _image(name, colours, green)
    nodes = None if material is None else shader_tree(material).nodes
    if nodes is None or any(nodes.get(key) is None for key in (_PLACE, _SIZE, _MAP, _GREEN)):
        if material is None:
            material = bpy.data.materials.new(name)
            material[MARK] = True
        material.diffuse_color = (*(float(c) for c in colours.mean(axis=(0, 1))), 1.0)
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


def _image(name: str, colours: NDArray[np.float64], green: NDArray[np.float64]) -> bpy.types.Image:
    """The map: colors as the display has them, so that eight bits are enough for dark ones, and the green in alpha."""
    rows, columns = green.shape
    image = bpy.data.images.new(name, columns, rows, alpha=True)
    image[MARK] = True
    image.alpha_mode = 'CHANNEL_PACKED'
    encoded = srgb_of(np.clip(colours, 0.0, 1.0))
    pixels = np.concatenate([encoded, np.clip(green, 0.0, 1.0)[..., None]], axis=2)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    image.pack()
    return image


def _build(graph: Graph) -> None:
    """Soil: the map from above, crumbs and old leaves by noise, and green in patches as large as its fraction."""
    place = graph.node("ShaderNodeNewGeometry").outputs["Position"]
    low, size = (graph.node("ShaderNodeCombineXYZ", {"Z": z}) for z in (0.0, 1.0))
    low.name = low.label = _PLACE
    size.name = size.label = _SIZE
    across = graph.vector('DIVIDE', graph.vector('SUBTRACT', place, low), size)
    ground = graph.node(
        "ShaderNodeTexImage", {"Vector": across}, interpolation='Cubic', extension='EXTEND', projection='FLAT'
    )
    ground.name = ground.label = _MAP
    broad, fine = _noise(graph, place, 1.3, 4.0), _noise(graph, place, 24.0, 6.0)
    leaves = graph.node("ShaderNodeTexVoronoi", {"Vector": _bent(graph, place, fine), "Scale": 26.0, "Randomness": 1.0})
    each = graph.node("ShaderNodeSeparateColor", {"Color": leaves.outputs["Color"]}).outputs
    # All factors are 1 on average, so that the mean is that of the map.
    tone = graph.math('MULTIPLY_ADD', each["Red"], 0.9, 0.55)
    tone = graph.math('MULTIPLY', tone, graph.math('MULTIPLY_ADD', fine, 1.7, 0.15))
    tone = graph.math('MULTIPLY', tone, graph.math('MULTIPLY_ADD', broad, 0.7, 0.65))
    warm = graph.math('MULTIPLY_ADD', each["Green"], 0.3, -0.15)
    tint = graph.node(
        "ShaderNodeCombineColor",
        {"Red": graph.math('ADD', 0.9, warm), "Green": 0.9, "Blue": graph.math('SUBTRACT', 0.9, warm)},
    )
    brown = graph.scaled(graph.tinted(ground.outputs["Color"], tint), graph.math('MULTIPLY', tone, 1.1))
    growth = graph.node("ShaderNodeRGB")
    growth.name = growth.label = _GREEN
    grown = graph.scaled(growth.outputs[0], graph.math('MULTIPLY_ADD', fine, 1.6, 0.2))
    # Noise is close to normally distributed around a half: from where the fraction says, the ground is green.
    patches = graph.math('MULTIPLY_ADD', broad, 0.5, graph.math('MULTIPLY', _noise(graph, place, 7.0, 5.0), 0.5))
    edge = graph.math('MULTIPLY_ADD', ground.outputs["Alpha"], -0.4, 0.7)
    share = graph.node(
        "ShaderNodeMapRange",
        {
            "Value": graph.math('SUBTRACT', patches, edge),
            "From Min": -0.05,
            "From Max": 0.05,
            "To Min": 0.0,
            "To Max": 0.85,
        },
        interpolation_type='SMOOTHSTEP',
    ).outputs[0]
    colour = graph.node("ShaderNodeMix", {"Factor_Float": share, "A_Color": brown, "B_Color": grown}, data_type='RGBA')
    height = graph.math('MULTIPLY_ADD', each["Blue"], 0.6, fine)
    bump = graph.node("ShaderNodeBump", {"Strength": 0.8, "Distance": 0.025, "Height": height})
    surface = graph.node(
        "ShaderNodeBsdfPrincipled",
        {"Base Color": find_socket(colour.outputs, "Result_Color"), "Roughness": 0.95, "Normal": bump},
    )
    level = next((s for s in surface.inputs if s.name in ("Specular IOR Level", "Specular")), None)
    if level is not None:
        level.default_value = 0.15
    graph.node("ShaderNodeOutputMaterial", {"Surface": surface})


def _noise(graph: Graph, place: Any, scale: float, detail: float) -> Any:
    return graph.node("ShaderNodeTexNoise", {"Vector": place, "Scale": scale, "Detail": detail}).outputs[0]


def _bent(graph: Graph, place: Any, noise: Any) -> Any:
    """Places moved a little by noise, so that cells get ragged outlines."""
    moved = graph.math('MULTIPLY_ADD', noise, 0.03, -0.015)
    return graph.vector('ADD', place, graph.node("ShaderNodeCombineXYZ", {"X": moved, "Y": moved, "Z": moved}))
