# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common: errors of the artist become reports, and the selection is read in one way.

Operators that work step by step: at once in scripts, in the window between redraws, with progress and Esc.
"""

import time
from collections.abc import Generator
from typing import Any

import bpy

from ..tetflora_addon.blender.placing.plant_objects import plants_of
from ..tetflora_addon.errors import TetFloraError
from ..tetflora_addon.refinement.statistics import Progress, at_once


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


# Seconds of work between two looks at the keyboard.
_SLICE = 0.05


class ModalJob(Reporting):
    """Mix-in for operators: `steps` yields progress and returns what `finish` reports.

    Closing the steps leaves everything as it was.
    """

    #: What is reported after Esc, and what the status bar says of keys.
    cancelled = "Cancelled; the scene is unchanged"
    keys = "Esc: Cancel"

    _steps: Generator[Progress, bool | None, Any] | None = None
    _timer: bpy.types.Timer | None = None
    _enough = False

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, Any]:
        """The work; True is sent to it when the artist presses Return, if `keys` tells of it."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, result: Any) -> set[str]:
        """Report; the operator's result."""
        raise NotImplementedError

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.finish(context, at_once(self.steps(context)))

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._steps = self.steps(context)
        try:
            # The scene is read in the second step: what is wrong with it is said while the artist still looks here.
            for _ in range(2):
                progress = next(self._steps)
        except StopIteration as stop:
            self._steps = None
            return self.finish(context, stop.value)
        except TetFloraError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        manager = context.window_manager
        manager.progress_begin(0.0, 1.0)
        self._show(context, progress)
        self._timer = manager.event_timer_add(_SLICE / 5.0, window=context.window)
        manager.modal_handler_add(self)
        return {'RUNNING_MODAL'}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == 'ESC' and event.value == 'PRESS':
            self.cancel(context)
            self.report({'INFO'}, self.cancelled)
            return {'CANCELLED'}
        if event.type in {'RET', 'NUMPAD_ENTER'} and event.value == 'PRESS':
            self._enough = True
        if event.type != 'TIMER':
            # Everything else waits: the scene must not change under the job.
            return {'RUNNING_MODAL'}
        end = time.monotonic() + _SLICE
        try:
            progress = self._next()
            while time.monotonic() < end:
                progress = self._next()
        except StopIteration as stop:
            self._leave(context)
            return self.finish(context, stop.value)
        except TetFloraError as error:
            self.cancel(context)
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        except BaseException:
            self.cancel(context)
            raise
        self._show(context, progress)
        return {'RUNNING_MODAL'}

    def cancel(self, context: bpy.types.Context) -> None:
        """Esc, or Blender ends the operator: what was half made goes."""
        if self._steps is not None:
            self._steps.close()
        self._leave(context)

    def _next(self) -> Progress:
        enough, self._enough = self._enough, False
        return self._steps.send(enough)

    def _show(self, context: bpy.types.Context, progress: Progress) -> None:
        context.window_manager.progress_update(progress.fraction)
        told = f"TetFlora {progress.fraction:4.0%}   {progress.message}   |   {self.keys}"
        context.workspace.status_text_set(told)

    def _leave(self, context: bpy.types.Context) -> None:
        self._steps = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
