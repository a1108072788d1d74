# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mark objects whose own polygons are refined."""

import bpy
from bpy.props import EnumProperty

from ..tetflora_addon.blender.explicit_objects import SURFACE_TYPES
from ..tetflora_addon.blender.plant_copies import may_instance
from . import ids
from .base import Reporting, counted


def can_be_explicit(obj: bpy.types.Object) -> bool:
    """Whether an object has a surface of its own that could be refined, or instances some."""
    group = obj.tetflora
    return not (group.is_plant or group.is_field) and (obj.type in SURFACE_TYPES or may_instance(obj))


class TETFLORA_OT_mark_explicit(Reporting, bpy.types.Operator):
    """Let the selected objects' own polygons take part in refinement, or take the mark away."""

    bl_idname = ids.MARK_EXPLICIT
    bl_label = "Refine These Meshes"
    bl_description = (
        "Refine the selected objects' own polygons with the plants: trees from elsewhere, rocks, scans, and what "
        "instances them. Again to take the mark away"
    )
    bl_options = {'REGISTER', 'UNDO'}

    action: EnumProperty(
        name="Action",
        description="What happens to the mark",
        items=(
            ('TOGGLE', "Toggle", "Mark all, or unmark them if all are marked"),
            ('MARK', "Mark", "Their polygons are refined"),
            ('UNMARK', "Unmark", "They are left as they are"),
        ),
        default='TOGGLE',
        options={'SKIP_SAVE'},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if any(can_be_explicit(o) or o.tetflora.is_explicit for o in context.selected_objects):
            return True
        cls.poll_message_set("Select meshes, or what instances them, first")
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        # Something marked that has since become a plant can still be unmarked.
        chosen = [o for o in context.selected_objects if can_be_explicit(o) or o.tetflora.is_explicit]
        mark = self.action == 'MARK' or (self.action == 'TOGGLE' and not all(o.tetflora.is_explicit for o in chosen))
        for obj in chosen:
            obj.tetflora.is_explicit = mark and can_be_explicit(obj)
        number = counted(len(chosen), "object")
        self.report({'INFO'}, f"{number} will be refined" if mark else f"{number} unmarked")
        return {'FINISHED'}
