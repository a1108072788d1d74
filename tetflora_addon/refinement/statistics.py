# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a refinement did: one object that the panel, the command line and the benchmarks all read."""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import asdict, dataclass, field
from typing import TypeVar

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Step:
    """The state after one pass through the loop.

    Attributes
    ----------
    tetrahedra_made, levels : int
        All tetrahedra ever made, and how deep their tree is.
    split, proxy, hidden, explicit : int
        Tetrahedra that hold something, by what was decided on them.
    subplants, pieces, foreign : int
        Things that they hold: sub-plants, pieces of branches, polygons of meshes that are not ours.
    polygons : int
        Expected polygons of what is to be explicit.
    seconds : float
        Wall clock since the loop began.
    memory_mb : float
        Megabytes of the tree and of what it holds.
    """

    tetrahedra_made: int
    levels: int
    split: int
    proxy: int
    hidden: int
    explicit: int
    subplants: int
    pieces: int
    foreign: int
    polygons: int
    seconds: float
    memory_mb: float


@dataclass
class Statistics:
    """Counts and seconds of one refinement; ``as_dict`` is what JSON output holds.

    Attributes
    ----------
    plants : int
        Plants that took part.
    polygons_full : int
        Polygons if every plant were expanded (compiled estimate).
    polygons_meshed : int
        Polygons of the plants' meshes that were made.
    polygons_proxy : int
        Faces that proxies are drawn with.
    tetrahedra_made, tetrahedra_terminal, tetrahedra_proxy : int
        All tetrahedra ever made; those that are not divided further; those of them that are drawn as approximations.
    levels : int
        Passes through the loop.
    facet_pixels : float
        Side of the facets of proxies, pixels; larger than asked for where a budget made them so; 0 for shells.
    complete : bool
        False where a limit of the settings stopped the loop.
    seconds : dict of str to float
        Wall clock by stage: ``read``, ``compile``, ``refine``, ``emit``.
    memory_mb : float
        Estimated megabytes of the meshes that were handed to Blender.
    steps : list of Step
        One for each pass through the loop.
    """

    plants: int = 0
    polygons_full: int = 0
    polygons_meshed: int = 0
    polygons_proxy: int = 0
    tetrahedra_made: int = 0
    tetrahedra_terminal: int = 0
    tetrahedra_proxy: int = 0
    levels: int = 0
    facet_pixels: float = 0.0
    complete: bool = True
    seconds: dict[str, float] = field(default_factory=dict)
    memory_mb: float = 0.0
    steps: list[Step] = field(default_factory=list)

    def as_dict(self) -> dict:
        """Plain dictionary, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Progress:
    """One step of a job.

    Attributes
    ----------
    fraction : float
        0 to 1, an estimate.
    message : str
        What is being done, for the status bar.
    """

    fraction: float
    message: str


def at_once(steps: Generator[object, object, _Result]) -> _Result:
    """Run a job to its end; returns what the job returns."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


class Stopwatch:
    """Adds up wall clock by stage.

    Attributes
    ----------
    seconds : dict of str to float
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Give the time since the last lap to a stage."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
