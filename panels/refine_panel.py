# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine and Clear on top of the tab, which is longer than most screens are tall, and what keeps renders bare."""

import bpy

from ..operators.clear import TETFLORA_OT_clear
from ..operators.refine import TETFLORA_OT_refine
from ..tetflora_addon.blender import auto_refresh
from ..tetflora_addon.blender.first_forest import is_first_forest
from ..tetflora_addon.blender.handlers import render_errors
from ..tetflora_addon.blender.output import KIND
from ..tetflora_addon.blender.scene_reader import has_contents
from .base import SidebarPanel, draw_message


class TETFLORA_PT_refine(SidebarPanel, bpy.types.Panel):
    """Refine and clear."""

    bl_label = "Refine"
    bl_order = -2  # with a header: a panel without one has no ground under its texts where the sidebar is transparent

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
            draw_message(context, layout, "The scene has no camera: add one, and make it active with Ctrl Numpad 0")
        elif text := hint(context.scene):
            draw_message(context, layout, text, 'INFO')


def hint(scene: bpy.types.Scene) -> str:
    """What to say of a scene with plants of which nothing is refined; else an empty text. Cheap as a rule."""
    settings = scene.tetflora
    if settings.statistics:
        return ""
    if settings.refine_at_render:
        return "Refine, then F12" if is_first_forest(scene) and has_contents(scene) else ""
    # Of results that were kept as meshes, the first of a collection tells: a panel cannot look through all objects.
    first = (next(iter(collection.objects), None) for collection in scene.collection.children_recursive)
    kept = any(obj is not None and KIND in obj for obj in first)
    return "" if kept or not has_contents(scene) else "Nothing is refined: renders show no plants"


CLASSES = (TETFLORA_PT_refine,)
