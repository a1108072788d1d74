# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do. Each file owns its operators and lists them in its ``CLASSES``."""

# ruff: noqa: F401 (the imports are the registry: a new file of operators is registered by its line here)

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

CLASSES = tuple(cls for module in tuple(vars().values()) for cls in getattr(module, "CLASSES", ()))

register, unregister = bpy.utils.register_classes_factory(CLASSES)
