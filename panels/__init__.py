# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sees: a tab in the 3D view's sidebar, panels in Properties, tools, menus. Nothing here computes."""

import bpy

from ..tetflora_addon.blender.job import render
from ..tetflora_addon.blender.runtime import classes_in
from . import base, layers, menus, outputs, places, plants, preferences, refine, season, species, tools

# In the order of registration, which is that of the panels in the tab: as an artist works, a panel after its parent.
_MODULES = (base, refine, layers, plants, season, places, species, outputs, menus)
CLASSES = classes_in(_MODULES, bpy.types.Panel, bpy.types.Menu, bpy.types.UIList)

_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Register panels and menus."""
    _register()
    preferences.register()
    tools.register()
    bpy.types.VIEW3D_PT_overlay_object.append(outputs.draw_in_overlays)
    bpy.types.VIEW3D_MT_add.append(menus.draw_in_add_menu)
    bpy.types.TOPBAR_MT_file_import.append(places.draw_in_import_menu)
    bpy.types.VIEW3D_MT_object.append(menus.draw_in_object_menu)
    for menu in (bpy.types.OUTLINER_MT_object, bpy.types.OUTLINER_MT_collection):
        menu.append(menus.draw_in_outliner)
    render.nothing_refined.append(menus.open_nothing_refined)


def unregister() -> None:
    """Unregister panels and menus."""
    render.nothing_refined.remove(menus.open_nothing_refined)
    for menu in (bpy.types.OUTLINER_MT_object, bpy.types.OUTLINER_MT_collection):
        menu.remove(menus.draw_in_outliner)
    bpy.types.VIEW3D_MT_object.remove(menus.draw_in_object_menu)
    bpy.types.TOPBAR_MT_file_import.remove(places.draw_in_import_menu)
    bpy.types.VIEW3D_MT_add.remove(menus.draw_in_add_menu)
    bpy.types.VIEW3D_PT_overlay_object.remove(outputs.draw_in_overlays)
    tools.unregister()
    preferences.unregister()
    _unregister()
