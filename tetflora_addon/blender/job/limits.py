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


def check_expanded(flora: Flora, seeds: Seeds, camera: Camera, left: float) -> None:
    """Refuse to expand plants that would not fit.

    Parameters
    ----------
    flora : Flora
    seeds : Seeds
    camera : Camera
        Near it, plants are finer.
    left : float
        Bytes, see `contents.memory_left`.

    Raises
    ------
    SceneError
        Has the numbers, and says what to do.
    """
    for faces in expanded_faces(flora, seeds, camera):
        if (needed := faces * BYTES_PER_POLYGON) > left:
            raise SceneError(
                f"Expand Everything would make more than {faces / 1e6:,.1f} million polygons, which take "
                f"{needed / memory.GIGABYTE:,.1f} GB with rendering; Max Memory leaves {left / memory.GIGABYTE:,.1f} "
                "GB. Turn Expand Everything off, raise Max Memory, use fewer plants, or move the camera away from them"
            )
