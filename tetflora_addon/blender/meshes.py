# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays in and out of Blender meshes, at the speed of a copy."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers
from .attributes import members, type_for, write

UV_MAP = "UVMap"

_DOMAINS = ("POINT", "FACE", "CORNER")


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
    write(mesh, "position", buffers.positions)
    write(mesh, ".edge_verts", buffers.edge_verts)
    write(mesh, ".corner_vert", buffers.corner_verts)
    write(mesh, ".corner_edge", buffers.corner_edges)
    # Offsets are no attribute, but setting the starts of faces writes the very same array.
    mesh.polygons.foreach_set("loop_start", np.ascontiguousarray(buffers.face_offsets[:-1]))
    for key, (domain, values) in buffers.attributes.items():
        if key == UV_MAP:
            mesh.uv_layers.new(name=UV_MAP, do_init=False)
        write(mesh, key, values, domain)
    if not buffers.smooth and buffers.polygons:
        # Smooth is what a mesh without this layer is; `shade_flat` does the same far more slowly.
        write(mesh, "sharp_face", np.ones(buffers.polygons, bool), "FACE")
    mesh.update()


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
        if type_for(values) is None:
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
    positions = members(mesh.vertices, "co", 3)
    edges = members(mesh.edges, "vertices", 2, np.int32)
    corner_verts = members(mesh.loops, "vertex_index", dtype=np.int32)
    corner_edges = members(mesh.loops, "edge_index", dtype=np.int32)
    smooth = members(mesh.polygons, "use_smooth", dtype=bool)
    attributes = {}
    layer = mesh.uv_layers.active
    if layer is not None and len(mesh.loops):
        attributes[UV_MAP] = ("CORNER", members(layer.uv, "vector", 2))
    if "material_index" in mesh.attributes:
        attributes["material_index"] = ("FACE", members(mesh.polygons, "material_index", dtype=np.int32))
    return MeshBuffers(positions, edges, corner_verts, corner_edges, face_offsets(mesh), attributes, bool(smooth.any()))


def face_offsets(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """First corner of each face, and the number of corners: (faces + 1,)."""
    return np.append(members(mesh.polygons, "loop_start", dtype=np.int32), np.int32(len(mesh.loops)))
