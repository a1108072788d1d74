# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of a scene's contents that must not happen while the window is drawn.

Blender calls the handlers of a render that the window shows in the thread of the render. *Lock Interface* keeps 3D
views and properties from drawing meanwhile, but not the Outliner (source of 5.2: its region has no lock). That looks up
every object of the view layer, and Blender crashes if the other thread is just linking or removing one, or is at the
list of these. So the main thread makes such changes between two redraws, and the lists at once.

Without *Lock Interface* nothing keeps the window from drawing what the other thread changes. Then all that a handler
does is handed over, and the window stands still meanwhile: `window_draws` tells.

Blender's timers are a list without a lock, so only the main thread may touch them: one timer looks at a queue.
"""

import threading
import traceback
from collections import deque
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, wait
from typing import TypeVar

import bpy

from ..errors import UnansweredError

#: Seconds after which the caller gives up: the main thread then waits for the render itself, as *Undo* does. One that
#: is only busy, on a first redraw for instance, must not be taken for it: what the caller then changed would crash it.
_PATIENCE = 30.0
#: Seconds between two looks, and between those of a while without any change; how many looks such a while has.
_LOOK, _IDLE, _LOOKS = 0.005, 0.05, 400

_Result = TypeVar("_Result")


class _Change(Future[_Result]):
    """A function for the main thread; whether anybody waits for its result."""

    def __init__(self, function: Callable[[], _Result], waits: bool = True) -> None:
        super().__init__()
        self._function, self._waits = function, waits

    def make(self) -> None:
        """Call the function unless nobody wants it any more."""
        if not self.set_running_or_notify_cancel():
            return
        try:
            result = self._function()
            sync_view_layers()
            self.set_result(result)
        except BaseException as error:  # raised again where it was asked for
            if not self._waits:
                traceback.print_exc()
            self.set_exception(error)


_asked: deque[_Change] = deque()
_idle = _LOOKS
_NO_ANSWER = "Blender's window did not answer; render again, or with blender -b"
#: Whether the main thread does not look any more, as far as is known.
_away = False


def sync_view_layers() -> None:
    """Let all view layers list their objects now, before another thread asks for it."""
    for scene in bpy.data.scenes:
        for layer in scene.view_layers:
            layer.objects.active  # noqa: B018  (reading it does so)


def in_main_thread(function: Callable[[], _Result] = sync_view_layers) -> _Result:
    """Call a function in Blender's main thread, and wait for its result; by default until that thread is free.

    At once in the main thread itself, and without a window. Errors of the function are raised here.

    Raises
    ------
    UnansweredError
        If the main thread does not look; the function is not called.
    """
    global _away
    if bpy.app.background or on_main_thread():
        return function()
    _asked.append(change := _Change(function))
    if _away or not wait([change], _PATIENCE).done:
        _away = change.cancel() or _away  # not if it is being made
    try:
        return change.result()
    except CancelledError:
        raise UnansweredError(_NO_ANSWER) from None
    finally:
        del change  # an error would hold itself by its traceback


def restore_in_main_thread(function: Callable[[], object]) -> None:
    """Call a function that undoes earlier ones like `in_main_thread`, or as soon as the main thread looks again."""
    try:
        in_main_thread(function)
    except UnansweredError:
        later(function)


def window_draws() -> bool:
    """Whether the window may draw while this thread changes data: in a render's thread without *Lock Interface*.

    That of the scene decides which is rendered; of a sequencer, not those of the scenes that it shows.
    """
    return not (bpy.app.background or on_main_thread() or bpy.data.window_managers[0].is_interface_locked)


def on_main_thread() -> bool:
    """Whether this is Blender's main thread."""
    return threading.current_thread() is threading.main_thread()


def later(function: Callable[[], object]) -> None:
    """Call a function in the main thread soon, from any thread; not without a window, where nothing would call it."""
    if not bpy.app.background:
        _asked.append(_Change(function, False))


def make_changes() -> float:
    """Make what other threads have asked for; seconds until the next look."""
    global _idle, _away
    _away = False
    _idle = 0 if _asked else min(_idle + 1, _LOOKS)
    while _asked:
        _asked.popleft().make()
    return _LOOK if _idle < _LOOKS else _IDLE


def leave(*_: object) -> None:
    """Refuse what is asked for until the next look: a render is to end first, or another file was opened."""
    global _away
    _away = True
    while _asked:
        if (change := _asked.popleft()).set_running_or_notify_cancel():
            change.set_exception(UnansweredError(_NO_ANSWER))


def register() -> None:
    """Begin to look, if there is a window; opening another file changes nothing about it."""
    if not bpy.app.background:
        bpy.app.timers.register(make_changes, persistent=True)


def unregister() -> None:
    """Look no more."""
    if bpy.app.timers.is_registered(make_changes):
        bpy.app.timers.unregister(make_changes)
