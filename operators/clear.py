# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Clear what refinement made."""

import bpy

from ..tetflora_addon.blender import auto_refresh, hiding, job
from .base import Reporting, counted, in_object_mode


class TETFLORA_OT_clear(Reporting, bpy.types.Operator):
    """Remove what Refine made."""

    bl_idname = "tetflora.clear"
    bl_label = "Clear"
    bl_description = (
        "Remove all meshes, materials and proxies that Refine created, and nothing else. Plants remain, and hidden "
        "meshes are shown again"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not in_object_mode(cls, context):
            return False
        # Results may have been deleted by hand, which leaves hidden what they stood for. Only then are all objects
        # looked through: a panel asks at every movement of the mouse.
        scene = context.scene
        if not (job.has_results(scene) or (scene.tetflora.statistics and hiding.hidden_originals(scene))):
            cls.poll_message_set("No results to clear")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        auto_refresh.stop()
        hidden = hiding.hidden_originals(context.scene, 'VIEW')
        removed = f"{counted(job.clear(context.scene), 'datablock')} removed"
        shown = sum(hiding.HIDDEN['VIEW'] not in original for original in hidden)
        self.report({'INFO'}, f"{removed}, {counted(shown, 'object')} shown again" if shown else removed)
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_clear,)
