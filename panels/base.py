# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels and menus share: how functions that draw become these; rows of settings and buttons, lists of species."""

from collections.abc import Callable
from textwrap import wrap
from typing import Any, NamedTuple

import bpy
from bpy.types import ID, Context, Menu, Panel, PropertyGroup, Scene, UILayout, UIList, bpy_struct

from ..tetflora_addon.blender.species.catalog import FALLBACK_ICON, icon_of
from .help import draw_help

#: Scale of the pictures of a gallery where there is room.
GALLERY = 5.0

Draw = Callable[[UILayout, Context], None]


def panel(
    label: str, manual: str, tab: str = "", poll: Callable[[Context], object] | None = None, **options: object
) -> Callable[[Draw], type[Panel]]:
    """Make a panel of the function that draws it; labels are to the left of values, as elsewhere in Blender.

    Parameters
    ----------
    manual : str
        Page of the manual, and its heading, which a button in the header opens.
    tab : str
        Of the Properties editor; the 3D view's sidebar if empty.
    poll : callable, optional
        Whether a context has the panel.
    **options
        What else panels have, such as ``bl_options``.
    """
    place = {"bl_space_type": 'PROPERTIES', "bl_region_type": 'WINDOW', "bl_context": tab}
    if not tab:
        place = {"bl_space_type": 'VIEW_3D', "bl_region_type": 'UI', "bl_category": "TetFlora"}
    place["draw_header_preset"] = lambda self, _context: draw_help(self.layout, self.manual)
    if poll is not None:
        place["poll"] = classmethod(lambda _cls, context: bool(poll(context)))
    return _drawn_by(Panel, {**place, "bl_label": label, "manual": f"manual/{manual}", **options}, True)


def popover(label: str, width: int) -> Callable[[Draw], type[Panel]]:
    """The same of a panel that a button opens, so many units wide."""
    place = {"bl_space_type": 'VIEW_3D', "bl_region_type": 'HEADER', "bl_options": {'INSTANCED'}}
    return _drawn_by(Panel, {**place, "bl_label": label, "bl_ui_units_x": width})


def menu(label: str) -> Callable[[Draw], type[Menu]]:
    """The same of a menu."""
    return _drawn_by(Menu, {"bl_label": label})


def _drawn_by(kind: type, members: dict[str, object], split: bool = False) -> Callable[[Draw], type]:
    """A class of a function's name and module, which that draws; split, labels are to the left of values."""

    def decorate(function: Draw) -> type:
        def draw(self: Any, context: Context) -> None:
            if split:
                self.layout.use_property_split, self.layout.use_property_decorate = True, False
            function(self.layout, context)

        about = {"draw": draw, "__doc__": function.__doc__, "__module__": function.__module__}
        return type(function.__name__, (kind,), members | about)

    return decorate


def section(
    layout: UILayout, title: str, closed: bool = True, switch: tuple[bpy_struct, str] | None = None
) -> UILayout | None:
    """Begin a section of a panel, with the property that turns it on in its header; None while it is closed."""
    header, body = layout.panel(title, default_closed=closed)
    if switch is not None:
        header.use_property_split = False
        header.prop(*switch, text="")
    header.label(text=title)
    return body


def draw_message(context: Context, layout: UILayout, text: str, icon: str = 'ERROR', width: int = 0) -> None:
    """A text over several lines, because Blender does not wrap; a letter is some 7 pixels wide at a scale of 1.

    ``width`` is that of a popover at a scale of 1; that of the region, which has tabs and sections, if not given.
    """
    scale = context.preferences.system.ui_scale or 1.0  # 0 without a window
    letters = (width or context.region.width / scale - 35.0) / 7.0
    column = layout.column(align=True)
    for n, line in enumerate(wrap(text, max(int(letters) - 4, 16))):
        column.label(text=line, icon='BLANK1' if n else icon)


def thumbnail(identifier: str) -> dict[str, str | int]:
    """Arguments for a layout's element that shows a species' thumbnail, or an icon where it has none."""
    number = icon_of(identifier)
    return {"icon_value": number} if number else {"icon": FALLBACK_ICON}


def draw_below(layout: UILayout, text: str, name: str = "") -> None:
    """A note where values are, under a property or with a name of its own."""
    row = layout.split(factor=0.4)
    left = row.row()
    left.alignment = 'RIGHT'
    left.label(text=name)
    row.label(text=text)


def draw_properties(layout: UILayout, owner: bpy_struct, *names: str) -> None:
    """Draw properties of an owner one below the other."""
    for name in names:
        layout.prop(owner, name)


def draw_where(layout: UILayout, owner: PropertyGroup) -> None:
    """Draw what limits where on its grounds something grows, and the menu of what can: the same for all that grows."""
    known, shown = owner.bl_rna.properties, owner.limits
    ground = next((entry.object for entry in owner.grounds if entry.object is not None), None)
    layout.prop_menu_enum(owner, "limits", icon='ADD')
    if 'GROUP' in shown:
        row = layout.row(align=True)
        _draw_search(row, owner, "vertex_group", ground, "vertex_groups")
        if "invert_group" in known:
            row.prop(owner, "invert_group", text="", icon='ARROW_LEFTRIGHT')
    if 'IMAGE' in shown:
        row = layout.row(align=True)
        row.prop(owner, "image")
        row.prop(owner, "invert_image", text="", icon='ARROW_LEFTRIGHT')
        mesh = ground.data if ground is not None and ground.type == 'MESH' else None
        _draw_search(layout, owner, "uv_layer", mesh, "uv_layers")
    biome = getattr(owner, "kind", "") == 'BIOME'
    for limit in ("slope", "altitude", "wetness"):
        if limit.upper() in shown and f"{limit}_range" in known:
            # Biomes blend; of others, only the edges of some limits are soft.
            draw_numbers(layout, owner, f"{limit}_range", 3 if biome or limit != "slope" else 2)
        elif limit.upper() in shown:
            layout.prop(owner, f"{limit}_max")
    if 'ALTITUDE' in shown and "scale_at_top" in known:
        layout.prop(owner, "scale_at_top")
    if 'FACING' in shown:
        draw_numbers(layout, owner, "aspect_range")
    others = {'EDGE': "edge_falloff", 'AREAS': "areas", 'PATHS': "paths"}
    draw_properties(layout, owner, *(name for limit, name in others.items() if limit in shown))
    if 'PATHS' in shown and biome:
        draw_numbers(layout, owner, "path_range", 3)
    elif 'PATHS' in shown:
        layout.prop(owner, "path_distance")


def _draw_search(layout: UILayout, owner: PropertyGroup, name: str, place: ID | None, names: str) -> None:
    """Draw a name to choose from those of a datablock, or to type where there is none."""
    if place is not None:
        layout.prop_search(owner, name, place, names)
    else:
        layout.prop(owner, name)


def draw_numbers(layout: UILayout, owner: PropertyGroup, name: str, number: int = 2, text: str | None = None) -> None:
    """Draw the first numbers of a setting beside each other, with another text than its label where one is given."""
    prop, row = owner.bl_rna.properties[name], layout.row(align=True)
    for index in range(number):
        row.prop(owner, name, index=index, slider=prop.hard_max <= 1.0, text="" if index else text or prop.name)


class Button(NamedTuple):
    """An operator in a menu or panel, with another text than its label where one is given."""

    operator: str
    icon: str
    text: str | None = None
    values: dict[str, object] = {}

    def draw(self, layout: UILayout, **options: object) -> None:
        """Draw it, with further options of ``UILayout.operator``."""
        text = {} if self.text is None else {"text": self.text}
        properties = layout.operator(f"tetflora.{self.operator}", icon=self.icon, **text, **options)
        for name, value in self.values.items():
            setattr(properties, name, value)


def draw_buttons(layout: UILayout, *buttons: Button | None) -> None:
    """Draw buttons one below the other; None is a separator."""
    for button in buttons:
        if button is None:
            layout.separator()
        else:
            button.draw(layout)


class TETFLORA_UL_species(UIList):
    """Species of a list, each with another property beside it; of fields, with its number."""

    #: Property beside the species, by the name of the list's owner's active index; width of the species.
    beside = {
        "mix_index": ("weight", 0.7),
        "leaf_objects_index": ("leaf", 0.5),
        "field_species_index": ("", 0.12),
        "output_index": ("pass_index", 0.7),
        "stand_index": ("planted", 0.7),
    }

    def draw_item(self, _context, layout, data, item, _icon, _active_data, active_property, index, _flag) -> None:
        if active_property == "species_index":
            active_property = "stand_index" if "planted" in item.bl_rna.properties else "output_index"
        beside, fraction = self.beside[active_property]
        row = layout.split(factor=fraction, align=True)
        if not beside:
            row.label(text=str(index))
        row.prop(item, "species_choice", text="", emboss=False)
        if beside:
            row.prop(item, beside, text="")


def draw_species(layout: UILayout, owner: PropertyGroup, entries: str = "species") -> None:
    """Draw a list of species of an owner, with buttons to add and remove."""
    place = "scene"
    if not isinstance(owner.id_data, Scene):
        place = f'blend_data.objects["{bpy.utils.escape_identifier(owner.id_data.name)}"]'
    given = {"owner": f"{place}.{owner.path_from_id()}", "entries": entries, "action": 'REMOVE'}
    row = layout.row()
    row.template_list(TETFLORA_UL_species.__name__, "", owner, entries, owner, f"{entries}_index", rows=2)
    column = row.column(align=True)
    width = bpy.context.window.width if bpy.context.window is not None else 0
    scale = gallery_scale(width, bpy.context.preferences.system.ui_scale)
    column.template_icon_view(owner, "add_species", show_labels=True, scale=1.0, scale_popup=scale)
    Button("edit_list", 'REMOVE', "", given).draw(column)


def gallery_scale(width: int, ui_scale: float) -> float:
    """Scale of a gallery's pictures, of which Blender puts eight beside each other, in a window so many pixels wide."""
    return GALLERY if width <= 0 or ui_scale <= 0.0 else min(GALLERY, (width / ui_scale - 60.0) / (8 * 20.0))
