# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a job may take of the machine, and what is refused before it is begun."""

from __future__ import annotations

import bpy

from ... import memory, parallel
from ...camera.camera import Camera
from ...compiled.flora import Flora
from ...emission.budget import BYTES_PER_POLYGON
from ...emission.expansion import expanded_faces
from ...errors import SceneError
from ...growth.seeds import Seeds
from ...processes import pool
from ..preferences import wanted_threads


def use_machine(scene: bpy.types.Scene) -> None:
    """Let what follows work with as many threads, and processes with as much memory, as the artist wants."""
    parallel.use(wanted_threads(scene))
    pool.use(memory.limit(scene.tetflora.max_memory))


def check_fits(what: str, polygons: float, left: float, remedy: str) -> None:
    """Refuse what would make too many polygons.

    Parameters
    ----------
    what : str
        Begins the message.
    polygons : float
        At least.
    left : float
        Bytes, see `contents.memory_left`.
    remedy : str
        What to do, beside raising the limit.

    Raises
    ------
    SceneError
        Has the numbers, and says what to do.
    """
    if (needed := polygons * BYTES_PER_POLYGON) > left:
        raise SceneError(
            f"{what} would make more than {polygons / 1e6:,.1f} million polygons, which take "
            f"{needed / memory.GIGABYTE:,.1f} GB with rendering; Max Memory leaves {left / memory.GIGABYTE:,.1f} GB. "
            f"Raise Max Memory, {remedy}"
        )


def check_expanded(flora: Flora, seeds: Seeds, camera: Camera, left: float) -> None:
    """Refuse to expand plants that would not fit, near a camera as finely as it sees them; as `check_fits`."""
    for polygons in expanded_faces(flora, seeds, camera):
        remedy = "turn Expand Everything off, use fewer plants, or move the camera away from them"
        check_fits("Expand Everything", polygons, left, remedy)
