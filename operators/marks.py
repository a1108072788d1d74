# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mark objects as refined meshes, occluders or fields of plants, convert fields, and edit the lists of the panels."""

from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty

from ..tetflora_addon.blender.placing.plant_objects import (
    field_from_plants,
    plants_from_field,
    plants_of,
    prepare_scene,
)
from ..tetflora_addon.blender.placing.populations import adopt, collection_of, owner_of
from ..tetflora_addon.blender.placing.properties import MOST_EMPTIES
from ..tetflora_addon.blender.scene.fields import FIELD_TYPES, fields_of
from ..tetflora_addon.blender.scene.objects import SURFACE_TYPES, may_instance
from ..tetflora_addon.blender.species.catalog import default_species
from ..tetflora_addon.blender.species.edits import catalog
from .base import Reporting, counted, in_object_mode, need, plants_selected, select_only, selected_plants


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
    def missing(cls, context: bpy.types.Context) -> str:
        return "" if cls._chosen(context) else cls.nothing

    def run(self, context: bpy.types.Context) -> set[str]:
        chosen = self._chosen(context)
        all_marked = all(getattr(o.tetflora, self.mark) for o in chosen)
        wanted = self.action == 'MARK' or (self.action == 'TOGGLE' and not all_marked)
        for obj in chosen:
            setattr(obj.tetflora, self.mark, wanted and self.fits(obj))
        number = counted(len(chosen), "object")
        return self.done(self.marked.format(number) if wanted else f"{number} unmarked")


def can_be_explicit(obj: bpy.types.Object) -> bool:
    """Whether an object has a surface of its own that could be refined, or instances some."""
    group = obj.tetflora
    return not (group.is_plant or group.is_field) and (obj.type in SURFACE_TYPES or may_instance(obj))


class TETFLORA_OT_mark_explicit(Marking, bpy.types.Operator):
    """Refine the polygons of the selected objects together with the plants: imported trees, rocks, scans, and objects
    that instance them.

    Use again to unmark.
    """

    bl_label = "Refine These Meshes"
    mark, nothing, marked = "is_explicit", "Select meshes, or objects that instance them, first", "{} will be refined"

    action: action_property("Refine the polygons of the objects", "Leave the objects unchanged")

    fits = staticmethod(can_be_explicit)


class TETFLORA_OT_mark_occluder(Marking, bpy.types.Operator):
    """Mark the selected meshes, such as terrain and buildings, as occluders: plants behind them count as hidden and
    cost next to nothing.

    Use again to unmark.
    """

    bl_label = "Mark as Occluder"
    mark, nothing, marked = "is_occluder", "Select meshes first", "{} marked as occluder"

    action: action_property("Plants behind the meshes count as hidden", "The meshes do not affect refinement")

    @staticmethod
    def fits(obj: bpy.types.Object) -> bool:
        return obj.type == 'MESH'


def can_be_field(obj: bpy.types.Object | None) -> bool:
    """Whether an object has points that could be plants, or is marked as a field although it has none any more."""
    return obj is not None and (obj.type in FIELD_TYPES or obj.tetflora.is_field)


class TETFLORA_OT_mark_field(Reporting, bpy.types.Operator):
    """Use each point of the active mesh or point cloud, after modifiers, as a plant.

    The attributes species, seed, rotation and scale define the plants. Use again to turn it off.
    """

    bl_label = "Use as Field of Plants"
    needs = (
        need(
            lambda context: can_be_field(context.active_object),
            "The active object must be a mesh or point cloud; select it last",
        ),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        obj = context.active_object
        field = obj.tetflora
        field.is_field = not field.is_field
        if not field.is_field:
            return self.done(f'"{obj.name}" is no longer a field of plants')
        field.is_plant = False
        if not field.field_species:
            field.field_species.add().species = field.species or default_species()
        prepare_scene(context.scene)
        return self.done(f'The points of "{obj.name}" are now plants')


class TETFLORA_OT_make_field(Reporting, bpy.types.Operator):
    """Replace the selected plants with one object whose vertices are the same plants.

    This keeps Blender fast with many plants; parents, constraints and animation of single plants are lost.
    """

    bl_label = "Convert Plants to Field"
    needs = (in_object_mode, plants_selected)

    def run(self, context: bpy.types.Context) -> set[str]:
        selected = plants_of(context.selected_objects)
        plants = [o for o in selected_plants(context) if o.tetflora.enabled and not o.hide_render]
        if not plants:
            return self.refused("The selected plants are disabled, hidden in renders, or linked; enable them first")
        left = len(selected) - len(plants)
        owner = owner_of(context.scene, plants)
        home = collection_of(context.scene, owner) if owner else None
        field = field_from_plants(context.scene, context.evaluated_depsgraph_get(), plants, home)
        if owner:  # or its next update would plant them once more
            adopt(context.scene, owner, [field])
        select_only(context, [field])
        rest = f"; {counted(left, 'plant')} not converted: disabled, hidden in renders, or linked" if left else ""
        return self.done(f'{counted(len(plants), "plant")} converted to the field "{field.name}"{rest}')


class TETFLORA_OT_split_field(Reporting, bpy.types.Operator):
    """Make an empty of each plant of the selected fields."""

    bl_label = "Convert Field to Objects"
    needs = (
        in_object_mode,
        need(lambda context: fields_of(context.selected_objects), "Select a field of plants first"),
    )
    bl_description = f"Replace the selected fields with one empty per plant. At most {MOST_EMPTIES:,} plants"

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
            return self.refused("The selected fields are linked; make them local first")
        select_only(context, made)
        return self.done(f"{counted(len(made), 'plant')} made")


class TETFLORA_OT_edit_list(Reporting, bpy.types.Operator):
    """Add an entry to a list of species, or remove the active one."""

    bl_label = "Edit List"
    bl_options = {'REGISTER', 'UNDO', 'INTERNAL'}

    owner: StringProperty(
        name="Owner", description="Where in the context the owner of the list is, such as scene.tetflora.populate"
    )
    entries: StringProperty(name="List", description="Name of the list")
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
        try:
            owner, index = context.path_resolve(self.owner), f"{self.entries}_index"
            entries = getattr(owner, self.entries)
        except (AttributeError, ValueError):
            return self.failed(f'There is no list "{self.entries}" of "{self.owner}"; click the buttons beside a list')
        if self.action == 'ADD':
            present = {entry.species for entry in entries}
            species = next((s for s in catalog() if s not in present), None) or default_species()
            entries.add().species = species
            setattr(owner, index, len(entries) - 1)
            return {'FINISHED'}
        active = getattr(owner, index)
        if not 0 <= active < len(entries):
            return self.refused("No active entry to remove")
        entries.remove(active)
        setattr(owner, index, max(min(active, len(entries) - 1), 0))
        return {'FINISHED'}
