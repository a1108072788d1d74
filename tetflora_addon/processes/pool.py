# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions called in other processes, one for each thread of `parallel`, with what all calls share sent once.

numpy lets go of the interpreter's lock while it computes, but what calls it does not: with the engine's blocks, two
threads gain about a tenth. Where no other Python can be started, or several have died at their work, it is done here
instead, and `tell` says so once: results are the same.

A process belongs to the thread that calls a function in it, and to nobody between two calls. Only its owner, or who
holds the lock where it has none, writes to it or closes its pipes; anybody may kill it.
"""

import atexit
import json
import math
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TypeVar

from .. import parallel
from . import child as child_module
from .messages import Closed, Packed, receive, send

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

#: Bytes of a pipe; more takes more than users without privileges may have by default.
_PIPE = 1 << 20
#: Polygons or facets from which on making them is work enough for other processes.
WORTH_PROCESSES = 150_000

_Shared = TypeVar("_Shared")
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_PACKAGE = __name__.rsplit(".", 2)[0]
#: Seconds in which a process has to say that it is there; one that a virus scanner holds never does.
_PATIENCE = 60.0
#: Processes that may die at their work and are replaced, before all work is done here.
_MOST_DEATHS = 3
#: Bytes of a process at its work (Python, numpy, the engine, species, a block), unless one has been seen with more.
_BYTES_EACH = 200e6
#: Fraction of a limit of memory that all of them may take; where it is too little for all, they are fewer.
_PART = 0.25

_numbers = count()


class _Pool:
    """The processes of this Python; whoever changes anything holds the lock."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.children: list[_Child] = []
        self.idle: list[_Child] = []  # those without an owner
        self.limit = math.inf  # bytes of all
        self.deaths, self.largest = 0, _BYTES_EACH
        self.broken = self.stopped = False


_pool = _Pool()


def tell(text: str) -> object:
    """Called once, when other processes cannot be used, from any thread; another function may take its place."""
    print(f"TetFlora: warning: {text}", file=sys.stderr, flush=True)


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
    if not worth or parallel.within() or not number():
        yield from (function(shared, item) for item in items)
        return
    given = _Given(shared)
    try:
        yield from parallel.on_all_cores(lambda item: _call(function, given, item), items)
    finally:
        given.forgotten = True
        _tidy()


def number(limit: float | None = None, each: float | None = None) -> int:
    """Processes that may work at the same time: none, or two at least.

    Parameters
    ----------
    limit : float, optional
        Bytes that Blender and they may take together; by default as `set_memory_limit` was told.
    each : float, optional
        Bytes of one; by default the most that one has been seen with.
    """
    if _pool.stopped or _pool.broken or not _python():
        return 0
    allowed = _pool.limit if limit is None else _PART * limit
    most = int(min(parallel.threads(), allowed / (each or _pool.largest)))
    return most if most > 1 else 0


def share(limit: float) -> float:
    """Bytes of a limit for Blender and all processes together that these need; the same whatever one was seen with."""
    return number(limit, _BYTES_EACH) * _BYTES_EACH


def set_memory_limit(limit: float) -> None:
    """Keep within a part of a limit of bytes for Blender and all processes together, from now on."""
    with _pool.changed:
        _pool.limit = _PART * limit
        while _pool.idle and len(_pool.children) > number():
            _leave(_pool.idle.pop())


def start() -> None:
    """Begin to start the processes, for work that is about to come; returns at once."""
    if number():
        parallel.begin(_start_all)


def peak() -> int:
    """Bytes that all processes together have held at most; 0 where there are none or the system does not tell."""
    return sum(one.peak for one in list(_pool.children))


def state() -> str:
    """How many there are, or why there are none, in words."""
    if not _python():
        return "no Python to start"
    if _pool.broken:
        return "given up"
    return "stopped" if _pool.stopped else f"{len(_pool.children)} of {number()}, {_pool.deaths} died"


def stop() -> None:
    """End all processes; none is started until `resume`, and who waits for one gets an error."""
    with _pool.changed:
        _pool.stopped = True
        for one in _pool.children:
            one.kill()
        while _pool.idle:
            _leave(_pool.idle.pop())
        _pool.changed.notify_all()


def resume() -> None:
    """Let processes be started again, whatever has happened to earlier ones."""
    with _pool.changed:
        _pool.deaths, _pool.broken, _pool.stopped = 0, False, False


class _Given:
    """What calls share, packed when the first process asks for it."""

    def __init__(self, thing: object) -> None:
        self.thing, self.number, self.forgotten = thing, next(_numbers), False
        self._lock, self._packed = threading.Lock(), None

    def packed(self) -> Packed:
        """The bytes of the thing."""
        with self._lock:
            if self._packed is None:
                self._packed = Packed(self.thing)
            return self._packed


class _StartError(OSError):
    """A process is not there and will never be."""


class _Child:
    """One other Python; only its owner uses it."""

    def __init__(self) -> None:
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW} if sys.platform == "win32" else {}
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        # As JSON, which is ASCII whatever letters and separators there are in paths.
        paths = json.dumps([path for path in sys.path if path])
        self._process = subprocess.Popen(
            [_python(), "-I", "-S", "-B", str(Path(child_module.__file__).resolve()), _PACKAGE, paths],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # Blender has none for it on Windows without a console
            env=environment,
            **hidden,
        )
        _widened(self._process)
        self._known: dict[int, _Given] = {}
        self._ready = False
        self.peak = 0

    def greet(self) -> bool:
        """Wait until it is there, or raise `_StartError`; whether it still is: without work it ends by itself."""
        if not self._ready:
            timer = threading.Timer(_PATIENCE, self.kill)
            timer.daemon = True
            timer.start()
            try:
                ((kind, told),) = receive(self._process.stdout)
            except (Closed, OSError):
                raise _StartError(f"it ended with code {self.end()}") from None
            finally:
                timer.cancel()
            if kind == "failed":
                raise _StartError(told)
            self._ready = True
        return self.runs

    def call(self, function: Callable, shared: _Given, item: object) -> tuple[str, object, str]:
        """What a call made, after "made"; or after "failed" its error, and where it was. Raises as `forget`."""
        self.forget()
        if shared.number not in self._known:
            send(self._process.stdin, "share", shared.number, shared.packed())
            self._known[shared.number] = shared
        send(self._process.stdin, "call", function, shared.number, item)
        ((*answer, self.peak),) = receive(self._process.stdout)
        return answer

    def forget(self) -> None:
        """Let go of what no call will need again; `Closed` or `OSError` where the process has ended."""
        for number in [number for number, given in self._known.items() if given.forgotten]:
            del self._known[number]
            send(self._process.stdin, "forget", number)

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def kill(self) -> None:
        """End the process; what it is at is lost, and its owner meets the end of its pipes."""
        self._process.kill()
        self._process.wait()

    def end(self) -> int:
        """Wait for its end, and bring it about; its exit code, 0 if there was nothing to do for too long."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(0.2)
        self.kill()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                stream.close()
        return self._process.returncode


def _call(function: Callable[[_Shared, _Item], _Result], shared: _Given, item: _Item) -> _Result:
    """The function's result by a process; another takes over for one that has ended, and in the end this one."""
    answer, tried = None, 0
    while answer is None and tried < 2 and (child := _taken()) is not None:
        try:
            if child.greet():
                tried += 1
                answer = child.call(function, shared, item)
        except _StartError as error:
            _break(f"cannot be started: {error}")
        except (Closed, OSError):
            _count_death(child.end())
        finally:
            _give(child)
    if answer is None:
        if _pool.stopped:
            raise Closed("other processes were stopped")
        return function(shared.thing, item)
    kind, result, told = answer
    if kind == "failed":
        result.add_note(told)
        raise result
    return result


def _taken() -> _Child | None:
    """A process for this thread alone, which waits for one; None if there will be none."""
    with _pool.changed:
        while not (_pool.stopped or _pool.broken):
            if _pool.idle:
                return _pool.idle.pop()
            if len(_pool.children) < max(number(), 1):
                return _started()
            _pool.changed.wait()
    return None


def _give(child: _Child) -> None:
    """Let others have a process, if it still runs."""
    with _pool.changed:
        _pool.largest = max(_pool.largest, child.peak)
        with suppress(Closed, OSError):
            child.forget()
        if _pool.stopped or _pool.broken or not child.runs or len(_pool.children) > max(number(), 1):
            _leave(child)
        else:
            _pool.idle.append(child)
        _pool.changed.notify_all()


def _leave(child: _Child) -> None:
    child.kill()
    child.end()
    _pool.children.remove(child)


def _tidy() -> None:
    """Let all processes give memory back that nobody needs; those at work do so after it."""
    with _pool.changed:
        for child in _pool.idle:
            with suppress(Closed, OSError):
                child.forget()


def _start_all() -> None:
    while True:
        with _pool.changed:
            if len(_pool.children) >= number() or (child := _started()) is None:
                return
            _pool.idle.append(child)
            _pool.changed.notify_all()


def _started() -> _Child | None:
    """One more process; None where the system refuses it."""
    try:
        child = _Child()
    except OSError as error:
        _break(f"cannot be started: {error}")
        return None
    _pool.children.append(child)
    return child


def _count_death(code: int) -> None:
    """Take note of how a process has ended that was at work."""
    if code == 0 or _pool.stopped:
        return
    with _pool.changed:
        _pool.deaths += 1
    if _pool.deaths >= _MOST_DEATHS:
        _break(f"have ended {_pool.deaths} times at their work, the last with code {code}")


def _break(reason: str) -> None:
    """Use no other processes any more, and tell it once."""
    with _pool.changed:
        first, _pool.broken = not (_pool.broken or _pool.stopped), True
        _pool.changed.notify_all()
    if first:
        tell(
            f"TetFlora's other processes {reason}. Plants are refined in Blender alone, which is slower but gives the "
            f'same result. A virus scanner may block "{_python()}", or memory was short; then lower Max Memory or '
            "Threads. Restart Blender to try again"
        )


def _widened(process: subprocess.Popen) -> None:
    """Let its pipes hold more, where the system can: a thread waits for the interpreter's lock after each filling."""
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # more than this user may have
                fcntl.fcntl(stream.fileno(), fcntl.F_SETPIPE_SZ, _PIPE)


def _python() -> str:
    """The Python that runs this; empty where there is none apart from Blender."""
    path = sys.executable or ""
    return path if Path(path).is_file() and "python" in Path(path).name.lower() else ""


atexit.register(stop)
