# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common that mark the selected objects, and take the mark away when called again.

Mark objects whose own polygons are refined.

Mark meshes as occluders.

Fields of plants: mark objects as fields, make a field of plants that are objects, and plants of a field.

Add entries to the lists of the panels and remove them.
"""

from typing import Any

import bpy
from bpy.props import EnumProperty

from ..tetflora_addon.blender.placing.plant_objects import (
    field_from_plants,
    plants_from_field,
    plants_of,
    prepare_scene,
)
from ..tetflora_addon.blender.placing.populations import adopt, collection_of, owner_of
from ..tetflora_addon.blender.placing.properties import MOST_EMPTIES
from ..tetflora_addon.blender.placing.rules import shown_population
from ..tetflora_addon.blender.scene.explicit import SURFACE_TYPES
from ..tetflora_addon.blender.scene.fields import FIELD_TYPES, fields_of
from ..tetflora_addon.blender.scene.objects import may_instance
from ..tetflora_addon.blender.species.catalogue import default_species
from ..tetflora_addon.blender.species.edits import catalogue
from .base import Reporting, counted, in_object_mode, plants_selected, select_only, selected_plants


def action_property(mark: str, unmark: str) -> Any:
    """The property that says what happens to the mark, from descriptions of both outcomes."""
    return EnumProperty(
        name="Action",
        description="How to change the mark",
        items=(
            ('TOGGLE', "Toggle", "Mark all, or unmark them if all are marked"),
            ('MARK', "Mark", mark),
            ('UNMARK', "Unmark", unmark),
        ),
        default='TOGGLE',
        options={'SKIP_SAVE'},
    )


class Marking(Reporting):
    """Mix-in for operators with an ``action``.

    Attributes
    ----------
    mark : str
        Property of objects, in ``tetflora``, that is the mark.
    nothing : str
        Why the operator cannot be used where nothing that fits is selected.
    marked : str
        Report, with ``{}`` for the number of objects.
    """

    mark: str
    nothing: str
    marked: str

    @staticmethod
    def fits(obj: bpy.types.Object) -> bool:
        """Whether an object may bear the mark."""
        raise NotImplementedError

    @classmethod
    def _chosen(cls, context: bpy.types.Context) -> list[bpy.types.Object]:
        # Something marked that has since become something else can still be unmarked.
        return [o for o in context.selected_objects if cls.fits(o) or getattr(o.tetflora, cls.mark)]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if cls._chosen(context):
            return True
        cls.poll_message_set(cls.nothing)
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        chosen = self._chosen(context)
        all_marked = all(getattr(o.tetflora, self.mark) for o in chosen)
        wanted = self.action == 'MARK' or (self.action == 'TOGGLE' and not all_marked)
        for obj in chosen:
            setattr(obj.tetflora, self.mark, wanted and self.fits(obj))
        number = counted(len(chosen), "object")
        self.report({'INFO'}, self.marked.format(number) if wanted else f"{number} unmarked")
        return {'FINISHED'}


def can_be_explicit(obj: bpy.types.Object) -> bool:
    """Whether an object has a surface of its own that could be refined, or instances some."""
    group = obj.tetflora
    return not (group.is_plant or group.is_field) and (obj.type in SURFACE_TYPES or may_instance(obj))


class TETFLORA_OT_mark_explicit(Marking, bpy.types.Operator):
    """Let the selected objects' own polygons take part in refinement, or take the mark away."""

    bl_idname = "tetflora.mark_explicit"
    bl_label = "Refine These Meshes"
    bl_description = (
        "Refine the polygons of the selected objects together with the plants: imported trees, rocks, scans, and "
        "objects that instance them. Use again to unmark"
    )
    bl_options = {'REGISTER', 'UNDO'}
    mark, nothing, marked = "is_explicit", "Select meshes, or objects that instance them, first", "{} will be refined"

    action: action_property("Refine the polygons of the objects", "Leave the objects unchanged")

    fits = staticmethod(can_be_explicit)


class TETFLORA_OT_mark_occluder(Marking, bpy.types.Operator):
    """Mark the selected meshes as occluders of the plants behind them, or unmark them."""

    bl_idname = "tetflora.mark_occluder"
    bl_label = "Mark as Occluder"
    bl_description = (
        "Mark the selected meshes, such as terrain and buildings, as occluders: plants behind them count as hidden and "
        "cost next to nothing. Use again to unmark"
    )
    bl_options = {'REGISTER', 'UNDO'}
    mark, nothing, marked = "is_occluder", "Select meshes first", "{} marked as occluder"

    action: action_property("Plants behind the meshes count as hidden", "The meshes do not affect refinement")

    @staticmethod
    def fits(obj: bpy.types.Object) -> bool:
        return obj.type == 'MESH'


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


class TETFLORA_OT_edit_list(Reporting, bpy.types.Operator):
    """Add an entry to a list of species, or remove the active one."""

    bl_idname = "tetflora.edit_list"
    bl_label = "Edit List"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    which: EnumProperty(
        name="List",
        description="List to edit",
        items=(
            ('MIX', "Species", "Species to populate with"),
            ('LEAVES', "Leaf Objects", "Meshes that replace leaves"),
            ('OUTPUT', "Output", "Species with their own pass index, light group or materials"),
            ('FIELD', "Field Species", "Species of the active field of plants"),
        ),
    )
    action: EnumProperty(
        name="Action",
        description="Change to make",
        items=(
            ('ADD', "Add", "Add an entry, if possible with a species that is not yet in the list"),
            ('REMOVE', "Remove", "Remove the active entry"),
        ),
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return properties.bl_rna.properties["action"].enum_items[properties.action].description

    def run(self, context: bpy.types.Context) -> set[str]:
        owner, name = self._list(context)
        if owner is None:
            self.report({'ERROR'}, "The active object must be a field of plants; select one")
            return {'CANCELLED'}
        entries, index = getattr(owner, name), f"{name}_index"
        if self.action == 'ADD':
            present = {entry.species for entry in entries}
            species = next((s for s in catalogue() if s not in present), None) or default_species()
            entries.add().species = species
            setattr(owner, index, len(entries) - 1)
            return {'FINISHED'}
        active = getattr(owner, index)
        if not 0 <= active < len(entries):
            self.report({'WARNING'}, "No active entry to remove")
            return {'CANCELLED'}
        entries.remove(active)
        setattr(owner, index, max(min(active, len(entries) - 1), 0))
        return {'FINISHED'}

    def _list(self, context: bpy.types.Context) -> tuple[bpy.types.PropertyGroup | None, str]:
        """The list's owner, and its name there."""
        if self.which == 'FIELD':
            active = context.active_object
            return (active.tetflora if active is not None and active.tetflora.is_field else None), "field_species"
        if self.which == 'OUTPUT':
            return context.scene.tetflora.output, "species"
        if self.which == 'MIX':
            return shown_population(context.scene), "mix"
        return context.scene.tetflora, "leaf_objects"


CLASSES = (
    TETFLORA_OT_mark_explicit,
    TETFLORA_OT_mark_occluder,
    TETFLORA_OT_mark_field,
    TETFLORA_OT_make_field,
    TETFLORA_OT_split_field,
    TETFLORA_OT_edit_list,
)
