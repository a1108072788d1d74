# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do. Each file owns its operators and lists them in its ``CLASSES``."""

# ruff: noqa: F401 (the imports are the registry: a new file of operators is registered by its line here)

import bpy

from . import (
    add,
    assets,
    biomes,
    brush,
    ground_cover,
    ground_tools,
    marks,
    places,
    plants,
    populations,
    preview,
    refine,
    report,
    species,
    stands,
    year,
)

CLASSES = tuple(cls for module in tuple(vars().values()) for cls in getattr(module, "CLASSES", ()))

register, unregister = bpy.utils.register_classes_factory(CLASSES)
