# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of films as properties of a scene: what frames share, and how much of it is kept."""

import math

from bpy.props import BoolProperty, FloatProperty


class FilmProperties:
    """Part of the settings of a scene."""

    share_frames: BoolProperty(
        name="Share Between Frames",
        description=(
            "Where the camera is animated, refine once for all frames whose cameras are nearly alike, and somewhat "
            "finer and wider than one of them needs. A frame looks the same whichever others are rendered before it"
        ),
        default=True,
    )
    cell_length: FloatProperty(
        name="Within Distance",
        description=(
            "How far the camera goes, along its line of sight, until plants are refined anew. Larger is faster, and "
            "more is made for each frame; 0.1 m and less are for close-ups of single plants. Where all plants are far "
            "away it is two, four or more times as far"
        ),
        subtype='DISTANCE',
        default=4.0,
        min=0.001,
        soft_min=0.1,
        soft_max=50.0,
    )
    cell_turn: FloatProperty(
        name="Within Angle",
        description="How far the camera turns until plants are refined anew. The view is widened by as much",
        subtype='ANGLE',
        default=math.radians(3.0),
        min=math.radians(0.05),
        soft_max=math.radians(20.0),
        max=math.radians(40.0),
    )
    kept_memory: FloatProperty(
        name="Keep at Most",
        description=(
            "Gigabytes of meshes that a render keeps for frames that come back to where the camera was; what has not "
            "been seen for longest goes first. What the frame itself needs is not limited by it"
        ),
        default=1.0,
        min=0.0,
        soft_max=64.0,
        precision=1,
    )
