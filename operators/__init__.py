# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do: one operator a file, each calls tetflora_addon.blender and reports."""

import bpy

from . import (
    add_plant,
    assign_species,
    clear,
    clear_cache,
    drop_to_ground,
    edit_list,
    field_plants,
    first_forest,
    keep_results,
    make_plant_mesh,
    mark_explicit,
    mark_occluder,
    paint_plants,
    place_plant,
    populate,
    population_files,
    populations,
    preview_levels,
    refine,
    remove_plants,
    reseed,
    select_species,
    species_assets,
    species_edit,
    species_files,
    species_preview,
    use_as_form,
)

CLASSES = (
    add_plant.TETFLORA_OT_add_plant,
    use_as_form.TETFLORA_OT_use_as_form,
    populate.TETFLORA_OT_populate,
    *populations.CLASSES,
    *population_files.CLASSES,
    first_forest.TETFLORA_OT_first_forest,
    paint_plants.TETFLORA_OT_paint_plants,
    place_plant.TETFLORA_OT_place_plant,
    drop_to_ground.TETFLORA_OT_drop_to_ground,
    assign_species.TETFLORA_OT_assign_species,
    reseed.TETFLORA_OT_reseed,
    select_species.TETFLORA_OT_select_species,
    remove_plants.TETFLORA_OT_remove_plants,
    mark_occluder.TETFLORA_OT_mark_occluder,
    mark_explicit.TETFLORA_OT_mark_explicit,
    field_plants.TETFLORA_OT_mark_field,
    field_plants.TETFLORA_OT_make_field,
    field_plants.TETFLORA_OT_split_field,
    edit_list.TETFLORA_OT_edit_list,
    refine.TETFLORA_OT_refine,
    clear.TETFLORA_OT_clear,
    preview_levels.TETFLORA_OT_preview_levels,
    preview_levels.TETFLORA_OT_forget_levels,
    preview_levels.TETFLORA_OT_look_through,
    keep_results.TETFLORA_OT_keep_results,
    make_plant_mesh.TETFLORA_OT_make_plant_mesh,
    species_edit.TETFLORA_OT_duplicate_species,
    species_edit.TETFLORA_OT_revert_species,
    species_edit.TETFLORA_OT_edit_orders,
    species_preview.TETFLORA_OT_preview_species,
    species_files.TETFLORA_OT_save_species,
    species_files.TETFLORA_OT_load_species,
    species_files.TETFLORA_OT_export_species,
    species_files.TETFLORA_OT_delete_species,
    species_assets.TETFLORA_OT_create_asset_library,
    clear_cache.TETFLORA_OT_clear_cache,
)


def register() -> None:
    """Register all operators."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister all operators."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
