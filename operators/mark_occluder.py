# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mark meshes as hiding plants."""

import bpy
from bpy.props import EnumProperty

from . import ids
from .base import Reporting, counted


class TETFLORA_OT_mark_occluder(Reporting, bpy.types.Operator):
    """Mark the selected meshes as hiding the plants behind them, or take the mark away."""

    bl_idname = ids.MARK_OCCLUDER
    bl_label = "Mark as Hiding Plants"
    bl_description = (
        "Mark the selected meshes, such as terrain and buildings, as hiding plants: what stands behind them costs "
        "next to nothing. Again to take the mark away"
    )
    bl_options = {'REGISTER', 'UNDO'}

    action: EnumProperty(
        name="Action",
        description="What happens to the mark",
        items=(
            ('TOGGLE', "Toggle", "Mark all, or unmark them if all are marked"),
            ('MARK', "Mark", "Plants behind the meshes count as hidden"),
            ('UNMARK', "Unmark", "The meshes do not matter to refinement"),
        ),
        default='TOGGLE',
        options={'SKIP_SAVE'},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if any(o.type == 'MESH' or o.tetflora.is_occluder for o in context.selected_objects):
            return True
        cls.poll_message_set("Select meshes first")
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        # Something marked that has since been converted can still be unmarked.
        meshes = [o for o in context.selected_objects if o.type == 'MESH' or o.tetflora.is_occluder]
        mark = self.action == 'MARK' or (self.action == 'TOGGLE' and not all(o.tetflora.is_occluder for o in meshes))
        for obj in meshes:
            obj.tetflora.is_occluder = mark and obj.type == 'MESH'
        number = counted(len(meshes), "object")
        self.report({'INFO'}, f"Plants behind {number} count as hidden" if mark else f"{number} unmarked")
        return {'FINISHED'}
