# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes of a scene: where each lies, and which comes first. Its layers are populations that know its identity."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, PointerProperty, StringProperty

from ...planting.zones import Limits
from ..placing.properties import TetFloraGround, listeners
from ..settings import properties_of


def _notify(_group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    listeners.notify()


_LIVE = {"options": set(), "update": _notify}
_HIDDEN = {"options": {'HIDDEN'}}
_LIMITS = properties_of(Limits, **_LIVE)


class TetFloraBiome(bpy.types.PropertyGroup):
    """One biome of a scene."""

    name: StringProperty(name="Name", description="Name of the biome")
    uid: StringProperty(name="Identity", **_HIDDEN)
    source: StringProperty(name="Source", **_HIDDEN)  # identifier of the file that it was made from
    data: StringProperty(name="Data", **_HIDDEN)  # of the file: what is not in populations, as JSON
    grounds: CollectionProperty(name="Grounds", description="Meshes that the biome grows on", type=TetFloraGround)
    gives_way: BoolProperty(
        name="Give Way",
        description=(
            "Leave the ground that others take by their mask and limits to these: to those above this one in the list "
            "or, if this one has no limits, to all. Where their edge is soft, the biomes blend"
        ),
        default=True,
        **_LIVE,
    )

    vertex_group: StringProperty(
        name="Vertex Group",
        description="Vertex group of the ground whose weights say where the biome is: 0 is elsewhere, 1 is within",
        **_LIVE,
    )
    invert_group: BoolProperty(name="Invert Vertex Group", description="Weight 1 is elsewhere, 0 is within", **_LIVE)
    image: PointerProperty(
        name="Image",
        description="Image whose brightness says where the biome is: black is elsewhere, white is within",
        type=bpy.types.Image,
        **_LIVE,
    )
    invert_image: BoolProperty(name="Invert Image", description="White is elsewhere, black is within", **_LIVE)
    uv_layer: StringProperty(
        name="UV Map",
        description="UV map of the ground for the image; the active one if empty",
        **_LIVE,
    )
    slope_min: _LIMITS.slope_min
    slope_max: _LIMITS.slope_max
    slope_softness: _LIMITS.slope_softness
    use_altitude: BoolProperty(
        name="Altitude", description="The biome lies between two heights above the scene's origin", **_LIVE
    )
    altitude_min: _LIMITS.altitude_min
    altitude_max: _LIMITS.altitude_max
    altitude_softness: _LIMITS.altitude_softness
    wetness_min: _LIMITS.wetness_min
    wetness_max: _LIMITS.wetness_max
    wetness_softness: _LIMITS.wetness_softness
    paths: PointerProperty(
        name="Paths",
        description="Collection of curves; the biome lies at a distance from them, as seen from above",
        type=bpy.types.Collection,
        **_LIVE,
    )
    path_min: _LIMITS.path_min
    path_max: _LIMITS.path_max
    path_softness: _LIMITS.path_softness


CLASSES = (TetFloraBiome,)
