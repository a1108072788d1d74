# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read the lights of a scene whose shadows are refined."""

from __future__ import annotations

import bpy
import numpy as np

from ..refinement.lights import Light
from .scene_reader import renderable_objects
from .transforms import world_matrix


def read_lights(depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer) -> tuple[Light, ...]:
    """Lights that render, shine and cast shadows, by name; an area counts as a point as wide as its longer side.

    Lights that collections or geometry nodes instance are not among them, nor is what the world's sky gives: its
    shadows are too soft to have a shape. A light that is placed nowhere is passed over.
    """
    found = []
    for obj in sorted(renderable_objects(view_layer), key=lambda o: o.name_full):
        if obj.type != 'LIGHT':
            continue
        data = obj.evaluated_get(depsgraph).data
        if data.energy <= 0.0 or not data.use_shadow:
            continue
        matrix = world_matrix(obj, depsgraph).astype(np.float64)
        length = float(np.linalg.norm(matrix[:3, 2]))
        if not np.isfinite(matrix).all() or length < 1e-9:
            continue
        position, direction = matrix[:3, 3], -matrix[:3, 2] / length
        if data.type == 'SUN':
            found.append(Light('SUN', position, direction, float(data.angle)))
        elif data.type == 'SPOT':
            found.append(Light('SPOT', position, direction, 2.0 * data.shadow_soft_size, data.spot_size / 2.0))
        elif data.type == 'AREA':
            oblong = data.shape in {'RECTANGLE', 'ELLIPSE'}
            found.append(Light('POINT', position, direction, max(data.size, data.size_y if oblong else 0.0)))
        else:
            found.append(Light('POINT', position, direction, 2.0 * data.shadow_soft_size))
    return tuple(found)
