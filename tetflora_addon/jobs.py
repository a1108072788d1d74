# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: generators that yield their progress and return a result, so that a window can draw between two steps."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import TypeVar

_Item, _Step, _Result = TypeVar("_Item"), TypeVar("_Step"), TypeVar("_Result")


@dataclass(frozen=True)
class Progress:
    """One step of a job.

    Attributes
    ----------
    fraction : float
        0 to 1, an estimate.
    message : str
        For the status bar.
    waiting : bool
        Whether nothing is new: the next step waits as well.
    amid : bool
        Whether something small is half done: whoever looks after the job may do that later.
    """

    fraction: float
    message: str
    waiting: bool = False
    amid: bool = False

    @property
    def again(self) -> Progress:
        """The same, while nothing is new."""
        return replace(self, waiting=True)

    def during(self, steps: Generator[object, None, _Result]) -> Generator[Progress, object, _Result]:
        """The same after each of some small steps; returns what these return."""
        amid = replace(self, amid=True)
        return mapped(steps, lambda _: amid)


def mapped(
    steps: Generator[_Item, None, _Result], change: Callable[[_Item], _Step]
) -> Generator[_Step, object, _Result]:
    """The steps of a part of a job as those of the whole; returns what the part returns."""
    while True:
        try:
            step = next(steps)
        except StopIteration as stop:
            return stop.value
        yield change(step)


def at_once(steps: Generator[object, object, _Result]) -> _Result:
    """Run a job to its end; returns what the job returns."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value
