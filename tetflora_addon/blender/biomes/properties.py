# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What biomes keep of their files beside their layers, and the numbers of their ground."""

from typing import Any

import bpy

from ...files import parse_json

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


def data_of(biome: bpy.types.PropertyGroup) -> dict[str, Any]:
    """What a biome keeps of its file beside its layers; nothing where that cannot be read."""
    try:
        data = parse_json(biome.data) if biome.data else {}
    except ValueError:
        data = {}
    return data if isinstance(data, dict) else {}
