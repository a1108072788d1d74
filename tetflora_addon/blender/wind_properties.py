# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind of a scene: its settings, and what they are at a frame."""

from __future__ import annotations

from math import radians

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ..plants.wind import Wind

#: Where the middle of the exposure lies from the frame, in times that the shutter is open.
_MIDDLE = {'START': 0.5, 'CENTER': 0.0, 'END': -0.5}


class TetFloraWind(bpy.types.PropertyGroup):
    """Settings of the wind; all but the switch and the loop can be animated."""

    enabled: BoolProperty(
        name="Wind",
        description=(
            "Plants bend and sway, and their leaves flutter, at the frame that is refined. Results that are made for "
            "one frame stay as they are: with Refine at Render each frame of a film has its own"
        ),
        options=set(),
    )
    speed: FloatProperty(
        name="Speed",
        description=(
            "Mean speed at the plants, metres a second: 2 stirs leaves, 4 is a gentle breeze, 10 sways trees, 20 is a "
            "gale. Animate it slowly: the plants lean at once"
        ),
        default=4.0,
        min=0.0,
        soft_max=25.0,
        max=100.0,
    )
    direction: FloatProperty(
        name="Direction",
        description="Where it blows to: 0 is along X, 90 degrees along Y",
        subtype='ANGLE',
        default=0.0,
        soft_min=radians(-180.0),
        soft_max=radians(180.0),
    )
    gusts: FloatProperty(
        name="Gusts",
        description="By what share gusts are stronger than the mean, and lulls weaker; they travel with the wind",
        subtype='FACTOR',
        default=0.5,
        min=0.0,
        max=1.0,
    )
    loop: IntProperty(
        name="Loop",
        description="Frames after which all movement repeats exactly; 0 for never",
        default=0,
        min=0,
        soft_max=1000,
        options=set(),
    )


def wind_of(scene: bpy.types.Scene) -> Wind | None:
    """The wind at the scene's frame, the part of a frame included; None where none blows.

    With motion blur it is that of the middle of the exposure, from which Cycles goes back and forth by velocities. The
    scene's range of frames has no say: workers of a farm set it to the frames that they render.
    """
    group = scene.tetflora.wind
    if not group.enabled or group.speed == 0.0:
        return None
    rate = scene.render.fps / scene.render.fps_base
    frame = scene.frame_current_final
    if group.loop:
        frame %= group.loop  # here, where frames are whole numbers, it is exact
    blurred = scene.render.use_motion_blur
    if blurred:
        frame += _MIDDLE[scene.render.motion_blur_position] * scene.render.motion_blur_shutter
    return Wind(group.speed, group.direction, group.gusts, frame / rate, group.loop / rate, blurred)


CLASSES = (TetFloraWind,)
