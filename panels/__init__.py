# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sees: a tab in the 3D view's sidebar, panels in Properties, tools, menus. Nothing here computes."""

import bpy

from ..tetflora_addon.blender.job import render
from ..tetflora_addon.blender.runtime import classes_in
from . import base, help, layers, menus, outputs, plants, preferences, refine, season, species, tools

# In the order of registration, which is that of the panels in the tab: as an artist works, a panel after its parent.
_MODULES = (base, refine, layers, plants, season, species, outputs, menus)
CLASSES = classes_in(_MODULES, bpy.types.Panel, bpy.types.Menu, bpy.types.UIList)

#: Menus and popovers of Blender's, and what draws entries in them.
_ADDED = (
    ("VIEW3D_PT_overlay_object", outputs.draw_in_overlays),
    ("VIEW3D_MT_add", menus.draw_in_add_menu),
    ("TOPBAR_MT_file_import", menus.draw_in_import_menu),
    ("TOPBAR_MT_file_export", menus.draw_in_export_menu),
    ("VIEW3D_MT_object", menus.draw_in_object_menu),
    ("OUTLINER_MT_object", menus.draw_in_outliner),
    ("OUTLINER_MT_collection", menus.draw_in_outliner),
)

_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Register panels and menus."""
    _register()
    preferences.register()
    tools.register()
    help.register()
    for name, draw in _ADDED:
        getattr(bpy.types, name).append(draw)
    render.nothing_refined.append(menus.open_nothing_refined)


def unregister() -> None:
    """Unregister panels and menus."""
    render.nothing_refined.remove(menus.open_nothing_refined)
    for name, draw in reversed(_ADDED):
        getattr(bpy.types, name).remove(draw)
    help.unregister()
    tools.unregister()
    preferences.unregister()
    _unregister()
