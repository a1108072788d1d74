# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's work beside Blender's: a generator in a thread of its own, in steps that never wait for long.

One pass or one block of a forest may take seconds. Meanwhile the window looks for Esc and draws, and meshes of earlier
blocks are written. What runs here must be the engine's: it never touches bpy. Nothing depends on when what is done.

Where nobody looks, `at_once` runs all in the caller's thread: a second one would save no time, but take more memory.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing
from typing import Any, TypeVar
from weakref import WeakSet

from .. import parallel
from ..jobs import Progress
from ..jobs import at_once as run
from ..processes import pool

#: Seconds after which a step ends at the latest although there is nothing new.
LOOK = 0.02
#: Seconds that Blender waits for work under way when it quits.
_PARTING = 1.0

_here = threading.local()  # "at_once" while jobs are not to use other threads

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def at_once(steps: Generator[object, object, _Result]) -> _Result:
    """Run a job to its end in this thread; returns what the job returns."""
    before, _here.at_once = getattr(_here, "at_once", False), True
    try:
        return run(steps)
    finally:
        _here.at_once = before


def nobody_waits() -> bool:
    """Whether what runs here is run to its end at once, so that nobody sees anything before."""
    return getattr(_here, "at_once", False)


def in_thread(work: Generator[_Item, Any, _Result], ahead: int = 0) -> Generator[_Item | None, object, _Result]:
    """Run a generator of the engine in a thread.

    Closing it stops the work at its next item, without waiting. Work that begins later waits until the thread has
    ended, so that there is memory for one only. Errors are raised here, with the traceback of where they happened.

    Parameters
    ----------
    work : generator
        Its items are not None. What is sent for an item, or what is true and sent while there is nothing yet, is sent
        to it when it goes on.
    ahead : int
        Items that it may make before they are asked for; with 0 it goes on when the next one is.

    Yields
    ------
    object or None
        The items in their order; None whenever there was nothing new for `LOOK` seconds.
    """
    if nobody_waits():
        return (yield from work)
    worker = _Worker(work, ahead)
    try:
        for former in [w for w in _workers if w.stopped]:
            while not former.rests(LOOK):
                worker.tell((yield None))
        worker.start()
        sent = None
        while True:
            worker.ask(sent)
            while not worker.has_news(LOOK):
                worker.tell((yield None))
            if worker.ended:
                return worker.result()
            sent = yield worker.take()
    finally:
        worker.stop()


def steps_in_thread(work: Generator[Progress, Any, _Result], progress: Progress) -> Generator[Progress, Any, _Result]:
    """As `in_thread`, for work whose items are its progress; the last one, at first a given one, stands meanwhile."""
    sent = None
    with closing(in_thread(work)) as items:
        while True:
            try:
                item = items.send(sent)
            except StopIteration as stop:
                return stop.value
            if item is not None:
                progress = item
            sent = yield progress.again if item is None else progress


def call_in_thread(
    progress: Progress, function: Callable[..., _Result], *given: object
) -> Generator[Progress, Any, _Result]:
    """The result of a function of the engine, which a thread computes."""
    return steps_in_thread(calling(function, *given), progress)


def calling(function: Callable[..., _Result], *given: object) -> Generator[Any, Any, _Result]:
    """Work without items that returns what a function does."""
    yield from ()
    return function(*given)


class _Worker:
    """A generator in a thread; `ask`, `has_news` and `take` are for the one who wants the items."""

    def __init__(self, work: Generator, ahead: int) -> None:
        self._work, self._ahead = work, ahead
        self._changed = threading.Condition()
        self._items: deque = deque()
        self._asked = self._made = 0
        self._sent: object = None
        self._end: tuple[object, BaseException | None] | None = None
        self._thread = threading.Thread(target=self._run, name="TetFlora", daemon=True)
        self.stopped = False

    def start(self) -> None:
        self._thread.start()
        _workers.add(self)

    def ask(self, sent: object) -> None:
        """Ask for one more item, and go on with what was sent for the last one."""
        with self._changed:
            self._asked += 1
            self._sent = sent or self._sent
            self._changed.notify_all()

    def tell(self, sent: object) -> None:
        """Keep what is sent while there is nothing yet."""
        with self._changed:
            self._sent = sent or self._sent

    def has_news(self, seconds: float) -> bool:
        """Whether there is an item or the end; waits for it."""
        with self._changed:
            return self._changed.wait_for(lambda: self._items or self._end, seconds)

    @property
    def ended(self) -> bool:
        """Whether there is no item left, and none will come."""
        return not self._items and self._end is not None

    def take(self) -> object:
        """The next item."""
        with self._changed:
            return self._items.popleft()

    def result(self) -> object:
        """What the work returned; or its error is raised."""
        result, error = self._end
        self._end = (None, None)
        if error is None:
            return result
        try:
            raise error
        finally:
            del error  # else it would hold itself by its traceback

    def stop(self) -> None:
        """Let it end at its next item; whatever it has made goes."""
        with self._changed:
            self.stopped = True
            self._items.clear()
            self._end = self._end and (None, None)
            self._changed.notify_all()
        if self._thread.ident is None:
            self._work.close()

    def rests(self, seconds: float) -> bool:
        """Whether the thread has ended; waits for it."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def _run(self) -> None:
        end: tuple[object, BaseException | None] = (None, None)
        try:
            while self._wanted():
                self._put(self._work.send(self._received()))
        except StopIteration as stop:
            end = (stop.value, None)
        except BaseException as error:
            end = (None, error)
        try:
            self._work.close()
        finally:
            self._work = None
            with self._changed:
                self._end = (None, None) if self.stopped else end
                end = None  # an error's traceback holds this frame
                self._changed.notify_all()

    def _wanted(self) -> bool:
        """Wait until one more item is wanted; False if none will be."""
        with self._changed:
            self._changed.wait_for(lambda: self.stopped or self._made < self._asked + self._ahead)
            return not self.stopped

    def _received(self) -> object:
        if not self._made:
            return None  # nothing can be sent to what has not begun
        with self._changed:
            sent, self._sent = self._sent, None
            return sent

    def _put(self, item: object) -> None:
        with self._changed:
            self._made += 1
            if not self.stopped:
                self._items.append(item)
                self._changed.notify_all()


_workers: WeakSet[_Worker] = WeakSet()


def stop_all() -> None:
    """Stop all work, end other processes and threads, and wait a moment for those that are at something."""
    end = time.monotonic() + _PARTING
    running = list(_workers)
    for worker in running:
        worker.stop()
    pool.stop()
    for worker in running:
        worker.rests(max(0.0, end - time.monotonic()))
    parallel.stop()


def register() -> None:
    """Stop when Python ends: a thread must not go on while its modules disappear."""
    pool.resume()
    atexit.register(stop_all)


def unregister() -> None:
    """Stop now."""
    atexit.unregister(stop_all)
    stop_all()
