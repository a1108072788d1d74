# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants dropped onto the ground: first it is looked for under all of them, then all move at once."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...jobs import Progress, mapped
from ..attributes import read, write
from ..runtime import JobData, job
from .field_edits import own_mesh, positions
from .ground import Ground

_STAYS = 1e-6  # meters: a smaller gap counts as standing on the ground
_LOOKING = "Looking for the ground"


@dataclass(frozen=True)
class DropResult:
    """How many plants moved, and how many have no ground below or above."""

    moved: int
    missed: int


@job("Dropping plants")
def drop_steps(
    data: JobData,
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    plants: Sequence[bpy.types.Object],
    fields: Sequence[bpy.types.Object],
) -> Generator[Progress, object, DropResult]:
    """Move plants vertically to the nearest ground; children move with their parents before they fall themselves.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        What is visible in its view layer is ground.
    plants : sequence of bpy.types.Object
        Plants that are objects.
    fields : sequence of bpy.types.Object
        Whose points are plants, all `field_edits.editable`.

    Raises
    ------
    SceneError
        Nothing is visible to stand on, or something was deleted meanwhile.
    """
    data.add_objects([*plants, *fields])
    yield Progress(0.0, _LOOKING)
    view_layer = depsgraph.view_layer
    view_layer.update()
    ground = Ground(view_layer, depsgraph)
    if not len(ground):
        raise SceneError("No mesh is visible below or above the plants; add a ground mesh, or show it")
    data.add_objects(ground.objects)
    groups = [np.array([o.matrix_world.translation for o in plants], dtype=np.float64).reshape(-1, 3)]
    groups += [positions(field) for field in fields]
    ends = np.cumsum([len(own) for own in groups])
    every = np.concatenate(groups)
    heights = yield from mapped(ground.nearest_heights(every), lambda fraction: Progress(fraction, _LOOKING))
    of_plants, *of_fields = np.split(heights, ends[:-1])
    moved = _drop_plants(view_layer, plants, of_plants)
    moved += sum(_drop_field(field, own) for field, own in zip(fields, of_fields, strict=True))
    return DropResult(moved, int(np.isnan(heights).sum()))


def _drop_plants(
    view_layer: bpy.types.ViewLayer, plants: Sequence[bpy.types.Object], heights: NDArray[np.float64]
) -> int:
    """Move plants that are objects to heights (n,); how many moved."""
    now = np.array([o.matrix_world.translation.z for o in plants], dtype=np.float64)
    fall = np.flatnonzero(np.abs(heights - now) > _STAYS)
    chosen = set(plants)
    for i in sorted(fall.tolist(), key=lambda i: _depth(plants[i])):
        plant = plants[i]
        placed = plant.matrix_world.copy()
        placed.translation.z = heights[i]
        plant.matrix_world = placed
        if any(child in chosen for child in plant.children):
            view_layer.update()
    return len(fall)


def _depth(obj: bpy.types.Object) -> int:
    return 0 if obj.parent is None else 1 + _depth(obj.parent)


def _drop_field(field: bpy.types.Object, heights: NDArray[np.float64]) -> int:
    """Move the points of an editable field to heights (n,); how many moved."""
    stored, places = read(field.data, "position"), positions(field)
    world = np.array(field.matrix_world, dtype=np.float64)
    # Positions are stored in single precision.
    fall = np.abs(heights - places[:, 2]) > np.maximum(_STAYS, 1e-6 * np.abs(places).max(axis=1, initial=0.0))
    if fall.any():
        places[fall, 2] = heights[fall]
        inverse = np.linalg.inv(world)
        stored[fall] = places[fall] @ inverse[:3, :3].T + inverse[:3, 3]
        mesh = own_mesh(field)
        write(mesh, "position", stored)
        mesh.update()
    return int(fall.sum())
