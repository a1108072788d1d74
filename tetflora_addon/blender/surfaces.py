# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of mesh objects in world space: what hides plants, and what they stand on."""

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from .transforms import world_matrix


def mesh_triangles(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, remedy: str) -> NDArray[np.float64]:
    """Triangles of a mesh object, modifiers applied.

    Parameters
    ----------
    obj : bpy.types.Object
        The original object.
    depsgraph : bpy.types.Depsgraph
        Decides about animation and modifiers. An object that it does not hold (switched off in viewports) is taken
        without its modifiers.
    remedy : str
        What the artist can do if the object cannot be used; ends the message of the error.

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
        raise SceneError(f'"{obj.name}" is not a mesh; {remedy}')
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        triangles = _triangles(mesh)
    finally:
        evaluated.to_mesh_clear()
    if not len(triangles):
        raise SceneError(f'"{obj.name}" has no faces; {remedy}')
    matrix = world_matrix(obj, depsgraph)
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
