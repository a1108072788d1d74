# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of plants: mark objects as fields, make a field of plants that are objects, and plants of a field."""

import bpy

from ..tetflora_addon.blender.plant_fields import FIELD_TYPES, fields_of
from ..tetflora_addon.blender.plant_objects import field_from_plants, plants_from_field, plants_of, prepare_scene
from ..tetflora_addon.blender.population_properties import MOST_EMPTIES
from ..tetflora_addon.blender.populations import adopt, collection_of, owner_of
from ..tetflora_addon.blender.species_items import default_species
from .base import Reporting, counted, in_object_mode, plants_selected, select_only, selected_plants


class TETFLORA_OT_mark_field(Reporting, bpy.types.Operator):
    """Use the active mesh or point cloud as a field of plants, or no longer."""

    bl_idname = "tetflora.mark_field"
    bl_label = "Use as Field of Plants"
    bl_description = (
        "Use each point of the active mesh or point cloud, after modifiers, as a plant. The attributes species, seed, "
        "rotation and scale define the plants. Use again to turn it off"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        active = context.active_object
        if active is not None and (active.type in FIELD_TYPES or active.tetflora.is_field):
            return True
        cls.poll_message_set("The active object must be a mesh or point cloud; select it last")
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        obj = context.active_object
        field = obj.tetflora
        field.is_field = not field.is_field
        if not field.is_field:
            self.report({'INFO'}, f'"{obj.name}" is no longer a field of plants')
            return {'FINISHED'}
        field.is_plant = False
        if not field.field_species:
            field.field_species.add().species = field.species or default_species()
        prepare_scene(context.scene)
        self.report({'INFO'}, f'The points of "{obj.name}" are now plants')
        return {'FINISHED'}


class TETFLORA_OT_make_field(Reporting, bpy.types.Operator):
    """Make one field of the selected plants."""

    bl_idname = "tetflora.make_field"
    bl_label = "Convert Plants to Field"
    bl_description = (
        "Replace the selected plants with one object whose vertices are the same plants. This keeps Blender fast with "
        "many plants; parents, constraints and animation of single plants are lost"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context) and plants_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        selected = plants_of(context.selected_objects)
        plants = [o for o in selected_plants(context) if o.tetflora.enabled and not o.hide_render]
        if not plants:
            self.report(
                {'WARNING'},
                "The selected plants are disabled, hidden in renders, or linked; enable them first",
            )
            return {'CANCELLED'}
        left = len(selected) - len(plants)
        owner = owner_of(context.scene, plants)
        home = collection_of(context.scene, owner) if owner else None
        field = field_from_plants(context.scene, context.evaluated_depsgraph_get(), plants, home)
        if owner:  # or its next update would plant them once more
            adopt(context.scene, owner, [field])
        select_only(context, [field])
        rest = f"; {counted(left, 'plant')} not converted: disabled, hidden in renders, or linked" if left else ""
        self.report({'INFO'}, f'{counted(len(plants), "plant")} converted to the field "{field.name}"{rest}')
        return {'FINISHED'}


class TETFLORA_OT_split_field(Reporting, bpy.types.Operator):
    """Make an empty of each plant of the selected fields."""

    bl_idname = "tetflora.split_field"
    bl_label = "Convert Field to Objects"
    bl_description = f"Replace the selected fields with one empty per plant. At most {MOST_EMPTIES:,} plants"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not in_object_mode(cls, context):
            return False
        if fields_of(context.selected_objects):
            return True
        cls.poll_message_set("Select a field of plants first")
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        depsgraph = context.evaluated_depsgraph_get()
        made: list[bpy.types.Object] = []
        for field in [o for o in fields_of(context.selected_objects) if o.library is None]:
            owner = owner_of(context.scene, [field])
            home = collection_of(context.scene, owner) if owner else None
            plants = plants_from_field(context.scene, depsgraph, field, MOST_EMPTIES - len(made), home)
            if owner:
                adopt(context.scene, owner, plants)
            made += plants
        if not made:
            self.report({'WARNING'}, "The selected fields are linked; make them local first")
            return {'CANCELLED'}
        select_only(context, made)
        self.report({'INFO'}, f"{counted(len(made), 'plant')} made")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_mark_field, TETFLORA_OT_make_field, TETFLORA_OT_split_field)
