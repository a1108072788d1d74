# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mark objects whose own polygons are refined."""

import bpy

from ..tetflora_addon.blender.explicit_objects import SURFACE_TYPES
from ..tetflora_addon.blender.view_layers import may_instance
from .marking import Marking, action_property


def can_be_explicit(obj: bpy.types.Object) -> bool:
    """Whether an object has a surface of its own that could be refined, or instances some."""
    group = obj.tetflora
    return not (group.is_plant or group.is_field) and (obj.type in SURFACE_TYPES or may_instance(obj))


class TETFLORA_OT_mark_explicit(Marking, bpy.types.Operator):
    """Let the selected objects' own polygons take part in refinement, or take the mark away."""

    bl_idname = "tetflora.mark_explicit"
    bl_label = "Refine These Meshes"
    bl_description = (
        "Refine the polygons of the selected objects together with the plants: imported trees, rocks, scans, and "
        "objects that instance them. Use again to unmark"
    )
    bl_options = {'REGISTER', 'UNDO'}
    mark, nothing, marked = "is_explicit", "Select meshes, or objects that instance them, first", "{} will be refined"

    action: action_property("Refine the polygons of the objects", "Leave the objects unchanged")

    fits = staticmethod(can_be_explicit)


CLASSES = (TETFLORA_OT_mark_explicit,)
