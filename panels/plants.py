# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants: the active plant or field; operators for the selected ones are in the Object menu."""

import bpy

from ..tetflora_addon.blender.assets.marks import is_species
from ..tetflora_addon.blender.scene.ages import stage_text
from ..tetflora_addon.blender.scene.fields import FIELD_TYPES, stored_size
from ..tetflora_addon.blender.scene.objects import has_nodes
from ..tetflora_addon.blender.scene.own_ages import has_ages
from ..tetflora_addon.blender.scene.skeletons import SKELETON_TYPES
from ..tetflora_addon.blender.settings import active_in
from ..tetflora_addon.blender.species.asset_species import name_of
from ..tetflora_addon.blender.species.edits import catalog
from .base import Button, SidebarPanel, TETFLORA_UL_field_species, draw_below, draw_properties, split_layout
from .menus import TETFLORA_MT_add_plant


class TETFLORA_PT_plants(SidebarPanel, bpy.types.Panel):
    """Plants."""

    bl_label = "Plants"

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        active = context.active_object
        column = layout.column()
        if active is not None and active.tetflora.is_plant:
            plant = active.tetflora
            column.prop(plant, "species_choice")
            if plant.species not in catalog():
                column.label(text=f'"{name_of(plant.species)}" is not in the catalog', icon='ERROR')
            draw_properties(column, plant, "seed", "enabled", "skeleton", "age")
            stage = stage_text(context.scene, plant.species, plant.age)
            if stage:
                draw_below(column, stage)
        elif active is not None and active.tetflora.is_field:
            _draw_field(column, active)
        else:
            column.label(text="The active object is not a plant", icon='INFO')
        layout.menu(TETFLORA_MT_add_plant.__name__, text="Add Plant", icon='ADD')
        if active is None or active.tetflora.is_plant:
            return
        _draw_asset(layout, active)
        # A mesh with faces is ground or something else, as a rule; the Object menu offers these for it too.
        faces = active.type == 'MESH' and len(active.data.polygons) > 0
        if active.type in SKELETON_TYPES and not faces:
            layout.operator("tetflora.use_as_skeleton", icon='CURVE_DATA')
        field = active.tetflora.is_field
        if field or (active.type in FIELD_TYPES and (not faces or has_nodes(active))):
            text = "Field of Plants" if field else "Use as Field of Plants"
            icon = 'CHECKMARK' if field else 'POINTCLOUD_DATA'
            Button("mark_field", icon, text).draw(layout, depress=field)


def _draw_asset(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    """Whether an object is used as a species."""
    if is_species(obj):
        row = layout.row(align=True)
        row.label(text="Used as a species", icon='CHECKMARK')
        Button("use_as_species", 'FILE_REFRESH', "").draw(row)
        Button("stop_using_as_species", 'X', "").draw(row)


def _draw_field(column: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    field, kinds = obj.tetflora, obj.tetflora.field_species
    # What nodes make of the points is not counted: a panel is drawn at every movement of the mouse.
    more = " before modifiers" if has_nodes(obj) else ""
    column.label(text=f"Field of {stored_size(obj):,} points{more}", icon='POINTCLOUD_DATA')
    TETFLORA_UL_field_species.draw_in(column, field)
    if not kinds:
        column.prop(field, "species_choice")
    elif entry := active_in(field, "field_species"):
        column.prop(entry, "skeleton")
    for species in {entry.species for entry in kinds} or {field.species}:
        if species not in catalog():
            column.label(text=f'"{name_of(species)}" is not in the catalog', icon='ERROR')
    draw_properties(column, field, "seed", "enabled")
    if has_ages(obj):
        column.label(text="Age by attribute", icon='INFO')
    else:
        column.prop(field, "age")
