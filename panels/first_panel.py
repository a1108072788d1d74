# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""First Forest: at the top of the tab while the scene has no plants."""

import bpy

from ..operators.first_forest import TETFLORA_OT_first_forest
from ..tetflora_addon.blender.view_layers import has_contents
from .base import SidebarPanel

_FEW = 200  # objects that are looked through at every movement of the mouse; who has more has begun


class TETFLORA_PT_first(SidebarPanel, bpy.types.Panel):
    """First forest."""

    bl_label = "Get Started"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        return len(scene.objects) <= _FEW and not has_contents(scene)

    def draw(self, _context: bpy.types.Context) -> None:
        column = self.layout.column()
        row = column.row()
        row.scale_y = 1.6
        row.operator(TETFLORA_OT_first_forest.bl_idname, icon='WORLD')
        column.label(text="Then click Refine and press F12")


CLASSES = (TETFLORA_PT_first,)
