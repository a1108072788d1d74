# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine: the buttons, what the last run made, and the settings that matter most."""

import bpy

from ..operators.clear import TETFLORA_OT_clear
from ..operators.mark_explicit import can_be_explicit
from ..operators.refine import TETFLORA_OT_refine
from ..tetflora_addon.blender import auto_refresh
from ..tetflora_addon.blender.first_forest import is_first_forest
from ..tetflora_addon.blender.handlers import render_errors
from ..tetflora_addon.blender.output import KIND
from ..tetflora_addon.blender.view_layers import has_contents
from .base import SidebarPanel, draw_message, split_layout
from .statistics_panel import rows_of


class TETFLORA_PT_refine(SidebarPanel, bpy.types.Panel):
    """Refine: always on top, because the tab is longer than most screens are tall."""

    bl_label = "Refine"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.tetflora
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.operator(TETFLORA_OT_refine.bl_idname, icon='MOD_DECIM')
        row.operator(TETFLORA_OT_clear.bl_idname, icon='TRASH')
        if settings.auto_refine:  # a line of its own also while nothing is done: what comes and goes moves all below
            draw_message(context, layout, auto_refresh.message() or "Refine Automatically is on", 'SORTTIME')
        for error in render_errors()[-1:]:
            draw_message(context, layout, error)
        if context.scene.camera is None:
            draw_message(context, layout, "The scene has no camera; add one, and make it active with Ctrl Numpad 0")
        elif text := hint(context.scene):
            draw_message(context, layout, text, 'INFO')
        elif rows := dict(rows_of(settings.statistics)):
            draw_message(context, layout, f"{rows['Polygons']} polygons made in {rows['Seconds']} s", 'INFO')
        layout = split_layout(self)
        column = layout.column()
        column.active = not settings.expand_everything
        for name in ("quality", "cutoff", "shadow_cutoff", "proxy_form", "baked_light", "max_polygons"):
            column.prop(settings, name)
        active = context.active_object
        if active is not None and (can_be_explicit(active) or active.tetflora.is_explicit):
            layout.prop(active.tetflora, "is_explicit")
        layout.prop(settings, "refine_at_render")
        layout.prop(settings, "auto_refine")


def hint(scene: bpy.types.Scene) -> str:
    """Text for a scene with plants of which nothing is refined; otherwise empty. Cheap as a rule."""
    settings = scene.tetflora
    if settings.statistics:
        return ""
    if settings.refine_at_render:
        return "Click Refine, then press F12 to render" if is_first_forest(scene) and has_contents(scene) else ""
    # Of results that were kept as meshes, the first of a collection tells: a panel cannot look through all objects.
    first = (next(iter(collection.objects), None) for collection in scene.collection.children_recursive)
    kept = any(obj is not None and KIND in obj for obj in first)
    return "" if kept or not has_contents(scene) else "Nothing is refined, so renders show no plants"


CLASSES = (TETFLORA_PT_refine,)
