# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do: all operators of these files."""

# ruff: noqa: F401 (the imports are the registry: a new file of operators is registered by its line here)

import bpy

from ..tetflora_addon.blender.runtime import classes_in
from . import (
    add,
    assets,
    brush,
    ground_tools,
    growing,
    layers,
    marks,
    places,
    plants,
    preview,
    refine,
    report,
    species,
    view,
)

CLASSES = classes_in(tuple(vars().values()), bpy.types.Operator)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
