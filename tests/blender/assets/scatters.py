# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets for tests: trees, what scatters them by nodes, and species of them."""

from __future__ import annotations

import bpy

from tests.blender.scenes import add_mesh, depsgraph
from tetflora_addon.blender.assets import marks, places


def scene():
    return bpy.context.scene


def read():
    return places.read_places(scene(), depsgraph())


def tree(name="tree", faces=((0, 1, 2, 3),)):
    """An asset that is not in the scene's own collection, as those of scatterers are."""
    made = add_mesh(name, faces, z=1.0)
    scene().collection.objects.unlink(made)
    held = bpy.data.collections.get("sources") or bpy.data.collections.new("sources")
    held.objects.link(made)
    return made


class Nodes:
    """Geometry nodes of an object, as a chain that ends in its output."""

    def __init__(self, obj):
        self.group = bpy.data.node_groups.new("nodes", 'GeometryNodeTree')
        self.group.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
        self.group.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
        self.input, self.output = self.add("NodeGroupInput"), self.add("NodeGroupOutput")
        obj.modifiers.new("nodes", 'NODES').node_group = self.group

    def add(self, kind, **values):
        node = self.group.nodes.new(kind)
        for name, value in values.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node

    def link(self, source, target, name, output=0):
        self.group.links.new(source.outputs[output], target.inputs[name])

    def asset(self, datablock):
        """What brings an object or a collection as an instance."""
        if isinstance(datablock, bpy.types.Object):
            return self.add("GeometryNodeObjectInfo", Object=datablock, As_Instance=True), "Geometry"
        return self.add("GeometryNodeCollectionInfo", Collection=datablock), "Instances"

    def scatter(self, source, count, scale=1.0, socket="Geometry"):
        """Instances of a source on points along x, a meter apart."""
        points = self.add("GeometryNodePoints", Count=count)
        index, along = self.add("GeometryNodeInputIndex"), self.add("ShaderNodeCombineXYZ")
        self.link(index, along, "X")
        self.link(along, points, "Position")
        on_points = self.add("GeometryNodeInstanceOnPoints", Scale=(scale, scale, scale))
        self.link(points, on_points, "Points")
        self.group.links.new(source.outputs[socket], on_points.inputs["Instance"])
        return on_points

    def show(self, *shown):
        """Show the object's own geometry with all of these."""
        join = self.add("GeometryNodeJoinGeometry")
        for node in (self.input, *shown):
            self.link(node, join, "Geometry")
        self.link(join, self.output, "Geometry")


def scattered(datablock, count=5, scale=1.0, name="ground", **options):
    """A ground that scatters, marked."""
    ground = add_mesh(name, **options)
    nodes = Nodes(ground)
    source, socket = nodes.asset(datablock)
    nodes.show(nodes.scatter(source, count, scale, socket))
    ground.tetflora.is_scatter = True
    return ground


def crown(name="crown", radius=2.0, low=1.0, high=5.0):
    """A box as a tree."""
    corners = [(x, y, z) for z in (low, high) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(x * radius, y * radius, z) for x, y, z in corners], [], faces)
    obj = bpy.data.objects.new(name, mesh)
    scene().collection.objects.link(obj)
    return obj


def species(asset, variants=False):
    return marks.use_as_species(scene(), depsgraph(), asset, variants).identifier
