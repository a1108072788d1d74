# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on all cores gives what one thread gives: in order, errors in their place, no thread waits for its own pool."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon import parallel
from tetflora_addon.parallel import blocks, each_on_all_cores, on_all_cores


@pytest.fixture(params=[1, 3])
def threads(request, monkeypatch):
    monkeypatch.setattr(parallel, "threads", lambda: request.param)
    return request.param


@given(number=st.integers(0, 50), size=st.integers(1, 20))
def test_blocks_are_all_rows_once(number: int, size: int) -> None:
    rows = np.arange(number)
    made = [rows[block] for block in blocks(number, size)]
    assert np.concatenate([*made, rows[:0]]).tolist() == rows.tolist()
    assert all(0 < len(one) <= size for one in made)


def test_results_come_in_order(threads: int) -> None:
    assert list(on_all_cores(lambda x: x * x, range(100))) == [x * x for x in range(100)]
    out = np.zeros(100)
    each_on_all_cores(lambda x: out.__setitem__(x, x), range(100))
    assert out.tolist() == list(range(100))


def test_errors_are_raised_where_the_result_would_come(threads: int) -> None:
    results = on_all_cores(lambda x: 1 / (x - 2), range(5))
    assert [next(results), next(results)] == [-0.5, -1.0]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_work_within_work_does_not_wait_for_ever(threads: int) -> None:
    found = list(on_all_cores(lambda x: sum(on_all_cores(lambda y: x * y, range(4))), range(20)))
    assert found == [6 * x for x in range(20)]


def test_few_more_are_made_ahead_than_there_are_threads(threads: int) -> None:
    begun, lock = [], threading.Lock()

    def note(x: int) -> int:
        with lock:
            begun.append(x)
        return x

    results = on_all_cores(note, range(1000))
    most = threads + min(threads, parallel.MOST_WAITING)
    assert next(results) == 0
    assert len(begun) <= most
    results.close()
    assert len(begun) <= most


def test_a_thread_has_work_while_another_is_at_a_longer_item() -> None:
    parallel.set_threads(2)
    others = threading.Event()

    def work(x: int) -> int:
        if x == 2:
            others.set()
        assert x or others.wait(10.0)
        return x

    try:
        assert list(on_all_cores(work, range(4))) == [0, 1, 2, 3]
    finally:
        parallel.set_threads(0)


def test_the_environment_says_how_many_where_nobody_else_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "_wanted", 0)
    for told, number in (("3", 3), ("0", None), ("many", None), ("", None)):
        monkeypatch.setenv(parallel.VARIABLE, told)
        assert parallel.threads() == (number or min(parallel.cores(), parallel.MOST_THREADS))
    monkeypatch.setattr(parallel, "_wanted", 2)
    assert parallel.threads() == 2
