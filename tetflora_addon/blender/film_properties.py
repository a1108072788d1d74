# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of animations as properties of a scene: what frames share, and the size of the frame cache."""

import math

from bpy.props import BoolProperty, FloatProperty


class AnimationProperties:
    """Part of the settings of a scene."""

    share_frames: BoolProperty(
        name="Share Between Frames",
        description=(
            "Where the camera is animated, refine once for all frames with similar cameras, slightly finer and wider "
            "than a single one needs. A frame looks the same whichever frames are rendered before it"
        ),
        default=True,
    )
    cell_length: FloatProperty(
        name="Within Distance",
        description=(
            "How far the camera moves along its line of sight before plants are refined again. Larger values are "
            "faster, with more geometry per frame; use 0.1 m or less for close-ups of single plants. Doubled, "
            "quadrupled and so on where all plants are far away"
        ),
        subtype='DISTANCE',
        default=4.0,
        min=0.001,
        soft_min=0.1,
        soft_max=50.0,
    )
    cell_turn: FloatProperty(
        name="Within Angle",
        description="How far the camera turns before plants are refined again. The view is widened by the same angle",
        subtype='ANGLE',
        default=math.radians(3.0),
        min=math.radians(0.05),
        soft_max=math.radians(20.0),
        max=math.radians(40.0),
    )
    kept_memory: FloatProperty(
        name="Frame Cache",
        description=(
            "Maximum size of the frame cache in gigabytes. A render keeps meshes for frames in which the camera "
            "returns; the least recently used go first. The current frame itself is not limited"
        ),
        default=1.0,
        min=0.0,
        soft_max=64.0,
        precision=1,
    )
