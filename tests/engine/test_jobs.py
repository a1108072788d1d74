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


def test_of_a_slow_window_most_of_the_time_is_work_and_esc_waits_no_longer_than_a_second(clock: Clock) -> None:
    pace = Pace(LEAST)
    worked(clock, pace, 0.0)
    assert worked(clock, pace, 0.2) >= 2.0 * 0.2
    assert worked(clock, pace, 9.0) <= 1.0 + STEP
    assert worked(clock, pace, 0.0) <= STEP  # soon again


def test_a_job_that_waits_holds_no_window_however_long_that_takes_to_draw(clock: Clock) -> None:
    """Nothing is drawn then: the window stood still for up to a second at a time."""
    pace = Pace(LEAST)
    worked(clock, pace, 0.0)
    assert [worked(clock, pace, redraw, waiting=True) for redraw in (2.0, 0.0, 0.5)] == [0.0, 0.0, 0.0]


def test_what_is_done_before_a_slow_redraw_is_done_together(clock: Clock) -> None:
    pace = Pace(LEAST)
    worked(clock, pace, 0.0)
    clock.now += 0.5
    pace.begin()
    assert pace.goes_on(Progress(0.5, ""))
    assert pace.goes_on(Progress(0.5, "", waiting=True))


def told(clock: Clock, pace: Pace, redraw: float, seconds: float) -> int:
    """How often a job tells how far it is, where drawing that takes so long."""
    end, number = clock.now + seconds, 0
    while clock.now < end:
        pace.begin()
        clock.now += LEAST
        pace.goes_on(Progress(0.5, "", waiting=True))
        if pace.tells():
            number += 1
            clock.now += redraw
    return number


def test_drawing_what_is_told_takes_a_tenth_of_the_time(clock: Clock) -> None:
    assert 9 <= told(clock, Pace(LEAST), 0.0, 1.0) <= 11
    assert told(clock, Pace(LEAST), 0.1, 10.0) <= 11
    assert told(clock, Pace(LEAST), 2.0, 30.0) >= 9  # a view was drawn as well: the text goes on all the same


def test_a_small_step_may_let_the_window_draw() -> None:
    steps = Progress(0.5, "").during(iter_of(None, True, None))
    assert [step.waiting for step in steps] == [False, True, False]


def iter_of(*items: object):
    yield from items


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
