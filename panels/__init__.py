# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sees: a tab in the 3D view's sidebar, panels in Properties, tools, menus. Nothing here computes."""

from functools import partial

import bpy

from ..tetflora_addon.blender.job import render
from ..tetflora_addon.blender.runtime import Part, classes_in, in_order, listening, open_menu
from . import base, help, layers, menus, outputs, plants, preferences, refine, season, species, tools

# In the order of registration, which is that of the panels in the tab: as an artist works, a panel after its parent.
_MODULES = (base, refine, layers, plants, season, species, outputs, menus)
CLASSES = classes_in(_MODULES, bpy.types.Panel, bpy.types.Menu, bpy.types.UIList)

register, unregister = in_order(
    Part(*bpy.utils.register_classes_factory(CLASSES)),
    *(preferences, tools, help),
    listening(outputs.draw_in_overlays, bpy.types.VIEW3D_PT_overlay_object),
    listening(menus.draw_in_add_menu, bpy.types.VIEW3D_MT_add),
    listening(menus.draw_in_import_menu, bpy.types.TOPBAR_MT_file_import),
    listening(menus.draw_in_export_menu, bpy.types.TOPBAR_MT_file_export),
    listening(menus.draw_in_object_menu, bpy.types.VIEW3D_MT_object),
    listening(menus.draw_in_outliner, bpy.types.OUTLINER_MT_object, bpy.types.OUTLINER_MT_collection),
    listening(partial(open_menu, menus.TETFLORA_MT_nothing_refined.__name__), render.nothing_refined),
)
