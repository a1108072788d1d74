# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Re-roll the seeds of plants."""

import bpy
from bpy.props import IntProperty

from ..tetflora_addon.blender.plant_objects import reseed
from . import ids
from .base import Reporting, counted, plants_selected, selected_plants


class TETFLORA_OT_reseed(Reporting, bpy.types.Operator):
    """Make other individuals of the selected plants."""

    bl_idname = ids.RESEED
    bl_label = "Re-roll Seeds"
    bl_description = (
        "Turn each selected plant into another individual of its species. Copies that share a seed become different"
    )
    bl_options = {'REGISTER', 'UNDO'}

    roll: IntProperty(
        name="Roll", description="Another number gives other plants", min=0, soft_max=100, options={'SKIP_SAVE'}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return plants_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        number = reseed(selected_plants(context), self.roll)
        self.report({'INFO'}, f"{counted(number, 'plant')} re-rolled")
        return {'FINISHED'}
