# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Object > TetFlora: the operators once more, because Blender's search (F3) finds only what stands in a menu."""

import bpy

from ..operators import ids
from .plants_panel import TETFLORA_MT_species


class TETFLORA_MT_object(bpy.types.Menu):
    """What can be done to plants and ground."""

    bl_label = "TetFlora"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(ids.POPULATE, text="Populate with Plants", icon='OUTLINER_OB_POINTCLOUD')
        layout.operator(ids.MARK_OCCLUDER, text="Mark or Unmark as Hiding Plants", icon='MOD_MASK')
        layout.operator(ids.MARK_EXPLICIT, text="Refine or Leave These Meshes", icon='MESH_ICOSPHERE')
        layout.operator(ids.USE_AS_FORM, icon='CURVE_DATA')
        layout.operator(ids.MARK_FIELD, text="Use or Stop Using as Field of Plants", icon='POINTCLOUD_DATA')
        layout.operator(ids.MAKE_FIELD, icon='POINTCLOUD_DATA')
        layout.operator(ids.SPLIT_FIELD, icon='OUTLINER_OB_EMPTY')
        layout.separator()
        layout.operator(ids.PAINT_PLANTS, icon='BRUSH_DATA')
        layout.menu("TETFLORA_MT_place_plant", icon='RESTRICT_SELECT_OFF')
        layout.operator(ids.DROP_TO_GROUND, icon='TRIA_DOWN_BAR')
        layout.separator()
        layout.menu(TETFLORA_MT_species.__name__, text="Change Species", icon='OUTLINER_OB_EMPTY')
        layout.operator(ids.RESEED, icon='FILE_REFRESH')
        layout.operator(ids.SELECT_SPECIES, text="Select All of This Species", icon='RESTRICT_SELECT_OFF')
        layout.operator(ids.MAKE_PLANT_MESH, icon='OUTLINER_OB_MESH')
        layout.operator(ids.REMOVE_PLANTS, text="Remove Selected Plants", icon='X').which = 'SELECTED'
        layout.operator(ids.REMOVE_PLANTS, text="Remove All Plants", icon='TRASH').which = 'ALL'
        layout.separator()
        layout.operator(ids.REFINE, text="Refine Plants", icon='MOD_DECIM')
        layout.operator(ids.CLEAR, text="Clear Refined Plants", icon='TRASH')


def draw_in_object_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in the 3D view's Object menu."""
    menu.layout.separator()
    menu.layout.menu(TETFLORA_MT_object.__name__, icon='OUTLINER_OB_FORCE_FIELD')
