# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes of a scene: where each lies, and which comes first. Its layers are populations that know its identity."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, PointerProperty, StringProperty

from ...planting.zones import Limits
from ..placing.properties import GroundMask, TetFloraGround, listeners
from ..settings import properties_of


def _notify(_group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    listeners.notify()


_LIVE = {"options": set(), "update": _notify}
_HIDDEN = {"options": {'HIDDEN'}}


class _Limits:
    """Mix-in: the settings of `planting.zones.Limits`."""

    __annotations__ = vars(properties_of(Limits, **_LIVE))


class TetFloraBiome(bpy.types.PropertyGroup, GroundMask, _Limits):
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
    use_altitude: BoolProperty(
        name="Altitude", description="The biome lies between two heights above the scene's origin", **_LIVE
    )
    paths: PointerProperty(
        name="Paths",
        description="Collection of curves; the biome lies at a distance from them, as seen from above",
        type=bpy.types.Collection,
        **_LIVE,
    )


CLASSES = (TetFloraBiome,)
