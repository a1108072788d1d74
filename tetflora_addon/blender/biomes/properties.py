# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes of a scene: where each lies, and which comes first. Its layers are populations that know its identity."""

from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, PointerProperty, StringProperty

from ...files import parse_json
from ...planting.zones import Limits
from ..placing.properties import HIDDEN, LIVE, GroundMask, TetFloraGround
from ..settings import settings_in

#: Ground: linear RGB of bare soil and of turf, the share that turf hides; and the shape of ground that is made for it:
#: hills in meters, slope in degrees, depth of a brook's valley in meters. Least and most of each number.
GROUND = {
    "earth": ((0.036, 0.025, 0.016), 0.0, 1.0),
    "turf": ((0.05, 0.08, 0.02), 0.0, 1.0),
    "turf_share": (0.0, 0.0, 1.0),
    "hills": (2.0, 0.0, 30.0),
    "slope": (0.0, 0.0, 45.0),
    "valley": (0.0, 0.0, 30.0),
}


class TetFloraBiome(bpy.types.PropertyGroup, GroundMask, settings_in(Limits, **LIVE)):
    """One biome of a scene."""

    name: StringProperty(name="Name", description="Name of the biome")
    uid: StringProperty(name="Identity", **HIDDEN)
    source: StringProperty(name="Source", **HIDDEN)  # identifier of the file that it was made from
    data: StringProperty(name="Data", **HIDDEN)  # of the file: what is not in populations, as JSON
    grounds: CollectionProperty(name="Grounds", description="Meshes that the biome grows on", type=TetFloraGround)
    gives_way: BoolProperty(
        name="Give Way",
        description=(
            "Leave the ground that others take by their mask and limits to these: to those above this one in the list "
            "or, if this one has no limits, to all. Where their edge is soft, the biomes blend"
        ),
        default=True,
        **LIVE,
    )
    paths: PointerProperty(
        name="Paths",
        description="Collection of curves; the biome lies at a distance from them, as seen from above",
        type=bpy.types.Collection,
        **LIVE,
    )


def data_of(biome: bpy.types.PropertyGroup) -> dict[str, Any]:
    """What a biome keeps of its file beside its layers; nothing where that cannot be read."""
    try:
        data = parse_json(biome.data) if biome.data else {}
    except ValueError:
        data = {}
    return data if isinstance(data, dict) else {}


CLASSES = (TetFloraBiome,)
