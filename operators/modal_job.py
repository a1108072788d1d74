# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that work step by step: at once in scripts, in the window between redraws, with progress and Esc."""

import time
from collections.abc import Generator
from typing import Any

import bpy

from ..tetflora_addon.errors import TetFloraError
from ..tetflora_addon.refinement.statistics import Progress, at_once
from .base import Reporting

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
