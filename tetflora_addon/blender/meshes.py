# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays in and out of Blender meshes, at the speed of a copy."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers

UV_MAP = "UVMap"

_DOMAINS = ("POINT", "FACE", "CORNER")
# Type of attribute and name of its value, by the values' dtype and trailing shape.
_TYPES = {
    (np.dtype(np.float32), ()): ("FLOAT", "value"),
    (np.dtype(np.float32), (2,)): ("FLOAT2", "vector"),
    (np.dtype(np.float32), (3,)): ("FLOAT_VECTOR", "vector"),
    (np.dtype(np.int32), ()): ("INT", "value"),
}


def write_mesh(name: str, buffers: MeshBuffers, materials: Sequence[bpy.types.Material | None] = ()) -> bpy.types.Mesh:
    """Make a mesh datablock from buffers.

    Topology is copied as it comes, edges included, so nothing has to be worked out by Blender. Positions and indices
    go through the mesh's attributes, which are plain memory; the older ``vertices`` and ``loops`` collections are
    many times slower.

    Parameters
    ----------
    name : str
        Name of the new datablock; Blender appends a number where it is taken.
    buffers : MeshBuffers
        The mesh, see ``docs/architecture.md``. ``UVMap`` becomes the UV map; an INT attribute ``material_index`` on
        ``'FACE'`` chooses among `materials`.
    materials : sequence of bpy.types.Material or None
        Material slots in their order.

    Returns
    -------
    bpy.types.Mesh
        Not linked to any object.

    Raises
    ------
    ValueError
        Arrays of wrong shape or type, or indices out of range; no datablock is left behind. Checked here because
        Blender takes whatever it is given and crashes later.
    """
    check_buffers(buffers)
    mesh = bpy.data.meshes.new(name)
    try:
        _fill(mesh, buffers)
    except BaseException:
        bpy.data.meshes.remove(mesh)
        raise
    for material in materials:
        mesh.materials.append(material)
    return mesh


def _fill(mesh: bpy.types.Mesh, buffers: MeshBuffers) -> None:
    mesh.vertices.add(len(buffers.positions))
    mesh.edges.add(len(buffers.edge_verts))
    mesh.loops.add(len(buffers.corner_verts))
    mesh.polygons.add(buffers.polygons)
    for key, values, field in (
        ("position", buffers.positions, "vector"),
        (".edge_verts", buffers.edge_verts, "value"),
        (".corner_vert", buffers.corner_verts, "value"),
        (".corner_edge", buffers.corner_edges, "value"),
    ):
        if len(values):
            # An empty mesh has no such layers.
            mesh.attributes[key].data.foreach_set(field, _flat(values))
    # Offsets are no attribute, but setting the starts of faces writes the very same array.
    mesh.polygons.foreach_set("loop_start", np.ascontiguousarray(buffers.face_offsets[:-1]))
    for key, (domain, values) in buffers.attributes.items():
        kind, field = _TYPES[values.dtype, values.shape[1:]]
        if key == UV_MAP:
            mesh.uv_layers.new(name=UV_MAP, do_init=False)
        elif key not in mesh.attributes:
            mesh.attributes.new(key, kind, domain)
        if len(values):
            mesh.attributes[key].data.foreach_set(field, _flat(values))
    if not buffers.smooth and buffers.polygons:
        # Smooth is what a mesh without this layer is; `shade_flat` does the same far more slowly.
        sharp = mesh.attributes.new("sharp_face", "BOOLEAN", "FACE")
        sharp.data.foreach_set("value", np.ones(buffers.polygons, dtype=bool))
    mesh.update()


def _flat(values: NDArray) -> NDArray:
    return np.ascontiguousarray(values).reshape(-1)


def check_buffers(buffers: MeshBuffers) -> None:
    """Raise ValueError unless Blender can take the buffers as they are.

    Parameters
    ----------
    buffers : MeshBuffers
        What to look at: shapes, types, ranges of indices, sizes of faces and of attributes.
    """
    corners, faces, vertices = len(buffers.corner_verts), buffers.polygons, len(buffers.positions)
    for key, shape, dtype in (
        ("positions", (vertices, 3), np.float32),
        ("edge_verts", (len(buffers.edge_verts), 2), np.int32),
        ("corner_verts", (corners,), np.int32),
        ("corner_edges", (corners,), np.int32),
        ("face_offsets", (faces + 1,), np.int32),
    ):
        array = getattr(buffers, key)
        if array.shape != shape or array.dtype != dtype:
            raise ValueError(
                f"{key} must be {np.dtype(dtype)} of shape {shape}, not {array.dtype} of shape {array.shape}"
            )
    offsets = buffers.face_offsets
    if faces < 0 or offsets[0] != 0 or offsets[-1] != corners or (faces and np.diff(offsets).min() < 3):
        raise ValueError(f"face_offsets must rise from 0 to {corners} corners in steps of at least 3")
    _check_range("edge_verts", buffers.edge_verts, vertices)
    _check_range("corner_verts", buffers.corner_verts, vertices)
    _check_range("corner_edges", buffers.corner_edges, len(buffers.edge_verts))
    sizes = {"POINT": vertices, "FACE": faces, "CORNER": corners}
    for key, (domain, values) in buffers.attributes.items():
        if domain not in _DOMAINS:
            raise ValueError(f"Attribute {key}: domain must be one of {', '.join(_DOMAINS)}, not {domain!r}")
        if (values.dtype, values.shape[1:]) not in _TYPES:
            raise ValueError(
                f"Attribute {key}: Blender has no attribute type for {values.dtype} of shape {values.shape}"
            )
        if len(values) != sizes[domain]:
            raise ValueError(f"Attribute {key}: has {len(values)} values, but {domain} has {sizes[domain]} elements")
        if key == UV_MAP and (domain != "CORNER" or values.shape[1:] != (2,)):
            raise ValueError(f"Attribute {UV_MAP} must be float32 of shape (corners, 2) on CORNER")


def _check_range(key: str, indices: NDArray, count: int) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= count):
        raise ValueError(f"{key} must lie between 0 and {count - 1}, not {indices.min()} to {indices.max()}")


def read_mesh_arrays(mesh: bpy.types.Mesh) -> MeshBuffers:
    """Copy a mesh into buffers: the geometry, the active UV map and the indices of materials if there are any.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Any mesh, of an object or evaluated. In edit mode it holds what was there when the mode was entered; call
        ``obj.update_from_editmode()`` first. Positions stay in the mesh's own space.

    Returns
    -------
    MeshBuffers
        Arrays of the caller's own; ``attributes`` may have ``UVMap`` and ``material_index``; ``smooth`` if any face is.
    """
    positions = np.zeros((len(mesh.vertices), 3), dtype=np.float32)
    edges = np.zeros((len(mesh.edges), 2), dtype=np.int32)
    corner_verts = np.zeros(len(mesh.loops), dtype=np.int32)
    corner_edges = np.zeros(len(mesh.loops), dtype=np.int32)
    offsets = np.full(len(mesh.polygons) + 1, len(mesh.loops), dtype=np.int32)
    smooth = np.zeros(len(mesh.polygons), dtype=bool)
    mesh.vertices.foreach_get("co", positions.reshape(-1))
    mesh.edges.foreach_get("vertices", edges.reshape(-1))
    mesh.loops.foreach_get("vertex_index", corner_verts)
    mesh.loops.foreach_get("edge_index", corner_edges)
    mesh.polygons.foreach_get("loop_start", offsets[:-1])
    mesh.polygons.foreach_get("use_smooth", smooth)
    attributes = {}
    layer = mesh.uv_layers.active
    if layer is not None and len(mesh.loops):
        uv = np.zeros((len(mesh.loops), 2), dtype=np.float32)
        layer.uv.foreach_get("vector", uv.reshape(-1))
        attributes[UV_MAP] = ("CORNER", uv)
    if "material_index" in mesh.attributes:
        index = np.zeros(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("material_index", index)
        attributes["material_index"] = ("FACE", index)
    return MeshBuffers(positions, edges, corner_verts, corner_edges, offsets, attributes, bool(smooth.any()))
