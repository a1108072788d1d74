# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Season and wind in the sidebar; where on Earth the scene lies, and how wind repeats, in the Scene tab."""

import bpy

from ..tetflora_addon.blender.geodata.origin import origin_of
from ..tetflora_addon.blender.settings import date_text
from ..tetflora_addon.errors import TetFloraError
from .base import draw_below, draw_message, draw_properties, panel


@panel("Season and Wind", "seasons.md#seasons")
def TETFLORA_PT_season(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """The day of the year, the years that have passed, and the wind."""
    year, wind = context.scene.tetflora.year, context.scene.tetflora.wind
    row = layout.row(heading="Seasons")
    row.prop(year, "enabled", text="")
    row.prop(year, "season", text="")
    column = layout.column()
    column.use_property_decorate = True  # they can be animated
    part = column.column()
    part.active = year.enabled
    part.prop(year, "day")
    draw_below(part, date_text(year.day) if year.enabled else "")
    part.prop(year, "snow")
    column.prop(year, "years")
    layout.separator()
    row = layout.row(heading="Wind")
    row.prop(wind, "enabled", text="")
    row.prop(wind, "speed", text="")


@panel("TetFlora", "seasons.md#seasons", tab="scene", bl_options={'DEFAULT_CLOSED'})
def TETFLORA_PT_scene(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Where on Earth the scene lies, how seasons spread, and how the wind blows."""
    settings = context.scene.tetflora
    layout.use_property_decorate = True
    draw_properties(layout, settings.year, "latitude", "spread")
    draw_properties(layout, settings.wind, "direction", "gusts", "loop")
    try:
        place = origin_of(context.scene)
    except TetFloraError as error:
        draw_message(context, layout, str(error))
        return
    if place is not None:
        where = f"{place.east:,.0f}, {place.north:,.0f} of " if place.system.epsg >= 0 else ""
        draw_below(layout, f"{where}{place.system.name}", "Origin")
