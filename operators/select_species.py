# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Select plants by species."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ..tetflora_addon.blender.plant_objects import plants_of
from .base import Reporting, counted


class TETFLORA_OT_select_species(Reporting, bpy.types.Operator):
    """Select all plants of a species."""

    bl_idname = "tetflora.select_species"
    bl_label = "Select Species"
    bl_description = "Select all plants of the same species as the active plant"
    bl_options = {'REGISTER', 'UNDO'}

    species: StringProperty(
        name="Species",
        description="Identifier of the species, which need not be in the catalog; that of the active plant if not set",
        options={'SKIP_SAVE'},
    )
    extend: BoolProperty(name="Extend", description="Extend the current selection", options={'SKIP_SAVE'})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != 'OBJECT':
            cls.poll_message_set("Only available in Object Mode")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        if not self.species:
            active = context.active_object
            if active is None or not active.tetflora.is_plant:
                self.report({'ERROR'}, "The active object must be a plant; select one")
                return {'CANCELLED'}
            self.species = active.tetflora.species
        found = [o for o in plants_of(context.view_layer.objects) if o.tetflora.species == self.species]
        if not self.extend:
            for obj in context.selected_objects:
                obj.select_set(False)
        for obj in found:
            obj.select_set(True)
        self.report({'INFO'}, f'{counted(len(found), "plant")} of species "{self.species}" selected')
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_select_species,)
