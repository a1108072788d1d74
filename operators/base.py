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
    cls.poll_message_set("Only available in Object Mode")
    return False


LINKED = (
    "The plants are linked from another file; use Object > Relations > Make Local, or Object > Library Override > Make"
)


def plants_selected(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: at least one plant is selected that this file may change."""
    plants = plants_of(context.selected_objects)
    if any(obj.library is None for obj in plants):
        return True
    cls.poll_message_set(LINKED if plants else "Select plants first")
    return False


def plants_or_fields_selected(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: at least one plant or field of plants is selected that this file may change."""
    found = [obj for obj in context.selected_objects if obj.tetflora.is_plant or obj.tetflora.is_field]
    if any(obj.library is None for obj in found):
        return True
    cls.poll_message_set(LINKED if found else "Select plants or a field of plants first")
    return False


def selected_plants(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected plants that this file may change: those that are linked would be as before when it is opened again."""
    return [obj for obj in plants_of(context.selected_objects) if obj.library is None]


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
