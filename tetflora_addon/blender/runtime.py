# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The mechanics of a running Blender: handlers, listeners, timers, jobs, redraws and messages in the window.

Between two steps of a job the artist, a script or another add-on may take away what it works on. A job lists that in
`JobData` and runs in `guarded`: undo, loading, rendering, Clear and Keep Results end it while all is still there, and
before each step it is asked whether anything was deleted. It then takes back what it has made and says why.
"""

import sys
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial, wraps
from math import inf
from pathlib import Path
from textwrap import wrap
from traceback import extract_tb
from typing import Any, Generic, NamedTuple, TypeVar

import bpy
from bpy.app.handlers import persistent

from ..errors import SceneError, readable
from ..jobs import run_to_end
from ..processes import pool
from . import compat
from .declare import once
from .main_thread import in_main_thread, later, leave, on_main_thread

_Datablock = TypeVar("_Datablock", bound=bpy.types.ID)
#: Letters of a line in a popup.
_LINE = 100
#: Errors of the last render: a text for each frame that was rendered without its plants.
failed_frames: list[str] = []


class Part(NamedTuple):
    """What is there while the add-on is enabled: modules and others have two such functions as well."""

    register: Callable[[], object]
    unregister: Callable[[], object]


def in_order(*parts: Any, end: Callable[[], object] | None = None) -> Part:
    """Parts that are registered in this order, and unregistered in the reverse one, after what ``end`` does."""

    def register() -> None:
        for part in parts:
            part.register()

    def unregister() -> None:
        if end is not None:
            end()
        for part in reversed(parts):
            part.unregister()

    return Part(register, unregister)


def listening(function: Callable[..., object], *listeners: Any) -> Part:
    """Let a function be called by `Listeners`, or draw in menus of Blender's, which take functions alike."""
    return in_order(*(Part(partial(one.append, function), partial(one.remove, function)) for one in listeners))


def handlers(**functions: Callable[..., None] | tuple[Callable[..., None], ...]) -> Part:
    """Functions that Blender calls, by their lists in `bpy.app.handlers`; they stay when another file is loaded."""
    every = [
        (compat.handlers(name), persistent(function))
        for name, given in functions.items()
        for function in (given if isinstance(given, tuple) else (given,))
    ]

    def unregister() -> None:
        for those, function in every:
            if function in those:  # a script may have taken it away
                those.remove(function)

    return Part(lambda: [those.append(function) for those, function in every], unregister)


class Listeners(list):
    """Functions of modules above to call when something changes below."""

    def notify(self, *arguments: object) -> None:
        """Call all of them."""
        for listener in tuple(self):
            listener(*arguments)


def classes_in(modules: Iterable[object], *kinds: type) -> tuple[type, ...]:
    """Classes that modules define and that are of some of Blender's kinds, in their order."""
    return tuple(
        cls
        for module in modules
        for cls in getattr(module, "__dict__", {}).values()
        if isinstance(cls, type) and issubclass(cls, kinds) and cls.__module__ == module.__name__
    )


@cache
def _after_renders(function: Callable[[], float | None]) -> Callable[[], float | None]:
    """A timer that waits while a render goes on: its thread evaluates scenes, and what else did so crashed Blender."""
    return lambda: 0.5 if bpy.app.is_job_running('RENDER') else function()


def call_soon(function: Callable[[], float | None], seconds: float) -> None:
    """Call a function of a module by a timer, once for all requests until then; from any thread, as of a render."""
    if not on_main_thread():
        later(partial(call_soon, function, seconds))
    elif not bpy.app.timers.is_registered(timer := _after_renders(function)):
        bpy.app.timers.register(timer, first_interval=seconds)


def call_off(function: Callable[[], float | None]) -> None:
    """Cancel a request of `call_soon`; also before a load, as 4.5's wheel hangs at exit if Blender drops the timer."""
    if bpy.app.timers.is_registered(timer := _after_renders(function)):
        bpy.app.timers.unregister(timer)


_Result = TypeVar("_Result")
#: Seconds of looking between two redraws and as many without, and from a change to the first look.
_SLICE, _QUIET = 0.01, 0.2


class Outlook(Generic[_Result]):
    """What panels say of a scene, found a moment after a change, and the less often the longer the window waits for it.

    Of the last two times the shorter counts: at first some is prepared. In the background it is found when asked for.

    Parameters
    ----------
    find : callable
        Finds it for a scene and a view layer; or begins small steps to it, which a change ends and begins anew.
    old : float
        Seconds after which a panel that is drawn asks for it anew.
    """

    def __init__(self, find: Callable[..., _Result | Generator], old: float = inf) -> None:
        self._find, self._old = find, old
        self._results: dict[tuple[int, str], _Result] = {}
        self._took, self._updated = (0.0, 0.0), -inf
        self._steps, self._shown, self._changed, self._longest, self._pause = None, [], False, 0.0, _QUIET
        self._timer = partial(self._look)  # one object, which Blender can find again

        def ask(*_: object) -> None:
            self._changed = True
            if not bpy.app.background:
                call_soon(self._timer, self._pause)

        self.ask = ask
        self._handlers = handlers(depsgraph_update_post=ask, undo_post=ask, redo_post=ask, load_post=ask)
        self.register = self._handlers.register

    def of(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> _Result | None:
        """What was found last."""
        key = scene.session_uid, view_layer.name
        if bpy.app.background:
            return run_to_end(self._all([(scene, view_layer)]))[key]
        if self._steps is None and (key not in self._results or time.perf_counter() - self._updated > self._old):
            self.ask()
        return self._results.get(key)

    def _all(self, shown: list[tuple[bpy.types.Scene, bpy.types.ViewLayer]]) -> Generator:
        results = {}
        for scene, layer in shown:
            one = self._find(scene, layer)
            results[scene.session_uid, layer.name] = (yield from one) if isinstance(one, Generator) else one
        return results

    def _look(self) -> float | None:
        shown = [(window.scene, window.view_layer) for window in bpy.context.window_manager.windows]
        if self._steps is not None and (self._changed or shown != self._shown):
            self._steps = None
            return self._pause
        if self._steps is None:
            self._steps, self._shown, self._changed, self._longest = self._all(shown), shown, False, 0.0
        begin, results = time.perf_counter(), None
        try:
            while time.perf_counter() - begin < _SLICE:
                next(self._steps)
        except StopIteration as stop:
            results, self._steps = stop.value, None
        except ReferenceError:  # deleted, which Blender tells soon
            self._changed = True
        now = time.perf_counter()
        self._longest = max(self._longest, now - begin)
        if results is None:
            return _SLICE
        self._updated, self._took = now, (self._took[1], self._longest)
        self._pause = max(_QUIET, 30.0 * min(self._took))
        if results != self._results:
            self._results = results
            redraw('UI')  # where panels are: views take seconds without a graphics card
        return None

    def unregister(self) -> None:
        """Look no more."""
        self._handlers.unregister()
        call_off(self._timer)
        self._results, self._steps = {}, None


@dataclass(eq=False)
class SceneSwitch:
    """What a switch of the window shows of one scene in this session, made anew a moment after each change."""

    #: name, label, tooltip: Of the switch, a property of the window manager
    name: str
    label: str
    tooltip: str
    make: Callable[[bpy.types.Scene | None], None]  # gets the scene, or None where it is off or gone
    clear: Callable[[], None]  # takes away what was made
    #: Seconds from a change; as many as making it took where that is more, or a slider that is dragged would stand
    soon: float
    drawn: bool  # whether there is nothing to make where no window draws it
    scene: int | None = None  # its `session_uid`

    def __post_init__(self) -> None:
        self._took = 0.0
        self.refresh = partial(self._refresh)  # one object, which Blender can find again

    def shown_in(self, scene: bpy.types.Scene) -> bool:
        """Whether it is switched on in a scene."""
        return self.scene == scene.session_uid

    def show(self, scene: bpy.types.Scene, on: bool) -> None:
        """Switch it on or off for a scene."""
        self.clear()
        self.scene = scene.session_uid if on else None
        self.schedule()

    def schedule(self) -> None:
        """Make it anew soon; many changes in a row are one."""
        if self.scene is not None:
            self.look()

    def look(self) -> None:
        """The same, or take it away where it is off."""
        if not (self.drawn and bpy.app.background):
            call_soon(self.refresh, max(self.soon, self._took))

    def _refresh(self) -> None:
        begin = time.perf_counter()
        self.make(with_uid(bpy.data.scenes, self.scene))
        self._took = time.perf_counter() - begin

    def forget(self) -> None:
        """Forget the scene, and what was made."""
        self.scene = None
        call_off(self.refresh)
        self.clear()

    def register(self) -> None:
        """Add the switch."""
        switch = once.boolean(
            self.label,
            self.tooltip,
            get=lambda _: bpy.context.scene is not None and self.shown_in(bpy.context.scene),
            set=lambda _, on: self.show(bpy.context.scene, on),
        )
        setattr(bpy.types.WindowManager, self.name, switch)

    def unregister(self) -> None:
        """Take it away, and what it shows."""
        delattr(bpy.types.WindowManager, self.name)
        self.forget()


def is_there(datablock: bpy.types.ID | None) -> bool:
    """Whether there is a datablock and it has not been deleted since."""
    try:
        return datablock is not None and bool(datablock.session_uid)
    except ReferenceError:
        return False


def with_uid(datablocks: Iterable[_Datablock], uid: int) -> _Datablock | None:
    """The datablock of this file with a ``session_uid``, which undo leaves alone; None where it is gone."""
    return next((d for d in datablocks if d.session_uid == uid and d.library is None), None)


class GoneError(SceneError):
    """What a job works on was taken away in its middle."""


class JobData:
    """What a job needs until its last step; once its view layer is gone, the dependency graph would crash Blender."""

    def __init__(self, job: str, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        self.job, self.scene, self.depsgraph, self._reason = job, scene, depsgraph, ""
        self._layer = depsgraph.view_layer.as_pointer(), depsgraph.view_layer.name
        self._known: list[tuple[bpy.types.ID, str]] = []
        self.add(f'the scene "{scene.name}"', scene)

    def add(self, name: str, *datablocks: bpy.types.ID) -> None:
        """Hold datablocks too; their name is for the message."""
        self._known += [(datablock, name) for datablock in datablocks]

    def add_objects(self, objects: Iterable[bpy.types.Object]) -> None:
        """Hold objects by their own names."""
        for obj in objects:
            self.add(f'"{obj.name}"', obj)

    def stop(self, reason: str) -> None:
        """Let the next `check` fail, whatever is there."""
        self._reason = self._reason or reason

    def check(self, few: bool = False) -> None:
        """See whether all is still there, or with ``few`` only the scene and its view layer.

        Raises
        ------
        GoneError
            Something is not, or the job was stopped; the message says what.
        """
        if not self._reason:
            lost = next((name for datablock, name in self._known[: 1 if few else None] if not is_there(datablock)), "")
            pointer, layer = self._layer
            if not lost and all(pointer != one.as_pointer() for one in self.scene.view_layers):
                lost = f'the view layer "{layer}"'
            self._reason = f"{lost} was deleted" if lost else ""
        if self._reason:
            raise GoneError(f"{self.job} was stopped because {self._reason}; start it again")

    @contextmanager
    def watched(self, few: bool = False) -> Iterator[None]:
        """`check`, and the same error where what is done meanwhile meets something that is not listed and gone."""
        self.check(few)
        try:
            yield
        except ReferenceError as error:
            self.stop("something that it works on was deleted")
            raise GoneError(f"{self.job} was stopped because {self._reason}; start it again") from error


_last: tuple[str, list[str]] = ("", [])
_running: list[tuple[JobData, Generator]] = []


def guarded(data: JobData, steps: Generator[Any, Any, _Result]) -> Generator[Any, Any, _Result]:
    """Run a job that must not outlive what it holds; after steps that wait, or are small, little is looked for.

    Closing the steps has to leave everything as it was, whatever is gone.

    Raises
    ------
    GoneError
        Something is gone, or somebody stopped the job.
    """
    entry, sent, waits = (data, steps), None, False
    _running.append(entry)
    try:
        while True:
            with data.watched(few=waits):
                try:
                    item = steps.send(sent)
                except StopIteration as stop:
                    return stop.value
            waits = getattr(item, "waiting", False) or getattr(item, "amid", False)
            sent = yield item
    finally:
        _running.remove(entry)
        steps.close()


def job(title: str) -> Callable[[Callable[..., Generator]], Callable[..., Generator]]:
    """Make a job of a generator function: callers give the scene, the dependency graph and what else there is.

    It gets `JobData` in place of the first two, and is `guarded`. Closing it, or an error, must leave all as it was.
    """

    def decorated(steps: Callable[..., Generator]) -> Callable[..., Generator]:
        @wraps(steps)
        def begin(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, *given: Any, **named: Any) -> Generator:
            data = JobData(title, scene, depsgraph)
            return guarded(data, steps(data, *given, **named))

        return begin

    return decorated


def stop_jobs(reason: str) -> None:
    """End all jobs, now if they are between two steps: what they work on is about to go or to change."""
    for data, steps in tuple(_running):
        data.stop(reason)
        if not steps.gi_running:
            steps.close()


_STOPPING = handlers(
    undo_pre=lambda *_: stop_jobs("Undo changed what it works on"),
    redo_pre=lambda *_: stop_jobs("Redo changed what it works on"),
    load_pre=(lambda *_: stop_jobs("another file was opened"), leave),
    load_post=leave,
    exit_pre=leave,
    render_init=lambda *_: in_main_thread(partial(stop_jobs, "a render began")),
)
unregister = _STOPPING.unregister


def register() -> None:
    """Register the handlers, and let the artist know when other processes cannot be used."""
    _STOPPING.register()
    pool.tell = complain


def remember(text: str, error: BaseException | None = None) -> None:
    """Keep the last error of the session for a report, and where it was; the error itself would keep all its data."""
    global _last
    calls = [] if error is None else extract_tb(error.__traceback__)
    # Without the folders of a user.
    _last = text, [f"  {'/'.join(Path(one.filename).parts[-3:])}:{one.lineno} in {one.name}" for one in calls]


def last_error() -> tuple[str, list[str]]:
    """What was told last, and the calls that led there if it was none that TetFlora expects; empty at first."""
    return _last


def redraw(only: str = "") -> None:
    """Redraw all 3D views in all windows: all of their regions, or those of one type alone."""
    for window in getattr(bpy.context.window_manager, "windows", ()):
        for area in window.screen.areas:
            for region in area.regions if area.type == 'VIEW_3D' else ():
                if only in ("", region.type):
                    region.tag_redraw()


def complain(text: str) -> None:
    """Report an error where no operator can: in the terminal, and in the window if there is one."""
    text = readable(text)
    remember(text)
    print(f"TetFlora: error: {text}", file=sys.stderr, flush=True)

    def draw(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
        for line in wrap(text, _LINE):
            menu.layout.label(text=line)

    _in_window(lambda: bpy.context.window_manager.popup_menu(draw, title="TetFlora", icon='ERROR'))


def show_status(text: str | None = None) -> None:
    """Show a text in status bars, and its beginning above pictures that are rendered, or again what is usual there."""
    for window in bpy.context.window_manager.windows:
        with bpy.context.temp_override(window=window):
            window.workspace.status_text_set(text)
        for area in window.screen.areas:
            if area.type == 'IMAGE_EDITOR' and getattr(area.spaces.active.image, "type", "") == 'RENDER_RESULT':
                area.header_text_set(text and text.partition("   |")[0])


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

    later(call)
