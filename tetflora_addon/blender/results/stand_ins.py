# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand-ins: what hidden scatterers show of their own, such as the ground, is shown by copies of them in the results.

An object is hidden as a whole when results replace its instances. A stand-in has the same data, materials and modifiers
as the object, and one more that drops instances; of particle systems it has the hair. What a simulation made is copied
as it is now.
"""

from __future__ import annotations

from typing import Any

import bpy

from ..materials.nodes import Graph, Term, find_socket, node_group
from ..scene.looks import look_like
from ..scene.objects import geometry_of
from .collection import Results
from .hiding import artists_flags, forget_marks
from .output import STAND_IN

_VERSION = 1
_NAME = "TetFlora Without Instances"
_SIMULATED = {'CLOTH', 'SOFT_BODY', 'FLUID', 'DYNAMIC_PAINT'}
_INSTANCED = {'OBJECT', 'COLLECTION'}
_TURNED_OFF = ("is_scatter", "is_explicit", "is_plant", "is_field", "is_occluder")


def add_stand_in(
    results: Results, name: str, original: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> bpy.types.Object | None:
    """Add what an object shows besides instances to the results; None if that is nothing.

    Parameters
    ----------
    results : Results
    name : str
        Of the new object, ending in a number.
    original : bpy.types.Object
        Of this file or of a library; shown or hidden.
    depsgraph : bpy.types.Depsgraph
        In which it is shown.
    """
    if not shows_itself(original, depsgraph):
        return None
    name = results.name_for(name)
    if _is_simulated(original):
        evaluated = original.evaluated_get(depsgraph)
        mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
        mesh.name = name
        results.hold(mesh, name)
        made = bpy.data.objects.new(name, mesh)
        made.matrix_world = evaluated.matrix_world
        for number, slot in enumerate(original.material_slots):
            if slot.link == 'OBJECT':
                made.material_slots[number].link = 'OBJECT'
                made.material_slots[number].material = slot.material
    else:
        made = original.copy()
        made.name = name
        flags = artists_flags(original)
        forget_marks(made)
        made.hide_render, made.hide_viewport = flags
        for switch in _TURNED_OFF:
            if getattr(made.tetflora, switch, False):
                setattr(made.tetflora, switch, False)
        _drop_instances(made)
    look_like(made, original, results.owners.get(original))
    return results.add_object(name, made, STAND_IN, placed=True)


def shows_itself(original: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether an object has geometry that renders besides its instances."""
    instances = original.instance_type in {'VERTS', 'FACES', 'COLLECTION'} or len(original.particle_systems)
    if instances and not original.show_instancer_for_render:
        return any(_is_hair(system) for system in original.particle_systems)
    geometry = geometry_of(original, depsgraph)
    if geometry is None:
        return len(getattr(original.data, "polygons", ())) > 0
    mesh, curves, points = (getattr(geometry, kind) for kind in ("mesh", "curves", "pointcloud"))
    return (
        (mesh is not None and len(mesh.polygons) > 0)
        or (curves is not None and len(curves.curves) > 0)
        or (points is not None and len(points.points) > 0)
        or geometry.volume is not None
        or any(_is_hair(system) for system in original.particle_systems)
    )


def _is_hair(system: bpy.types.ParticleSystem) -> bool:
    return system.settings.render_type == 'PATH'


def _is_simulated(original: bpy.types.Object) -> bool:
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


def _drop_instances(made: bpy.types.Object) -> None:
    made.instance_type = 'NONE'
    for modifier in list(made.modifiers):
        if modifier.type == 'PARTICLE_SYSTEM' and modifier.particle_system.settings.render_type in _INSTANCED:
            made.modifiers.remove(modifier)
    nodes = [n for n, modifier in enumerate(made.modifiers) if modifier.type == 'NODES']
    if nodes:
        modifier = made.modifiers.new("Without Instances", 'NODES')
        modifier.node_group = _group()
        # Not at the end: adaptive subdivision has to be the last one.
        made.modifiers.move(len(made.modifiers) - 1, nodes[-1] + 1)


def _group() -> bpy.types.NodeTree:
    """Geometry nodes that pass on all but instances."""

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        parts = graph.node("GeometryNodeSeparateComponents", {"Geometry": given["Geometry"]})
        joined = graph.node("GeometryNodeJoinGeometry")
        for part in parts.outputs:
            if part.name != "Instances":
                graph.feed(find_socket(joined.inputs, "Geometry"), part)
        return {"Geometry": joined}

    whole = (("Geometry", 'Geometry'),)
    return node_group(_NAME, _VERSION, whole, whole, build, 'Geometry')
