# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: generators that yield their progress and return a result, so that a window can draw between two steps."""

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

_Item, _Step, _Result = TypeVar("_Item"), TypeVar("_Step"), TypeVar("_Result")
#: What a job works between two redraws, in times of what the last redraw took, and at most, seconds: Esc waits for it.
_REDRAWS, _LONGEST = 3.0, 1.0
_SLOW = 0.03  # seconds of a redraw from which on waiting for a thread is no reason for another
_MOMENT = 0.005  # seconds of sleep while a thread computes


@dataclass(frozen=True)
class Progress:
    """One step of a job."""

    fraction: float  # 0 to 1, an estimate
    message: str  # for the status bar
    waiting: bool = False  # whether nothing is new: the next step waits as well

    @property
    def repeated(self) -> Self:
        """The same, while nothing is new."""
        return replace(self, waiting=True)

    def during(self, steps: Generator[object, None, _Result]) -> Generator[Self, object, _Result]:
        """The same after each of some small steps; returns what these return."""
        return mapped(steps, lambda _: self)


#: What yields its progress and returns a result.
Job = Generator[Progress, Any, _Result]


def mapped(steps: Generator[_Item, Any, _Result], change: Callable[[_Item], _Step]) -> Generator[_Step, Any, _Result]:
    """The steps of a part of a job as those of the whole; the part gets what is sent, and its result is returned."""
    sent = None
    while True:
        try:
            step = steps.send(sent)
        except StopIteration as stop:
            return stop.value
        sent = yield change(step)


def part_of(
    steps: Generator[Progress, None, _Result], begin: float, end: float, title: str = ""
) -> Generator[Progress, object, _Result]:
    """The steps of a job as a part of another, from a fraction of it to a later one."""
    title = f"{title}: " if title else ""

    def change(step: Progress) -> Progress:
        return replace(step, fraction=begin + (end - begin) * step.fraction, message=title + step.message)

    return mapped(steps, change)


class Pace:
    """How long a job works between two redraws: a window that takes long to draw is drawn less often.

    Parameters
    ----------
    least, most : float
        Seconds of work where drawing takes no time, and where it takes long.
    """

    def __init__(self, least: float, most: float = _LONGEST) -> None:
        self._least, self._most, self._left = least, most, time.monotonic()
        self._begun = self._end = self._left
        self._slow = False

    def begin(self) -> None:
        """Work begins; what has passed since it was left is what a redraw takes."""
        now = time.monotonic()
        seconds = min(_REDRAWS * (now - self._left), self._most)
        self._end, self._slow = now + max(self._least, seconds), seconds > _REDRAWS * _SLOW

    def goes_on(self, progress: Progress) -> bool:
        """Whether to take another step now, after one; else the window has its turn."""
        now = time.monotonic()
        if now < self._end and (self._slow or not progress.waiting):
            if progress.waiting:
                time.sleep(_MOMENT)
            return True
        self._left = now
        return False

    def remaining(self, fraction: float, expected: float = 0.0) -> float:
        """Seconds to the end: of what was expected of all or, once that is over, by what is done; 0 if unknown."""
        passed = time.monotonic() - self._begun
        if passed < expected:
            return expected - passed
        return passed * (1.0 / fraction - 1.0) if passed > 3.0 and fraction > 0.05 else 0.0  # else too early to tell


def run_to_end(steps: Generator[object, object, _Result]) -> _Result:
    """Run a job to its end; returns what the job returns."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value
