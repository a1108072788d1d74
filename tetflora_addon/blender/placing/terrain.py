# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read terrain to populate: meshes, vertex groups, an image, and curves around areas and along paths."""

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import Collection, Curves, Depsgraph, Image, Mesh, Object, Spline

from ...arrays import Floats, Floats32
from ...errors import SceneError
from ...growth.hashing import uniform
from ...planting.plane import Path, Terrain
from ..attributes import image_pixels, members, mesh_of, read, values_of, world_matrix
from ..scene.objects import objects_within
from ..scene.skeletons import spline_chain

_SAME = 1e-5  # of a ground's reach: what single precision may move
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec. 709
#: Custom property of curves that are paths without a bevel: half their width, meters.
HALF_WIDTH = "tetflora_half_width"
#: Settings of populations that mask the ground: keyword arguments of `read_ground`.
MASKS = (*("vertex_group", "image", "uv_layer", "invert_group", "invert_image"), *("areas", "paths", "path_distance"))


def grid_mesh(name: str, points: Floats) -> Mesh:
    """A smooth mesh of the quadrilaterals between rows of points (rows, columns, 3)."""
    rows, columns = points.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    faces = np.stack([first, first + 1, first + columns + 1, first + columns], axis=1)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces.tolist(), shade_flat=False)
    return mesh


def ground_form(obj: Object, depsgraph: Depsgraph | None) -> str:
    """Numbers that tell where a ground lies and how it is formed, for `lies_elsewhere`; none of one that is not shown.

    How far it reaches, meters; its vertices; its corners; and three means of places, meters, times the root of the
    number of vertices. Each vertex has its weight, so that hardly any two forms have the same mean.
    """
    if depsgraph is None or obj.mode == 'EDIT' or not obj.visible_get(view_layer=depsgraph.view_layer):
        return ""
    with mesh_of(obj.evaluated_get(depsgraph)) as mesh:
        points, corners, place = read(mesh, "position"), len(mesh.loops), world_matrix(obj, depsgraph)
    weight = 0.5 + uniform(np.arange(len(points), dtype=np.uint64), 0)
    mean = (place[:3, :3] @ (weight @ points) + weight.sum() * place[:3, 3]) / max(len(points), 1) ** 0.5
    reach = np.abs(place[:3, :3]).max() * np.abs(points).max(initial=1e-3) + np.abs(place[:3, 3]).max()
    return " ".join(map(repr, (float(reach), len(points), corners, *mean.tolist())))


def lies_elsewhere(before: str, now: str) -> bool:
    """Whether grounds lie elsewhere, or are formed otherwise, than before; no where that is not known."""
    try:
        then, current = (np.array(text.split(), dtype=np.float64).reshape(-1, 6) for text in (before, now))
    except ValueError:
        return False
    if len(then) != len(current) or not len(current):
        return min(len(then), len(current)) > 0
    return bool((np.abs(then - current) > _SAME * current[:, :1] * [np.inf, 0.0, 0.0, 1.0, 1.0, 1.0]).any())


@dataclass(frozen=True)
class Line:
    """One curve."""

    points: Floats  # (k, 2): on the map, meters
    cyclic: bool  # the last point is joined to the first, which is not repeated
    half_width: float  # width that its bevel adds to each side, meters


def _lines_of(obj: Object, depsgraph: Depsgraph) -> list[Line]:
    """Lines of a curve object, as smooth as it is drawn; none of objects of other types.

    Modifiers count, except where a curve has a bevel, an extrusion or a fill: then its control points are read, but of
    NURBS, which are an error.
    """
    evaluated, matrix, half_width = obj.evaluated_get(depsgraph), world_matrix(obj, depsgraph), 0.0
    if obj.type == 'CURVE':
        splines = _from_edges(evaluated)
        if splines is None:
            splines = [_from_spline(spline, obj) for spline in obj.data.splines]
            half_width = obj.data.bevel_depth * float(np.linalg.norm(matrix[:3, :3], axis=0).mean())
    elif obj.type == 'CURVES':
        splines = _from_curves(evaluated.data)
    else:
        return []
    stored = obj.get(HALF_WIDTH)
    half_width = max(half_width, stored) if isinstance(stored, float) else half_width
    lines = [((points @ matrix[:3, :3].T + matrix[:3, 3])[:, :2], cyclic) for points, cyclic in splines if len(points)]
    if not all(np.isfinite(points).all() for points, _ in lines):
        raise SceneError(f'The curve "{obj.name}" has points that are not finite numbers; check its transform')
    return [Line(points, cyclic, half_width) for points, cyclic in lines]


def _from_edges(evaluated: Object) -> list[tuple[Floats, bool]] | None:
    """Splines of a curve that evaluates to nothing but edges; None if it has faces."""
    with mesh_of(evaluated) as mesh:
        if mesh is None or len(mesh.polygons):
            return None
        count = len(mesh.vertices)
        positions = members(mesh.vertices, "co", 3).astype(np.float64)
        ends = np.sort(members(mesh.edges, "vertices", 2, np.int32), axis=1)
    if not count:
        return []
    # The points of a spline follow each other, and an edge from the last to the first closes it.
    joined = np.zeros(count, bool)
    joined[ends[ends[:, 1] - ends[:, 0] == 1, 0]] = True
    stops = np.flatnonzero(~joined) + 1
    starts = np.concatenate([[0], stops[:-1]])
    closing = set(map(tuple, ends[ends[:, 1] - ends[:, 0] > 1].tolist()))
    return [(positions[a:b], (a, b - 1) in closing) for a, b in zip(starts.tolist(), stops.tolist(), strict=True)]


def _from_spline(spline: Spline, obj: Object) -> tuple[Floats, bool]:
    if spline.type == 'NURBS':
        raise SceneError(
            f'The NURBS curve "{obj.name}" has a bevel, extrusion or fill; remove it, or change its type to Bézier'
        )
    return spline_chain(spline).points[:, :3], spline.use_cyclic_u


def _from_curves(curves: Curves) -> list[tuple[Floats, bool]]:
    """Lines through the points of hair curves."""
    if not len(curves.curves):
        return []
    first = members(curves.curve_offset_data, "value", dtype=np.int32)
    attribute = curves.attributes.get("cyclic")
    cyclic = np.zeros(len(curves.curves), bool) if attribute is None else values_of(attribute)
    return list(zip(np.split(read(curves, "position").astype(np.float64), first[1:-1]), cyclic.tolist(), strict=True))


def read_ground(
    objects: Iterable[Object],
    depsgraph: Depsgraph,
    *,
    vertex_group: str = "",
    image: Image | None = None,
    uv_layer: str = "",
    invert_group: bool = False,
    invert_image: bool = False,
    areas: Collection | None = None,
    paths: Collection | None = None,
    path_distance: float = 0.0,
) -> Terrain:
    """The ground as the engine takes it, modifiers applied, in world space.

    Parameters
    ----------
    vertex_group : str
        Group whose weights define how suitable the ground is; every mesh needs it, or a float attribute of its name.
    image : bpy.types.Image, optional
        Its luminance, as stored, defines how suitable the ground is: 50 % gray halves the plants. Alpha does not count.
    uv_layer : str
        UV map for the image; the one that renders if empty.
    invert_group, invert_image : bool
        Plants grow where weight or luminance are low.
    areas : bpy.types.Collection, optional
        Plants grow inside of its cyclic curves only; open curves do not count.
    paths : bpy.types.Collection, optional
        All of its curves are kept free.
    path_distance : float
        Meters to either side of the paths, beyond the depth of their bevel.

    Raises
    ------
    SceneError
        Something is missing or cannot be used; names the object and the setting.
    """
    parts = [_read_mesh(obj, depsgraph, vertex_group, uv_layer, image is not None) for obj in objects]
    if not parts:
        raise SceneError("No ground to populate; select a mesh with faces")
    triangles, weight, uv, border = zip(*parts, strict=True)
    weights = np.concatenate(weight) if vertex_group else None
    if weights is not None and invert_group:
        weights = 1.0 - weights
    corners, gray = (None, None) if image is None else (np.concatenate(uv), _luminance(image))
    gray = 1.0 - gray if image is not None and invert_image else gray
    inside = () if areas is None else tuple(line.points for line in _lines(areas, depsgraph, "Areas", closed=True))
    bare = () if paths is None else tuple(_path(line, path_distance) for line in _lines(paths, depsgraph, "Paths"))
    return Terrain(np.concatenate(triangles), weights, corners, gray, inside, bare, np.concatenate(border))


def _path(line: Line, distance: float) -> Path:
    points = np.concatenate([line.points, line.points[:1]]) if line.cyclic else line.points
    return Path(points, distance + line.half_width)


def lines_within(paths: Collection, depsgraph: Depsgraph) -> tuple[Floats, ...]:
    """Curves of a collection of paths as lines on the map, (k, 2) each; closed ones end where they begin."""
    return tuple(_path(line, 0.0).points for line in _lines(paths, depsgraph, "Paths"))


def _lines(collection: Collection, depsgraph: Depsgraph, setting: str, closed: bool = False) -> list[Line]:
    """Curves of a collection, those that are closed or all of them; there is at least one."""
    lines = [line for obj in objects_within(collection) for line in _lines_of(obj, depsgraph)]
    if not lines:
        raise SceneError(f'The {setting} collection "{collection.name}" has no curves; add one, or clear {setting}')
    if not closed:
        return lines
    cyclic = [line for line in lines if line.cyclic and len(line.points) > 2]
    if not cyclic:
        raise SceneError(
            f'The {setting} collection "{collection.name}" has no closed curves; close one in Edit Mode with '
            "Curve > Toggle Cyclic"
        )
    return cyclic


def _read_mesh(
    obj: Object, depsgraph: Depsgraph, group: str, uv_layer: str, with_uv: bool
) -> tuple[Floats, Floats32 | None, Floats | None, Floats]:
    """Triangles in world space, weights and UV at their corners where asked for, and the border."""
    if obj.type != 'MESH':
        raise SceneError(f'"{obj.name}" is not a mesh; select a mesh with faces')
    evaluated = obj.evaluated_get(depsgraph)
    with mesh_of(evaluated) as mesh:
        if not len(mesh.polygons):
            raise SceneError(f'"{obj.name}" has no faces; select a mesh with faces')
        mesh.calc_loop_triangles()
        vertices = members(mesh.loop_triangles, "vertices", 3, np.int32)
        matrix = world_matrix(obj, depsgraph)
        positions = read(mesh, "position").astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        weight = _weights(evaluated, mesh, group, obj.name)[vertices] if group else None
        uv = None
        if with_uv:
            uv = _uv(mesh, uv_layer, obj.name)[members(mesh.loop_triangles, "loops", 3, np.int32)]
        ends = read(mesh, ".edge_verts")
        faces = np.bincount(read(mesh, ".corner_edge"), minlength=len(ends))
    return positions[vertices], weight, uv, positions[ends[faces == 1]]


def _weights(evaluated: Object, mesh: Mesh, group: str, name: str) -> Floats:
    """Weight of each vertex, (v,)."""
    attribute = mesh.attributes.get(group)
    # Geometry nodes turn vertex groups into attributes.
    if attribute is not None and (attribute.domain, attribute.data_type) == ('POINT', 'FLOAT'):
        return values_of(attribute).astype(np.float64)
    vertex_group = evaluated.vertex_groups.get(group)
    if vertex_group is None:
        raise SceneError(f'"{name}" has no vertex group "{group}"; add it, or clear Vertex Group')
    index = vertex_group.index
    # Weights are lists within lists, which no foreach_get reads.
    each = (next((g.weight for g in v.groups if g.group == index), 0.0) for v in mesh.vertices)
    return np.fromiter(each, np.float64, len(mesh.vertices))


def _uv(mesh: Mesh, layer: str, name: str) -> Floats:
    """UV of each corner, (c, 2)."""
    if layer and layer not in mesh.uv_layers:
        raise SceneError(f'"{name}" has no UV map "{layer}"; add it, or clear UV Map')
    uv_map = mesh.uv_layers[layer] if layer else next((u for u in mesh.uv_layers if u.active_render), None)
    if uv_map is None:
        raise SceneError(f'"{name}" has no UV map for the image; unwrap it, or clear Image')
    return read(mesh, uv_map.name).astype(np.float64)


def _luminance(image: Image) -> Floats32:
    """Gray values of an image, (h, w), the first row at the bottom."""
    if image.source == 'TILED':
        raise SceneError(f'The image "{image.name}" has UDIM tiles, which layers do not support; use a single image')
    if not (all(image.size) and image.channels):
        raise SceneError(
            f'Cannot load the image "{image.name}" from "{image.filepath}"; find it with '
            "File > External Data > Find Missing Files, or clear Image"
        )
    pixels = image_pixels(image)
    return pixels[..., :3] @ _LUMINANCE if image.channels >= 3 else pixels[..., 0].copy()
