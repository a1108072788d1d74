# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes and point clouds from buffers, and buffers from meshes, at the speed of a copy.

Where Python cannot resize point clouds, geometry nodes make them from the vertices of a mesh.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...buffers import MeshBuffers, PointBuffers
from ...jobs import at_once
from ..attributes import face_offsets, members, type_for, write
from ..compat import can_resize_point_clouds
from ..materials.nodes import Graph, Term, node_group
from ..runtime import is_there

UV_MAP = "UVMap"

SPHERES = "TetFlora Spheres"
_SPHERES_VERSION = 1
_DOMAINS = ("POINT", "FACE", "CORNER")


def write_mesh(name: str, buffers: MeshBuffers, materials: Sequence[bpy.types.Material | None] = ()) -> bpy.types.Mesh:
    """Make a mesh datablock from buffers.

    Topology is copied, edges included, so that Blender computes nothing; where buffers have none it finds them.
    Positions and indices are written through the mesh's attributes, which are plain memory; the collections
    ``vertices`` and ``loops`` are many times slower.

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
        Arrays of wrong shape or type, or indices out of range, with which Blender would crash later; no datablock is
        left behind.
    """
    return at_once(mesh_steps(name, buffers, materials))


def mesh_steps(
    name: str, buffers: MeshBuffers, materials: Sequence[bpy.types.Material | None] = ()
) -> Generator[None, None, bpy.types.Mesh]:
    """The same array by array, so that nobody waits for long; closing the generator removes the mesh."""
    check_buffers(buffers)
    yield
    mesh = bpy.data.meshes.new(name)
    try:
        yield from _fill(mesh, buffers)
        for material in materials:
            mesh.materials.append(material)
    except BaseException:
        if is_there(mesh):
            bpy.data.meshes.remove(mesh)
        raise
    return mesh


def _fill(mesh: bpy.types.Mesh, buffers: MeshBuffers) -> Iterator[None]:
    mesh.vertices.add(len(buffers.positions))
    mesh.edges.add(len(buffers.edge_verts))
    mesh.loops.add(len(buffers.corner_verts))
    mesh.polygons.add(buffers.polygons)
    # Offsets are no attribute, but setting the starts of faces writes the very same array. It comes first, so that the
    # mesh is valid whenever Blender looks at it between two steps, as for undo.
    mesh.polygons.foreach_set("loop_start", np.ascontiguousarray(buffers.face_offsets[:-1]))
    yield
    write(mesh, "position", buffers.positions)
    yield
    write(mesh, ".corner_vert", buffers.corner_verts)
    if len(buffers.edge_verts):
        write(mesh, ".edge_verts", buffers.edge_verts)
        write(mesh, ".corner_edge", buffers.corner_edges)
    elif buffers.polygons:
        mesh.update(calc_edges=True)
    for key, (domain, values) in buffers.attributes.items():
        yield
        if key == UV_MAP:
            mesh.uv_layers.new(name=UV_MAP, do_init=False)
        write(mesh, key, values, domain)
    yield
    if not buffers.smooth and buffers.polygons:
        # A mesh without this layer is smooth; `shade_flat` does the same far more slowly.
        write(mesh, "sharp_face", np.ones(buffers.polygons, bool), "FACE")
    mesh.update()


def check_buffers(buffers: MeshBuffers) -> None:
    """Raise ValueError unless shapes, dtypes, indices, faces and attributes of buffers are valid in Blender."""
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
    if len(buffers.edge_verts):
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
        Of an object or evaluated. In Edit Mode, call ``obj.update_from_editmode()`` first. Positions stay in the mesh's
        own space.

    Returns
    -------
    MeshBuffers
        Copies; ``attributes`` may have ``UVMap`` and ``material_index``; ``smooth`` if any face is.
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


def point_object(
    name: str,
    buffers: PointBuffers,
    material: bpy.types.Material,
    by_nodes: bool | None = None,
) -> bpy.types.Object:
    """Make an object of points that render as spheres, not linked to any collection.

    Parameters
    ----------
    name : str
        Name of the new datablocks; Blender appends a number where it is taken.
    buffers : PointBuffers
    material : bpy.types.Material
        Of all points.
    by_nodes : bool, optional
        Vertices with geometry nodes instead of a point cloud; by default only where Blender requires it.

    Returns
    -------
    bpy.types.Object
        Its data is a point cloud, or a mesh with a modifier.

    Raises
    ------
    ValueError
        Arrays of wrong shape or type; no datablock is left behind.
    """
    vertices = _as_vertices(buffers)
    by_nodes = not can_resize_point_clouds() if by_nodes is None else by_nodes
    if by_nodes:
        data = write_mesh(name, vertices, [material])
    else:
        data = _write_cloud(name, vertices)
        data.materials.append(material)
    made = bpy.data.objects.new(name, data)
    if by_nodes:
        made.modifiers.new("Spheres", 'NODES').node_group = spheres_group(material)
    return made


def _as_vertices(buffers: PointBuffers) -> MeshBuffers:
    """Points as a mesh without edges and faces, its attributes on the vertices."""
    none = np.zeros(0, np.int32)
    values = {"radius": buffers.radius, **buffers.attributes}
    attributes = {name: ("POINT", array) for name, array in values.items()}
    return MeshBuffers(buffers.positions, none.reshape(0, 2), none, none, np.zeros(1, np.int32), attributes)


def _write_cloud(name: str, vertices: MeshBuffers) -> bpy.types.PointCloud:
    check_buffers(vertices)
    cloud = bpy.data.pointclouds.new(name)
    cloud.resize(len(vertices.positions))
    write(cloud, "position", vertices.positions)
    for key, (_, values) in vertices.attributes.items():
        write(cloud, key, values)
    cloud.update_tag()
    return cloud


def spheres_group(material: bpy.types.Material) -> bpy.types.NodeTree:
    """The group "TetFlora Spheres" of geometry nodes: vertices become points with the radius in their attribute."""

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        named = graph.node("GeometryNodeInputNamedAttribute", {"Name": "radius"}, data_type='FLOAT')
        inputs = {"Mesh": given["Geometry"], "Radius": named}
        points = graph.node("GeometryNodeMeshToPoints", inputs, mode='VERTICES')
        # Points made of vertices do not inherit the material.
        return {"Geometry": graph.node("GeometryNodeSetMaterial", {"Geometry": points})}

    whole = (("Geometry", 'Geometry'),)
    group = node_group(SPHERES, _SPHERES_VERSION, whole, whole, build, 'Geometry')
    for node in group.nodes:
        if node.bl_idname == "GeometryNodeSetMaterial":
            node.inputs["Material"].default_value = material
    return group
