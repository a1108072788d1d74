# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The species editor: a species, its orders as a list, and a slider for each key of the species file."""

import bpy

from ..tetflora_addon.blender.species.catalog import own_file
from ..tetflora_addon.blender.species.editor import NONE, OBJECT, VARIATION, orders_of, present_order, present_species
from ..tetflora_addon.blender.species.edits import find_edit, problem_of, skipped_files
from ..tetflora_addon.blender.viewport import species
from ..tetflora_addon.species.catalog import ORDER_KEYS
from ..tetflora_addon.species.species import LEAF_KINDS
from .base import Button, draw_buttons, draw_message, draw_numbers, draw_properties, menu, panel, section

_MOST_TOLD = 3  # files of the folder that are not used
# Prefixes of an order's keys about leaves; the others are about branches.
_LEAVES = ("leaf", "leaves")
_SHORT = {"count_by_length": "By Length", "leaf_envelope_radius": "Radius"}  # labels that have no room


@menu("Species Files")
def TETFLORA_MT_species_files(layout: bpy.types.UILayout, _context: bpy.types.Context) -> None:
    """Saving, loading, sharing and deleting species."""
    layout.operator_context = 'INVOKE_DEFAULT'
    draw_buttons(
        layout,
        Button("save_species", 'FILE_TICK'),
        Button("load_species", 'IMPORT'),
        Button("export_species", 'EXPORT'),
        None,
        Button("delete_file", 'TRASH', "Delete from My Species"),
        None,
        Button("create_asset_library", 'ASSET_MANAGER'),
    )


@panel(
    "Species Editor",
    "seasons.md#species-editor",
    poll=lambda context: context.scene.tetflora.species_editor.shown,
    bl_category="Species",
)
def TETFLORA_PT_species(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Species."""
    scene = context.scene
    editor = scene.tetflora.species_editor
    identifier = present_species(editor)
    layout.template_icon_view(editor, "species_choice", show_labels=True, scale=5.0, scale_popup=5.0)
    row = layout.row(align=True)
    row.use_property_split = False
    row.prop(editor, "species_choice", text="")
    row.operator("tetflora.duplicate_species", text="", icon='DUPLICATE')
    row.operator("tetflora.revert_species", text="", icon='LOOP_BACK')
    row.menu(TETFLORA_MT_species_files.__name__, text="", icon='DOWNARROW_HLT')
    if find_edit(scene, identifier) is not None:
        layout.label(text="Edited in this file", icon='GREASEPENCIL')
    else:
        text = "Saved in your species folder" if own_file(identifier) else "Built-in species"
        layout.label(text=text, icon='LOCKED')
    if problem := problem_of(scene, identifier):
        draw_message(context, layout, problem)
    for text in skipped_files()[:_MOST_TOLD]:
        draw_message(context, layout, text)
    shown = species.switch.shown_in(scene)
    row = layout.row(align=True)
    row.use_property_split = False
    row.prop(context.window_manager, "tetflora_species", icon='HIDE_OFF' if shown else 'HIDE_ON', toggle=True)
    row.prop(editor, "preview_seed")
    text, failed = species.message()
    if shown and text and text != problem:
        draw_message(context, layout, text, 'ERROR' if failed else 'BLANK1')
    if not orders_of(editor):
        return
    if body := section(layout, "Name, Leaf and Bark"):
        _draw_whole(body, editor)
    if body := section(layout, "Branches by Order", closed=False):
        _draw_orders(body, editor)
    if body := section(layout, "Leaves of This Order"):
        _draw_keys(body, editor, leaves=True)


def _draw_whole(layout: bpy.types.UILayout, editor: bpy.types.PropertyGroup) -> None:
    """Name, leaf and what else holds for the whole species."""
    draw_properties(layout, editor, "species_name", "species_description")
    for kind in LEAF_KINDS:
        form = getattr(editor, f"{kind}_form")
        layout.prop(editor, f"{kind}_form")
        if form == OBJECT:
            layout.prop_search(editor, f"{kind}_object", bpy.data, "objects")
        if form != NONE:
            layout.prop(editor, f"{kind}_transmission", text="Translucency")
    draw_properties(layout, editor, "bark", "quality", "habit", "exact")


def _draw_orders(layout: bpy.types.UILayout, editor: bpy.types.PropertyGroup) -> None:
    """The orders as a list, and the branches of the active one."""
    row = layout.row()
    row.use_property_split = False
    row.column(align=True).prop(editor, "order", expand=True)
    buttons = row.column(align=True)
    for action, icon in (('ADD', 'ADD'), ('REMOVE', 'REMOVE'), ('SPUR', 'OUTLINER_OB_FORCE_FIELD')):
        Button("edit_orders", icon, "", {"action": action}).draw(buttons)
    _draw_keys(layout, editor, leaves=False)


def _draw_keys(layout: bpy.types.UILayout, editor: bpy.types.PropertyGroup, leaves: bool) -> None:
    column = layout.column(align=True)
    last = present_order(editor) >= len(orders_of(editor)) - 1
    split = column.split(factor=0.4)
    split.label(text="")
    head = split.row(align=True)
    head.label(text="Mean")
    head.label(text="±")
    bare = sum(editor.leaves) <= 0.0
    for name, key in ORDER_KEYS.items():
        if name.startswith(_LEAVES) != leaves:
            continue
        row = column.row(align=True)
        # It can be changed, but has no effect at present.
        row.active = not (bare and leaves and name != "leaves") and not (name == "branches" and last)
        text = _SHORT.get(name) or editor.bl_rna.properties[name].name.removeprefix("Leaf ")
        if key.kind == "range":
            draw_numbers(row, editor, name, text=text)
        else:
            row.prop(editor, name, text=text)
        if key.kind == "color":
            row.prop(editor, name + VARIATION, text="")
            column.separator()
