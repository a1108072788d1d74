# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes and point clouds from buffers, and arrays from meshes, at the speed of a copy.

Where Python cannot resize point clouds, geometry nodes make them from the vertices of a mesh.

Clusters are some faces of an asset, with all that renderers read of them. The arrays of each surface are read once. A
cluster only gathers from them, and its normals are those that the faces had among all others, so that nobody sees where
one ends. Faces of several surfaces, such as leaves on twigs, become one mesh.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Floats32, Integers, Integers32, Mask, linear_of, spread
from ...buffers import MeshBuffers, PointBuffers
from ...jobs import run_to_end
from ..attributes import KINDS, empty, face_offsets, members, read, type_for, values_of, write
from ..compat import can_resize_point_clouds
from ..materials.nodes import Graph, Term, node_group
from ..runtime import is_there

UV_MAP = "UVMap"

SPHERES = "TetFlora Spheres"
_SPHERES_VERSION = 1
_DOMAINS = ("POINT", "FACE", "CORNER")


def write_mesh(name: str, buffers: MeshBuffers, materials: Sequence[bpy.types.Material | None] = ()) -> bpy.types.Mesh:
    """Make a mesh datablock from buffers, not linked to any object.

    Topology is copied, edges included, so that Blender computes nothing; where buffers have none it finds them.
    Positions and indices are written through the mesh's attributes, which are plain memory; the collections
    ``vertices`` and ``loops`` are many times slower.

    Parameters
    ----------
    buffers : MeshBuffers
        The mesh, see ``docs/architecture.md``. ``UVMap`` becomes the UV map; an INT attribute ``material_index`` on
        ``'FACE'`` chooses among `materials`.

    Raises
    ------
    ValueError
        Arrays of wrong shape or type, or indices out of range, which crash Blender later; no datablock is left.
    """
    return run_to_end(mesh_steps(name, buffers, materials))


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
    """Raise ValueError where shapes, dtypes, indices, faces or attributes are not valid; Blender would crash."""
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
            raise ValueError(f"{key} must be {np.dtype(dtype)} of shape {shape}, not {array.dtype} of {array.shape}")
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
            raise ValueError(f"Attribute {key}: Blender has no type for {values.dtype} of shape {values.shape}")
        if len(values) != sizes[domain]:
            raise ValueError(f"Attribute {key}: has {len(values)} values, but {domain} has {sizes[domain]} elements")
        if key == UV_MAP and (domain != "CORNER" or values.shape[1:] != (2,)):
            raise ValueError(f"Attribute {UV_MAP} must be float32 of shape (corners, 2) on CORNER")


def _check_range(key: str, indices: NDArray, count: int) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= count):
        raise ValueError(f"{key} must lie between 0 and {count - 1}, not {indices.min()} to {indices.max()}")


def point_object(name: str, buffers: PointBuffers, material: bpy.types.Material) -> bpy.types.Object:
    """Make an object of points that render as spheres, a point cloud or a mesh with a modifier, in no collection.

    Raises
    ------
    ValueError
        Arrays of wrong shape or type; no datablock is left behind.
    """
    none, values = np.zeros(0, np.int32), {"radius": buffers.radius, **buffers.attributes}
    attributes = {name: ("POINT", array) for name, array in values.items()}
    vertices = MeshBuffers(buffers.positions, none.reshape(0, 2), none, none, np.zeros(1, np.int32), attributes)
    by_nodes = not can_resize_point_clouds()
    if by_nodes:
        data = write_mesh(name, vertices, [material])
    else:
        check_buffers(vertices)
        data = bpy.data.pointclouds.new(name)
        data.resize(len(buffers.positions))
        for key, array in {"position": buffers.positions, **values}.items():
            write(data, key, array)
        data.update_tag()
        data.materials.append(material)
    obj = bpy.data.objects.new(name, data)
    if by_nodes:
        obj.modifiers.new("Spheres", 'NODES').node_group = spheres_group(material)
    return obj


def spheres_group(material: bpy.types.Material) -> bpy.types.NodeTree:
    """The group "TetFlora Spheres" of geometry nodes: vertices become points with the radius in their attribute."""

    def build(graph: Graph, given: dict[str, Term]) -> dict[str, Any]:
        named = graph.node("GeometryNodeInputNamedAttribute", {"Name": "radius"}, data_type='FLOAT')
        points = graph.node("GeometryNodeMeshToPoints", {"Mesh": given["Geometry"], "Radius": named}, mode='VERTICES')
        # Points made of vertices do not inherit the material.
        return {"Geometry": graph.node("GeometryNodeSetMaterial", {"Geometry": points})}

    whole = (("Geometry", 'Geometry'),)
    group = node_group(SPHERES, _SPHERES_VERSION, whole, whole, build, 'Geometry')
    for node in group.nodes:
        if node.bl_idname == "GeometryNodeSetMaterial":
            node.inputs["Material"].default_value = material
    return group


#: Attributes that are the mesh itself, or follow from normals.
_OWN = {"position", "material_index", "sharp_face", "sharp_edge", "custom_normal"}


@dataclass(frozen=True)
class AttributeArray:
    """An attribute of a mesh."""

    domain: str  # {'POINT', 'FACE', 'CORNER'}
    data_type: str  # one of `attributes.KINDS`
    values: NDArray  # (n,) or (n, width)


@dataclass(frozen=True)
class SurfaceArrays:
    """All of one mesh that renderers read."""

    positions: Floats32  # (v, 3)
    corner_verts: Integers32  # (c,)
    face_offsets: Integers32  # (f + 1,)
    slots: Integers32  # (f,): material of each face
    materials: list[bpy.types.Material | None]  # at least one
    layers: Mapping[str, AttributeArray]
    #: (str, str): Names of the UV map and the color attribute that materials read if they name none; empty without any
    rendered: tuple[str, str]
    normals: Floats32 | None  # (c, 3): of corners; None where all faces are flat
    flat: Mask  # (f,)
    texture_space: Floats  # (2, 3): location and size of the box that generated coordinates fill


def read_mesh(mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None]) -> SurfaceArrays:
    """Read an evaluated mesh with given materials in its slots."""
    faces = len(mesh.polygons)
    sharp = mesh.attributes.get("sharp_face")
    flat = np.zeros(faces, bool) if sharp is None else values_of(sharp)
    smooth = not flat.all() or mesh.has_custom_normals
    uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    colors = mesh.color_attributes
    color = colors[colors.render_color_index].name if 0 <= colors.render_color_index < len(colors) else ""
    slots = np.zeros(faces, np.int32)
    if "material_index" in mesh.attributes:
        slots = np.clip(members(mesh.polygons, "material_index", dtype=np.int32), 0, len(materials) - 1)
    return SurfaceArrays(
        positions=read(mesh, "position"),
        corner_verts=read(mesh, ".corner_vert"),
        face_offsets=face_offsets(mesh),
        slots=slots,
        materials=materials,
        layers=dict(_layers(mesh)),
        rendered=(uv, color),
        normals=members(mesh.corner_normals, "vector", 3) if smooth and faces else None,
        flat=flat,
        texture_space=np.array([mesh.texspace_location, mesh.texspace_size], np.float64),
    )


def _layers(mesh: bpy.types.Mesh) -> Iterator[tuple[str, AttributeArray]]:
    for attribute in mesh.attributes:
        known = attribute.data_type in KINDS and attribute.domain in {'POINT', 'FACE', 'CORNER'}
        if known and attribute.name not in _OWN and not attribute.name.startswith("."):
            yield attribute.name, AttributeArray(attribute.domain, attribute.data_type, values_of(attribute))


#: Types by what they can hold: where surfaces differ, an attribute has the later one.
_WIDER = ('BOOLEAN', 'INT8', 'INT', 'FLOAT', 'FLOAT2', 'FLOAT_VECTOR', 'BYTE_COLOR', 'FLOAT_COLOR')
#: UV map and color attribute of meshes whose surfaces render with others of different names.
_RENDERED = "tf_rendered"


class AssetMeshes:
    """Surfaces of an asset and where it shows them, ready to be taken apart.

    Parameters
    ----------
    surface : (n,) int32
        Surface of each part.
    matrices : (n, 4, 4) float64
        From the space of that surface to that of the asset.
    """

    def __init__(self, surfaces: Sequence[SurfaceArrays], surface: Integers32, matrices: NDArray) -> None:
        self.surfaces = tuple(surfaces)
        self.surface = np.asarray(surface, np.int32)
        self.matrices = np.asarray(matrices, np.float64).reshape(-1, 4, 4)
        rows = self.matrices[:, :3, :3].transpose(0, 2, 1)
        self.mirrored = np.linalg.det(rows) < 0.0
        turned = np.cross(np.roll(rows, -1, axis=1), np.roll(rows, -2, axis=1))
        #: (n, 3, 3): a row vector times this is a normal in the space of the asset, of any length.
        self.cofactors = turned * np.where(self.mirrored, -1.0, 1.0)[:, None, None]
        self.moved = (self.matrices != np.eye(4)).any(axis=(1, 2))
        self._numbers = np.zeros(0, np.int32)

    def numbered(self, keys: Integers, bound: int) -> tuple[Integers, Integers32]:
        """Different keys in no particular order, and the number among them of each; keys are below a bound."""
        if bound > max(4 * len(keys), len(self._numbers), 1 << 20):
            unique, number = np.unique(keys, return_inverse=True)
            return unique, number.reshape(-1).astype(np.int32)
        if bound > len(self._numbers):
            self._numbers = np.zeros(bound, np.int32)
        numbers, every = self._numbers, np.arange(len(keys), dtype=np.int32)
        numbers[keys] = every
        last = numbers[keys] == every
        unique = keys[last]
        numbers[unique] = np.arange(len(unique), dtype=np.int32)
        return unique, numbers[keys]


@dataclass(frozen=True)
class _Piece:
    """Faces of one surface in a cluster; ``vertex`` (v,), ``corner`` (c,) and ``face`` (f,) count in the surface."""

    surface: SurfaceArrays
    positions: Floats32
    corner_verts: Integers32
    sizes: Integers32
    normals: Floats32 | None
    vertex: Integers
    corner: Integers
    face: Integers

    def values(self, layer: AttributeArray | None, domain: str, data_type: str) -> NDArray:
        """Values of an attribute of the surface on a domain, as of a type; 0 for None."""
        index = {"POINT": self.vertex, "CORNER": self.corner, "FACE": self.face}
        if layer is None:
            return empty(KINDS[data_type], len(index[domain]))
        if layer.domain == domain:
            values = layer.values[index[domain]]
        elif layer.domain == 'POINT':
            values = layer.values[self.vertex[self.corner_verts]]
        elif layer.domain == 'FACE':
            values = np.repeat(layer.values[self.face], self.sizes, axis=0)
        return values if layer.data_type == data_type else _converted(values, layer.data_type, data_type)


def cluster_mesh_steps(
    asset: AssetMeshes, name: str, part: Integers32, face: Integers32
) -> Generator[None, None, bpy.types.Mesh]:
    """Make the mesh of a cluster step by step; closing the generator removes it.

    Parameters
    ----------
    part, face : (k,) int32
        Faces of parts, by their number in the mesh of the part's surface.

    Returns
    -------
    bpy.types.Mesh
        In the space of the asset, with the slots of the surface, or those of all surfaces, each material once. What one
        surface lacks is 0 there. Generated coordinates are the original's if the part stands straight.
    """
    part, face = np.asarray(part), np.asarray(face)
    owner = asset.surface[part]
    used = np.unique(owner) if len(owner) else [0]
    pieces = []
    for surface in used:
        chosen = slice(None) if len(used) == 1 else owner == surface
        pieces.append(_piece(asset, asset.surfaces[surface], part[chosen], face[chosen]))
        yield
    materials, slots = _slots(pieces)
    smooth = any(piece.normals is not None for piece in pieces)
    mesh = yield from mesh_steps(name, _buffers(pieces, smooth), materials)
    try:
        if smooth:
            write(mesh, "custom_normal", _joined([_normals(p) for p in pieces]), 'CORNER')
            flat = _joined([p.surface.flat[p.face] for p in pieces])
            if flat.any():
                write(mesh, "sharp_face", flat, 'FACE')
        if len(materials) > 1:
            write(mesh, "material_index", _joined(slots), 'FACE')
        for key, domain, data_type, layers in _attributes(pieces):
            values = _joined([p.values(layer, domain, data_type) for p, layer in zip(pieces, layers, strict=True)])
            write(mesh, key, values, domain, data_type)
            yield
        _choose_rendered(mesh, pieces)
        _set_texture_space(mesh, asset, part[0] if len(part) else None)
        mesh.update()
    except BaseException:
        bpy.data.meshes.remove(mesh)
        raise
    return mesh


def _piece(asset: AssetMeshes, surface: SurfaceArrays, part: NDArray, face: NDArray) -> _Piece:
    start = surface.face_offsets[face]
    sizes = surface.face_offsets[face + 1] - start
    owner, index = spread(sizes)
    if asset.mirrored[part].any():
        turned = asset.mirrored[part][owner] & (index > 0)  # the first stays, and with it the triangles of quads
        index = np.where(turned, sizes[owner] - index, index)
    corner = start[owner] + index
    vertex = surface.corner_verts[corner]
    count = len(surface.positions)
    one = len(part) == 0 or bool((part == part[0]).all())
    if one:
        unique, corner_verts = asset.numbered(vertex, count)
        whose = part[:1]
    else:
        parts, local = asset.numbered(part, len(asset.surface))
        keys, corner_verts = asset.numbered(local[owner].astype(np.int64) * count + vertex, len(parts) * count)
        local, unique = np.divmod(keys, count)
        whose = parts[local]
    positions = surface.positions[unique]
    if len(part) and asset.moved[whose].any():
        matrices = asset.matrices[whose]
        columns = matrices[:, :3, :3].transpose(0, 2, 1)
        points = positions.astype(np.float64)
        points = points @ columns[0] if one else np.einsum("nj,nji->ni", points, columns)
        positions = (points + matrices[:, :3, 3]).astype(np.float32)
    normals = None
    if surface.normals is not None:
        normals = surface.normals[corner]
        if len(part) and asset.moved[whose].any():
            turn = asset.cofactors[part[:1] if one else part[owner]]
            normals = normals @ turn[0] if one else np.einsum("ni,nij->nj", normals, turn)
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
            normals = normals.astype(np.float32)
    return _Piece(surface, positions, corner_verts, sizes, normals, unique, corner, face)


def _buffers(pieces: Sequence[_Piece], smooth: bool) -> MeshBuffers:
    first = np.cumsum([0, *(len(p.positions) for p in pieces)], dtype=np.int32)
    corner_verts = _joined([p.corner_verts + n for p, n in zip(pieces, first[:-1], strict=True)])
    offsets = np.zeros(sum(len(p.face) for p in pieces) + 1, np.int32)
    np.cumsum(_joined([p.sizes for p in pieces]), out=offsets[1:])
    positions, no_edges = _joined([p.positions for p in pieces]), np.zeros((0, 2), np.int32)
    return MeshBuffers(positions, no_edges, corner_verts, corner_verts, offsets, smooth=smooth)


def _joined(arrays: Sequence[NDArray]) -> NDArray:
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _normals(piece: _Piece) -> Floats32:
    """Normals of corners, those of its faces where a surface has none."""
    if piece.normals is not None:
        return piece.normals
    # Newell's: of faces of any number of corners.
    points = piece.positions[piece.corner_verts].astype(np.float64)
    start = np.cumsum(piece.sizes) - piece.sizes
    after = np.arange(1, len(points) + 1)
    after[start + piece.sizes - 1] = start
    points -= np.repeat(points[start], piece.sizes, axis=0)
    area = np.add.reduceat(np.cross(points, points[after]), start, axis=0)
    area /= np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
    return np.repeat(area, piece.sizes, axis=0).astype(np.float32)


def _slots(pieces: Sequence[_Piece]) -> tuple[list[bpy.types.Material | None], list[Integers32]]:
    """Materials of a mesh, and the slot of each face, piece by piece."""
    if len(pieces) == 1:
        return pieces[0].surface.materials, [pieces[0].surface.slots[pieces[0].face]]
    numbers: dict[bpy.types.Material | None, int] = {}
    slots = []
    for piece in pieces:
        place = [numbers.setdefault(material, len(numbers)) for material in piece.surface.materials]
        slots.append(np.array(place, np.int32)[piece.surface.slots[piece.face]])
    return list(numbers), slots


def _attributes(pieces: Sequence[_Piece]) -> Iterator[tuple[str, str, str, list[AttributeArray | None]]]:
    """Name, domain, type and the layer of each piece of all attributes."""
    for key in dict.fromkeys(key for piece in pieces for key in piece.surface.layers):
        yield key, *_common([piece.surface.layers.get(key) for piece in pieces])
    for kind in range(2):
        names = [piece.surface.rendered[kind] for piece in pieces]
        if len(set(filter(None, names))) > 1:
            layers = [piece.surface.layers.get(name) for piece, name in zip(pieces, names, strict=True)]
            yield f"{_RENDERED}_{kind}", *_common(layers)


def _common(layers: list[AttributeArray | None]) -> tuple[str, str, list[AttributeArray | None]]:
    """Domain and type that hold all of some layers."""
    known = [layer for layer in layers if layer is not None]
    domains, types = {layer.domain for layer in known}, {layer.data_type for layer in known}
    if len(types) > 1:  # what has no place in the order, such as matrices, goes before what has
        known = [layer for layer in known if layer.data_type in _WIDER] or known[:1]
        types = {layer.data_type for layer in known}
        layers = [layer if layer is not None and layer.data_type in types else None for layer in layers]
    data_type = max(types, key=_WIDER.index) if len(types) > 1 else next(iter(types))
    return next(iter(domains)) if len(domains) == 1 else 'CORNER', data_type, layers


def _converted(values: NDArray, old: str, new: str) -> NDArray:
    """Values of a type as those of a wider one: numbers are gray, vectors begin alike."""
    if old == 'BYTE_COLOR' and new == 'FLOAT_COLOR':
        linear = linear_of(values)
        linear[:, 3] = values[:, 3]
        return linear
    width = KINDS[new].width
    values = values.astype(KINDS[new].dtype)
    if width == 1:
        return values
    if values.ndim == 1:
        values = np.repeat(values[:, None], min(width, 3), axis=1)
    filled = np.ones((len(values), width), values.dtype) if width == 4 else np.zeros((len(values), width), values.dtype)
    filled[:, : values.shape[1]] = values
    return filled


def _choose_rendered(mesh: bpy.types.Mesh, pieces: Sequence[_Piece]) -> None:
    """Let materials that name no UV map or color attribute read those that they read before."""
    for kind in range(2):
        names = list(dict.fromkeys(name for piece in pieces if (name := piece.surface.rendered[kind])))
        name = names[0] if len(names) == 1 else f"{_RENDERED}_{kind}"
        if not names:
            continue
        if kind == 0 and name in mesh.uv_layers:
            mesh.uv_layers[name].active_render = True
            mesh.uv_layers.active = mesh.uv_layers[name]
        elif kind == 1 and name in mesh.color_attributes:
            mesh.color_attributes.render_color_index = mesh.color_attributes.find(name)


def _set_texture_space(mesh: bpy.types.Mesh, asset: AssetMeshes, part: int | None) -> None:
    """Generated coordinates of a part that is moved and stretched along its axes, else of the surface as it was."""
    if part is None:
        return
    location, size = asset.surfaces[asset.surface[part]].texture_space
    linear, to = asset.matrices[part, :3, :3], asset.matrices[part, :3, 3]
    stretch = np.diag(linear)
    if np.allclose(linear, np.diag(stretch), atol=1e-6 * np.abs(linear).max()):
        location, size = location * stretch + to, size * stretch
    mesh.use_auto_texspace = False
    mesh.texspace_location, mesh.texspace_size = location, size
