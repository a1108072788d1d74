# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The mechanics of a running Blender: handlers, listeners, timers, redraws and messages in the window."""

from __future__ import annotations

import sys
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

#: Errors of the last render: a text for each frame that was rendered without its plants.
failed_frames: list[str] = []


class Handlers:
    """Functions that Blender calls, which stay registered when another file is loaded.

    Parameters
    ----------
    **functions : callable or tuple of callable
        By the name of their list in `bpy.app.handlers`.
    """

    def __init__(self, **functions: Callable[..., None] | tuple[Callable[..., None], ...]) -> None:
        self._functions = [
            (name, persistent(function))
            for name, given in functions.items()
            for function in (given if isinstance(given, tuple) else (given,))
        ]

    def register(self) -> None:
        """Add them in order."""
        for name, function in self._functions:
            getattr(bpy.app.handlers, name).append(function)

    def unregister(self) -> None:
        """Remove those that are still there."""
        for name, function in self._functions:
            if function in getattr(bpy.app.handlers, name):
                getattr(bpy.app.handlers, name).remove(function)


class Listeners(list):
    """Functions of modules above to call when something changes below."""

    def notify(self, *arguments: object) -> None:
        """Call all of them."""
        for listener in tuple(self):
            listener(*arguments)


def call_soon(function: Callable[[], float | None], seconds: float) -> None:
    """Call a function of a module by a timer, once for all requests until then."""
    if not bpy.app.timers.is_registered(function):
        bpy.app.timers.register(function, first_interval=seconds)


def call_off(function: Callable[[], float | None]) -> None:
    """Cancel a request of `call_soon`.

    Do so before a file is loaded as well: Blender 4.5's wheel hangs at exit if Blender itself dropped the timer.
    """
    if bpy.app.timers.is_registered(function):
        bpy.app.timers.unregister(function)


def redraw() -> None:
    """Redraw all 3D views with their sidebars, in all windows."""
    for window in getattr(bpy.context.window_manager, "windows", ()):
        for area in window.screen.areas:
            if area.type == 'VIEW_3D':
                area.tag_redraw()


def complain(text: str) -> None:
    """Report an error where no operator can: in the terminal, and in the window if there is one."""
    print(f"TetFlora: error: {text}", file=sys.stderr, flush=True)
    _in_window(
        lambda: bpy.context.window_manager.popup_menu(
            lambda menu, _context: menu.layout.label(text=text), title="TetFlora", icon='ERROR'
        )
    )


def open_menu(identifier: str) -> None:
    """Open a menu under the cursor, if there is a window."""
    _in_window(lambda: bpy.ops.wm.call_menu(name=identifier))


def _in_window(function: Callable[[], object]) -> None:
    """Call a function soon with a window as its context; from any thread, such as that of a render."""

    def call() -> None:
        windows = bpy.context.window_manager.windows
        if windows:
            with bpy.context.temp_override(window=windows[0]):
                function()

    if not bpy.app.background:
        bpy.app.timers.register(call)
