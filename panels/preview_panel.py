# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview: levels of refinement and plants in the viewport, without making anything."""

import bpy

from ..operators.preview_levels import TETFLORA_OT_forget_levels, TETFLORA_OT_look_through, TETFLORA_OT_preview_levels
from ..tetflora_addon.blender import preview_state
from .base import SidebarPanel, draw_message, split_layout


class TETFLORA_PT_preview(SidebarPanel, bpy.types.Panel):
    """Preview."""

    bl_label = "Preview"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora.preview
        preview = preview_state.find(context.scene)
        column = layout.column()
        column.prop(settings, "plants")
        if settings.plants != 'NONE':
            # Blender's own setting of this viewport: thousands of empties cost more than the plants that are drawn.
            column.prop(context.space_data, "show_object_viewport_empty", text="Empties")
            if preview is not None and preview.message:
                draw_message(context, column, preview.message)
        row = layout.row(align=True)
        row.operator(TETFLORA_OT_preview_levels.bl_idname, icon='MOD_REMESH')
        row.operator(TETFLORA_OT_forget_levels.bl_idname, text="", icon='X')
        layout.prop(settings, "freeze")
        layout.operator(TETFLORA_OT_look_through.bl_idname, icon='VIEW_CAMERA')
        if preview is None or preview.levels is None:
            return
        column = layout.column()
        last = preview.levels.levels[-1].number
        column.prop(settings, "level", text=f"Level of {last}", slider=True)
        column.prop(settings, "wires")
        row = column.row()
        row.active = settings.wires
        row.prop(settings, "colour")
        column.prop(settings, "projected")
        column.column(align=True).prop(settings, "forms")
        column.prop(settings, "statistics")
        if preview_state.is_outdated(context.scene):
            draw_message(context, layout, "The camera has changed; compute the levels again, or freeze the camera")


CLASSES = (TETFLORA_PT_preview,)
