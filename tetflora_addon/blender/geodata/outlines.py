# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves from outlines of a map, in a collection for each kind: areas and paths of populations, and things to see.

Woods and meadows are closed curves on the ground. Water is flat and filled, buildings stand on the lowest of their
corners, roads are ribbons: a curve that is tilted on its side and extruded.
"""

from math import pi

import bpy
import numpy as np

from ...arrays import Floats
from ...geodata.outlines import BUILDING, KINDS, WATER, MapFeature, denser, one_ring, read_outlines
from ...jobs import Progress
from ...planting.wetness import HeightGrid
from ..attributes import members
from ..materials.nodes import Graph, surface_material
from ..placing.terrain import HALF_WIDTH
from ..worker import call_in_thread
from .origin import Import, Imported, Steps, importing
from .terrain import heights_steps

_STEP, _ABOVE = 4.0, 0.08  # meters between points of roads on the ground, and how far they lie above it
_SINK = 0.3  # meters that a building reaches into the ground below its lowest corner
_BATCH = 200
#: Linear RGB and roughness of what has a surface.
_LOOKS = {
    WATER: ("Map water", (0.02, 0.035, 0.04), 0.08),
    BUILDING: ("Map building", (0.55, 0.5, 0.44), 0.8),
    "": ("Map road", (0.14, 0.13, 0.12), 0.9),
}
#: On objects that are imported buildings.
BUILDING_MARK = "tetflora_building"


@importing
def outline_steps(order: Import, kind: str = "") -> Steps:
    """Make curves of the outlines in a file; yields progress. Closing the steps leaves all as it was.

    ``kind`` is what all are taken for; empty to tell them by their keys. A file that is broken, or cannot lie in this
    scene, is a `SceneError`.
    """
    progress = Progress(0.0, f"Reading {order.path.name}")
    yield progress
    outlines, system, notes = yield from call_in_thread(progress, read_outlines, order.path, order.epsg, kind)
    points = np.concatenate([ring for outline in outlines for ring in outline.rings])
    box = order.box(points, system)
    if box is not None:
        number = len(outlines)
        outlines = [outline for outline in outlines if any(box.holds(ring).any() for ring in outline.rings)]
        if not outlines:
            raise order.nothing_left()
        points = np.concatenate([ring for outline in outlines for ring in outline.rings])
        notes.append(f"{number - len(outlines):,} beyond the Crop")
    sizes = [len(ring) for outline in outlines for ring in outline.rings]
    place = order.origin(points, system)
    flat = iter(np.split(order.local(place, points, system), np.cumsum(sizes)[:-1]))
    rings = [[next(flat) for _ in outline.rings] for outline in outlines]
    heights = yield from heights_steps(order, Progress(0.4, "Reading the ground"))
    top = bpy.data.collections.new(order.path.stem)
    made = [bpy.data.collections.new(kind) for kind in KINDS]
    try:
        for number, (outline, own) in enumerate(zip(outlines, rings, strict=True)):
            if number % _BATCH == 0:
                yield Progress(0.5 + 0.5 * number / len(outlines), "Drawing outlines")
            curve = _curve(outline, own, heights)
            made[KINDS.index(outline.kind)].objects.link(curve)
    except BaseException:  # an error, or Esc
        _remove([top, *made])
        raise
    found = {kind: collection for kind, collection in zip(KINDS, made, strict=True) if collection.objects}
    for collection in found.values():
        top.children.link(collection)
    bpy.data.batch_remove([collection for collection in made if not collection.objects])
    order.scene.collection.children.link(top)
    order.remember(place)
    told = ", ".join(f"{kind} {len(collection.objects):,}" for kind, collection in found.items())
    return Imported(None, [f"Outlines imported: {told}", *notes, f"coordinates: {system.name}"])


def building_areas(scene: bpy.types.Scene) -> list[Floats]:
    """Borders (k, 2) of the buildings that were imported into a scene, in world space."""
    return [
        (members(spline.points, "co", 4).astype(np.float64) @ np.array(obj.matrix_world).T)[:, :2]
        for obj in scene.objects
        if obj.type == 'CURVE' and obj.get(BUILDING_MARK)
        for spline in obj.data.splines[:1]
    ]


def _remove(collections: list[bpy.types.Collection]) -> None:
    """Take back what was drawn."""
    objects = [obj for collection in collections for obj in collection.objects]
    curves = [obj.data for obj in objects]
    materials = {material for curve in curves for material in curve.materials}
    bpy.data.batch_remove([*objects, *collections])
    bpy.data.batch_remove([*curves, *(material for material in materials if not material.users)])


def _curve(outline: MapFeature, rings: list[Floats], heights: HeightGrid | None) -> bpy.types.Object:
    """One outline as an object; its points count from its first one, so that far ones are exact."""
    data = bpy.data.curves.new(outline.name, 'CURVE')
    filled = outline.closed and outline.kind in (WATER, BUILDING)
    ribbon = not outline.closed and outline.width > 0.0
    if filled:
        data.dimensions, data.fill_mode = '2D', 'BOTH'
        data.extrude = outline.height / 2.0
    else:
        data.dimensions, data.twist_mode = '3D', 'Z_UP'
        rings = [one_ring(tuple(rings))] if outline.closed else [denser(rings[0], _STEP)] if ribbon else rings
        data.extrude = outline.width / 2.0
    ground = [
        np.zeros(len(ring)) if heights is None else np.nan_to_num(heights.at(heights.height, ring)) for ring in rings
    ]
    foot = np.array([*np.round(rings[0][0]), 0.0])
    if filled:
        sunk = _SINK if outline.height else 0.0
        foot[2] = min(float(z.min()) for z in ground) + outline.height / 2.0 - sunk
    for ring, z in zip(rings, ground, strict=True):
        local = np.column_stack([ring, z + _ABOVE * ribbon]) - foot
        if filled:
            local[:, 2] = 0.0
        spline = data.splines.new('POLY')
        spline.points.add(len(local) - 1)
        spline.points.foreach_set("co", np.column_stack([local, np.ones(len(local))]).astype(np.float32).ravel())
        spline.use_cyclic_u = outline.closed
        if ribbon:
            spline.points.foreach_set("tilt", np.full(len(local), pi / 2.0, np.float32))
    if filled or ribbon:
        data.materials.append(_look(outline.kind if outline.kind in (WATER, BUILDING) else ""))
    obj = bpy.data.objects.new(outline.name, data)
    obj.location = foot
    if ribbon:
        obj[HALF_WIDTH] = outline.width / 2.0
    if filled and outline.kind == BUILDING:
        obj[BUILDING_MARK] = True
    return obj


def _look(kind: str) -> bpy.types.Material:
    """The material of water, buildings or roads; that of an earlier import if there is one."""
    name, color, rough = _LOOKS[kind]

    def build(graph: Graph, material: bpy.types.Material) -> None:
        material.diffuse_color = (*color, 1.0)
        surface = graph.node("ShaderNodeBsdfPrincipled", {"Base Color": (*color, 1.0), "Roughness": rough})
        graph.node("ShaderNodeOutputMaterial", {"Surface": surface})

    return surface_material(name, 1, build)
