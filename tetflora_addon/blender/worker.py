# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's work beside Blender's: a generator in a thread of its own, in steps that never wait for long.

One pass or one block of a forest may take seconds. Meanwhile the window looks for Esc and draws, and meshes of earlier
blocks are written. What runs here must be the engine's: it never touches bpy. Nothing depends on when what is done.

Where nobody looks, `run_to_end` runs all in the caller's thread: a second one would save no time, but take more memory.
"""

import atexit
import threading
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import closing, suppress
from queue import Empty, SimpleQueue
from typing import Any, TypeVar
from weakref import WeakSet

from .. import parallel
from ..jobs import Job, Progress, mapped
from ..jobs import run_to_end as run
from ..processes import pool

#: Seconds after which a step ends at the latest although there is nothing new.
LOOK = 0.02
#: Seconds that Blender waits for work under way when it quits.
_PARTING = 1.0

_here = threading.local()  # "run_to_end" while jobs are not to use other threads

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def run_to_end(steps: Generator[object, object, _Result]) -> _Result:
    """Run a job to its end in this thread; returns what the job returns."""
    before, _here.run_to_end = getattr(_here, "run_to_end", False), True
    try:
        return run(steps)
    finally:
        _here.run_to_end = before


def nobody_waits() -> bool:
    """Whether what runs here is run to its end at once, so that nobody sees anything before."""
    return getattr(_here, "run_to_end", False)


def in_thread(work: Generator[_Item, Any, _Result], ahead: int = 0) -> Generator[_Item | None, object, _Result]:
    """Run a generator of the engine in a thread.

    Closing it stops the work at its next item, without waiting. Work that begins later waits until the thread has
    ended, so that there is memory for one only. Errors are raised here, with the traceback of where they happened.

    Parameters
    ----------
    work : generator
        Its items are not None. What is sent for an item, or is true and sent before there is one, is sent to it.
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
            while (news := worker.news(LOOK)) is None:
                worker.tell((yield None))
            if news[0] == 'item':
                sent = yield news.pop()
            elif news[0] == 'result':
                return news.pop()
            else:
                raise news.pop()
    finally:
        worker.stop()


def steps_in_thread(work: Job[_Result], progress: Progress) -> Job[_Result]:
    """As `in_thread`, for work whose items are its progress; the last one, at first a given one, stands meanwhile."""

    def shown(item: Progress | None) -> Progress:
        nonlocal progress
        progress = item or progress
        return progress.repeated if item is None else progress

    with closing(in_thread(work)) as items:
        return (yield from mapped(items, shown))


def call_in_thread(progress: Progress, function: Callable[..., _Result], *given: object) -> Job[_Result]:
    """The result of a function of the engine, which a thread computes."""
    return steps_in_thread(calling(function, *given), progress)


def written(
    blocks: Iterable[_Item], write: Callable[[_Item], Generator[None, None, Progress]], progress: Progress
) -> Job[None]:
    """Write blocks one by one, while a thread makes the next."""
    with closing(in_thread((block for block in blocks), ahead=1)) as items:
        for block in items:
            if block is not None:
                progress = yield from progress.during(write(block))
            yield progress.repeated if block is None else progress


def calling(function: Callable[..., _Result], *given: object) -> Generator[Any, Any, _Result]:
    """Work without items that returns what a function does."""
    yield from ()
    return function(*given)


class _Worker:
    """A generator in a thread, which goes on as often as it is asked to."""

    def __init__(self, work: Generator, ahead: int) -> None:
        self._work, self._sent, self.stopped = work, None, False
        self._wanted, self._lock = threading.Semaphore(ahead), threading.Lock()
        self._news: SimpleQueue[list] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="TetFlora", daemon=True)

    def start(self) -> None:
        self._thread.start()
        _workers.add(self)

    def ask(self, sent: object) -> None:
        """Ask for one more item, and go on with what was sent for the last one."""
        self.tell(sent)
        self._wanted.release()

    def tell(self, sent: object) -> None:
        """Keep what is sent while there is nothing yet."""
        with self._lock:
            self._sent = sent or self._sent

    def news(self, seconds: float) -> list | None:
        """What it is, 'item', 'result' or 'error', and that itself; None where there is nothing for so long."""
        with suppress(Empty):
            return self._news.get(timeout=seconds)
        return None

    def stop(self) -> None:
        """Let it end at its next item; whatever it has made goes."""
        self.stopped, self._news = True, SimpleQueue()
        self._wanted.release()
        if self._thread.ident is None:
            self._work.close()

    def rests(self, seconds: float) -> bool:
        """Whether the thread has ended; waits for it."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def _run(self) -> None:
        end, begun = ['result', None], False
        try:
            while self._wanted.acquire() and not self.stopped:
                with self._lock:  # nothing can be sent to what has not begun
                    sent, self._sent = (self._sent, None) if begun else (None, self._sent)
                begun = True
                self._put(['item', self._work.send(sent)])
        except StopIteration as stop:
            end = ['result', stop.value]
        except BaseException as error:
            end = ['error', error]
        try:
            self._work.close()
        finally:
            self._work = None
            self._put(end)
            end = None  # an error's traceback holds this frame

    def _put(self, news: list) -> None:
        if not self.stopped:
            self._news.put(news)


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
