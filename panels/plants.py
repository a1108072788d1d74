# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The active plant in the sidebar; what any object is to TetFlora in the Object tab of Properties."""

import bpy

from ..operators.marks import can_be_explicit, can_be_field
from ..tetflora_addon.blender.assets.marks import is_species
from ..tetflora_addon.blender.scene.ages import stage_text
from ..tetflora_addon.blender.scene.fields import has_ages, stored_size
from ..tetflora_addon.blender.scene.objects import has_nodes, is_drop, is_scatter, may_scatter
from ..tetflora_addon.blender.scene.skeletons import SKELETON_TYPES
from ..tetflora_addon.blender.settings import active_in
from ..tetflora_addon.blender.species.asset_species import name_of
from ..tetflora_addon.blender.species.edits import catalog
from .base import Button, draw_below, draw_properties, draw_species, panel


@panel(
    "Plant",
    "plants.md#single-plants",
    poll=lambda context: context.active_object is not None and context.active_object.tetflora.is_plant,
)
def TETFLORA_PT_plant(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """The active plant."""
    draw_plant(layout, context.scene, context.active_object, "seed", "age")


def draw_plant(layout: bpy.types.UILayout, scene: bpy.types.Scene, obj: bpy.types.Object, *names: str) -> None:
    """Species of a plant, other properties, and its stage of life."""
    plant, column = obj.tetflora, layout.column()
    row = column.row(align=True)
    row.prop(plant, "species_choice")
    row.prop(scene.tetflora.species_editor, "shown", text="", icon='GREASEPENCIL')
    _draw_missing(column, {plant.species})
    draw_properties(column, plant, *names)
    draw_below(column, stage_text(scene, plant.species, plant.age))


def _draw_missing(layout: bpy.types.UILayout, species: set[str]) -> None:
    for one in sorted(species - catalog().keys()):
        layout.label(text=f'"{name_of(one)}" is not in the catalog', icon='ERROR')


@panel("TetFlora", "models.md", tab="object")
def TETFLORA_PT_object(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What the active object is: a plant, a field, ground, an asset."""
    # Not the context's active object, which is none while results hide it.
    obj = context.view_layer.objects.active
    if obj is None:
        return
    group = obj.tetflora
    if group.is_plant:
        draw_plant(layout, context.scene, obj, "seed", "enabled", "skeleton", "age")
        return
    if group.is_field:
        _draw_field(layout.column(), obj)
        if group.stand.is_grown:
            layout.prop(group.stand, "seed")
    column = layout.column(heading="Use As")
    if obj.type == 'MESH':
        column.prop(group, "is_occluder")
    if can_be_explicit(obj) or group.is_explicit:
        column.prop(group, "is_explicit")
    if may_scatter(obj) or is_scatter(obj):
        _draw_scatter(column, obj)
    if can_be_field(obj):
        text = "Stop Using as Field" if group.is_field else "Use as Field of Plants"
        Button("mark", 'POINTCLOUD_DATA', text, {"what": 'FIELD'}).draw(layout, depress=group.is_field)
    if obj.type in SKELETON_TYPES:
        layout.operator("tetflora.use_as_skeleton", icon='CURVE_DATA')
    row = layout.row(align=True)
    used = is_species(obj)
    Button("use_as_species", 'ASSET_MANAGER', "Use Again as Species" if used else None).draw(row)
    if used:
        Button("use_as_species", 'X', "", {"stop": True}).draw(row)


def _draw_scatter(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    """Whether what an object scatters is refined; the mark of a linked one is not its own."""
    if obj.library is None and is_drop(obj):
        layout.label(text="A plant of the species that it shows", icon='CHECKMARK')
    elif obj.library is None:
        layout.prop(obj.tetflora, "is_scatter")
    else:
        marked = is_scatter(obj)
        icon = 'CHECKBOX_HLT' if marked else 'CHECKBOX_DEHLT'
        Button("mark", icon, "Refine Scatter", {"what": 'SCATTER'}).draw(layout, depress=marked)


def _draw_field(column: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    field, kinds = obj.tetflora, obj.tetflora.field_species
    # What nodes make of the points is not counted: a panel is drawn at every movement of the mouse.
    more = " before modifiers" if has_nodes(obj) else ""
    column.label(text=f"Field of {stored_size(obj):,} points{more}", icon='POINTCLOUD_DATA')
    draw_species(column, field, "field_species")
    if not kinds:
        column.prop(field, "species_choice")
    elif entry := active_in(field, "field_species"):
        column.prop(entry, "skeleton")
    _draw_missing(column, {entry.species for entry in kinds} or {field.species})
    draw_properties(column, field, "seed", "enabled")
    if has_ages(obj):
        column.label(text="Age by attribute", icon='INFO')
    else:
        column.prop(field, "age")
