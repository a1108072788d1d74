# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind of a scene: its settings, and what they are at a frame."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, IntProperty

from ..plants.wind import Wind
from .generated import properties_of

#: Where the middle of the exposure lies from the frame, in times that the shutter is open.
_MIDDLE = {'START': 0.5, 'CENTER': 0.0, 'END': -0.5}
_WIND = properties_of(Wind)


class TetFloraWind(bpy.types.PropertyGroup):
    """Settings of the wind; all but the switch and the loop can be animated."""

    enabled: BoolProperty(
        name="Wind",
        description=(
            "Bend and sway plants, and flutter their leaves, as they are at the refined frame. Results of Refine do "
            "not move; with Refine at Render, each frame of an animation has its own"
        ),
        options=set(),
    )
    speed: _WIND.speed
    direction: _WIND.direction
    gusts: _WIND.gusts
    loop: IntProperty(
        name="Loop",
        description="Number of frames after which all movement repeats exactly; 0 for never",
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
