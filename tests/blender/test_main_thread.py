# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What another thread asks for is done in the main thread, or by itself where that does not answer."""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from tetflora_addon.blender import main_thread


@pytest.fixture(autouse=True)
def no_timer():
    yield
    main_thread.unregister()


def asked(function) -> Future:
    """Ask from another thread."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(main_thread._handed_over, function)
        end = time.monotonic() + 5.0
        while not main_thread._asked and time.monotonic() < end:
            time.sleep(0.001)
        main_thread.make_changes()
        future.exception(5.0)
    return future


def test_the_main_thread_makes_the_change_and_the_asker_gets_its_result() -> None:
    assert asked(threading.current_thread).result() is threading.main_thread()


def test_an_error_is_raised_where_it_was_asked_for() -> None:
    def fail() -> None:
        raise ValueError("no such scene")

    with pytest.raises(ValueError, match="no such scene"):
        asked(fail).result()


def test_without_a_window_it_is_made_at_once() -> None:
    assert main_thread.in_main_thread(threading.current_thread) is threading.main_thread()


def test_where_the_main_thread_waits_itself_the_asker_makes_the_change_once(monkeypatch) -> None:
    monkeypatch.setattr(main_thread, "_PATIENCE", 0.01)
    calls = []
    with ThreadPoolExecutor(1) as pool:
        pool.submit(main_thread._handed_over, lambda: calls.append(threading.current_thread())).result(5.0)
    main_thread.make_changes()
    assert len(calls) == 1
    assert calls[0] is not threading.main_thread()


def test_the_timer_ends_when_nothing_is_asked_for_a_while() -> None:
    looks = 0
    while main_thread.make_changes() is not None:
        looks += 1
        assert looks < 1000
    assert looks > 100
