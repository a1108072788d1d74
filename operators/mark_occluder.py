# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mark meshes as occluders."""

import bpy

from .marking import Marking, action_property


class TETFLORA_OT_mark_occluder(Marking, bpy.types.Operator):
    """Mark the selected meshes as occluders of the plants behind them, or unmark them."""

    bl_idname = "tetflora.mark_occluder"
    bl_label = "Mark as Occluder"
    bl_description = (
        "Mark the selected meshes, such as terrain and buildings, as occluders: plants behind them count as hidden and "
        "cost next to nothing. Use again to unmark"
    )
    bl_options = {'REGISTER', 'UNDO'}
    mark, nothing, marked = "is_occluder", "Select meshes first", "{} marked as occluder"

    action: action_property("Plants behind the meshes count as hidden", "The meshes do not affect refinement")

    @staticmethod
    def fits(obj: bpy.types.Object) -> bool:
        return obj.type == 'MESH'


CLASSES = (TETFLORA_OT_mark_occluder,)
