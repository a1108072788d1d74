# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Crowns of RAMI as TetFlora's plants: species whose leaves fill a solid, and materials without what RAMI has not.

Leaves of the species are as large as the discs and as many, evenly in the same solids; unlike RAMI's they may cut each
other.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import bpy
import numpy as np

from tetflora_addon.blender.compat import shader_tree
from tetflora_addon.blender.materials import microsphere
from tetflora_addon.blender.materials.nodes import Graph
from tetflora_addon.blender.placing import plant_objects
from tetflora_addon.blender.species import edits
from tetflora_addon.planting.places import Placement

from .rami_discs import CORNERS, Canopy, Solid

#: Wood of what has none: a thread of so much of its length.
_THREAD = {"thickness": 0.001, "taper": 0, "sides": 3}
#: Reflectance of the thread.
_BARK = 0.16


def species_data(name: str, solid: Solid) -> dict:
    """A species file with a crown of discs on its trunk, or on a thread through it."""
    albedo = solid.reflectance + solid.transmittance
    order = {
        "length": solid.height,
        **_THREAD,
        "leaves": solid.discs,
        "leaf_size": 2 * solid.disc_radius,
        "leaf_envelope": solid.shape,
        "leaf_envelope_radius": solid.radius / solid.height,
        "leaf_inclination": solid.inclination,
        "leaf_light": 0,
        "leaf_start": 0,
        "leaf_color": [[albedo] * 3, [0, 0, 0]],
        "branch_color": [[_BARK] * 3, [0, 0, 0]],
    }
    orders = [order]
    if solid.trunk:
        height, radius, reflectance = solid.trunk
        color = [[reflectance] * 3, [0, 0, 0]]
        trunk = {"length": height, "thickness": radius / height, "taper": 1, "sides": 16, "branch_color": color}
        trunk |= {"branches": 1, "branch_start": 0.99}
        orders = [trunk, order | {"length": solid.height / height, "azimuth": [0, 0]}]
    return {
        "format": 1,
        "name": name,
        "leaf": [_disc()],
        "leaf_transmission": solid.transmittance / albedo,
        "orders": orders,
    }


def _disc() -> dict:
    """A flat leaf of length 1 with the area of a disc of that diameter."""
    reach = 0.5 * sqrt(2 * pi / (CORNERS * sin(2 * pi / CORNERS)))
    turns = [(i + 0.5) * 2 * pi / CORNERS for i in range(CORNERS)]
    around = [[round(reach * cos(turn), 6), round(0.5 + reach * sin(turn), 6)] for turn in turns]
    uv = [[round(min(max(x + 0.5, 0), 1), 6), round(min(max(y, 0), 1), 6)] for x, y in around]
    return {"vertices": [[x, y, 0.0] for x, y in around], "faces": [list(range(CORNERS))], "uv": uv}


def add_plants(scene: bpy.types.Scene, stand: Canopy, rings: int | None = None) -> None:
    """One field of all crowns as plants; copies around the scene have the seeds of what they repeat."""
    for kind, solid in stand.solids.items():
        edits.store_species(scene, identifier(stand, kind), species_data(f"{stand.name} {kind}", solid))
    kinds, places, seeds = [], [], []
    for number, (kind, solid) in enumerate(stand.solids.items()):
        place = stand.padded(kind, rings)
        if solid.shape == "sphere":
            place = place - (0.0, 0.0, solid.radius)
        places.append(place)
        kinds.append(np.full(len(place), number, np.int32))
        seeds.append(np.arange(len(place)) % len(stand.places[kind]))
    position = np.concatenate(places)
    n = len(position)
    planted = Placement(
        position, np.zeros(n), np.ones(n), np.concatenate(kinds), np.concatenate(seeds).astype(np.int32), n
    )
    plant_objects.add_field(scene, planted, [identifier(stand, kind) for kind in stand.solids])


def add_one(scene: bpy.types.Scene, stand: Canopy, kind: str, seed: int) -> bpy.types.Object:
    """One crown as a plant at the origin of its kind's crowns."""
    solid = stand.solids[kind]
    edits.store_species(scene, identifier(stand, kind), species_data(f"{stand.name} {kind}", solid))
    below = solid.radius if solid.shape == "sphere" else 0.0
    one = Placement(np.array([[0.0, 0.0, -below]]), np.zeros(1), np.ones(1), np.zeros(1, np.int32), np.array([seed]), 1)
    return plant_objects.add_field(scene, one, [identifier(stand, kind)])


def identifier(stand: Canopy, kind: str) -> str:
    """Name by which plants refer to the species of a kind of crown."""
    return f"{stand.name.lower()}-{kind}"


def make_lambertian() -> None:
    """Take gloss and tints out of all materials that TetFlora has made in this file, and patterns from leaves and wood.

    Proxies keep their own nodes: inside of the groups that they share, what is led to gloss and tint is cut off.
    """
    for name in (microsphere.SCATTER, microsphere.MICROSPHERE):
        group = bpy.data.node_groups.get(name)
        if group is not None:
            _without(group, {"Gloss": 0.0, "Reflected Tint": microsphere.WHITE, "Through Tint": microsphere.WHITE})
    for material in bpy.data.materials:
        if material.name.startswith("TetFlora ") and material.name.endswith((" leaf", " bark")):
            graph = Graph(shader_tree(material))
            looks = {"Color": graph.attribute("tf_color", "Color")}
            if material.name.endswith(" leaf"):
                looks["Transmission"] = graph.attribute("tf_transmission", "Fac")
            looks["Normal"] = graph.node("ShaderNodeNewGeometry").outputs["Normal"]
            surface = graph.node("ShaderNodeGroup", looks, node_tree=microsphere.scatter_group())
            graph.node("ShaderNodeOutputMaterial", {"Surface": surface})


def _without(group: bpy.types.NodeTree, values: dict) -> None:
    """Put values in place of some inputs of a group, inside of it."""
    for link in list(group.links):
        if link.from_node.type == 'GROUP_INPUT' and link.from_socket.name in values:
            socket, value = link.to_socket, values[link.from_socket.name]
            group.links.remove(link)
            socket.default_value = value
