# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves as lines on the map: borders of areas to plant, and paths to keep free."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from .attributes import members, read, values_of
from .transforms import world_matrix


@dataclass(frozen=True)
class Line:
    """One curve.

    Attributes
    ----------
    points : (k, 2) float64
        On the map, metres.
    cyclic : bool
        The last point is joined to the first, which is not repeated.
    half_width : float
        What its bevel adds to either side, metres.
    """

    points: NDArray[np.float64]
    cyclic: bool
    half_width: float


def lines_of(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> list[Line]:
    """Lines of a curve object, as smooth as it is drawn; none of objects of other types.

    Modifiers count, except where a curve has a bevel, an extrusion or a fill: then its control points are read.

    Raises
    ------
    SceneError
        A NURBS curve with a bevel, an extrusion or a fill.
    """
    evaluated = obj.evaluated_get(depsgraph)
    half_width = 0.0
    if obj.type == 'CURVE':
        found = _from_edges(evaluated)
        if found is None:
            found = [_from_spline(spline, obj) for spline in obj.data.splines]
            matrix = world_matrix(obj, depsgraph)
            half_width = obj.data.bevel_depth * float(np.linalg.norm(matrix[:3, :3], axis=0).mean())
    elif obj.type == 'CURVES':
        found = _from_curves(evaluated.data)
    else:
        return []
    matrix = world_matrix(obj, depsgraph)
    lines = [((points @ matrix[:3, :3].T + matrix[:3, 3])[:, :2], cyclic) for points, cyclic in found if len(points)]
    if not all(np.isfinite(points).all() for points, _ in lines):
        raise SceneError(f'The curve "{obj.name}" has points that are not finite numbers; check its transform')
    return [Line(points, cyclic, half_width) for points, cyclic in lines]


def _from_edges(evaluated: bpy.types.Object) -> list[tuple[NDArray[np.float64], bool]] | None:
    """Splines of a curve that evaluates to nothing but edges; None if it has faces."""
    mesh = evaluated.to_mesh()
    try:
        if mesh is None or len(mesh.polygons):
            return None
        count = len(mesh.vertices)
        positions = members(mesh.vertices, "co", 3).astype(np.float64)
        ends = np.sort(members(mesh.edges, "vertices", 2, np.int32), axis=1)
    finally:
        evaluated.to_mesh_clear()
    if not count:
        return []
    # The points of a spline follow each other, and an edge from the last to the first closes it.
    joined = np.zeros(count, bool)
    joined[ends[ends[:, 1] - ends[:, 0] == 1, 0]] = True
    stops = np.flatnonzero(~joined) + 1
    starts = np.concatenate([[0], stops[:-1]])
    closing = set(map(tuple, ends[ends[:, 1] - ends[:, 0] > 1].tolist()))
    return [(positions[a:b], (a, b - 1) in closing) for a, b in zip(starts.tolist(), stops.tolist(), strict=True)]


def _from_spline(spline: bpy.types.Spline, obj: bpy.types.Object) -> tuple[NDArray[np.float64], bool]:
    cyclic = spline.use_cyclic_u
    if spline.type == 'POLY':
        return np.array([p.co[:3] for p in spline.points], dtype=np.float64).reshape(-1, 3), cyclic
    if spline.type != 'BEZIER':
        raise SceneError(
            f'The NURBS curve "{obj.name}" has a bevel, extrusion or fill; remove it, or change its type to Bézier'
        )
    knots = np.array([(p.handle_left, p.co, p.handle_right) for p in spline.bezier_points], dtype=np.float64)
    following = np.roll(knots, -1, axis=0) if cyclic else knots[1:]
    before = knots if cyclic else knots[:-1]
    t = (np.arange(spline.resolution_u) / spline.resolution_u)[None, :, None]
    a, b, c, d = (p[:, None] for p in (before[:, 1], before[:, 2], following[:, 0], following[:, 1]))
    points = (1 - t) ** 3 * a + 3 * (1 - t) ** 2 * t * b + 3 * (1 - t) * t**2 * c + t**3 * d
    return np.concatenate([points.reshape(-1, 3), knots[len(before) :, 1]]), cyclic


def _from_curves(curves: bpy.types.Curves) -> list[tuple[NDArray[np.float64], bool]]:
    """Lines through the points of hair curves."""
    if not len(curves.curves):
        return []
    first = members(curves.curve_offset_data, "value", dtype=np.int32)
    attribute = curves.attributes.get("cyclic")
    cyclic = np.zeros(len(curves.curves), bool) if attribute is None else values_of(attribute)
    parts = np.split(read(curves, "position").astype(np.float64), first[1:-1])
    return list(zip(parts, cyclic.tolist(), strict=True))
