# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same wood as artists make it without the extension: a few variants, instanced at its places."""

from __future__ import annotations

import time
from collections.abc import Iterable

import bpy
import numpy as np

from tetflora_addon.blender.job.contents import compile_for, in_year, read_scene
from tetflora_addon.blender.job.plant_mesh import plant_mesh, plant_parts, single_seed
from tetflora_addon.growth.seeds import Seeds

from .report import peak_mb

#: Different plants in all; species have equal parts of them, rounded up.
VARIANTS = 8
_NAME = "Variants"
#: Attributes of places: their types, and the sockets that they feed.
_NAMED = (
    ("turned", 'FLOAT_VECTOR', "Rotation"),
    ("size", 'FLOAT', "Scale"),
    ("variant", 'INT', "Instance Index"),
)


def build(scene: bpy.types.Scene, of_each: int = 0, own: bool = False) -> dict[str, float]:
    """Put variants at the places of all plants of a scene; seconds, and polygons of the variants.

    So many of each species, or `VARIANTS` in all, each at random; ``own``: that of the plant's own seed, which must be
    below their number.
    """
    start = time.perf_counter()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seeds = read_scene(scene, depsgraph, depsgraph.view_layer).seeds
    variants = bpy.data.collections.new(_NAME)  # of no scene: only the instances are rendered
    polygons, each = 0, of_each or -(-VARIANTS // len(seeds.identifiers))
    for number, kind in enumerate(seeds.identifiers):
        flora = in_year(scene, compile_for((kind,), scene, depsgraph))
        for one in range(each):
            # Geometry nodes sort the members of a collection by their names.
            name = f"{_NAME} {number:03d} {one:03d}"
            mesh = plant_mesh(scene, name, flora.species[0], plant_parts(flora, single_seed(kind, one)))
            variants.objects.link(bpy.data.objects.new(name, mesh))
            polygons += len(mesh.polygons)
    wood = bpy.data.objects.new("Wood", _points(seeds, each, own))
    scene.collection.objects.link(wood)
    wood.modifiers.new("Instances", 'NODES').node_group = _nodes(variants)
    bpy.context.view_layer.update()
    seconds = time.perf_counter() - start
    return {"instances": len(seeds), "build_s": seconds, "variant_polygons": polygons, "peak_mb": peak_mb()}


def _points(seeds: Seeds, each: int, own: bool) -> bpy.types.Mesh:
    """A vertex for each plant, with its rotation, scale and variant, out of so many of its species."""
    if own and len(seeds) and not 0 <= seeds.seed.min() <= seeds.seed.max() < each:
        raise ValueError(f"Seeds from {seeds.seed.min()} to {seeds.seed.max()} are none of {each} variants")
    mesh = bpy.data.meshes.new("Wood")
    mesh.vertices.add(len(seeds))
    frame = seeds.frame
    angles = np.stack(
        [
            np.arctan2(frame[:, 2, 1], frame[:, 2, 2]),
            -np.arcsin(np.clip(frame[:, 2, 0], -1.0, 1.0)),
            np.arctan2(frame[:, 1, 0], frame[:, 0, 0]),
        ],
        axis=1,
    )
    chosen = seeds.seed if own else np.random.default_rng(1).integers(0, each, len(seeds))
    variant = seeds.species * each + chosen
    mesh.attributes["position"].data.foreach_set("vector", seeds.position.astype(np.float32).ravel())
    for name, kind, key, values in (
        ("turned", 'FLOAT_VECTOR', "vector", angles.astype(np.float32)),
        ("size", 'FLOAT', "value", seeds.scale.astype(np.float32)),
        ("variant", 'INT', "value", variant.astype(np.int32)),
    ):
        mesh.attributes.new(name, kind, 'POINT').data.foreach_set(key, values.ravel())
    return mesh


def _nodes(variants: bpy.types.Collection) -> bpy.types.GeometryNodeTree:
    """Vertices in, instances of the members of a collection out."""
    tree, members, placed = placing_nodes("GeometryNodeCollectionInfo", _NAMED)
    members.inputs["Collection"].default_value = variants
    members.inputs["Separate Children"].default_value = True
    placed.inputs["Pick Instance"].default_value = True
    return tree


def placing_nodes(
    source: str, named: Iterable[tuple[str, str, str]]
) -> tuple[bpy.types.GeometryNodeTree, bpy.types.Node, bpy.types.Node]:
    """A tree that places what a kind of node gives on vertices; with that node, and the one that places.

    named: attributes, with their types and the sockets of the latter that they feed.
    """
    tree = bpy.data.node_groups.new("Instances", 'GeometryNodeTree')
    tree.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
    tree.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    new, link = tree.nodes.new, tree.links.new
    given, made = new("NodeGroupInput"), new("NodeGroupOutput")
    members, placed = new(source), new("GeometryNodeInstanceOnPoints")
    link(given.outputs[0], placed.inputs["Points"])
    link(next(s for s in members.outputs if s.type == 'GEOMETRY'), placed.inputs["Instance"])
    for name, kind, socket in named:
        stored = new("GeometryNodeInputNamedAttribute")
        stored.data_type = kind
        stored.inputs["Name"].default_value = name
        link(next(s for s in stored.outputs if s.enabled), placed.inputs[socket])
    link(placed.outputs[0], made.inputs[0])
    return tree, members, placed
