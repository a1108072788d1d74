# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common: errors of the artist become reports, and the selection is read in one way."""

import bpy

from ..tetflora_addon.blender.plant_objects import plants_of
from ..tetflora_addon.errors import TetFloraError


class Reporting:
    """Mix-in for operators: ``run`` does the work, and an error of the artist's becomes a report.

    Blender counts the operator as cancelled then, and pushes no undo step.
    """

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            return self.run(context)
        except TetFloraError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}

    def run(self, context: bpy.types.Context) -> set[str]:
        """Do it; the result of ``execute``."""
        raise NotImplementedError


def in_object_mode(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: objects can be made and deleted now."""
    if context.mode == 'OBJECT':
        return True
    cls.poll_message_set("Works in Object Mode")
    return False


def plants_selected(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: at least one plant is selected."""
    if any(obj.tetflora.is_plant for obj in context.selected_objects):
        return True
    cls.poll_message_set("Select plants first")
    return False


def plants_or_fields_selected(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: at least one plant or field of plants is selected."""
    if any(obj.tetflora.is_plant or obj.tetflora.is_field for obj in context.selected_objects):
        return True
    cls.poll_message_set("Select plants first, or a field of plants")
    return False


def selected_plants(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected plants."""
    return plants_of(context.selected_objects)


def select_only(context: bpy.types.Context, objects: list[bpy.types.Object]) -> None:
    """Select these objects and no others, as far as the view layer has them; the first becomes active."""
    for obj in context.selected_objects:
        obj.select_set(False)
    within = set(context.view_layer.objects)
    shown = [obj for obj in objects if obj in within]
    for obj in shown:
        obj.select_set(True)
    if shown:
        context.view_layer.objects.active = shown[0]


def counted(number: int, what: str) -> str:
    """``1 plant``, ``2 plants``."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"
