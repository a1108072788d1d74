# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mark meshes as hiding plants."""

import bpy

from .marking import Marking, action_property


class TETFLORA_OT_mark_occluder(Marking, bpy.types.Operator):
    """Mark the selected meshes as hiding the plants behind them, or take the mark away."""

    bl_idname = "tetflora.mark_occluder"
    bl_label = "Mark as Hiding Plants"
    bl_description = (
        "Mark the selected meshes, such as terrain and buildings, as hiding plants: what stands behind them costs "
        "next to nothing. Again to take the mark away"
    )
    bl_options = {'REGISTER', 'UNDO'}
    mark, nothing, marked = "is_occluder", "Select meshes first", "Plants behind {} count as hidden"

    action: action_property("Plants behind the meshes count as hidden", "The meshes do not matter to refinement")

    @staticmethod
    def fits(obj: bpy.types.Object) -> bool:
        return obj.type == 'MESH'


CLASSES = (TETFLORA_OT_mark_occluder,)
