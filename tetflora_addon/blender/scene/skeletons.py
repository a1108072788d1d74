# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants modeled by hand: curves, mesh edges and hair curves as skeletons, and the kinds of plants that have them."""

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Integers
from ...errors import SpeciesError
from ...species import skeletons
from ...species.kinds import Kind
from ..attributes import frames_of, members, mesh_of, values_of, world_matrix

#: Types of objects that can be the skeleton of a plant.
SKELETON_TYPES = ('CURVE', 'CURVES', 'MESH')

RADIUS = "radius"  # the attribute's name in hair curves and, by convention, in meshes
_CATMULL_ROM, _POLY, _BEZIER, _NURBS = range(4)  # Blender's numbers for types of hair curves
_DEFAULT_STEPS = 12


def upright_turn(matrix: Floats) -> float:
    """Turn about the vertical, in radians, of an object with a matrix (4, 4) in world space: that of its x axis."""
    return float(np.arctan2(matrix[1, 0], matrix[0, 0])) if np.hypot(*matrix[:2, 0]) > 0 else 0.0


def read_skeleton(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> skeletons.Skeleton:
    """The skeleton that an object draws.

    Parameters
    ----------
    obj : bpy.types.Object
        A curve, a mesh or hair curves; the original object.
    depsgraph : bpy.types.Depsgraph
        Applies animation and modifiers. An object that it does not evaluate is read without its modifiers.

    Returns
    -------
    Skeleton
        About the object's origin, in meters, z up: with its scale and tilt; position and turn are the plant's.

    Raises
    ------
    SpeciesError
        Another type of object, a mesh with faces, no edges, a scale of 0 or above 100,000, or as
        `skeleton_from_edges`; the message names the object.
    """
    if obj.type not in SKELETON_TYPES:
        raise SpeciesError(
            f'"{obj.name}" cannot be the skeleton of a plant: '
            "choose a curve, hair curves, or a mesh of edges without faces"
        )
    matrix = world_matrix(obj, depsgraph)
    _, scale, sound = frames_of(matrix[None, :3, :3])
    if not sound[0]:
        raise SpeciesError(
            f'"{obj.name}" cannot be the skeleton of a plant: its scale is 0 or above 100,000; clear it with Alt S'
        )
    if obj.type == 'MESH':
        (points, edges), line = _of_mesh(obj, depsgraph), None
    else:
        chains = _of_curve(obj, depsgraph) if obj.type == 'CURVE' else _of_hair(obj, depsgraph)
        # Radii in the object's own measure, as they are joined there.
        points, edges, line = skeletons.joined_edges(chains)
    turn = upright_turn(matrix)
    upright = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]) @ matrix[:3, :3]
    return skeletons.skeleton_from_edges(points[:, :3] @ upright.T, points[:, 3] * scale[0], edges, obj.name, line)


def _of_mesh(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[Floats, Integers]:
    """Points (p, 4) with radii, 0 where there are none, and edges (e, 2)."""
    with mesh_of(obj.evaluated_get(depsgraph)) as mesh:
        if not len(mesh.polygons):
            return _mesh_arrays(mesh)
    # A modifier such as Skin adds faces around the edges: the modeled mesh is the skeleton.
    if len(obj.data.polygons):
        raise SpeciesError(
            f'"{obj.name}" cannot be the skeleton of a plant: it has faces. Keep only edges along the centers of '
            "branches (X > Only Faces in Edit Mode), or use a curve"
        )
    return _mesh_arrays(obj.data)


def _mesh_arrays(mesh: bpy.types.Mesh) -> tuple[Floats, Integers]:
    points = np.zeros((len(mesh.vertices), 4))
    points[:, :3] = _read(mesh.vertices, "co", 3)
    radius = mesh.attributes.get(RADIUS)
    if radius is not None and radius.domain == 'POINT' and radius.data_type == 'FLOAT':
        points[:, 3] = values_of(radius)
    elif len(mesh.skin_vertices):
        points[:, 3] = _read(mesh.skin_vertices[0].data, "radius", 2).mean(axis=1)
    return points, members(mesh.edges, "vertices", 2, np.int32).astype(np.int64)


def _of_curve(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> skeletons.Chains:
    """Splines of a curve object, with shape keys and modifiers that move its control points."""
    evaluated = obj.evaluated_get(depsgraph)
    curve = evaluated.to_curve(depsgraph, apply_modifiers=True) if evaluated.is_evaluated else obj.data
    try:
        parts = [spline_chain(spline) for spline in curve.splines]
    finally:
        if evaluated.is_evaluated:
            evaluated.to_curve_clear()
    return _meant_radii(skeletons.Chains.concatenate(parts), _thickness(obj.data))


def spline_chain(spline: bpy.types.Spline) -> skeletons.Chains:
    """A spline as it is drawn, in its object's space."""
    cyclic = np.array([spline.use_cyclic_u])
    if spline.type == 'BEZIER':
        knots = spline.bezier_points
        places = np.column_stack([_read(knots, "co", 3), _read(knots, "radius")])
        handles = (_read(knots, side, 3) for side in ("handle_left", "handle_right"))
        control = skeletons.Chains(places, np.array([0, len(knots)]), cyclic)
        return skeletons.bezier_chains(control, *handles, np.array([spline.resolution_u]))
    places = _read(spline.points, "co", 4)
    weights = places[:, 3].copy()
    places[:, 3] = _read(spline.points, "radius")
    if spline.type == 'NURBS':
        flags = {"endpoint": spline.use_endpoint_u, "bezier": spline.use_bezier_u, "cyclic": spline.use_cyclic_u}
        return skeletons.nurbs_chain(places, weights, spline.order_u, spline.resolution_u, **flags)
    return skeletons.Chains(places, np.array([0, len(places)]), cyclic)


def _thickness(curve: bpy.types.Curve) -> float:
    """Factor from the radius of a curve's points to that of its tube; 0 without a tube."""
    if curve.bevel_mode == 'OBJECT':
        return max(curve.bevel_object.dimensions[:2]) / 2 if curve.bevel_object is not None else 0.0
    return curve.bevel_depth


def _meant_radii(chains: skeletons.Chains, thickness: float) -> skeletons.Chains:
    """Radii in the object's space; 0 where all are equal and nothing shows them, as in new curves."""
    points = chains.points.copy()
    if thickness > 0:
        points[:, 3] *= thickness
    elif len(points) and np.ptp(points[:, 3]) < 1e-6:
        points[:, 3] = 0.0
    return skeletons.Chains(points, chains.first, chains.cyclic)


def _of_hair(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> skeletons.Chains:
    """Hair curves with their modifiers."""
    curves = obj.evaluated_get(depsgraph).data
    points = np.zeros((len(curves.points), 4))
    points[:, :3] = _attribute(curves, "position", np.zeros((len(points), 3)))
    points[:, 3] = _attribute(curves, RADIUS, points[:, 3])
    starts = members(curves.curves, "first_point_index", dtype=np.int32)
    first = np.append(starts, len(points)).astype(np.int64)
    none = np.zeros(len(starts), np.int32)
    kind = _attribute(curves, "curve_type", none)
    control = skeletons.Chains(points, first, _attribute(curves, "cyclic", none > 0))
    steps = _attribute(curves, "resolution", none + _DEFAULT_STEPS)
    left, right = skeletons.smooth_handles(control)
    bezier = np.repeat(kind == _BEZIER, np.diff(first))[:, None]
    left = np.where(bezier, _attribute(curves, "handle_left", left), left)
    right = np.where(bezier, _attribute(curves, "handle_right", right), right)
    chains = skeletons.bezier_chains(control, left, right, np.where(kind == _POLY, 1, steps))
    nurbs = np.flatnonzero(kind == _NURBS)
    if len(nurbs):
        weights = _attribute(curves, "nurbs_weight", np.ones(len(points)))
        order = _attribute(curves, "nurbs_order", none + 4)
        mode = _attribute(curves, "knots_mode", none)  # 1 ends at the outer points, 2 Bezier, 3 both
        parts = [chains.without(nurbs)]
        for i in nurbs.tolist():
            span = slice(first[i], first[i + 1])
            flags = {"endpoint": mode[i] in (1, 3), "bezier": mode[i] in (2, 3), "cyclic": bool(control.cyclic[i])}
            parts.append(skeletons.nurbs_chain(points[span], weights[span], int(order[i]), int(steps[i]), **flags))
        chains = skeletons.Chains.concatenate(parts)
    return _meant_radii(chains, 0.0)


def _read(collection: bpy.types.bpy_prop_collection, name: str, width: int = 1) -> Floats:
    return members(collection, name, width).astype(np.float64)


def _attribute(curves: bpy.types.Curves, name: str, default: NDArray) -> NDArray:
    """Values of an attribute of hair curves, like ``default`` in shape and type; ``default`` where it is missing."""
    stored = curves.attributes.get(name)
    values = None if stored is None else values_of(stored)
    return default if values is None or values.shape != default.shape else values.astype(default.dtype)


def kind_of(plant: bpy.types.Object) -> str:
    """Kind of a plant, full-grown whatever its age."""
    return kind_of_choice(plant.tetflora)


def kind_of_choice(group: bpy.types.PropertyGroup) -> str:
    """Kind of a group of properties with a species and a skeleton."""
    return group.species if group.skeleton is None else str(Kind(group.species, group.skeleton.name_full))


def skeleton_object_of(kind: str) -> bpy.types.Object | None:
    """Object with the skeleton of a kind of plant; None without one."""
    name = Kind.read(kind).skeleton
    return next((o for o in bpy.data.objects if o.name_full == name), None) if name else None
