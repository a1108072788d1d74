# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done most, around the mouse: the menu that Alt Shift F opens."""

import bpy

from ..operators.clear import TETFLORA_OT_clear
from ..operators.drop_to_ground import TETFLORA_OT_drop_to_ground
from ..operators.first_forest import TETFLORA_OT_first_forest
from ..operators.keymaps import PIE
from ..operators.paint_plants import TETFLORA_OT_paint_plants
from ..operators.populate import TETFLORA_OT_populate
from ..operators.refine import TETFLORA_OT_refine
from .add_menu import TETFLORA_MT_place_plant, TETFLORA_MT_species


class TETFLORA_MT_pie(bpy.types.Menu):
    """The pie menu of the 3D view."""

    bl_idname = PIE
    bl_label = "TetFlora"

    def draw(self, _context: bpy.types.Context) -> None:
        pie = self.layout.menu_pie()
        # West, east, south, north, north-west, north-east, south-west, south-east: Blender's own order.
        pie.operator(TETFLORA_OT_paint_plants.bl_idname, icon='BRUSH_DATA')
        pie.operator(TETFLORA_OT_refine.bl_idname, icon='MOD_DECIM')
        pie.operator(TETFLORA_OT_populate.bl_idname, text="Populate with Plants", icon='OUTLINER_OB_POINTCLOUD')
        pie.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
        pie.operator(TETFLORA_OT_drop_to_ground.bl_idname, icon='TRIA_DOWN_BAR')
        pie.operator(TETFLORA_OT_clear.bl_idname, icon='TRASH')
        pie.operator(TETFLORA_OT_first_forest.bl_idname, icon='WORLD')
        pie.menu(TETFLORA_MT_species.__name__, text="Change Species", icon='OUTLINER_OB_EMPTY')


CLASSES = (TETFLORA_MT_pie,)
