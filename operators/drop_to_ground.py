# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Let plants fall onto the ground."""

import bpy

from ..tetflora_addon.blender.field_edits import editable
from ..tetflora_addon.blender.ground import Ground
from ..tetflora_addon.blender.grounding import drop_field, drop_plants
from ..tetflora_addon.blender.plant_fields import fields_of
from .base import Reporting, counted, in_object_mode, plants_or_fields_selected, selected_plants


class TETFLORA_OT_drop_to_ground(Reporting, bpy.types.Operator):
    """Move the selected plants up or down onto the ground."""

    bl_idname = "tetflora.drop_to_ground"
    bl_label = "Drop Plants to Ground"
    bl_description = (
        "Move the selected plants, and the plants of selected fields, vertically to the nearest visible mesh. Plants, "
        "results and refined meshes do not count as ground"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context) and plants_or_fields_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()
        depsgraph = context.evaluated_depsgraph_get()
        ground = Ground(context.view_layer, depsgraph)
        if not len(ground):
            self.report({'ERROR'}, "No mesh is visible below or above the plants; add a ground mesh, or show it")
            return {'CANCELLED'}
        plants = selected_plants(context)
        fields = fields_of(context.selected_objects)
        moved, missed = drop_plants(plants, ground)
        for field in fields:
            if editable(field):
                more, none = drop_field(field, ground)
                moved, missed = moved + more, missed + none
        left = [field.name for field in fields if not editable(field)]
        notes = [f"{counted(missed, 'plant')} had no ground below or above"] if missed else []
        if left:
            notes.append(f'"{left[0]}" was not moved: it has modifiers, or was not created by TetFlora')
        said = f"{counted(moved, 'plant')} moved to the ground"
        self.report({'WARNING' if notes else 'INFO'}, "; ".join([said, *notes]))
        return {'FINISHED'} if moved else {'CANCELLED'}


CLASSES = (TETFLORA_OT_drop_to_ground,)
