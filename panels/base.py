# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels share: their place in the sidebar, layout, rows of properties and buttons, and lists of species."""

from textwrap import wrap
from typing import NamedTuple

import bpy
from bpy.utils import units

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
    """A text over several lines, because Blender does not wrap; a letter is some 7 pixels wide at a scale of 1."""
    letters = context.region.width / (7.0 * (context.preferences.system.ui_scale or 1.0))  # 0 without a window
    column = layout.column(align=True)
    for n, line in enumerate(wrap(text, max(int(letters) - 4, 16))):
        column.label(text=line, icon='BLANK1' if n else icon)


def thumbnail(identifier: str) -> dict[str, str | int]:
    """Arguments for a layout's element that shows a species' thumbnail, or an icon where it has none."""
    number = icon_of(identifier)
    return {"icon_value": number} if number else {"icon": FALLBACK_ICON}


def draw_below(layout: bpy.types.UILayout, text: str) -> None:
    """A note under a property, where its value is."""
    row = layout.split(factor=0.4)
    row.label()
    row.label(text=text)


def shown_length(metres: float) -> str:
    """A length in the scene's units, as its fields show it."""
    unit = bpy.context.scene.unit_settings
    return units.to_string(unit.system, 'LENGTH', metres * unit.scale_length, precision=2)


def draw_properties(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct, *names: str) -> None:
    """Draw properties of an owner one below the other."""
    for name in names:
        layout.prop(owner, name)


def draw_limits(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct, name: str, *more: str) -> bpy.types.UILayout:
    """Draw least and most of something, and more of it, in a column; returns that."""
    column = layout.column(align=True)
    column.prop(owner, f"{name}_min")
    for part in ("max", *more):
        column.prop(owner, f"{name}_{part}", text=part.capitalize())
    return column


def draw_vertex_group(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct) -> bpy.types.Object | None:
    """Draw the vertex group of the first ground; returns that."""
    ground = next((entry.object for entry in owner.grounds if entry.object is not None), None)
    if ground is not None:
        layout.prop_search(owner, "vertex_group", ground, "vertex_groups")
    else:
        layout.prop(owner, "vertex_group")
    return ground


def draw_mask(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct) -> None:
    """Draw vertex group and image of a population or biome."""
    row = layout.row(align=True)
    ground = draw_vertex_group(row, owner)
    row.prop(owner, "invert_group", text="", icon='ARROW_LEFTRIGHT')
    row = layout.row(align=True)
    row.prop(owner, "image")
    row.prop(owner, "invert_image", text="", icon='ARROW_LEFTRIGHT')
    if owner.image is not None and ground is not None and ground.type == 'MESH':
        layout.prop_search(owner, "uv_layer", ground.data, "uv_layers")
    elif owner.image is not None:
        layout.prop(owner, "uv_layer")


def draw_paths(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct) -> None:
    """Draw areas and paths of a population or stand."""
    draw_properties(layout, owner, "areas", "paths")
    if owner.paths is not None:
        layout.prop(owner, "path_distance")


class Button(NamedTuple):
    """An operator in a menu or panel, with another text than its label where one is given."""

    operator: type[bpy.types.Operator]
    icon: str
    text: str | None = None
    values: dict[str, object] = {}

    def draw(self, layout: bpy.types.UILayout, **options: object) -> None:
        """Draw it, with further options of ``UILayout.operator``."""
        text = {} if self.text is None else {"text": self.text}
        made = layout.operator(self.operator.bl_idname, icon=self.icon, **text, **options)
        for name, value in self.values.items():
            setattr(made, name, value)


def draw_buttons(layout: bpy.types.UILayout, *buttons: Button | None) -> None:
    """Draw buttons one below the other; None is a separator."""
    for button in buttons:
        if button is None:
            layout.separator()
        else:
            button.draw(layout)


class _SpeciesList:
    """Mix-in for lists of entries with a species, and one more property beside it.

    Attributes
    ----------
    which : {'MIX', 'LEAVES', 'FIELD', 'OUTPUT'}
        The list as the operator that edits it names it.
    entries : str
        Name of the owner's collection; that of the active index ends in ``_index``.
    beside : str
        Name of the other property.
    fraction : float
        Width of the species.
    """

    which: str
    entries: str
    beside = ""
    fraction = 0.7

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, index, _flag) -> None:
        row = layout.split(factor=self.fraction, align=True)
        if not self.beside:
            row.label(text=str(index))
        row.prop(item, "species_choice", text="", emboss=False)
        if self.beside:
            row.prop(item, self.beside, text="")

    @classmethod
    def draw_in(cls, layout: bpy.types.UILayout, owner: bpy.types.PropertyGroup) -> None:
        """Draw the list of an owner, with buttons to add and remove."""
        row = layout.row()
        row.template_list(cls.__name__, "", owner, cls.entries, owner, f"{cls.entries}_index", rows=2)
        column = row.column(align=True)
        for action in ('ADD', 'REMOVE'):
            Button(TETFLORA_OT_edit_list, action, "", {"which": cls.which, "action": action}).draw(column)


class TETFLORA_UL_mix(_SpeciesList, bpy.types.UIList):
    """A species and its weight."""

    which, entries, beside = 'MIX', "mix", "weight"


class TETFLORA_UL_leaf_objects(_SpeciesList, bpy.types.UIList):
    """A species and the mesh that replaces its leaf."""

    which, entries, beside, fraction = 'LEAVES', "leaf_objects", "leaf", 0.5


class TETFLORA_UL_field_species(_SpeciesList, bpy.types.UIList):
    """A number of the attribute species, and the species that it means."""

    which, entries, fraction = 'FIELD', "field_species", 0.12


class TETFLORA_UL_output_species(_SpeciesList, bpy.types.UIList):
    """A species with output settings of its own."""

    which, entries, beside = 'OUTPUT', "species", "pass_index"


class TETFLORA_UL_stand_species(_SpeciesList, bpy.types.UIList):
    """A species of a stand and its share of what is planted."""

    which, entries, beside = 'STAND', "species", "planted"


CLASSES = (
    TETFLORA_UL_mix,
    TETFLORA_UL_stand_species,
    TETFLORA_UL_leaf_objects,
    TETFLORA_UL_field_species,
    TETFLORA_UL_output_species,
)
