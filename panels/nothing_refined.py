# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Popup for a render without plants because nothing is refined: the reason and the remedies."""

import bpy

from ..operators.refine import TETFLORA_OT_refine
from ..tetflora_addon.blender.runtime import open_menu


class TETFLORA_MT_nothing_refined(bpy.types.Menu):
    """Nothing is refined."""

    bl_idname = "TETFLORA_MT_nothing_refined"
    bl_label = "The Render Shows No Plants"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.label(text="Nothing is refined, and Refine at Render is off", icon='INFO')
        self.layout.operator(TETFLORA_OT_refine.bl_idname, icon='MOD_DECIM')
        self.layout.prop(context.scene.tetflora, "refine_at_render")


def open_nothing_refined() -> None:
    """Open the menu, where there is a window."""
    open_menu(TETFLORA_MT_nothing_refined.bl_idname)


CLASSES = (TETFLORA_MT_nothing_refined,)
