# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in blocks on several cores: numpy lets go of the interpreter's lock while it computes, so threads suffice.

No block may depend on another, and none on the number of cores: then neither do results, to the bit.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

#: More threads than this gain little, as memory is what they wait for; and each has a block of its own in memory.
MOST_THREADS = 16

#: Results that wait at most until longer items before them are done; each takes the memory of a block.
MOST_WAITING = 4

#: Environment variable with the number of threads where nobody has chosen one, for farms and tests.
VARIABLE = "TETFLORA_THREADS"

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_wanted = 0  # threads, see `set_threads`
_pools: dict[int, ThreadPoolExecutor] = {}  # by their numbers of threads
_lock = threading.Lock()
_here = threading.local()  # "at_work" in threads of the pool, which must not wait for each other


@cache
def cores() -> int:
    """Cores that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # not on every system
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def threads() -> int:
    """Threads that work at the same time: what `set_threads` or `VARIABLE` says, or all cores; up to `MOST_THREADS`."""
    told = os.environ.get(VARIABLE, "")
    return min(_wanted or (int(told) if told.isdecimal() else 0) or cores(), MOST_THREADS)


def set_threads(number: int) -> None:
    """Work with so many threads from now on; 0 is all cores."""
    global _wanted
    _wanted = number


def blocks(number: int, size: int) -> list[slice]:
    """Slices of at most ``size`` rows that make up ``number`` rows."""
    return [slice(start, min(start + size, number)) for start in range(0, number, size)]


def on_all_cores(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """Results of a function for items, in their order.

    A few more are made ahead than there are threads, so that a thread has work while another is at a longer item. An
    error is raised where its result would come; what is not asked for any more is not begun.
    """
    if threads() < 2 or within():
        yield from map(function, items)
        return
    pending = deque()
    try:
        for item in items:
            pending.append(_pool().submit(function, item))
            if len(pending) >= threads() + min(threads(), MOST_WAITING):
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        for future in pending:
            future.cancel()


def each_on_all_cores(function: Callable[[_Item], object], items: Iterable[_Item]) -> None:
    """Call a function with each item, for what it writes."""
    deque(on_all_cores(function, items), maxlen=0)


def within() -> bool:
    """Whether this thread is one of those that work at the same time; they must not wait for each other."""
    return getattr(_here, "at_work", False)


def begin(function: Callable[[], object]) -> None:
    """Call a function in one of the threads that work at the same time, and do not wait for it."""
    _pool().submit(function)


def stop() -> None:
    """Let all threads end when they have done what they are at; new ones begin when they are needed."""
    while _pools:
        _pools.popitem()[1].shutdown(wait=False, cancel_futures=True)


def _pool() -> ThreadPoolExecutor:
    number = threads()
    with _lock:
        if number not in _pools:
            _pools[number] = ThreadPoolExecutor(number, "tetflora", lambda: setattr(_here, "at_work", True))
        return _pools[number]
