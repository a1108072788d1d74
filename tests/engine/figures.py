# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over all numbers of a result, kept in ``tests/data``: what they say changes where a commit says so.

After a change of results that is meant, ``python -m tests.engine.figures`` writes them anew, or only those named.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

KEPT = Path(__file__).parents[1] / "data"
#: By which part of itself a sum may differ: machines add up in another order, which equations that are solved magnify.
ROUNDING = 1e-6
#: Modules with ``FIGURES``, and files that keep their sums.
MODULES = {
    "tests.engine.test_figures": "figures.json",
    "tests.engine.emission.test_figures_of_drawing": "figures_of_drawing.json",
    "tests.engine.planting.test_figures_of_places": "figures_of_places.json",
}

#: What is summed up, by name.
Figures = dict[str, Callable[[], Any]]


def numbers(one: Any) -> list[np.ndarray]:
    """All numbers of arrays, dataclasses, tables, and lists and dictionaries of them, one after another."""
    if isinstance(one, np.ndarray) and one.dtype.names:
        return [part for name in one.dtype.names for part in numbers(one[name])]
    if isinstance(one, np.ndarray | int | float | np.generic):
        value = np.asarray(one)
        # Keys are random bits: as floats they would drown all else.
        bits = value.dtype.kind == "u" and value.dtype.itemsize == 8
        return [] if value.dtype.kind in "SUO" or bits else [value.astype(float).ravel()]
    if isinstance(one, Mapping):
        return [part for value in one.values() for part in numbers(value)]
    if isinstance(one, list | tuple):
        return [part for value in one for part in numbers(value)]
    if is_dataclass(one):
        return [part for field in fields(one) for part in numbers(getattr(one, field.name))]
    return []


def summary(one: Any) -> list[float]:
    """How many arrays there are, and numbers in all; how large they are, and where in its array each is.

    Both are sums of parts of each array, so that one of small numbers is not drowned by one of large ones.
    """
    every = [array[np.isfinite(array)] for array in numbers(one)]
    large, placed = 0.0, 0.0
    for k, array in enumerate(every):
        magnitude = np.abs(array).sum()
        if magnitude > 0:
            large += (2.0 + np.sin(k)) * np.log(magnitude)
            placed += (2.0 + np.sin(k)) * (array @ np.sin(1.0 + np.arange(len(array)))) / magnitude
    return [len(every), sum(map(len, every)), float(large), float(placed)]


def check(module: str, name: str, found: Any, rounding: float = ROUNDING) -> None:
    """Compare a result with the sums that are kept of it."""
    kept, sums = json.loads((KEPT / MODULES[module]).read_text(encoding="utf-8"))[name], summary(found)
    assert sums[0] == kept[0]
    assert sums[1] == pytest.approx(kept[1], rel=0.0 if rounding == ROUNDING else rounding)
    assert sums[2:] == pytest.approx(kept[2:], rel=0.0, abs=rounding * kept[0])


def main(names: list[str]) -> None:
    """Write the sums of modules, or of those whose names end with one that is given."""
    for module, file in MODULES.items():
        if not names or module.endswith(tuple(names)):
            sums = {name: summary(one()) for name, one in import_module(module).FIGURES.items()}
            (KEPT / file).write_text(json.dumps(sums, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
