# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Remove plants."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ..tetflora_addon.blender.plant_fields import fields_of
from ..tetflora_addon.blender.plant_objects import plants_of, remove_fields, remove_plants
from ..tetflora_addon.blender.populations import recount
from .base import LINKED, Reporting, counted, in_object_mode


class TETFLORA_OT_remove_plants(Reporting, bpy.types.Operator):
    """Delete plants from the scene."""

    bl_idname = "tetflora.remove_plants"
    bl_label = "Remove Plants"
    bl_options = {'REGISTER', 'UNDO'}

    which: EnumProperty(
        name="Which",
        description="Plants to remove",
        items=(
            ('SELECTED', "Selected", "Delete the selected plants; other selected objects stay"),
            ('SPECIES', "Species", "Delete all plants of one species in the scene"),
            ('ALL', "All", "Delete all plants in the scene"),
        ),
        default='SELECTED',
    )
    species: StringProperty(name="Species", description="Identifier of the species to remove", options={'SKIP_SAVE'})

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return properties.bl_rna.properties["which"].enum_items[properties.which].description

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        objects = context.selected_objects if self.which == 'SELECTED' else context.scene.objects
        plants = [o for o in plants_of(objects) if self.which != 'SPECIES' or o.tetflora.species == self.species]
        fields = [] if self.which == 'SPECIES' else fields_of(objects)
        local = [o for o in (*plants, *fields) if o.library is None]
        if (plants or fields) and not local:
            self.report({'WARNING'}, f"{LINKED}; nothing removed")
            return {'CANCELLED'}
        if not local:
            none = {
                'SELECTED': "Select plants first",
                'SPECIES': f'The scene has no plants of species "{self.species}"',
                'ALL': "The scene has no plants",
            }
            self.report({'WARNING'}, f"{none[self.which]}; nothing removed")
            return {'CANCELLED'}
        number = remove_plants(plants) + remove_fields(fields)
        recount(context.scene)
        self.report({'INFO'}, f"{counted(number, 'plant')} removed")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_remove_plants,)
