# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions called in other processes, one for each thread of `parallel`, with what all calls share sent once.

numpy lets go of the interpreter's lock while it computes, but what calls it does not: with the engine's blocks, two
threads gain about a tenth. ``python -m benchmarks scaling`` tells what processes gain. Where no other Python can be
started, or one ends, the work is done here instead: results are the same.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TypeVar
from weakref import WeakSet, finalize, ref

from .. import parallel
from . import child as child_module
from .messages import Closed, Packed, receive, send

with suppress(ImportError):  # Windows has none
    import fcntl

#: Bytes of a pipe; more takes more than users without privileges may have by default.
_PIPE = 1 << 20
#: Polygons or facets from which on making them is work enough for other processes.
WORTH_PROCESSES = 150_000

_Shared = TypeVar("_Shared")
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_PACKAGE = __name__.rsplit(".", 2)[0]
_numbers = count()
_here = threading.local()  # "child" of this thread
_children: WeakSet[_Child] = WeakSet()
_broken = threading.Event()  # no Python can be started here


def in_processes(
    function: Callable[[_Shared, _Item], _Result], shared: _Shared, items: Iterable[_Item], worth: bool = True
) -> Iterator[_Result]:
    """Results of ``function(shared, item)`` for items, in their order, made on all cores.

    Parameters
    ----------
    function : callable
        Of a module of the engine; what it returns, and what it is given, can be pickled.
    shared : object
        Sent once to each process, however many items there are.
    items : iterable
        No more are taken ahead than there are threads.
    worth : bool
        Whether this is work enough for other processes.

    Raises
    ------
    Exception
        Whatever the function raises, where its result would come.
    """
    if not worth or parallel.threads() < 2 or parallel.within() or _broken.is_set() or not _python():
        yield from (function(shared, item) for item in items)
        return
    own = _Given(shared)
    try:
        yield from parallel.on_all_cores(lambda item: _call(function, own, item), items)
    finally:
        own.forgotten = True
        parallel.in_each_thread(_tidied)


def start() -> None:
    """Begin to start the processes, for work that is about to come; returns at once."""
    if parallel.threads() > 1 and not _broken.is_set() and _python():
        parallel.in_each_thread(_child_of_this_thread)


def peak() -> int:
    """Bytes that all processes together have held at most; 0 where there are none or the system does not tell."""
    return sum(one.peak for one in list(_children))


def stop() -> None:
    """End all processes."""
    for one in list(_children):
        one.end()


class _Given:
    """What calls share, packed when the first process asks for it.

    What it holds of types that are `sent_once` goes apart and stays there as long as it is here: what such a thing has
    computed for itself serves all later calls.
    """

    def __init__(self, thing: object) -> None:
        self.thing, self.number, self.forgotten = thing, next(_numbers), False
        self._lock, self._packed = threading.Lock(), None

    def packed(self) -> tuple[Packed, list[_Given]]:
        """The bytes of the thing without some of its parts, and these, which have to be there before it."""
        with self._lock:
            if self._packed is None:
                self._packed = self._pack(self.thing)
            return self._packed

    @staticmethod
    def _pack(whole: object) -> tuple[Packed, list[_Given]]:
        parts: list[_Given] = []

        def known(thing: object) -> int | None:
            if thing is whole or not getattr(type(thing), "sent_once", False):
                return None
            part = _kept(thing)
            if part not in parts:
                parts.append(part)
            return part.number

        return Packed(whole, known), parts


class _Weakly(_Given):
    """Something that is sent once, as long as it lives."""

    def __init__(self, thing: object) -> None:
        super().__init__(None)
        self._there = ref(thing)
        finalize(thing, self._forget).atexit = False

    def _forget(self) -> None:
        self.forgotten = True
        _once.pop(self.number, None)

    def packed(self) -> tuple[Packed, list[_Given]]:
        """As above, but not kept, as few processes ask; several may at once."""
        return self._pack(self._there())

    def holds(self, thing: object) -> bool:
        """Whether it is this one."""
        return self._there() is thing


_once: dict[int, _Weakly] = {}
_once_lock = threading.Lock()


def _kept(thing: object) -> _Weakly:
    with _once_lock:
        for one in _once.values():
            if one.holds(thing):
                return one
        made = _Weakly(thing)
        _once[made.number] = made
        return made


class _Child:
    """One other Python; only one thread uses it."""

    def __init__(self) -> None:
        paths = os.pathsep.join(path for path in sys.path if path)
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW} if sys.platform == "win32" else {}
        environment = {
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        self._process = subprocess.Popen(
            [_python(), "-I", "-S", str(Path(child_module.__file__).resolve()), _PACKAGE, paths],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            **hidden,
        )
        _widened(self._process)
        self._known: dict[int, _Given] = {}
        self.peak = 0
        _children.add(self)

    def call(self, function: Callable, shared: _Given, item: object) -> object:
        """The function's result.

        Raises
        ------
        Closed, OSError
            The process has ended.
        Exception
            What the function raises.
        """
        there = self._process.stdin
        self.forget()
        if shared.number not in self._known:
            self._share(shared)
        send(there, "call", function, shared.number, item)
        ((kind, result, told, self.peak),) = receive(self._process.stdout)
        if kind == "failed":
            result.add_note(told)
            raise result
        return result

    def forget(self) -> None:
        """Let go of what no call will need again.

        Raises
        ------
        OSError
            The process has ended.
        """
        for number in [number for number, given in self._known.items() if given.forgotten]:
            del self._known[number]
            send(self._process.stdin, "forget", number)

    def _share(self, given: _Given) -> None:
        packed, parts = given.packed()
        for part in parts:
            if part.number not in self._known:
                self._share(part)
        send(self._process.stdin, "share", given.number, packed)
        self._known[given.number] = given

    def end(self) -> None:
        """End the process; what it is at is lost."""
        self._process.kill()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                stream.close()
        self._process.wait()


def _call(function: Callable[[_Shared, _Item], _Result], shared: _Given, item: _Item) -> _Result:
    """The function's result by the process of this thread; another takes over for one that has ended."""
    for _ in range(2):
        if (own := _child_of_this_thread()) is None:
            break
        try:
            return own.call(function, shared, item)
        except (Closed, OSError):
            own.end()
            _here.child = None
    return function(shared.thing, item)


def _tidied() -> None:
    """Let the process of this thread give memory back."""
    own = getattr(_here, "child", None)
    with suppress(Closed, OSError):
        if own is not None:
            own.forget()


def _child_of_this_thread() -> _Child | None:
    if getattr(_here, "child", None) is None and not _broken.is_set():
        try:
            _here.child = _Child()
        except OSError:
            _broken.set()
    return getattr(_here, "child", None)


def _widened(process: subprocess.Popen) -> None:
    """Let its pipes hold more, where the system can: a thread waits for the interpreter's lock after each filling."""
    if sys.platform == "linux":
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # more than this user may have
                fcntl.fcntl(stream.fileno(), fcntl.F_SETPIPE_SZ, _PIPE)


def _python() -> str:
    """The Python that runs this; empty where there is none apart from Blender."""
    path = sys.executable or ""
    return path if Path(path).is_file() and "python" in Path(path).name.lower() else ""


atexit.register(stop)
