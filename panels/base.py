# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels share: their place in the sidebar, layout, rows of properties and buttons, and lists of species."""

from textwrap import wrap
from typing import NamedTuple

import bpy
from bpy.utils import units

from ..tetflora_addon.blender.species.catalog import FALLBACK_ICON, icon_of


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


def section(
    layout: bpy.types.UILayout,
    title: str,
    closed: bool = True,
    switch: tuple[bpy.types.bpy_struct, str] | None = None,
) -> bpy.types.UILayout | None:
    """Begin a section of a panel, with the property that turns it on in its header; None while it is closed."""
    header, body = layout.panel(title, default_closed=closed)
    if switch is not None:
        header.use_property_split = False
        header.prop(*switch, text="")
    header.label(text=title)
    return body


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


def shown_length(meters: float) -> str:
    """A length in the scene's units, as its fields show it."""
    unit = bpy.context.scene.unit_settings
    return units.to_string(unit.system, 'LENGTH', meters * unit.scale_length, precision=2)


def draw_properties(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct, *names: str) -> None:
    """Draw properties of an owner one below the other."""
    for name in names:
        layout.prop(owner, name)


def draw_where(layout: bpy.types.UILayout, owner: bpy.types.PropertyGroup) -> None:
    """Draw where on its ground a population, biome or stand is: masks, limits and curves, as far as it has them."""
    known = owner.bl_rna.properties
    ground = next((entry.object for entry in owner.grounds if entry.object is not None), None)
    row = layout.row(align=True)
    _draw_search(row, owner, "vertex_group", ground, "vertex_groups")
    if "image" in known:
        row.prop(owner, "invert_group", text="", icon='ARROW_LEFTRIGHT')
        row = layout.row(align=True)
        row.prop(owner, "image")
        row.prop(owner, "invert_image", text="", icon='ARROW_LEFTRIGHT')
        if owner.image is not None:
            mesh = ground.data if ground is not None and ground.type == 'MESH' else None
            _draw_search(layout, owner, "uv_layer", mesh, "uv_layers")
    if "use_altitude" in known:
        layout.prop(owner, "use_altitude")
        if owner.use_altitude:
            _draw_limits(layout, owner, "altitude")
    _draw_limits(layout, owner, "slope")
    _draw_limits(layout, owner, "wetness")
    draw_properties(layout, owner, *(name for name in ("areas", "paths") if name in known))
    if owner.paths is not None:
        _draw_limits(layout, owner, "path")
        draw_properties(layout, owner, *({"path_distance"} & set(known.keys())))


def _draw_search(
    layout: bpy.types.UILayout, owner: bpy.types.PropertyGroup, name: str, place: bpy.types.ID | None, names: str
) -> None:
    """Draw a name to choose from those of a datablock, or to type where there is none."""
    if place is not None:
        layout.prop_search(owner, name, place, names)
    else:
        layout.prop(owner, name)


def _draw_limits(layout: bpy.types.UILayout, owner: bpy.types.PropertyGroup, name: str) -> None:
    """Draw the limits of something as far as they are there, and how soft they are; that only matters to limits."""
    known, column = owner.bl_rna.properties, layout.column(align=True)
    ends = [f"{name}_{end}" for end in ("min", "max") if f"{name}_{end}" in known]
    softness = f"{name}_softness"
    draw_properties(column, owner, *ends[:1])
    for part in ends[1:]:
        column.prop(owner, part, text="Max")
    if softness in known:
        row = column.row()
        row.active = any(getattr(owner, end) != getattr(known[end], f"hard_{end[-3:]}") for end in ends)
        row.prop(owner, softness, text="Softness")
    if f"{name}_falloff" in known:
        column.prop(owner, f"{name}_falloff", text="Falloff")


class Button(NamedTuple):
    """An operator in a menu or panel, with another text than its label where one is given."""

    operator: str
    icon: str
    text: str | None = None
    values: dict[str, object] = {}

    def draw(self, layout: bpy.types.UILayout, **options: object) -> None:
        """Draw it, with further options of ``UILayout.operator``."""
        text = {} if self.text is None else {"text": self.text}
        made = layout.operator(f"tetflora.{self.operator}", icon=self.icon, **text, **options)
        for name, value in self.values.items():
            setattr(made, name, value)


def draw_buttons(layout: bpy.types.UILayout, *buttons: Button | None) -> None:
    """Draw buttons one below the other; None is a separator."""
    for button in buttons:
        if button is None:
            layout.separator()
        else:
            button.draw(layout)


def draw_list(
    layout: bpy.types.UILayout,
    kind: type[bpy.types.UIList],
    owner: bpy.types.PropertyGroup,
    entries: str,
    *buttons: Button,
    rows: int = 2,
) -> bpy.types.UILayout:
    """Draw a list of an owner, with buttons beside it; returns the column of these."""
    row = layout.row()
    row.template_list(kind.__name__, "", owner, entries, owner, f"{entries}_index", rows=rows)
    column = row.column(align=True)
    draw_buttons(column, *buttons)
    return column


class LayerList:
    """Mix-in for lists of what grows on the ground: a name, how many plants, and an icon for what they are in."""

    icon: str

    @staticmethod
    def state(item: bpy.types.PropertyGroup) -> tuple[int, str]:
        """Number of plants, and an icon."""
        raise NotImplementedError

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon=self.icon)
        right = row.row()
        right.alignment = 'RIGHT'
        number, icon = self.state(item)
        right.label(text=f"{number:,}", icon=icon)


class _SpeciesList:
    """Mix-in for lists of entries with a species, and one more property beside it.

    Attributes
    ----------
    entries : str
        Name of the owner's collection; that of the active index ends in ``_index``.
    beside : str
        Name of the other property.
    fraction : float
        Width of the species.
    """

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
        place = "scene" if isinstance(owner.id_data, bpy.types.Scene) else "active_object"
        given = {"owner": f"{place}.{owner.path_from_id()}", "entries": cls.entries}
        buttons = (Button("edit_list", action, "", {**given, "action": action}) for action in ('ADD', 'REMOVE'))
        draw_list(layout, cls, owner, cls.entries, *buttons)


class TETFLORA_UL_mix(_SpeciesList, bpy.types.UIList):
    """A species and its weight."""

    entries, beside = "mix", "weight"


class TETFLORA_UL_leaf_objects(_SpeciesList, bpy.types.UIList):
    """A species and the mesh that replaces its leaf."""

    entries, beside, fraction = "leaf_objects", "leaf", 0.5


class TETFLORA_UL_field_species(_SpeciesList, bpy.types.UIList):
    """A number of the attribute species, and the species that it means."""

    entries, fraction = "field_species", 0.12


class TETFLORA_UL_output_species(_SpeciesList, bpy.types.UIList):
    """A species with output settings of its own."""

    entries, beside = "species", "pass_index"


class TETFLORA_UL_stand_species(_SpeciesList, bpy.types.UIList):
    """A species of a stand and its share of what is planted."""

    entries, beside = "species", "planted"
