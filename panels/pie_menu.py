# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done most, around the mouse: the menu that Alt Shift F opens."""

import bpy

from ..operators import ids
from ..tetflora_addon.blender.keymaps import PIE


class TETFLORA_MT_pie(bpy.types.Menu):
    """The pie menu of the 3D view."""

    bl_idname = PIE
    bl_label = "TetFlora"

    def draw(self, _context: bpy.types.Context) -> None:
        pie = self.layout.menu_pie()
        # West, east, south, north, north-west, north-east, south-west, south-east: Blender's own order.
        pie.operator(ids.PAINT_PLANTS, icon='BRUSH_DATA')
        pie.operator(ids.REFINE, icon='MOD_DECIM')
        pie.operator(ids.POPULATE, text="Populate with Plants", icon='OUTLINER_OB_POINTCLOUD')
        pie.menu("TETFLORA_MT_place_plant", icon='RESTRICT_SELECT_OFF')
        pie.operator(ids.DROP_TO_GROUND, icon='TRIA_DOWN_BAR')
        pie.operator(ids.CLEAR, icon='TRASH')
        pie.operator(ids.FIRST_FOREST, icon='WORLD')
        pie.menu("TETFLORA_MT_species", text="Change Species", icon='OUTLINER_OB_EMPTY')
