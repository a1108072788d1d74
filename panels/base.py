# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all of TetFlora's panels share: their place in the sidebar and their layout.

Lists of species in panels: the mixture to populate with, leaf objects, and kinds of a field.
"""

from collections.abc import Iterable
from textwrap import wrap

import bpy

from ..operators.marks import TETFLORA_OT_edit_list
from ..tetflora_addon.blender.species.catalogue import FALLBACK_ICON, icon_of


class SidebarPanel:
    """Mix-in for panels in the 3D view's sidebar."""

    bl_space_type = 'VIEW_3D'
    bl_region_type = 'UI'
    bl_category = "TetFlora"


def split_layout(panel: bpy.types.Panel) -> bpy.types.UILayout:
    """The panel's layout with labels to the left of values, as elsewhere in Blender."""
    panel.layout.use_property_split = True
    panel.layout.use_property_decorate = False
    return panel.layout


def draw_message(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str = 'ERROR') -> None:
    """A text over several lines, as Blender breaks none; a letter is some 7 pixels wide at a scale of 1."""
    letters = context.region.width / (7.0 * context.preferences.system.ui_scale)
    column = layout.column(align=True)
    for n, line in enumerate(wrap(text, max(int(letters) - 4, 16))):
        column.label(text=line, icon='BLANK1' if n else icon)


def picture(identifier: str) -> dict[str, str | int]:
    """Arguments for a layout's element that shows a species' picture, or an icon where it has none."""
    number = icon_of(identifier)
    return {"icon_value": number} if number else {"icon": FALLBACK_ICON}


class TETFLORA_UL_mix(bpy.types.UIList):
    """A species and its share."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = layout.split(factor=0.7, align=True)
        row.prop(item, "species_choice", text="", emboss=False)
        row.prop(item, "weight", text="")


class TETFLORA_UL_leaf_objects(bpy.types.UIList):
    """A species and the mesh that replaces its leaf."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = layout.row(align=True)
        row.prop(item, "species_choice", text="", emboss=False)
        row.prop(item, "leaf", text="")


class TETFLORA_UL_field_species(bpy.types.UIList):
    """A number of the attribute species, and the kind of plant that it means."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, index, _flag) -> None:
        row = layout.split(factor=0.12, align=True)
        row.label(text=str(index))
        row.prop(item, "species_choice", text="", emboss=False)


class TETFLORA_UL_output_species(bpy.types.UIList):
    """A species with output settings of its own."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = layout.split(factor=0.7, align=True)
        row.prop(item, "species_choice", text="", emboss=False)
        row.prop(item, "pass_index", text="")


def draw_list(
    layout: bpy.types.UILayout,
    cls: type[bpy.types.UIList],
    owner: bpy.types.PropertyGroup,
    names: Iterable[str],
    which: str,
) -> None:
    """A list with buttons to add and remove.

    Parameters
    ----------
    names : iterable of str
        The owner's collection and its active index.
    which : {'MIX', 'LEAVES', 'FIELD', 'OUTPUT'}
        As in the operator.
    """
    entries, index = names
    row = layout.row()
    row.template_list(cls.__name__, "", owner, entries, owner, index, rows=2)
    column = row.column(align=True)
    for icon, action in (('ADD', 'ADD'), ('REMOVE', 'REMOVE')):
        button = column.operator(TETFLORA_OT_edit_list.bl_idname, text="", icon=icon)
        button.which, button.action = which, action


CLASSES = (
    TETFLORA_UL_mix,
    TETFLORA_UL_leaf_objects,
    TETFLORA_UL_field_species,
    TETFLORA_UL_output_species,
)
