# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Buffers of points as objects that are drawn as spheres: point clouds, or vertices that nodes make one of.

Versions of Blender whose point clouds cannot be given a size get a mesh of vertices and a group of geometry nodes.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..buffers import MeshBuffers, PointBuffers
from .attributes import write
from .compat import can_resize_point_clouds
from .meshes import check_buffers, write_mesh
from .node_tools import Graph, get_or_create

SPHERES = "TetFlora Spheres"
_SPHERES_VERSION = 1


def point_object(
    name: str,
    buffers: PointBuffers,
    material: bpy.types.Material,
    by_nodes: bool | None = None,
) -> bpy.types.Object:
    """Make an object of points, not linked to any collection.

    Parameters
    ----------
    name : str
        Name of the new datablocks; Blender appends a number where it is taken.
    buffers : PointBuffers
    material : bpy.types.Material
        Of all points.
    by_nodes : bool, optional
        Vertices with nodes, or a point cloud; by default what this Blender can do best.

    Returns
    -------
    bpy.types.Object
        Its data is a point cloud, or a mesh that a modifier makes one of.

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
    """The group "TetFlora Spheres" of geometry nodes: vertices become points of the radius that they carry."""

    def build(tree: bpy.types.NodeTree) -> None:
        for in_out in ('INPUT', 'OUTPUT'):
            tree.interface.new_socket(name="Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
        graph = Graph(tree)
        given = graph.node("NodeGroupInput").outputs["Geometry"]
        named = graph.node("GeometryNodeInputNamedAttribute", {"Name": "radius"}, data_type='FLOAT')
        points = graph.node("GeometryNodeMeshToPoints", {"Mesh": given, "Radius": named}, mode='VERTICES')
        # Points that are made of vertices take no material over.
        graph.node("NodeGroupOutput", {"Geometry": graph.node("GeometryNodeSetMaterial", {"Geometry": points})})
        graph.arrange()

    def new(name: str) -> bpy.types.NodeTree:
        return bpy.data.node_groups.new(name, "GeometryNodeTree")

    group = get_or_create(bpy.data.node_groups, SPHERES, _SPHERES_VERSION, new, build)
    for node in group.nodes:
        if node.bl_idname == "GeometryNodeSetMaterial":
            node.inputs["Material"].default_value = material
    return group
