# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that are instances of the artist's own objects, or of meshes of clusters: points with a matrix each.

Nothing is copied: materials, modifiers and attributes are those of the original because it is the original. Geometry
nodes turn the vertices of a mesh into instances, because they show what is hidden, excluded or linked as well, and
take any matrix: mirrored, stretched, sheared.

An object is hidden as a whole when results replace its instances. What it shows besides, such as the ground, a stand-in
shows: it has the same data, materials and modifiers, and one more that drops instances; of particle systems it has the
hair. What a simulation made is copied as it is now.
"""

import re
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from bpy.types import ID, Collection, Depsgraph, GeometrySet, Mesh, NodeTree, Object
from numpy.typing import NDArray

from ...arrays import Floats, Integers, Integers32
from ..attributes import write
from ..compat import set_node_input
from ..main_thread import in_main_thread
from ..materials.nodes import Graph, Term, find_socket, node_group
from ..scene.looks import look_like
from ..scene.objects import geometry_of, references_of
from .collection import Results
from .hiding import HIDDEN, artists_flags
from .output import STAND_IN

#: Attributes of points: where each instance stands, and which of several objects it shows.
MATRIX, PICK = "tf_matrix", "tf_pick"
#: Kinds of results, see `output.KIND`.
KIND_WHOLE, KIND_CLUSTERS = "asset", "asset clusters"
_VERSION = 1
_NAMES = {
    'OBJECT': "TetFlora Instances",
    'COLLECTION': "TetFlora Collection Instances",
    'CHILDREN': "TetFlora Cluster Instances",
}
_SOURCE = "Source"
_COMPONENTS = ("mesh", "curves", "pointcloud", "volume")

Source = Object | Collection


def add_instances(
    results: Results, name: str, source: Source, matrices: Floats, ids: Integers32, like: Object | None = None
) -> Object:
    """Add one object to the result collection that shows many instances of an object or a collection.

    Parameters
    ----------
    source : bpy.types.Object or bpy.types.Collection
        The artist's own, or what `carrier_of` returned. Visible or not, in the scene or not, of this file or not.
    matrices : (n, 4, 4) float64
        Affine maps from the source's space (a collection's begins at its offset), meters from ``results.origin``.
    ids : (n,) int32
        Become the instances' ``id``, which random values of materials follow.
    like : bpy.types.Object, optional
        Object that shows the instances in the artist's scene: see `look_like`.

    """
    name = results.name_for(name)
    instancer = _instancer(name, source, matrices, ids)
    look_like(instancer, like, results.owners.get(like))
    return results.add_object(name, instancer, KIND_WHOLE, source)


def add_cluster_instances(
    results: Results,
    name: str,
    objects: Sequence[Object],
    pick: Integers32,
    matrices: Floats,
    ids: Integers32,
    like: Object | None = None,
) -> Object:
    """Add one object that shows instances of many objects, such as those of `add_cluster`.

    Parameters
    ----------
    results, name, matrices, ids, like
        As for `add_instances`; matrices apply to the meshes of the objects, whose own transforms do not count.
    objects : sequence of bpy.types.Object
        In no collection of a scene. The same sequence shares one collection.
    pick : (n,) int32
        Index of the object that each instance shows.
    """
    key = ("clusters", *(o.session_uid for o in objects))
    collection = results.shared(key, lambda: _collection(results, "clusters", objects))
    # Blender numbers the objects of a collection by their names: numbers within count as such, and case does not.
    names = [re.split(r"(\d+)", obj.name.casefold()) for obj in objects]
    keys = [[(p.isdigit(), int(p) if p.isdigit() else 0, p) for p in parts if p] for parts in names]
    order = sorted(range(len(objects)), key=keys.__getitem__)
    place = np.zeros(len(objects), np.int32)
    place[order] = np.arange(len(objects), dtype=np.int32)
    name = results.name_for(name)
    instancer = _instancer(name, collection, matrices, ids, place[pick])
    look_like(instancer, like, results.owners.get(like))
    return results.add_object(name, instancer, KIND_CLUSTERS, collection)


def add_cluster(results: Results, stem: str, number: int, mesh: Mesh, like: Object | None = None) -> Object:
    """Make an object of the mesh of a numbered cluster, which goes with it, in no collection.

    Parameters
    ----------
    like : bpy.types.Object, optional
        The object that the faces are of, whose color, pass index and the like materials may read.
    """
    name = results.name_for(f"{stem} {number:06d}")
    obj = bpy.data.objects.new(name, mesh)
    look_like(obj, like, results.owners.get(like))
    results.hold(obj, name)
    return obj


def carrier_of(results: Results, target: Any) -> Source:
    """Something to instance for a target that is no datablock: an object with a copy, made once for a result.

    A collection of such objects where it is more than one mesh; its instances are instances there too.
    """
    make = _family if target.geometry is None else _carrier
    return results.shared(("carrier", target), lambda: make(results, target.name, target.geometry or target.family))


def _family(results: Results, name: str, family: Sequence[tuple[Object, Any]]) -> Collection:
    held = [_held(results, f"{name} {n}", one, np.array([pose]), np.array([n])) for n, (one, pose) in enumerate(family)]
    return _collection(results, name, held)


def _carrier(results: Results, name: str, geometry: GeometrySet) -> Source:
    parts = [c for c in (getattr(geometry, kind, None) for kind in _COMPONENTS) if c is not None]
    parts = [c for c in parts if not isinstance(c, Mesh) or len(c.vertices)]
    objects = [_carried(results, name, part) for part in parts]
    nested = _nested(results, name, geometry)
    return objects[0] if len(objects) == 1 and not nested else _collection(results, name, objects + nested)


def _carried(results: Results, name: str, part: ID) -> Object:
    data = part.copy()
    name = results.name_for(f"{name} 0")
    data.name = name
    for number, material in enumerate(data.materials):
        if material is not None and material.is_evaluated:
            data.materials[number] = material.original
    carrier = bpy.data.objects.new(name, data)
    results.hold(carrier, name)
    return carrier


def _nested(results: Results, name: str, geometry: GeometrySet) -> list[Object]:
    """Objects that show the instances within geometry."""
    held = []
    for inner, rows in references_of(geometry):
        known = isinstance(inner, Object | Collection)
        source = inner.original if known else _carrier(results, name, inner)
        held.append(_held(results, f"{name} {len(held) + 1}", source, rows.columns.transpose(0, 2, 1), rows.number))
    return held


def _held(results: Results, name: str, source: Source, matrices: NDArray[np.floating], ids: Integers) -> Object:
    instancer = _instancer(full_name := results.name_for(name), source, matrices, ids)
    results.hold(instancer, full_name)
    return instancer


def _instancer(name: str, source: Source, matrices: NDArray, ids: Integers, pick: Integers32 | None = None) -> Object:
    """An object in no collection whose nodes show instances of a source, or of objects picked from a collection."""
    kind = 'COLLECTION' if isinstance(source, Collection) else 'OBJECT'
    kind = kind if pick is None else 'CHILDREN'
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(matrices))
    columns = np.ascontiguousarray(matrices.transpose(0, 2, 1), np.float32)  # as Blender stores them
    write(mesh, "position", columns[:, 3, :3])
    write(mesh, MATRIX, columns.reshape(-1, 16), data_type='FLOAT4X4')
    write(mesh, "id", np.asarray(ids, np.int32))
    if pick is not None:
        write(mesh, PICK, pick)
    instancer = bpy.data.objects.new(name, mesh)
    modifier = instancer.modifiers.new("Instances", 'NODES')
    modifier.node_group = group = _group(kind)
    given = next(s for s in group.interface.items_tree if s.name == _SOURCE and s.in_out == 'INPUT')
    set_node_input(modifier, given.identifier, source)
    return instancer


def _group(kind: str) -> NodeTree:
    """Geometry nodes that turn points into instances of an object, of a collection, or of the objects of one."""

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        if kind == 'OBJECT':
            inputs = {"Object": given[_SOURCE], "As Instance": True}
            shown = graph.outputs("GeometryNodeObjectInfo", inputs, transform_space='ORIGINAL')["Geometry"]
        else:
            apart = dict.fromkeys(("Separate Children", "Reset Children"), kind == 'CHILDREN')
            inputs = {"Collection": given[_SOURCE], **apart}
            shown = graph.outputs("GeometryNodeCollectionInfo", inputs, transform_space='ORIGINAL')["Instances"]
        # Points lose their matrices, or instances would keep them as well. Only here: to remove them from instances, or
        # to do anything to what these show, would turn objects into plain geometry.
        bare = graph.node("GeometryNodeRemoveAttribute", {"Geometry": given["Geometry"], "Name": MATRIX})
        pick = graph.node("FunctionNodeInputInt")
        if kind == 'CHILDREN':
            pick = graph.node("GeometryNodeInputNamedAttribute", {"Name": PICK}, data_type='INT')
        # "Pick Instance": the source, not a geometry that holds it.
        inputs = {"Points": bare, "Instance": shown, "Instance Index": pick, "Pick Instance": True}
        placed = graph.node("GeometryNodeInstanceOnPoints", inputs)
        stored = graph.node("GeometryNodeInputNamedAttribute", {"Name": MATRIX}, data_type='FLOAT4X4')
        inputs = {"Geometry": given["Geometry"], "Value": stored, "Index": graph.node("GeometryNodeInputIndex")}
        matrix = graph.node("GeometryNodeSampleIndex", inputs, data_type='FLOAT4X4', domain='POINT')
        return {"Geometry": graph.node("GeometryNodeSetInstanceTransform", {"Instances": placed, "Transform": matrix})}

    inputs = (("Geometry", 'Geometry'), (_SOURCE, 'Object' if kind == 'OBJECT' else 'Collection'))
    return node_group(_NAMES[kind], _VERSION, inputs, (("Geometry", 'Geometry'),), build, 'Geometry')


def _collection(results: Results, name: str, objects: Sequence[Object]) -> Collection:
    """A collection in no scene; the dot keeps it out of menus."""
    collection = bpy.data.collections.new(f".TetFlora {name}")
    results.hold(collection)

    def link() -> None:
        for obj in objects:
            collection.objects.link(obj)

    in_main_thread(link)
    return collection


_BARE_VERSION = 1
_BARE_NAME = "TetFlora Without Instances"
_SIMULATED = {'CLOTH', 'SOFT_BODY', 'FLUID', 'DYNAMIC_PAINT'}
_INSTANCED = {'OBJECT', 'COLLECTION'}
_TURNED_OFF = ("is_scatter", "is_explicit", "is_plant", "is_field", "is_occluder")


def add_stand_in(results: Results, name: str, original: Object, depsgraph: Depsgraph) -> Object | None:
    """Add what an object, hidden or not, shows besides instances to the results; None if that is nothing."""
    if not shows_itself(original, depsgraph):
        return None
    name = results.name_for(name)
    if _is_simulated(original):
        evaluated = original.evaluated_get(depsgraph)
        mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
        mesh.name = name
        results.hold(mesh, name)
        stand_in = bpy.data.objects.new(name, mesh)
        stand_in.matrix_world = evaluated.matrix_world
        for number, slot in enumerate(original.material_slots):
            if slot.link == 'OBJECT':
                stand_in.material_slots[number].link = 'OBJECT'
                stand_in.material_slots[number].material = slot.material
    else:
        stand_in = original.copy()
        stand_in.name = name
        flags = artists_flags(original)
        for key in HIDDEN.values():  # it was never hidden
            stand_in.pop(key, None)
        stand_in.hide_render, stand_in.hide_viewport = flags
        for switch in _TURNED_OFF:
            if getattr(stand_in.tetflora, switch, False):
                setattr(stand_in.tetflora, switch, False)
        stand_in.instance_type = 'NONE'
        for modifier in list(stand_in.modifiers):
            if modifier.type == 'PARTICLE_SYSTEM' and modifier.particle_system.settings.render_type in _INSTANCED:
                stand_in.modifiers.remove(modifier)
        nodes = [n for n, modifier in enumerate(stand_in.modifiers) if modifier.type == 'NODES']
        if nodes:
            stand_in.modifiers.new("Without Instances", 'NODES').node_group = _bare_group()
            # Not at the end: adaptive subdivision has to be the last one.
            stand_in.modifiers.move(len(stand_in.modifiers) - 1, nodes[-1] + 1)
    look_like(stand_in, original, results.owners.get(original))
    return results.add_object(name, stand_in, STAND_IN, None, placed=True)


def shows_itself(original: Object, depsgraph: Depsgraph) -> bool:
    """Whether an object has geometry that renders besides its instances."""
    instances = original.instance_type in {'VERTS', 'FACES', 'COLLECTION'} or len(original.particle_systems)
    hair = any(system.settings.render_type == 'PATH' for system in original.particle_systems)
    if instances and not original.show_instancer_for_render:
        return hair
    geometry = geometry_of(original, depsgraph)
    if geometry is None:
        return len(getattr(original.data, "polygons", ())) > 0
    kinds = (("mesh", "polygons"), ("curves", "curves"), ("pointcloud", "points"))
    shown = any(len(getattr(getattr(geometry, kind), items, ())) for kind, items in kinds)
    return shown or geometry.volume is not None or hair


def _is_simulated(original: Object) -> bool:
    """Whether a copy would not be as the object is: its modifiers remember earlier frames."""
    groups = {m.node_group for m in original.modifiers if m.type == 'NODES' and m.node_group is not None}
    waiting = list(groups)
    while waiting:
        for node in waiting.pop().nodes:
            if node.bl_idname == "GeometryNodeSimulationOutput":
                return True
            inner = getattr(node, "node_tree", None)
            if inner is not None and inner not in groups:
                groups.add(inner)
                waiting.append(inner)
    return any(modifier.type in _SIMULATED for modifier in original.modifiers)


def _bare_group() -> NodeTree:
    """Geometry nodes that pass on all but instances."""

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        parts = graph.node("GeometryNodeSeparateComponents", {"Geometry": given["Geometry"]})
        joined = graph.node("GeometryNodeJoinGeometry")
        for part in parts.outputs:
            if part.name != "Instances":
                graph.feed(find_socket(joined.inputs, "Geometry"), part)
        return {"Geometry": joined}

    whole = (("Geometry", 'Geometry'),)
    return node_group(_BARE_NAME, _BARE_VERSION, whole, whole, build, 'Geometry')
