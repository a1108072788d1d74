# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""First Forest: where the tab begins as long as the scene has no plants, with the step that comes next."""

import bpy

from ..operators import ids
from ..tetflora_addon.blender.first_forest import is_first_forest
from ..tetflora_addon.blender.scene_reader import has_contents
from .base import SidebarPanel

_FEW = 200  # objects that are looked through at every movement of the mouse; who has more has begun


class TETFLORA_PT_first(SidebarPanel, bpy.types.Panel):
    """First forest."""

    bl_label = "Begin"
    bl_order = -1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        if len(scene.objects) > _FEW:
            return False
        return not has_contents(scene) or (is_first_forest(scene) and not scene.tetflora.statistics)

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        row = column.row()
        row.scale_y = 1.6
        if is_first_forest(context.scene):
            row.operator(ids.REFINE, icon='MOD_DECIM')
            column.label(text="Then F12")
        else:
            row.operator(ids.FIRST_FOREST, icon='WORLD')
            column.label(text="Then Refine, then F12")
