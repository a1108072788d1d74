# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What another thread asks for is done in the main thread, or refused where that does not answer."""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from types import SimpleNamespace

import bpy
import pytest

from tetflora_addon.blender import main_thread, runtime
from tetflora_addon.errors import UnansweredError


@pytest.fixture
def window(monkeypatch):
    """A window with *Lock Interface* off, and what is asked of Blender's timers from which thread."""
    asked = []

    def register(function, **options) -> None:
        asked.append((threading.current_thread(), function, options))

    manager = SimpleNamespace(is_interface_locked=False)
    timers = SimpleNamespace(register=register, is_registered=lambda _: False)
    app = SimpleNamespace(background=False, timers=timers)
    data = SimpleNamespace(window_managers=[manager], scenes=())
    monkeypatch.setattr(main_thread, "_away", False)  # or a file was loaded without any window, which never looks
    monkeypatch.setattr(main_thread, "bpy", SimpleNamespace(app=app, data=data))
    monkeypatch.setattr(bpy.app.timers, "register", register)
    yield SimpleNamespace(manager=manager, timers=asked)
    main_thread._asked.clear()


def elsewhere(function, *given) -> object:
    """Call a function in another thread."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function, *given).result(5.0)


def wait_until(true) -> None:
    """Wait for something that another thread does."""
    end = time.monotonic() + 5.0
    while not true() and time.monotonic() < end:
        time.sleep(0.001)


def asked(function) -> Future:
    """Ask from another thread."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(main_thread.in_main_thread, function)
        wait_until(lambda: main_thread._asked)
        main_thread.make_changes()
        future.exception(5.0)
    return future


def test_the_main_thread_makes_the_change_and_the_asker_gets_its_result(window) -> None:
    assert asked(threading.current_thread).result() is threading.main_thread()


def test_an_error_is_raised_where_it_was_asked_for(window) -> None:
    def fail() -> None:
        raise ValueError("no such scene")

    with pytest.raises(ValueError, match="no such scene"):
        asked(fail).result()


def test_without_a_window_it_is_made_at_once() -> None:
    assert main_thread.in_main_thread(threading.current_thread) is threading.main_thread()


def test_while_the_main_thread_is_busy_nobody_makes_the_change_and_what_restores_is_made_afterward(
    window, monkeypatch
) -> None:
    monkeypatch.setattr(main_thread, "_PATIENCE", 0.01)
    calls, after = [], []
    with pytest.raises(UnansweredError, match="did not answer"):
        elsewhere(main_thread.in_main_thread, lambda: calls.append(1))
    monkeypatch.setattr(main_thread, "_PATIENCE", 30.0)  # whoever waited once for nothing does not wait again
    elsewhere(main_thread.restore_in_main_thread, lambda: after.append(threading.current_thread()))
    main_thread.make_changes()
    assert (calls, after) == ([], [threading.main_thread()])
    assert asked(int).result() == 0


def test_what_waits_while_a_file_is_opened_or_blender_quits_is_refused_at_once(window) -> None:
    calls = []
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(main_thread.in_main_thread, lambda: calls.append(1))
        wait_until(lambda: main_thread._asked)
        main_thread.leave()
        assert isinstance(future.exception(5.0), UnansweredError)
        assert isinstance(pool.submit(main_thread.in_main_thread, int).exception(5.0), UnansweredError)
        pool.submit(main_thread.restore_in_main_thread, lambda: calls.append(1)).result(5.0)
    main_thread.leave()  # after the file was read
    main_thread.make_changes()
    assert not calls
    assert asked(int).result() == 0


def test_one_timer_looks_for_ever_often_after_a_change_and_seldom_else(window) -> None:
    main_thread.register()
    assert window.timers == [(threading.main_thread(), main_thread.make_changes, {"persistent": True})]
    asked(int)
    waits = [main_thread.make_changes() for _ in range(1000)]
    assert waits[0] < 0.01 and 0.02 < waits[-1] < 0.2 and waits == sorted(waits)


def test_no_other_thread_touches_blenders_timers(window) -> None:
    elsewhere(asked, int)
    elsewhere(runtime.call_soon, main_thread.make_changes, 0.5)
    elsewhere(runtime.complain, "something is wrong")
    elsewhere(runtime.open_menu, "TETFLORA_MT_nothing_refined")
    assert not window.timers
    main_thread._asked.popleft().make()  # in the main thread, the request for a timer reaches it
    timer = runtime._after_renders(main_thread.make_changes)
    assert window.timers == [(threading.main_thread(), timer, {"first_interval": 0.5})]


def test_timers_wait_while_a_render_goes_on(monkeypatch) -> None:
    """An estimate was looked for in the main thread while a render evaluated the scene: Blender crashed."""
    rendering, calls = ['RENDER'], []
    app = SimpleNamespace(is_job_running=rendering.__contains__)
    monkeypatch.setattr(runtime, "bpy", SimpleNamespace(app=app))
    timer = runtime._after_renders(lambda: calls.append(1))
    assert 0.1 < timer() < 1.0 and not calls
    rendering.clear()
    assert timer() is None and calls


def test_an_error_that_nobody_waits_for_is_printed_and_ends_nothing(window, capsys) -> None:
    later: list[int] = []
    main_thread.later(lambda: {}["missing"])
    main_thread.later(lambda: later.append(1))
    main_thread.make_changes()
    assert later == [1]
    assert "KeyError: 'missing'" in capsys.readouterr().err


def test_the_window_draws_only_while_another_thread_works_and_nothing_locks_it(window) -> None:
    assert not main_thread.window_draws()
    assert elsewhere(main_thread.window_draws)
    window.manager.is_interface_locked = True
    assert not elsewhere(main_thread.window_draws)
