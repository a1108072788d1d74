# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Empty the cache folder."""

import bpy

from ..tetflora_addon import cache_folder
from .base import Reporting, counted


class TETFLORA_OT_clear_cache(Reporting, bpy.types.Operator):
    """Delete what was kept about species."""

    bl_idname = "tetflora.clear_cache"
    bl_label = "Clear Cache"
    bl_description = (
        "Delete all cached species analysis, and nothing else in the folder. It is computed again when needed"
    )
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if cache_folder.used() is None:
            cls.poll_message_set("The cache folder does not exist")
            return False
        return True

    def run(self, _context: bpy.types.Context) -> set[str]:
        self.report({'INFO'}, f"{counted(cache_folder.clear(), 'file')} deleted from {cache_folder.used()}")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_clear_cache,)
