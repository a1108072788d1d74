# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all of TetFlora's panels share: their place in the sidebar and their layout."""

from textwrap import wrap

import bpy

from ..tetflora_addon.blender.thumbnails import FALLBACK_ICON, icon_of


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
