# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in a thread: order, what is sent, results, errors and their places, closing, and memory ahead.

Nothing here measures time: whoever must wait waits for an event, and gives up after `PATIENCE` seconds.
"""

from __future__ import annotations

import gc
import operator
import subprocess
import sys
import threading
import time
import traceback
import weakref
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import bpy
import pytest

from tetflora_addon import parallel
from tetflora_addon.blender import worker
from tetflora_addon.jobs import Progress
from tetflora_addon.processes import pool

PATIENCE = 30.0
ROOT = Path(__file__).resolve().parents[2]


class Payload:
    """Something that a weak reference can point to."""


@pytest.fixture(autouse=True)
def no_thread_is_left():
    yield
    for thread in threads():
        thread.join(PATIENCE)
    assert not threads()
    pool.resume()


def begin(steps: Iterator) -> None:
    """Wait for the first step, and leave the processor to the thread meanwhile."""
    while next(steps) is None:
        time.sleep(1e-3)


def threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "TetFlora"]


def counting(number: int, received: list | None = None):
    """Counts, notes what is sent, and returns the name of its thread."""
    for i in range(number):
        sent = yield i
        if received is not None:
            received.append(sent)
    return threading.current_thread().name


def items_of(steps) -> tuple[list, object]:
    """All items that are not None, and the result."""
    items = []
    while True:
        try:
            item = next(steps)
        except StopIteration as stop:
            return items, stop.value
        if item is not None:
            items.append(item)


@pytest.mark.parametrize("ahead", [0, 1, 100])
def test_items_come_in_order_and_the_result_last(ahead):
    assert items_of(worker.in_thread(counting(50), ahead)) == (list(range(50)), "TetFlora")


def test_at_once_there_is_no_other_thread():
    def job():
        return (yield from worker.in_thread(counting(3)))

    assert worker.run_to_end(job()) == threading.current_thread().name
    assert items_of(worker.in_thread(counting(3)))[1] == "TetFlora"  # afterward as before


def test_a_failed_job_at_once_leaves_threads_on():
    def job():
        yield from worker.in_thread(counting(1))
        raise ValueError

    with pytest.raises(ValueError):
        worker.run_to_end(job())
    assert items_of(worker.in_thread(counting(3)))[1] == "TetFlora"


def test_whoever_waits_gets_control_and_is_heard():
    """Nothing new yields None; what is true and sent meanwhile arrives although something false follows."""
    go, received = threading.Event(), []

    def work():
        assert go.wait(PATIENCE)
        received.append((yield "first"))
        received.append((yield "second"))
        yield "third"

    with closing(worker.in_thread(work())) as steps:
        assert next(steps) is None
        assert steps.send(True) is None
        assert steps.send(False) is None
        go.set()
        while (item := steps.send(False)) is None:
            pass
        assert item == "first"
        while (item := steps.send(False)) is None:
            pass
        assert item == "second"
        assert received == [True]
        while (item := steps.send(None)) is None:
            pass
        assert item == "third"
        assert not received[1]


def test_what_is_sent_for_an_item_is_what_the_work_gets():
    received: list = []
    steps, sent = worker.in_thread(counting(4, received)), None
    with pytest.raises(StopIteration):
        while True:
            item = steps.send(sent)
            sent = None if item is None else f"for {item}"
    assert received == ["for 0", "for 1", "for 2", "for 3"]


def test_no_more_is_made_ahead_than_allowed():
    """A thread that is as fast as it gets, and one who takes his time: never more than one block in advance."""
    made, most = [], []

    def work():
        for i in range(20):
            made.append(i)
            yield i

    taken = 0
    for item in worker.in_thread(work(), ahead=1):
        if item is not None:
            taken += 1
            threading.Event().wait(0.002)
            most.append(len(made) - taken)
    assert max(most) <= 1
    assert taken == 20


def test_errors_arrive_with_the_place_where_they_happened():
    def deep_inside():
        raise ValueError("no such leaf")

    def work():
        yield 1
        deep_inside()

    steps = worker.in_thread(work())
    with pytest.raises(ValueError, match="no such leaf") as caught:
        items_of(steps)
    assert "deep_inside" in "".join(traceback.format_exception(caught.value))


def test_memory_of_failed_work_is_not_kept():
    kept = []

    def work():
        payload = Payload()
        kept.append(weakref.ref(payload))
        yield 1
        raise MemoryError

    gc.disable()
    try:
        with suppress(MemoryError):
            items_of(worker.in_thread(work()))
        for thread in threads():
            thread.join(PATIENCE)
        assert kept[0]() is None
    finally:
        gc.enable()


def test_closing_ends_the_work_and_drops_what_it_made():
    kept, ended = [], threading.Event()

    def work():
        try:
            while True:
                payload = Payload()
                kept.append(weakref.ref(payload))
                yield payload
        finally:
            ended.set()

    steps = worker.in_thread(work(), ahead=3)
    begin(steps)
    steps.close()
    assert ended.wait(PATIENCE)
    for thread in threads():
        thread.join(PATIENCE)
    assert kept
    assert not any(reference() for reference in kept)


def test_closing_does_not_wait_and_what_begins_later_does():
    """Two forests at the same time would need the memory of two."""
    begun, go, log = threading.Event(), threading.Event(), []

    def slow():
        yield 1
        begun.set()
        assert go.wait(PATIENCE)
        log.append("slow ended")
        yield 2

    def later():
        log.append("later began")
        yield 3

    steps = worker.in_thread(slow(), ahead=1)
    begin(steps)
    assert begun.wait(PATIENCE)
    steps.close()  # returns although nobody has said go
    assert log == []
    with closing(worker.in_thread(later())) as steps:
        assert next(steps) is None
        assert next(steps) is None
        go.set()
        assert items_of(steps)[0] == [3]
    assert log == ["slow ended", "later began"]


def test_an_error_after_closing_is_nobodys():
    failed = threading.Event()

    def work():
        yield 1
        failed.set()
        raise ValueError

    steps = worker.in_thread(work(), ahead=5)
    begin(steps)
    assert failed.wait(PATIENCE)
    steps.close()


def test_work_that_never_began_is_closed():
    steps = worker.in_thread(counting(3))
    steps.close()
    assert not threads()


def test_progress_stands_while_there_is_nothing_new():
    go = threading.Event()

    def work():
        assert go.wait(PATIENCE)
        yield Progress(0.5, "half")
        return 7

    steps = worker.steps_in_thread(work(), Progress(0.1, "begun"))
    assert next(steps) == Progress(0.1, "begun", waiting=True)
    go.set()
    seen, result = items_of(steps)
    assert [p for p in seen if not p.waiting] == [Progress(0.5, "half")]
    assert result == 7


def test_functions_give_their_results():
    assert items_of(worker.call_in_thread(Progress(0.0, ""), divmod, 17, 5))[1] == (3, 2)


def test_stop_all_ends_what_waits():
    steps = worker.in_thread(counting(3))
    begin(steps)
    worker.stop_all()
    for thread in threads():
        thread.join(PATIENCE)
    assert not threads()
    steps.close()


def test_python_ends_although_a_thread_is_at_work():
    """As when Blender is closed in the middle of a pass."""
    script = """
import time
from tetflora_addon import parallel
from tetflora_addon.blender import worker
worker.register()
def work():
    yield 1
    time.sleep(600)
steps = worker.in_thread(work(), ahead=1)
while next(steps) is None:
    pass
time.sleep(0.2)
print("left")
"""
    script = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{script}"
    blender = bpy.app.binary_path  # empty where bpy is a module of Python's
    command = [blender, "-b", "--factory-startup", "--python-expr"] if blender else [sys.executable, "-c"]
    done = subprocess.run([*command, script], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert "left" in done.stdout.splitlines(), done.stderr
    assert done.returncode == 0


def test_when_the_extension_is_disabled_all_ends_and_begins_again_when_it_is_enabled(monkeypatch):
    monkeypatch.setattr(parallel, "threads", lambda: 2)
    assert list(pool.in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
    started = [own._process for own in pool._pool.children]
    assert started
    worker.unregister()
    try:
        assert all(process.poll() is not None for process in started)
        pool.start()
        assert list(pool.in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
        assert not pool._pool.children
    finally:
        worker.register()
    assert list(pool.in_processes(operator.add, 1, range(4))) == [1, 2, 3, 4]
    assert pool._pool.children
    pool.stop()
    pool.resume()
