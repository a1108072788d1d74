# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an asset consists of: each distinct mesh once, with all of its places in the asset, as arrays.

Objects, collections, nodes, particles and what is instanced by instances are followed down to meshes.

What is instanced: an object, a collection, or geometry that nodes instance without an object of its own.

Its digest tells whether what it shows has changed since it was compiled.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ..attributes import members, read, values_of, world_matrix
from ..materials.nodes import is_ours
from ..scene.instances import instanced
from ..scene.objects import SURFACE_TYPES, collected, geometry_of, has_nodes, is_listed, listed_instances, materials_of
from .material_digests import attributes_of, material_digest

Slots = list[bpy.types.Material | None]


@dataclass
class AssetPart:
    """A mesh of an asset.

    Attributes
    ----------
    name : str
        Of the object, for messages.
    shown : bpy.types.Object or bpy.types.GeometrySet
        The original object whose mesh it is, or the geometry.
    places : list of (n, 4, 4) float64
        From its space to that of the asset.
    """

    name: str
    shown: bpy.types.Object | bpy.types.GeometrySet
    places: list[NDArray[np.float64]] = field(default_factory=list)

    @property
    def matrices(self) -> NDArray[np.float64]:
        """All places (n, 4, 4)."""
        return np.concatenate(self.places)

    @contextmanager
    def opened(self, depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[bpy.types.Mesh, Slots] | None]:
        """The mesh as it is evaluated, and its materials, while the context lasts; None if it has no faces."""
        if isinstance(self.shown, bpy.types.GeometrySet):
            mesh = self.shown.mesh
            if mesh is None or not len(mesh.polygons):
                yield None
            else:
                yield mesh, [m.original if m is not None else None for m in mesh.materials] or [None]
            return
        obj = _evaluated(self.shown, depsgraph)
        try:
            mesh = _mesh_of(obj)
            if mesh is None or not len(mesh.polygons):
                yield None
                return
            yield mesh, materials_of(obj, mesh)
        finally:
            obj.to_mesh_clear()


def _evaluated(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object:
    """The evaluated object; the original where it is not evaluated, which has no modifiers then."""
    evaluated = obj.evaluated_get(depsgraph)
    return evaluated if evaluated.is_evaluated else obj


def _mesh_of(obj: bpy.types.Object) -> bpy.types.Mesh | None:
    try:
        return obj.to_mesh()
    except RuntimeError:  # hair, of which nodes may have made a mesh all the same
        return None


def parts_of(
    shown: bpy.types.Object | bpy.types.Collection | bpy.types.GeometrySet,
    name: str,
    depsgraph: bpy.types.Depsgraph,
) -> tuple[list[AssetPart], list[str]]:
    """Meshes of an asset with their places, and warnings of what is left out.

    Raises
    ------
    SceneError
        Something instances itself; the message names it.
    """
    walk = _Walk(name, depsgraph)
    start = np.eye(4)[None]
    if isinstance(shown, bpy.types.GeometrySet):
        walk.geometry(shown, start, ())
    elif isinstance(shown, bpy.types.Collection):
        walk.collection(shown, start, ())
    else:
        walk.object(shown, start, ())
    return list(walk.parts.values()), walk.warnings


Path = tuple[bpy.types.ID, ...]


class _Walk:
    """Follows references down to meshes, with all places at once; a path are the datablocks that it is in."""

    def __init__(self, name: str, depsgraph: bpy.types.Depsgraph) -> None:
        self.name, self.depsgraph = name, depsgraph
        self.parts: dict[object, AssetPart] = {}
        self.warnings: list[str] = []

    def object(self, obj: bpy.types.Object, matrices: NDArray[np.float64], path: Path) -> None:
        """Take an original object with what it instances."""
        if obj in path:
            raise SceneError(
                f'"{obj.name}" instances itself, by way of "{path[-1].name}"; change what one of the two instances'
            )
        path = (*path, obj)
        if not obj.is_instancer or obj.show_instancer_for_render or obj.instance_type == 'COLLECTION':
            self._own(obj, matrices)
        if is_listed(obj):
            self._one_by_one(obj, matrices)
            return
        if obj.instance_type == 'COLLECTION' and obj.instance_collection is not None:
            self.collection(obj.instance_collection, matrices, path)
        if has_nodes(obj) and (geometry := geometry_of(obj, self.depsgraph)) is not None:
            self._instances(geometry, matrices, path)
            if obj.type == 'CURVES' and geometry.mesh is not None:
                self._add(obj, AssetPart(obj.name, geometry), matrices)

    def collection(self, collection: bpy.types.Collection, matrices: NDArray[np.float64], path: Path) -> None:
        """Take what a collection shows in renders."""
        if collection in path:
            raise SceneError(
                f'The collection "{collection.name}" instances itself, by way of "{path[-1].name}"; take that object '
                "out of the collection, or let it instance another one"
            )
        path = (*path, collection)
        for obj, places in collected(collection, matrices, self.depsgraph):
            self.object(obj, places, path)

    def geometry(self, geometry: bpy.types.GeometrySet, matrices: NDArray[np.float64], path: Path) -> None:
        """Take geometry without an object, with what it instances."""
        if geometry.mesh is not None:
            name = geometry.name or (path[-1].name if path else self.name)
            self._add(geometry, AssetPart(name, geometry), matrices)
        self._instances(geometry, matrices, path)

    def _instances(self, geometry: bpy.types.GeometrySet, matrices: NDArray[np.float64], path: Path) -> None:
        keys = np.zeros(len(matrices), np.uint64)
        for target, places, _ in instanced(geometry, matrices, keys):
            if isinstance(target, bpy.types.GeometrySet):
                self.geometry(target, places, path)
            elif isinstance(target, bpy.types.Collection):
                self.collection(target, places, path)
            else:
                self.object(target, places, path)

    def _one_by_one(self, obj: bpy.types.Object, matrices: NDArray[np.float64]) -> None:
        """Instances on vertices and faces, and of particles, which only Blender's own list has."""
        back = np.linalg.pinv(world_matrix(obj, self.depsgraph).astype(np.float64))
        found: dict[bpy.types.Object, list[NDArray[np.float64]]] = {}
        for _, instance in listed_instances(self.depsgraph, (obj,)):
            if instance.object.original != obj:
                place = back @ np.array(instance.matrix_world, dtype=np.float64)
                found.setdefault(instance.object.original, []).append(place)
        if not found:
            self.warnings.append(
                f'What "{obj.name}" instances on vertices, faces or particles is left out of "{self.name}", because it '
                "is not in the scene; link it to the scene, or make its instances real"
            )
        for shown, places in found.items():
            self._own(shown, (matrices[:, None] @ np.array(places)).reshape(-1, 4, 4))

    def _own(self, obj: bpy.types.Object, matrices: NDArray[np.float64]) -> None:
        """Take the surface of an object itself."""
        if obj.type not in SURFACE_TYPES or is_ours(obj):
            return
        if obj.type == 'CURVES':
            if not has_nodes(obj):
                self.warnings.append(f'The hair of "{obj.name}" is left out of "{self.name}"; give it faces by nodes')
            return
        evaluated = _evaluated(obj, self.depsgraph)
        if obj.type == 'MESH':
            # Objects that share a mesh and its materials are one.
            own = tuple(s.material for s in obj.material_slots if s.link == 'OBJECT')
            self._add((evaluated.data.as_pointer(), own), AssetPart(obj.name, obj), matrices)
        else:
            self._add(obj, AssetPart(obj.name, obj), matrices)

    def _add(self, key: object, part: AssetPart, matrices: NDArray[np.float64]) -> None:
        self.parts.setdefault(key, part).places.append(matrices)


#: Changes what a digest is of; raise it when what is read of an asset changes.
_VERSION = 2
_COLOURS = {'FLOAT_COLOR', 'BYTE_COLOR'}
_TYPES = {'FLOAT', 'INT', 'BOOLEAN', 'FLOAT2', 'FLOAT_VECTOR', *_COLOURS}


@dataclass(frozen=True)
class Target:
    """What is instanced; equal where it is the same datablock, or the same geometry.

    Attributes
    ----------
    datablock : bpy.types.Object or bpy.types.Collection or None
        An original. An object's space is its own, without its place in the scene; that of a collection is where
        instances of it show it: its objects as they stand, from its offset.
    geometry : bpy.types.GeometrySet or None
        Without a datablock: what nodes instance.
    owner : bpy.types.Object or None
        Whose nodes.
    name : str
        For messages.
    """

    datablock: bpy.types.Object | bpy.types.Collection | None
    geometry: bpy.types.GeometrySet | None
    owner: bpy.types.Object | None
    name: str

    @property
    def shown(self) -> bpy.types.Object | bpy.types.Collection | bpy.types.GeometrySet:
        """The datablock or the geometry."""
        return self.geometry if self.datablock is None else self.datablock

    def parts(self, depsgraph: bpy.types.Depsgraph) -> tuple[list[AssetPart], list[str]]:
        """What it consists of, see `parts.parts_of`."""
        return parts_of(self.shown, self.name, depsgraph)


def digest_of(target: Target, depsgraph: bpy.types.Depsgraph) -> str:
    """Hexadecimal digest of all that a target shows: meshes, their attributes, materials and images, and places.

    Names of objects do not count, and of images in files only which file it is, how long and how old.

    Parameters
    ----------
    target : Target
    depsgraph : bpy.types.Depsgraph

    Raises
    ------
    SceneError
        As `parts.parts_of`.
    """
    parts, _ = target.parts(depsgraph)
    return digest_of_parts(parts, depsgraph)


def digest_of_parts(parts: list[AssetPart], depsgraph: bpy.types.Depsgraph) -> str:
    """As `digest_of`."""
    content = hashlib.sha256(str(_VERSION).encode())
    for part in parts:
        with part.opened(depsgraph) as opened:
            if opened is not None:
                content.update(np.ascontiguousarray(part.matrices))
                _add_mesh(content, *opened)
    return content.hexdigest()


def _add_mesh(content: hashlib._Hash, mesh: bpy.types.Mesh, slots: Slots) -> None:
    for material in slots:
        content.update(material_digest(material).encode())
    content.update(f"{len(mesh.vertices)} {len(mesh.polygons)} {len(mesh.loops)}".encode())
    content.update(read(mesh, "position"))
    content.update(read(mesh, ".corner_vert"))
    if len(mesh.loops) != 3 * len(mesh.polygons):  # else all are triangles, one after the other
        content.update(members(mesh.polygons, "loop_start", dtype=np.int32))
    wanted = {"material_index", *(name for material in slots for name in attributes_of(material))}
    for attribute in mesh.attributes:
        kind = attribute.data_type
        if kind in _TYPES and (attribute.name in wanted or kind == 'FLOAT2'):
            content.update(f"{attribute.name} {attribute.domain} {kind}".encode())
            content.update(values_of(attribute, "color" if kind in _COLOURS else ""))
    first = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    content.update(first.encode())
