# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of species in panels: the mixture to populate with, leaf objects, and kinds of a field."""

from collections.abc import Iterable

import bpy

from ..operators.edit_list import TETFLORA_OT_edit_list


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


CLASSES = (TETFLORA_UL_mix, TETFLORA_UL_leaf_objects, TETFLORA_UL_field_species, TETFLORA_UL_output_species)
