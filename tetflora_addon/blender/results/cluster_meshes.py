# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of clusters: some faces of an asset with all that renderers read of them, in the space of the asset.

The arrays of each surface are read once. A cluster only gathers from them, and its normals are those that the faces had
among all others, so that nobody sees where one ends. Faces of several surfaces, such as leaves on twigs, become one
mesh.

All that renderers read of a mesh, as arrays: attributes, slots, normals, texture space.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import linear_of, spread
from ...buffers import MeshBuffers
from ..attributes import KINDS, face_offsets, members, read, values_of, write
from .meshes import mesh_steps

#: Attributes that are the mesh itself, or follow from normals.
_OWN = {"position", "material_index", "sharp_face", "sharp_edge", "custom_normal"}


@dataclass(frozen=True)
class AttributeArray:
    """An attribute of a mesh.

    Attributes
    ----------
    domain : {'POINT', 'FACE', 'CORNER'}
    data_type : str
        One of `attributes.KINDS`.
    values : (n,) or (n, width)
    """

    domain: str
    data_type: str
    values: NDArray


@dataclass(frozen=True)
class SurfaceArrays:
    """All of one mesh that renderers read.

    Attributes
    ----------
    positions : (v, 3) float32
    corner_verts : (c,) int32
    face_offsets : (f + 1,) int32
    slots : (f,) int32
        Material of each face.
    materials : list of bpy.types.Material or None
        At least one.
    layers : mapping of str to AttributeArray
    rendered : (str, str)
        Names of the UV map and the color attribute that materials read if they name none; empty without any.
    normals : (c, 3) float32 or None
        Of corners; None where all faces are flat.
    flat : (f,) bool
    texture_space : (2, 3) float64
        Location and size of the box that generated coordinates fill.
    """

    positions: NDArray[np.float32]
    corner_verts: NDArray[np.int32]
    face_offsets: NDArray[np.int32]
    slots: NDArray[np.int32]
    materials: list[bpy.types.Material | None]
    layers: Mapping[str, AttributeArray]
    rendered: tuple[str, str]
    normals: NDArray[np.float32] | None
    flat: NDArray[np.bool_]
    texture_space: NDArray[np.float64]


def read_mesh(mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None]) -> SurfaceArrays:
    """Read an evaluated mesh with given materials in its slots."""
    faces = len(mesh.polygons)
    sharp = mesh.attributes.get("sharp_face")
    flat = np.zeros(faces, bool) if sharp is None else values_of(sharp)
    smooth = not flat.all() or mesh.has_custom_normals
    uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    colours = mesh.color_attributes
    colour = colours[colours.render_color_index].name if 0 <= colours.render_color_index < len(colours) else ""
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
        rendered=(uv, colour),
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
    surfaces : sequence of SurfaceArrays
    surface : (n,) int32
        Surface of each part.
    matrices : (n, 4, 4) float64
        From the space of that surface to that of the asset.
    """

    def __init__(self, surfaces: Sequence[SurfaceArrays], surface: NDArray[np.int32], matrices: NDArray) -> None:
        self.surfaces = tuple(surfaces)
        self.surface = np.asarray(surface, np.int32)
        self.matrices = np.asarray(matrices, np.float64).reshape(-1, 4, 4)
        rows = self.matrices[:, :3, :3].transpose(0, 2, 1)
        a, b, c = rows[:, 0], rows[:, 1], rows[:, 2]
        self.mirrored = np.linalg.det(rows) < 0.0
        turned = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        #: (n, 3, 3): a row vector times this is a normal in the space of the asset, of any length.
        self.cofactors = turned * np.where(self.mirrored, -1.0, 1.0)[:, None, None]
        self.moved = (self.matrices != np.eye(4)).any(axis=(1, 2))
        self._numbers = np.zeros(0, np.int32)

    def numbered(self, keys: NDArray[np.int64], bound: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
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
    positions: NDArray[np.float32]
    corner_verts: NDArray[np.int32]
    sizes: NDArray[np.int32]
    normals: NDArray[np.float32] | None
    vertex: NDArray[np.integer]
    corner: NDArray[np.integer]
    face: NDArray[np.integer]

    def values(self, layer: AttributeArray | None, domain: str, data_type: str) -> NDArray:
        """Values of an attribute of the surface on a domain, as of a type; 0 for None."""
        index = {"POINT": self.vertex, "CORNER": self.corner, "FACE": self.face}
        if layer is None:
            kind = KINDS[data_type]
            size = len(index[domain])
            return np.zeros(size if kind.width == 1 else (size, kind.width), kind.dtype)
        if layer.domain == domain:
            found = layer.values[index[domain]]
        elif layer.domain == 'POINT':
            found = layer.values[self.vertex[self.corner_verts]]
        elif layer.domain == 'FACE':
            found = np.repeat(layer.values[self.face], self.sizes, axis=0)
        return found if layer.data_type == data_type else _converted(found, layer.data_type, data_type)


def cluster_mesh_steps(
    asset: AssetMeshes, name: str, part: NDArray[np.int32], face: NDArray[np.int32]
) -> Generator[None, None, bpy.types.Mesh]:
    """Make the mesh of a cluster step by step; closing the generator removes it.

    Parameters
    ----------
    asset : AssetMeshes
    name : str
        Of the mesh.
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
    none = np.zeros((0, 2), np.int32)
    return MeshBuffers(
        positions=_joined([p.positions for p in pieces]),
        edge_verts=none,
        corner_verts=corner_verts,
        corner_edges=corner_verts,
        face_offsets=offsets,
        smooth=smooth,
    )


def _joined(arrays: Sequence[NDArray]) -> NDArray:
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _normals(piece: _Piece) -> NDArray[np.float32]:
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


def _slots(pieces: Sequence[_Piece]) -> tuple[list[bpy.types.Material | None], list[NDArray[np.int32]]]:
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
    """Values of a type as those of a wider one: numbers are grey, vectors begin alike."""
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
