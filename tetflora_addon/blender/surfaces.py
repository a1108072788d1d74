# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of mesh objects in world space: what hides plants, and what they stand on."""

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError


def mesh_triangles(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> NDArray[np.float64]:
    """Triangles of a mesh object, modifiers applied.

    Parameters
    ----------
    obj : bpy.types.Object
        Original or evaluated object.
    depsgraph : bpy.types.Depsgraph
        Decides about animation and modifiers. An object that it does not hold (hidden in the viewport) is taken
        without its modifiers.

    Returns
    -------
    (t, 3, 3) float64
        Corners in world space, metres.

    Raises
    ------
    SceneError
        Not a mesh (any more), or a mesh without faces.
    """
    if obj.type != 'MESH':
        raise SceneError(
            f'"{obj.name}" is marked as hiding plants but is not a mesh; '
            "convert it (Object > Convert > Mesh) or take the mark away in the sidebar's TetFlora tab"
        )
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        triangles = _triangles(mesh)
    finally:
        evaluated.to_mesh_clear()
    if not len(triangles):
        raise SceneError(
            f'"{obj.name}" has no faces; give it some, or take the mark as hiding plants away '
            "in the sidebar's TetFlora tab"
        )
    matrix = np.array(evaluated.matrix_world)
    return triangles @ matrix[:3, :3].T + matrix[:3, 3]


def _triangles(mesh: bpy.types.Mesh) -> NDArray[np.float64]:
    if not len(mesh.polygons):
        return np.zeros((0, 3, 3))
    mesh.calc_loop_triangles()
    corners = np.zeros(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    positions = np.zeros(3 * len(mesh.vertices), np.float32)
    # Attributes are plain memory; ``vertices.foreach_get`` is many times slower.
    mesh.attributes["position"].data.foreach_get("vector", positions)
    return positions.reshape(-1, 3)[corners].reshape(-1, 3, 3).astype(np.float64)
