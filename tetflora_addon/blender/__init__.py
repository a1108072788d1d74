# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything below the operators that uses bpy: properties, reading scenes, writing results, rendering."""

from . import main_thread, preferences, properties, runtime, saved_files, translations, worker
from .biomes import layers, library
from .cli import command
from .job import forecast, render, stored_contents
from .placing import assets, rules
from .runtime import in_order
from .species import catalog, edits
from .viewport import auto, levels, overlay, points, warnings
from .viewport import species as species_preview  # or the room of that name could not be read as an attribute

# Handlers and commands read properties, so those come first.
register, unregister = in_order(
    main_thread,
    worker,
    runtime,
    preferences,
    catalog,
    library.pictures,
    properties,
    render,
    forecast,
    stored_contents,
    saved_files,
    edits,
    auto,
    levels,
    overlay,
    species_preview,
    points,
    warnings,
    assets,
    rules,
    layers,
    command,
    translations,
)
