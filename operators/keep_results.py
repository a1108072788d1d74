# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn results into ordinary meshes of the artist's."""

import bpy

from ..tetflora_addon.blender import auto_refresh
from ..tetflora_addon.blender.emit import result_collections
from ..tetflora_addon.blender.hiding import keep_results
from ..tetflora_addon.errors import TetFloraError
from .base import Reporting, counted


class TETFLORA_OT_keep_results(Reporting, bpy.types.Operator):
    """Make ordinary meshes of what Refine made."""

    bl_idname = "tetflora.keep_results"
    bl_label = "Keep Results as Meshes"
    bl_description = (
        "Turn the results into ordinary meshes that are saved in the file and can be edited. Refine and Clear no "
        "longer change them. Turns off Refine at Render, to avoid rendering the plants twice"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != 'OBJECT':
            cls.poll_message_set("Only available in Object Mode")
            return False
        if not result_collections(context.scene, 'VIEW'):
            cls.poll_message_set("No results to keep; click Refine first")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        auto_refresh.stop()
        if not result_collections(scene, 'VIEW'):
            raise TetFloraError("Refine Automatically has not finished; wait, or click Refine")
        kept = keep_results(scene)
        scene.tetflora.refine_at_render = False
        scene.tetflora.statistics = ""
        self.report({'INFO'}, f"{counted(kept, 'object')} kept as meshes; Refine at Render is off")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_keep_results,)
