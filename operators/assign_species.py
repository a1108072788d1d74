# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Change the species of plants."""

import bpy
from bpy.props import EnumProperty

from ..tetflora_addon.blender.field_edits import assign_field_species
from ..tetflora_addon.blender.plant_fields import fields_of, stored_size
from ..tetflora_addon.blender.plant_objects import assign_species
from ..tetflora_addon.blender.species_items import NO_SPECIES, operator_items
from .base import Reporting, counted, plants_or_fields_selected, selected_plants


class TETFLORA_OT_assign_species(Reporting, bpy.types.Operator):
    """Give the selected plants, and those of selected fields, another species."""

    bl_idname = "tetflora.assign_species"
    bl_label = "Change Species"
    bl_description = (
        "Assign this species to all selected plants and to all plants of selected fields. Seeds, scales and positions "
        "do not change"
    )
    bl_options = {'REGISTER', 'UNDO'}

    species: EnumProperty(name="Species", description="Species from the catalog", items=operator_items)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return plants_or_fields_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        if self.species in {"", NO_SPECIES}:
            self.report({'ERROR'}, "Choose a species")
            return {'CANCELLED'}
        changed = assign_species(selected_plants(context), self.species)
        for field in fields_of(context.selected_objects):
            if assign_field_species(field, self.species):
                changed += stored_size(field)
        self.report({'INFO'}, f"{counted(changed, 'plant')} changed")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_assign_species,)
