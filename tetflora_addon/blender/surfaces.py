# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of mesh objects in world space: what hides plants, and what they stand on."""

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from .attributes import members, read
from .transforms import world_matrix
from .view_layers import renderable_objects

_OCCLUDER_REMEDY = (
    "an occluder must be a mesh with faces. Add faces, or turn off Occluder in the TetFlora tab of the sidebar"
)


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
        positions, corners = _triangles(mesh)
    finally:
        evaluated.to_mesh_clear()
    if not len(corners):
        raise SceneError(f'"{obj.name}" has no faces; {remedy}')
    matrix = world_matrix(obj, depsgraph)
    return (positions @ matrix[:3, :3].T + matrix[:3, 3])[corners]


def _triangles(mesh: bpy.types.Mesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Places (v, 3) of vertices, and the vertices (t, 3) of triangles."""
    if not len(mesh.polygons):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    mesh.calc_loop_triangles()
    vertices = read(mesh, ".corner_vert")[members(mesh.loop_triangles, "loops", 3, np.int32)]
    return read(mesh, "position").astype(np.float64), vertices


def read_occluders(
    _scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer | None = None
) -> NDArray[np.float64]:
    """Triangles of all meshes of a view layer that are marked as hiding plants and render.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer or None
        None takes the one that the depsgraph was made for.

    Returns
    -------
    (t, 3, 3) float64
        Corners in world space, metres; ``(0, 3, 3)`` if there are none.

    Raises
    ------
    SceneError
        One of them has no faces or is no longer a mesh.
    """
    marked = [o for o in renderable_objects(view_layer or depsgraph.view_layer) if o.tetflora.is_occluder]
    marked.sort(key=lambda o: o.name_full)
    return np.concatenate([np.zeros((0, 3, 3)), *(mesh_triangles(o, depsgraph, _OCCLUDER_REMEDY) for o in marked)])
