# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of animations as properties of a scene: what frames share, and the size of the frame cache."""

from bpy.props import BoolProperty, FloatProperty

from ..refinement.view_cells import ViewCells
from .generated import properties_of

_CELLS = properties_of(ViewCells)


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
    cell_length: _CELLS.length
    cell_turn: _CELLS.turn
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
