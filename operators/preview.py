# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute the levels that viewports preview, forget them, and look at them from where they were refined for."""

from collections.abc import Generator

import bpy
from mathutils import Matrix

from ..tetflora_addon.blender.viewport import levels as preview_job
from ..tetflora_addon.blender.viewport import state
from ..tetflora_addon.camera.camera import Camera
from ..tetflora_addon.preview.levels import Levels
from ..tetflora_addon.refinement.statistics import Progress
from .base import ModalJob, counted

#: Extent of a viewport's longer side at distance 1, times its focal length in millimetres.
_VIEWPORT = 72.0


def _camera_is_there(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    preview = state.find(context.scene)
    if context.scene.camera is not None or (preview is not None and preview.frozen is not None):
        return True
    cls.poll_message_set("The scene has no active camera; add one with Add > Camera")
    return False


class TETFLORA_OT_preview_levels(ModalJob, bpy.types.Operator):
    """Refine without making anything."""

    bl_idname = "tetflora.preview_levels"
    bl_label = "Compute Levels"
    bl_description = (
        "Refine for the scene camera, or the frozen one, without creating meshes, and keep every level to step "
        "through in viewports. Takes as long as the first part of Refine; Esc cancels and keeps the previous levels"
    )
    bl_options = {'REGISTER'}  # nothing in the file changes but the level that is shown

    cancelled = "Cancelled; the levels are unchanged"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _camera_is_there(cls, context)

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, Levels]:
        return preview_job.level_steps(context.scene, context.evaluated_depsgraph_get(), context.view_layer)

    def finish(self, context: bpy.types.Context, levels: Levels) -> set[str]:
        context.scene.tetflora.preview.level = levels.levels[-1].number
        last = levels.levels[-1]
        self.report(
            {'INFO'},
            f"{counted(len(levels), 'level')}, {len(last):,} tetrahedra with plants, {levels.nbytes / 1e6:.0f} MB",
        )
        return {'FINISHED'}


class TETFLORA_OT_forget_levels(bpy.types.Operator):
    """Take the levels out of viewports and memory."""

    bl_idname = "tetflora.forget_levels"
    bl_label = "Clear Levels"
    bl_description = "Remove the levels from viewports and memory. The file does not change"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        preview = state.find(context.scene)
        if preview is not None and preview.levels is not None:
            return True
        cls.poll_message_set("No levels to clear; click Compute Levels first")
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        state.forget(context.scene)
        return {'FINISHED'}


class TETFLORA_OT_look_through(bpy.types.Operator):
    """Look at the preview from where it was made for."""

    bl_idname = "tetflora.look_through"
    bl_label = "Look Through Camera"
    bl_description = (
        "Look through the scene camera or, if the camera is frozen, from the position and in the direction of the "
        "frozen camera"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.space_data is None or context.space_data.type != 'VIEW_3D':
            cls.poll_message_set("Only available in a 3D viewport")
            return False
        return _camera_is_there(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, space = context.scene, context.space_data
        preview = state.find(scene)
        frozen = None if preview is None else preview.frozen
        if frozen is None:
            space.region_3d.view_perspective = 'CAMERA'
        else:
            look_from(space, frozen)
        return {'FINISHED'}


def look_from(space: bpy.types.SpaceView3D, camera: Camera) -> None:
    """Turn a viewport to where a camera looks; the picture is as wide as the viewport."""
    region = space.region_3d
    region.view_perspective = 'ORTHO' if camera.kind == "ORTHO" else 'PERSP'
    matrix = Matrix(camera.frame.tolist()).to_4x4()
    matrix.translation = camera.position.tolist()
    left, right, bottom, top = camera.window
    if camera.kind == "PERSP":
        space.lens = min(max(_VIEWPORT / max(right - left, top - bottom), 1.0), 250.0)
    region.view_matrix = matrix.inverted()


CLASSES = (TETFLORA_OT_preview_levels, TETFLORA_OT_forget_levels, TETFLORA_OT_look_through)
