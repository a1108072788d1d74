# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Object > TetFlora: the operators once more, because Blender's search (F3) finds only what stands in a menu."""

import bpy

from ..operators.clear import TETFLORA_OT_clear
from ..operators.drop_to_ground import TETFLORA_OT_drop_to_ground
from ..operators.field_plants import TETFLORA_OT_make_field, TETFLORA_OT_mark_field, TETFLORA_OT_split_field
from ..operators.make_plant_mesh import TETFLORA_OT_make_plant_mesh
from ..operators.mark_explicit import TETFLORA_OT_mark_explicit
from ..operators.mark_occluder import TETFLORA_OT_mark_occluder
from ..operators.paint_plants import TETFLORA_OT_paint_plants
from ..operators.populate import TETFLORA_OT_populate
from ..operators.refine import TETFLORA_OT_refine
from ..operators.remove_plants import TETFLORA_OT_remove_plants
from ..operators.reseed import TETFLORA_OT_reseed
from ..operators.select_species import TETFLORA_OT_select_species
from ..operators.use_as_form import TETFLORA_OT_use_as_form
from .add_menu import TETFLORA_MT_place_plant, TETFLORA_MT_species


class TETFLORA_MT_object(bpy.types.Menu):
    """What can be done to plants and ground."""

    bl_label = "TetFlora"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(TETFLORA_OT_populate.bl_idname, text="Populate with Plants", icon='OUTLINER_OB_POINTCLOUD')
        layout.operator(TETFLORA_OT_mark_occluder.bl_idname, text="Mark or Unmark as Occluder", icon='MOD_MASK')
        layout.operator(
            TETFLORA_OT_mark_explicit.bl_idname, text="Refine or Ignore These Meshes", icon='MESH_ICOSPHERE'
        )
        layout.operator(TETFLORA_OT_use_as_form.bl_idname, icon='CURVE_DATA')
        layout.operator(
            TETFLORA_OT_mark_field.bl_idname, text="Use or Stop Using as Field of Plants", icon='POINTCLOUD_DATA'
        )
        layout.operator(TETFLORA_OT_make_field.bl_idname, icon='POINTCLOUD_DATA')
        layout.operator(TETFLORA_OT_split_field.bl_idname, icon='OUTLINER_OB_EMPTY')
        layout.separator()
        layout.operator(TETFLORA_OT_paint_plants.bl_idname, icon='BRUSH_DATA')
        layout.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
        layout.operator(TETFLORA_OT_drop_to_ground.bl_idname, icon='TRIA_DOWN_BAR')
        layout.separator()
        layout.menu(TETFLORA_MT_species.__name__, text="Change Species", icon='OUTLINER_OB_EMPTY')
        layout.operator(TETFLORA_OT_reseed.bl_idname, icon='FILE_REFRESH')
        layout.operator(
            TETFLORA_OT_select_species.bl_idname, text="Select All of This Species", icon='RESTRICT_SELECT_OFF'
        )
        layout.operator(TETFLORA_OT_make_plant_mesh.bl_idname, icon='OUTLINER_OB_MESH')
        layout.operator(TETFLORA_OT_remove_plants.bl_idname, text="Remove Selected Plants", icon='X').which = 'SELECTED'
        layout.operator(TETFLORA_OT_remove_plants.bl_idname, text="Remove All Plants", icon='TRASH').which = 'ALL'
        layout.separator()
        layout.operator(TETFLORA_OT_refine.bl_idname, text="Refine Plants", icon='MOD_DECIM')
        layout.operator(TETFLORA_OT_clear.bl_idname, text="Clear Refined Plants", icon='TRASH')


def draw_in_object_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in the 3D view's Object menu."""
    menu.layout.separator()
    menu.layout.menu(TETFLORA_MT_object.__name__, icon='OUTLINER_OB_FORCE_FIELD')


CLASSES = (TETFLORA_MT_object,)
