# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sees: a tab in the 3D view's sidebar, entries in the Add and Object menus. Nothing here computes."""

import bpy

from ..tetflora_addon.blender import handlers
from . import (
    add_menu,
    brush_panel,
    first_panel,
    lists,
    nothing_refined,
    object_menu,
    output_panel,
    pie_menu,
    plants_panel,
    populate_panel,
    preferences_page,
    preview_panel,
    refine_panel,
    refinement_panel,
    species_panel,
    statistics_panel,
    wind_panel,
)

# In the order of registration, which is that of the panels in the tab: as an artist works, a panel after its parent.
_MODULES = (
    lists,
    first_panel,
    refine_panel,
    refinement_panel,
    plants_panel,
    populate_panel,
    brush_panel,
    species_panel,
    wind_panel,
    output_panel,
    preview_panel,
    statistics_panel,
    add_menu,
    nothing_refined,
    object_menu,
    pie_menu,
)
CLASSES = tuple(cls for module in _MODULES for cls in module.CLASSES)

_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Register panels and menus."""
    _register()
    preferences_page.register()
    bpy.types.VIEW3D_MT_add.append(add_menu.draw_in_add_menu)
    bpy.types.VIEW3D_MT_object.append(object_menu.draw_in_object_menu)
    handlers.nothing_refined.append(nothing_refined.open_nothing_refined)


def unregister() -> None:
    """Unregister panels and menus."""
    handlers.nothing_refined.remove(nothing_refined.open_nothing_refined)
    bpy.types.VIEW3D_MT_object.remove(object_menu.draw_in_object_menu)
    bpy.types.VIEW3D_MT_add.remove(add_menu.draw_in_add_menu)
    preferences_page.unregister()
    _unregister()
