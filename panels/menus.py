# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add > TetFlora Plant, > Place Plants by Clicking, with an entry for each species, and > First Forest.

Object > TetFlora: the operators once more, because Blender's search (F3) finds only what stands in a menu.

What is done most, around the mouse: the menu that Alt Shift F opens.

Popup for a render without plants because nothing is refined: the reason and the remedies.
"""

import bpy

from ..operators.add import (
    TETFLORA_OT_add_plant,
    TETFLORA_OT_first_forest,
    TETFLORA_OT_populate,
    TETFLORA_OT_use_as_form,
)
from ..operators.brush import TETFLORA_OT_paint_plants
from ..operators.ground_tools import TETFLORA_OT_place_plant
from ..operators.marks import (
    TETFLORA_OT_make_field,
    TETFLORA_OT_mark_explicit,
    TETFLORA_OT_mark_field,
    TETFLORA_OT_mark_occluder,
    TETFLORA_OT_split_field,
)
from ..operators.plants import (
    TETFLORA_OT_assign_species,
    TETFLORA_OT_drop_to_ground,
    TETFLORA_OT_remove_plants,
    TETFLORA_OT_reseed,
    TETFLORA_OT_select_species,
)
from ..operators.refine import TETFLORA_OT_clear, TETFLORA_OT_make_plant_mesh, TETFLORA_OT_refine
from ..tetflora_addon.blender.runtime import open_menu
from ..tetflora_addon.blender.species.edits import catalogue
from .base import picture
from .preferences import PIE


class TETFLORA_MT_species(bpy.types.Menu):
    """Species to give to the selected plants."""

    bl_label = "Change Species"

    def draw(self, _context: bpy.types.Context) -> None:
        for info in catalogue().values():
            icon = picture(info.identifier)
            self.layout.operator(TETFLORA_OT_assign_species.bl_idname, text=info.name, **icon).species = info.identifier


class TETFLORA_MT_add_plant(bpy.types.Menu):
    """Species to add a plant of."""

    bl_label = "TetFlora Plant"

    def draw(self, _context: bpy.types.Context) -> None:
        known = catalogue()
        for info in known.values():
            icon = picture(info.identifier)
            self.layout.operator(TETFLORA_OT_add_plant.bl_idname, text=info.name, **icon).species = info.identifier
        if not known:
            self.layout.label(text="The catalog has no species", icon='ERROR')


class TETFLORA_MT_place_plant(bpy.types.Menu):
    """Species to set by clicking on the ground."""

    bl_label = "Place Plants by Clicking"

    def draw(self, _context: bpy.types.Context) -> None:
        # Buttons of a menu are executed by default, and this tool needs the mouse.
        self.layout.operator_context = 'INVOKE_DEFAULT'
        for info in catalogue().values():
            icon = picture(info.identifier)
            self.layout.operator(TETFLORA_OT_place_plant.bl_idname, text=info.name, **icon).species = info.identifier


def draw_in_add_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in Blender's Add menu."""
    menu.layout.separator()
    menu.layout.operator(TETFLORA_OT_first_forest.bl_idname, icon='WORLD')
    menu.layout.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
    menu.layout.menu(TETFLORA_MT_add_plant.__name__, icon='OUTLINER_OB_FORCE_FIELD')


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


CLASSES = (
    TETFLORA_MT_species,
    TETFLORA_MT_add_plant,
    TETFLORA_MT_place_plant,
    TETFLORA_MT_object,
    TETFLORA_MT_pie,
    TETFLORA_MT_nothing_refined,
)
