# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Paint Plants: the brush's settings, and the buttons that take it up."""

import bpy

from ..operators.paint_plants import TETFLORA_OT_paint_plants
from ..tetflora_addon.blender.brush_properties import MODES
from .base import SidebarPanel, split_layout


class TETFLORA_PT_brush(SidebarPanel, bpy.types.Panel):
    """Paint plants."""

    bl_label = "Paint Plants"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora.brush
        row = layout.row(align=True)
        row.scale_y = 1.4
        for mode, name, _, icon, _ in MODES:
            button = row.operator(
                TETFLORA_OT_paint_plants.bl_idname, text=name, icon=icon, depress=settings.mode == mode
            )
            button.mode = mode
        column = layout.column(align=True)
        column.prop(settings, "radius")
        column.prop(settings, "density")
        column.prop(settings, "strength", slider=True)
        column.prop(settings, "min_distance")
        column = layout.column()
        column.prop(settings, "source")
        if settings.source == 'ONE':
            column.prop(settings, "species_choice", text=" ")
        column = layout.column(align=True)
        column.prop(settings, "scale_min")
        column.prop(settings, "scale_max")
        column = layout.column()
        column.prop(settings, "store")
        column.prop(settings, "seed")


CLASSES = (TETFLORA_PT_brush,)
