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
    preview_panel,
    refine_panel,
    refinement_panel,
    species_panel,
    statistics_panel,
    wind_panel,
)

CLASSES = (
    lists.TETFLORA_UL_mix,
    lists.TETFLORA_UL_leaf_objects,
    lists.TETFLORA_UL_field_species,
    lists.TETFLORA_UL_output_species,
    refine_panel.TETFLORA_PT_refine,
    first_panel.TETFLORA_PT_first,
    plants_panel.TETFLORA_PT_plants,
    plants_panel.TETFLORA_PT_selected_plants,
    species_panel.TETFLORA_MT_species_files,
    species_panel.TETFLORA_PT_species,
    species_panel.TETFLORA_PT_species_orders,
    species_panel.TETFLORA_PT_species_leaves,
    species_panel.TETFLORA_PT_species_whole,
    *populate_panel.CLASSES,
    brush_panel.TETFLORA_PT_brush,
    refinement_panel.TETFLORA_PT_refinement,
    refinement_panel.TETFLORA_PT_films,
    refinement_panel.TETFLORA_PT_limits,
    refinement_panel.TETFLORA_PT_proxy_shading,
    refinement_panel.TETFLORA_PT_leaf_objects,
    preview_panel.TETFLORA_PT_preview,
    wind_panel.TETFLORA_PT_wind,
    output_panel.TETFLORA_PT_output,
    output_panel.TETFLORA_PT_ray_visibility,
    output_panel.TETFLORA_PT_passes,
    statistics_panel.TETFLORA_PT_statistics,
    statistics_panel.TETFLORA_PT_steps,
    add_menu.TETFLORA_MT_add_plant,
    nothing_refined.TETFLORA_MT_nothing_refined,
    add_menu.TETFLORA_MT_place_plant,
    plants_panel.TETFLORA_MT_species,
    object_menu.TETFLORA_MT_object,
    pie_menu.TETFLORA_MT_pie,
)


def register() -> None:
    """Register panels and menus."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.VIEW3D_MT_add.append(add_menu.draw_in_add_menu)
    bpy.types.VIEW3D_MT_object.append(object_menu.draw_in_object_menu)
    handlers.nothing_refined.append(nothing_refined.open_nothing_refined)


def unregister() -> None:
    """Unregister panels and menus."""
    handlers.nothing_refined.remove(nothing_refined.open_nothing_refined)
    bpy.types.VIEW3D_MT_object.remove(object_menu.draw_in_object_menu)
    bpy.types.VIEW3D_MT_add.remove(add_menu.draw_in_add_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
