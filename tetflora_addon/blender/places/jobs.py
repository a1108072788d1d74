# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports as jobs: what they work on may be deleted between two steps."""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import bpy

from ...jobs import Progress
from ..runtime import JobData, guarded

_Result = TypeVar("_Result")
_Import = Callable[..., Generator[Progress, Any, _Result]]


def importing(steps: _Import[_Result]) -> _Import[_Result]:
    """Guard the steps of an import, which takes scene, dependency graph, file, grounds, and more, as a job."""

    @wraps(steps)
    def job(
        scene: bpy.types.Scene,
        depsgraph: bpy.types.Depsgraph,
        path: Path,
        grounds: list[bpy.types.Object],
        *others: Any,
        **named: Any,
    ) -> Generator[Progress, Any, _Result]:
        data = JobData("Importing", scene, depsgraph.view_layer)
        data.add_objects(grounds)
        return guarded(data, steps(scene, depsgraph, path, grounds, *others, **named))

    return job
