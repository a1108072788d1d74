# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute the levels that viewports preview, and clear them."""

import bpy

from ..tetflora_addon.blender.declare import once
from ..tetflora_addon.blender.viewport import state
from ..tetflora_addon.blender.viewport.levels import level_steps
from ..tetflora_addon.jobs import Job
from ..tetflora_addon.preview.levels import Levels
from .base import NO_CAMERA, ModalJob, counted, need

_camera_found = need(
    lambda context: context.scene.camera is not None or getattr(state.find(context.scene), "frozen", None) is not None,
    NO_CAMERA,
)


class TETFLORA_OT_preview_levels(ModalJob, bpy.types.Operator):
    """Refine for the scene camera, or the frozen one, without creating meshes, and keep every level to step through in
    viewports.

    Takes as long as the first part of Refine; Esc cancels and keeps the previous levels.
    """

    bl_label = "Compute Levels"
    needs = (_camera_found,)
    bl_options = {'REGISTER'}  # nothing in the file changes but the level that is shown

    cancelled = "Cancelled; the levels are unchanged"

    clear: once.boolean("Clear Levels", "Remove the levels from viewports and memory instead. The file does not change")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.execute(context) if self.clear else super().invoke(context, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        if not self.clear:
            return super().run(context)
        if getattr(state.find(context.scene), "levels", None) is None:
            return self.refused("No levels to clear; click Compute Levels first")
        state.forget(context.scene)
        return {'FINISHED'}

    def steps(self, context: bpy.types.Context) -> Job[Levels]:
        return level_steps(context.scene, context.evaluated_depsgraph_get())

    def finish(self, context: bpy.types.Context, levels: Levels) -> set[str]:
        last = levels.levels[-1]
        context.scene.tetflora.preview.level = last.number
        return self.done(
            f"{counted(len(levels), 'level')}, {len(last):,} tetrahedra with plants, {levels.nbytes / 1e6:.0f} MB"
        )
