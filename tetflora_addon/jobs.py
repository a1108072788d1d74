# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: generators that yield their progress and return a result, so that a window can draw between two steps."""

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

_Item, _Step, _Result = TypeVar("_Item"), TypeVar("_Step"), TypeVar("_Result")
#: What a job works between two turns of the window, in times of what one after work took; at most; and a slow turn, s.
_TURNS, _LONGEST, _SLOW = 3.0, 1.0, 0.03
#: What lies between two changes of what is shown, in times of what drawing one takes; of texts at least and at most, s.
SPACED, _OFTEN, _SELDOM = 9.0, 0.1, 1.0


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
        """The same after each of some small steps; true ones let the window draw. Returns what these return."""
        return mapped(steps, lambda shown: self.repeated if shown else self)


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
    """How long a job works between two turns of the window, at once where these are slow, and how often it tells of it.

    Parameters
    ----------
    least, most : float
        Seconds of work where drawing takes no time, and where it takes long.
    """

    def __init__(self, least: float, most: float = _LONGEST) -> None:
        self._least, self._most, self._left = least, most, time.monotonic()
        self._begun = self._end = self._next = self._left
        self._worked, self._told, self._turn = False, False, 0.0

    def begin(self) -> None:
        """Work begins; what has passed since it was left is what the turn took."""
        turn = (now := time.monotonic()) - self._left
        self._turn = turn if self._worked else self._turn
        self._next = now + min(max(SPACED * turn, _OFTEN), _SELDOM) if self._told else self._next
        self._end = now + max(self._least, min(_TURNS * self._turn, self._most))
        self._worked = self._told = False

    def goes_on(self, progress: Progress) -> bool:
        """Whether to take another step now, after one; else the window has its turn, at once where nothing is new."""
        self._left, self._worked = time.monotonic(), self._worked or not progress.waiting
        gathers = self._worked and self._turn > _SLOW
        return self._left < self._end and (gathers or not progress.waiting)

    def tells(self) -> bool:
        """Whether to tell how far the job is in this turn."""
        self._told = self._left >= self._next
        return self._told

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
