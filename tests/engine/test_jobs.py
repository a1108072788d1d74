# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Work between two redraws of a window, by a clock of the test's own; parts of jobs."""

from __future__ import annotations

import pytest

from tetflora_addon import jobs
from tetflora_addon.jobs import Pace, Progress, mapped

STEP, LEAST = 0.05, 0.01


class Clock:
    """Goes on only when somebody works or sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(jobs, "time", clock)
    return clock


def worked(clock: Clock, pace: Pace, redraw: float, waiting: bool = False) -> float:
    """Seconds until the window has its turn, after a redraw of so many seconds."""
    clock.now += redraw
    begin = clock.now
    pace.begin()
    while True:
        clock.now += 0.0 if waiting else STEP
        if not pace.goes_on(Progress(0.5, "", waiting=waiting)):
            return clock.now - begin


def test_a_window_that_draws_at_once_has_its_turn_after_each_step(clock: Clock) -> None:
    pace = Pace(LEAST)
    assert worked(clock, pace, 0.0) == pytest.approx(STEP)
    assert worked(clock, pace, 0.0, waiting=True) == 0.0


@pytest.mark.parametrize("waiting", [False, True])
def test_of_a_slow_window_most_of_the_time_is_work_and_esc_waits_no_longer_than_a_second(
    clock: Clock, waiting: bool
) -> None:
    pace = Pace(LEAST)
    assert worked(clock, pace, 0.2, waiting) >= 2.0 * 0.2
    assert worked(clock, pace, 9.0, waiting) <= 1.0 + STEP
    assert worked(clock, pace, 0.0, waiting) <= STEP  # soon again


def test_the_time_that_is_left_follows_from_what_is_expected_and_then_from_what_is_done(clock: Clock) -> None:
    pace = Pace(LEAST)
    clock.now += 1.0
    assert pace.remaining(0.5) == 0.0  # too early to tell
    assert pace.remaining(0.5, expected=60.0) == pytest.approx(59.0)
    clock.now += 19.0
    assert pace.remaining(0.04) == 0.0
    assert pace.remaining(0.25) == pytest.approx(60.0)
    assert pace.remaining(0.8, expected=30.0) == pytest.approx(10.0)
    assert pace.remaining(0.8, expected=10.0) == pytest.approx(5.0)


def test_a_part_of_a_job_gets_what_is_sent_and_its_result_is_returned():
    received = []

    def part():
        received.append((yield 1))
        received.append((yield 2))
        return "done"

    steps = mapped(part(), lambda item: 10 * item)
    assert next(steps) == 10
    assert steps.send("first") == 20
    with pytest.raises(StopIteration) as stop:
        steps.send("second")
    assert stop.value.value == "done"
    assert received == ["first", "second"]
