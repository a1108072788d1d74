# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add entries to the lists of the panels and remove them."""

import bpy
from bpy.props import EnumProperty

from ..tetflora_addon.blender.population_rules import shown_population
from ..tetflora_addon.blender.species_edits import catalogue
from ..tetflora_addon.blender.species_items import default_species
from .base import Reporting


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


CLASSES = (TETFLORA_OT_edit_list,)
