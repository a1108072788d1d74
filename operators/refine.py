# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine the scene: at once in scripts, step by step with progress and Esc in the window."""

from collections.abc import Generator

import bpy

from ..tetflora_addon.blender import auto_refresh, job
from ..tetflora_addon.blender.handlers import forget_render_errors
from ..tetflora_addon.blender.plant_objects import plants_of, prepare_scene
from ..tetflora_addon.blender.runtime import redraw
from ..tetflora_addon.blender.shell_bounces import few_bounces
from ..tetflora_addon.blender.world_reader import read_world
from ..tetflora_addon.refinement.statistics import Progress, Statistics
from .base import counted
from .modal_job import ModalJob


class TETFLORA_OT_refine(ModalJob, bpy.types.Operator):
    """Make meshes and proxies of all plants, as fine as the scene's camera sees them."""

    bl_idname = "tetflora.refine"
    bl_label = "Refine"
    bl_description = (
        "Create meshes of plants near the scene camera and proxies of the others, replacing earlier results. Esc "
        "cancels without changes; Return stops refining and creates what has been decided so far"
    )
    bl_options = {'REGISTER', 'UNDO'}

    keys = "Esc: Cancel   |   Return: Finish Early"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != 'OBJECT':
            cls.poll_message_set("Only available in Object Mode")
            return False
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no active camera; add one with Add > Camera")
            return False
        return True

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, Statistics]:
        with auto_refresh.paused():
            depsgraph = context.evaluated_depsgraph_get()
            return (yield from job.refine_steps(context.scene, depsgraph, view_layer=context.view_layer))

    def finish(self, context: bpy.types.Context, statistics: Statistics) -> set[str]:
        prepare_scene(context.scene)
        if statistics.complete:
            auto_refresh.refined(context.scene)
        forget_render_errors()
        redraw()
        self.report(
            {'INFO'},
            f"{counted(statistics.plants, 'plant')}: {statistics.polygons_meshed:,} of {statistics.polygons_full:,} "
            f"polygons, {statistics.tetrahedra_proxy:,} proxies in {sum(statistics.seconds.values()):.1f} s",
        )
        if not statistics.complete and statistics.levels:
            self.report({'INFO'}, "Stopped early; click Refine again to complete the result")
        outside = _cut_off(context.scene) or _unseen(context.scene, statistics)
        for warning in (outside, few_bounces(context.scene), _unread_world(context.scene)):
            if warning:
                self.report({'WARNING'}, warning)
        return {'FINISHED'}


def _unread_world(scene: bpy.types.Scene) -> str:
    """Parts of the world that baked lighting could not read, else an empty text."""
    if scene.tetflora.baked_light == 'OFF' or scene.tetflora.expand_everything:
        return ""
    note = read_world(scene).note
    return f"Baked lighting: {note}" if note else ""


def _unseen(scene: bpy.types.Scene, statistics: Statistics) -> str:
    """A warning if the camera sees no plant at all, so that nothing was divided after the first look; else empty."""
    if statistics.levels != 1 or statistics.polygons_meshed or scene.tetflora.max_passes:
        return ""
    return (
        f'The camera "{scene.camera.name}" sees no plants. Press Numpad 0 to look through it, and check that it '
        "points at the plants and is not inside an object"
    )


def _cut_off(scene: bpy.types.Scene) -> str:
    """A warning if the camera's range ends before some plants, else an empty text.

    A new file's camera ends at 100 m: a forest then renders as nothing, and nobody sees why.
    """
    camera, plants = scene.camera, [o for o in plants_of(scene.objects) if o.tetflora.enabled and not o.hide_render]
    to_camera = camera.matrix_world.normalized().inverted_safe()
    end = camera.data.clip_end
    beyond = sum(-(to_camera @ obj.matrix_world.translation).z > end for obj in plants)
    if not beyond:
        return ""
    return (
        f"{beyond:,} of {counted(len(plants), 'plant')} are beyond the camera range and invisible; "
        f'raise the Clip End of "{camera.name}", which is {end:g} m'
    )


CLASSES = (TETFLORA_OT_refine,)
