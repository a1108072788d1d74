# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Re-roll the seeds of plants."""

import bpy
from bpy.props import IntProperty

from ..tetflora_addon.blender.field_edits import reseed_field
from ..tetflora_addon.blender.plant_fields import fields_of, stored_size
from ..tetflora_addon.blender.plant_objects import reseed
from .base import Reporting, counted, plants_or_fields_selected, selected_plants


class TETFLORA_OT_reseed(Reporting, bpy.types.Operator):
    """Make other individuals of the selected plants."""

    bl_idname = "tetflora.reseed"
    bl_label = "Re-roll Seeds"
    bl_description = (
        "Turn each selected plant, and each plant of selected fields, into a different individual of its species. "
        "Copies with the same seed become different"
    )
    bl_options = {'REGISTER', 'UNDO'}

    roll: IntProperty(
        name="Roll", description="A different number gives different plants", min=0, soft_max=100, options={'SKIP_SAVE'}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return plants_or_fields_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        number = reseed(selected_plants(context), self.roll)
        fields = sorted((o for o in fields_of(context.selected_objects) if o.library is None), key=lambda o: o.name)
        for place, field in enumerate(fields):
            reseed_field(field, place, self.roll)
            number += stored_size(field)
        self.report({'INFO'}, f"{counted(number, 'plant')} re-rolled")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_reseed,)
