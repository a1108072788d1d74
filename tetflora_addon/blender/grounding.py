# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants moved along the vertical onto the ground."""

from collections.abc import Sequence

import bpy
import numpy as np

from .attributes import read, write
from .field_edits import own_mesh
from .ground import Ground

_STAYS = 1e-6  # metres: less is standing on it already


def drop_plants(plants: Sequence[bpy.types.Object], ground: Ground) -> tuple[int, int]:
    """Move plants that are objects; how many moved, and how many have no ground below or above.

    Children move with their parents before they fall themselves.
    """
    places = np.array([o.matrix_world.translation for o in plants], dtype=np.float64).reshape(-1, 3)
    heights = ground.nearest_heights(places)
    gaps = heights - places[:, 2]
    fall = np.flatnonzero(np.abs(gaps) > _STAYS)
    chosen = set(plants)
    for i in sorted(fall.tolist(), key=lambda i: _depth(plants[i])):
        plant = plants[i]
        moved = plant.matrix_world.copy()
        moved.translation.z = heights[i]
        plant.matrix_world = moved
        if any(child in chosen for child in plant.children):
            bpy.context.view_layer.update()
    return len(fall), int(np.isnan(heights).sum())


def _depth(obj: bpy.types.Object) -> int:
    return 0 if obj.parent is None else 1 + _depth(obj.parent)


def drop_field(field: bpy.types.Object, ground: Ground) -> tuple[int, int]:
    """Move the points of an editable field; how many moved, and how many have no ground below or above."""
    positions = read(field.data, "position")
    world = np.array(field.matrix_world, dtype=np.float64)
    places = positions.astype(np.float64) @ world[:3, :3].T + world[:3, 3]
    heights = ground.nearest_heights(places)
    # Positions are stored in single precision.
    fall = np.abs(heights - places[:, 2]) > np.maximum(_STAYS, 1e-6 * np.abs(places).max(axis=1, initial=0.0))
    if fall.any():
        places[fall, 2] = heights[fall]
        inverse = np.linalg.inv(world)
        positions[fall] = places[fall] @ inverse[:3, :3].T + inverse[:3, 3]
        mesh = own_mesh(field)
        write(mesh, "position", positions)
        mesh.update()
    return int(fall.sum()), int(np.isnan(heights).sum())
