# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute the levels that viewports preview, clear them, and look through the camera that they belong to."""

from collections.abc import Generator

import bpy
from mathutils import Matrix

from ..tetflora_addon.blender.viewport import state
from ..tetflora_addon.blender.viewport.levels import level_steps
from ..tetflora_addon.camera.camera import Camera
from ..tetflora_addon.jobs import Progress
from ..tetflora_addon.preview.levels import Levels
from .base import NO_CAMERA, ModalJob, Reporting, counted, need

#: Extent of a viewport's longer side at distance 1, times its focal length in millimeters.
_VIEWPORT = 72.0


def _frozen(scene: bpy.types.Scene) -> Camera | None:
    return getattr(state.find(scene), "frozen", None)


_camera_found = need(lambda context: context.scene.camera is not None or _frozen(context.scene) is not None, NO_CAMERA)


class TETFLORA_OT_preview_levels(ModalJob, bpy.types.Operator):
    """Refine for the scene camera, or the frozen one, without creating meshes, and keep every level to step through in
    viewports.

    Takes as long as the first part of Refine; Esc cancels and keeps the previous levels.
    """

    bl_label = "Compute Levels"
    needs = (_camera_found,)
    bl_options = {'REGISTER'}  # nothing in the file changes but the level that is shown

    cancelled = "Cancelled; the levels are unchanged"

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, Levels]:
        return level_steps(context.scene, context.evaluated_depsgraph_get(), context.view_layer)

    def finish(self, context: bpy.types.Context, levels: Levels) -> set[str]:
        last = levels.levels[-1]
        context.scene.tetflora.preview.level = last.number
        return self.done(
            f"{counted(len(levels), 'level')}, {len(last):,} tetrahedra with plants, {levels.nbytes / 1e6:.0f} MB",
        )


class TETFLORA_OT_forget_levels(Reporting, bpy.types.Operator):
    """Remove the levels from viewports and memory. The file does not change."""

    bl_label = "Clear Levels"
    bl_options = set()
    needs = (
        need(
            lambda context: getattr(state.find(context.scene), "levels", None) is not None,
            "No levels to clear; click Compute Levels first",
        ),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        state.forget(context.scene)
        return {'FINISHED'}


class TETFLORA_OT_look_through(Reporting, bpy.types.Operator):
    """Look through the scene camera or, if the camera is frozen, from the position and in the direction of the frozen
    camera.
    """

    bl_label = "Look Through Camera"
    bl_options = set()
    needs = (
        need(
            lambda context: context.space_data is not None and context.space_data.type == 'VIEW_3D',
            "Only available in a 3D viewport",
        ),
        _camera_found,
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        space, frozen = context.space_data, _frozen(context.scene)
        if frozen is None:
            space.region_3d.view_perspective = 'CAMERA'
        else:
            look_from(space, frozen)
        return {'FINISHED'}


def look_from(space: bpy.types.SpaceView3D, camera: Camera) -> None:
    """Turn a viewport to where a camera looks; the image is as wide as the viewport."""
    region = space.region_3d
    region.view_perspective = 'ORTHO' if camera.kind == "ORTHO" else 'PERSP'
    matrix = Matrix(camera.frame.tolist()).to_4x4()
    matrix.translation = (camera.position + camera.origin).tolist()
    left, right, bottom, top = camera.window
    if camera.kind == "PERSP":
        space.lens = min(max(_VIEWPORT / max(right - left, top - bottom), 1.0), 250.0)
    region.view_matrix = matrix.inverted()
