# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an asset consists of: each distinct mesh once, with all of its places in the asset, as arrays.

An asset is an object, a collection, or geometry that nodes instance without an object of its own. What it instances by
collections, nodes and particles is followed down to meshes. Its digest, of meshes, materials and images, tells whether
what it shows has changed since it was compiled.
"""

import hashlib
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...arrays import Floats
from ...assets.asset import AssetSource, AssetSurface
from ...errors import SceneError
from ...jobs import mapped
from ..attributes import image_pixels, members, read, values_of, world_matrix
from ..compat import tree_in_use
from ..materials.face_looks import FaceReader
from ..materials.node_values import settings_of
from ..materials.nodes import is_ours
from ..scene.objects import (
    SURFACE_TYPES,
    collected,
    geometry_of,
    has_nodes,
    instanced,
    is_listed,
    listed_instances,
    materials_of,
)

#: What all nodes have: where they stand in the editor and how they look there; and what only refers to others.
_IDLE = {one.identifier for one in bpy.types.Node.bl_rna.properties} - {"type", "mute"}
_IDLE |= {"image_user", "texture_mapping", "color_mapping"}
# Content of packed images by identity and length: they are read once.
_packed: dict[tuple[int, int], str] = {}


def material_digest(material: bpy.types.Material | None) -> str:
    """Hexadecimal digest of what a material looks like."""
    if material is None:
        return ""
    content = hashlib.sha256(repr(tuple(material.diffuse_color)).encode())
    tree = tree_in_use(material)
    if tree is not None:
        _add_tree(content, tree)
    return content.hexdigest()


def attributes_of(material: bpy.types.Material | None) -> Iterator[str]:
    """Names of attributes that a material asks for, groups included."""
    waiting = [] if material is None or (tree := tree_in_use(material)) is None else [tree]
    while waiting:
        for node in waiting.pop().nodes:
            if node.type == 'ATTRIBUTE':
                yield node.attribute_name
            elif node.type == 'VERTEX_COLOR':
                yield node.layer_name
            elif node.type == 'GROUP' and node.node_tree is not None:
                waiting.append(node.node_tree)


def _add_tree(content: "hashlib._Hash", tree: bpy.types.NodeTree) -> None:
    nodes = {node.as_pointer(): i for i, node in enumerate(tree.nodes)}
    for node in tree.nodes:
        if node.type in {'FRAME', 'REROUTE'}:
            continue
        content.update(node.bl_idname.encode())
        for name in _settings(node):
            _add(content, name, getattr(node, name))
        for socket in node.inputs:
            if not socket.is_linked and hasattr(socket, "default_value"):
                _add(content, socket.identifier, socket.default_value)
        if node.type in {'RGB', 'VALUE'}:
            _add(content, "value", node.outputs[0].default_value)
    for link in tree.links:
        ends = (link.from_node, link.from_socket), (link.to_node, link.to_socket)
        named = [(nodes[node.as_pointer()], socket.identifier) for node, socket in ends]
        content.update(f"{named}{link.is_muted}".encode())


def _settings(node: bpy.types.Node) -> list[str]:
    kind = node.bl_idname
    if kind not in _known:
        properties = node.bl_rna.properties
        _known[kind] = [p.identifier for p in properties if p.identifier not in _IDLE and p.type != 'COLLECTION']
    return _known[kind]


_known: dict[str, list[str]] = {}


def _add(content: "hashlib._Hash", name: str, value: Any) -> None:
    if isinstance(value, bpy.types.Image):
        value = image_digest(value)
    elif isinstance(value, bpy.types.NodeTree):
        content.update(name.encode())
        _add_tree(content, value)
        return
    elif isinstance(value, bpy.types.ColorRamp | bpy.types.CurveMapping):
        value = settings_of(value)
    elif isinstance(value, bpy.types.ID):
        value = value.name_full
    elif isinstance(value, bpy.types.bpy_struct):
        return
    elif hasattr(value, "__len__") and not isinstance(value, str):
        value = tuple(value)
    content.update(f"{name}={value!r};".encode())


def image_digest(image: bpy.types.Image) -> str:
    """Digest of an image: of its pixels if only this file has them, else of the file that it is in."""
    how = f"{tuple(image.size)} {image.source} {image.alpha_mode} {image.colorspace_settings.name} "
    if image.is_dirty and image.size[0]:
        return how + hashlib.sha256(np.ascontiguousarray(image_pixels(image))).hexdigest()
    packed = image.packed_file
    if packed is not None:
        key = image.session_uid, packed.size
        if key not in _packed:
            _packed[key] = hashlib.sha256(packed.data).hexdigest()
        return how + _packed[key]
    if image.source == 'GENERATED':
        return how + f"{image.generated_type} {tuple(image.generated_color)}"
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    try:
        stat = path.stat()
    except OSError:
        return how + f"{path}"
    return how + f"{path} {stat.st_size} {stat.st_mtime_ns}"


Slots = list[bpy.types.Material | None]


@dataclass
class AssetPart:
    """A mesh of an asset."""

    name: str  # of the object, for messages
    shown: bpy.types.Object | bpy.types.GeometrySet  # the original object whose mesh it is, or the geometry
    places: list[Floats] = field(default_factory=list)  # from its space to that of the asset

    @property
    def matrices(self) -> Floats:
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
    shown: bpy.types.Object | bpy.types.Collection | bpy.types.GeometrySet, name: str, depsgraph: bpy.types.Depsgraph
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


Trail = tuple[bpy.types.ID, ...]


class _Walk:
    """Follows references down to meshes, with all places at once; a path are the datablocks that it is in."""

    def __init__(self, name: str, depsgraph: bpy.types.Depsgraph) -> None:
        self.name, self.depsgraph = name, depsgraph
        self.parts: dict[object, AssetPart] = {}
        self.warnings: list[str] = []

    def object(self, obj: bpy.types.Object, matrices: Floats, path: Trail) -> None:
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

    def collection(self, collection: bpy.types.Collection, matrices: Floats, path: Trail) -> None:
        """Take what a collection shows in renders."""
        if collection in path:
            raise SceneError(
                f'The collection "{collection.name}" instances itself, by way of "{path[-1].name}"; take that object '
                "out of the collection, or let it instance another one"
            )
        path = (*path, collection)
        for obj, places in collected(collection, matrices, self.depsgraph):
            self.object(obj, places, path)

    def geometry(self, geometry: bpy.types.GeometrySet, matrices: Floats, path: Trail) -> None:
        """Take geometry without an object, with what it instances."""
        if geometry.mesh is not None:
            name = geometry.name or (path[-1].name if path else self.name)
            self._add(geometry, AssetPart(name, geometry), matrices)
        self._instances(geometry, matrices, path)

    def _instances(self, geometry: bpy.types.GeometrySet, matrices: Floats, path: Trail) -> None:
        keys = np.zeros(len(matrices), np.uint64)
        for target, places, _ in instanced(geometry, matrices, keys):
            if isinstance(target, bpy.types.GeometrySet):
                self.geometry(target, places, path)
            elif isinstance(target, bpy.types.Collection):
                self.collection(target, places, path)
            else:
                self.object(target, places, path)

    def _one_by_one(self, obj: bpy.types.Object, matrices: Floats) -> None:
        """Instances on vertices and faces, and of particles, which only Blender's own list has."""
        back = np.linalg.pinv(world_matrix(obj, self.depsgraph).astype(np.float64))
        found: dict[bpy.types.Object, list[Floats]] = {}
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

    def _own(self, obj: bpy.types.Object, matrices: Floats) -> None:
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

    def _add(self, key: object, part: AssetPart, matrices: Floats) -> None:
        self.parts.setdefault(key, part).places.append(matrices)


#: Changes what a digest is of; raise it when what is read of an asset changes.
_VERSION = 2
_COLORS = {'FLOAT_COLOR', 'BYTE_COLOR'}
_TYPES = {'FLOAT', 'INT', 'BOOLEAN', 'FLOAT2', 'FLOAT_VECTOR', *_COLORS}


@dataclass(frozen=True)
class Target:
    """What is instanced; equal where it is the same datablock, or the same geometry."""

    #: An original. An object's space is its own, without its place in the scene; that of a collection is where
    #: instances of it show it: its objects as they stand, from its offset.
    datablock: bpy.types.Object | bpy.types.Collection | None
    geometry: bpy.types.GeometrySet | None  # without a datablock: what nodes instance
    owner: bpy.types.Object | None  # whose nodes
    name: str  # for messages

    @property
    def shown(self) -> bpy.types.Object | bpy.types.Collection | bpy.types.GeometrySet:
        """The datablock or the geometry."""
        return self.geometry if self.datablock is None else self.datablock

    def parts(self, depsgraph: bpy.types.Depsgraph) -> tuple[list[AssetPart], list[str]]:
        """What it consists of, see `parts.parts_of`."""
        return parts_of(self.shown, self.name, depsgraph)

    def meshes(self, depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[AssetPart, bpy.types.Mesh, Slots]]:
        """Its parts with faces one after the other, each with its mesh and materials while it is looked at."""
        for part in self.parts(depsgraph)[0]:
            with part.opened(depsgraph) as opened:
                if opened is not None:
                    yield part, *opened


def digest_of(target: Target, depsgraph: bpy.types.Depsgraph) -> str:
    """Hexadecimal digest of all that a target shows: meshes, their attributes, materials and images, and places.

    Names of objects do not count, and of images in files only which file it is, how long and how old.
    Errors are those of `parts.parts_of`.
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


def _add_mesh(content: "hashlib._Hash", mesh: bpy.types.Mesh, slots: Slots) -> None:
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
            content.update(values_of(attribute, "color" if kind in _COLORS else ""))
    first = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    content.update(first.encode())


#: Triangles whose corners become vertices at once.
_TRIANGLES = 1 << 18


def read_source_steps(
    target: Target, depsgraph: bpy.types.Depsgraph
) -> Generator[float, None, tuple[AssetSource, tuple[str, ...]]]:
    """Read all surfaces of an asset; yields the fraction that is done.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Between two steps it may be evaluated again, but must be there.

    Returns
    -------
    AssetSource
    tuple of str
        Warnings for the artist: images that are missing, materials without shaders, and what is left out.

    Raises
    ------
    SceneError
        The asset has no faces, has vertices that are not finite numbers, or instances itself; the message names it.
    """
    parts, left = target.parts(depsgraph)
    reader = FaceReader()
    reader.warn(left)
    digest = digest_of_parts(parts, depsgraph)
    surfaces: list[AssetSurface] = []
    shown: list[AssetPart] = []
    for number, part in enumerate(parts):
        steps = _surface_steps(part, depsgraph, reader)
        surface = yield from mapped(steps, lambda done, before=number: (before + done) / len(parts))
        if surface is not None:
            surfaces.append(surface)
            shown.append(part)
    if not surfaces:
        raise SceneError(
            f'"{target.name}" has no faces, so there is nothing to refine as an asset; add faces, or choose another '
            "object or collection"
        )
    counts = [len(part.matrices) for part in shown]
    source = AssetSource(
        name=target.name,
        surfaces=tuple(surfaces),
        surface=np.repeat(np.arange(len(surfaces)), counts).astype(np.int32),
        matrices=np.concatenate([part.matrices for part in shown]),
        digest=digest,
    )
    if not np.isfinite(source.matrices).all():
        raise SceneError(
            f'"{target.name}" shows instances whose place is not a finite number; correct the nodes or particles that '
            "make them"
        )
    return source, tuple(reader.warnings)


def _surface_steps(
    part: AssetPart, depsgraph: bpy.types.Depsgraph, reader: FaceReader
) -> Generator[float, None, AssetSurface | None]:
    """Read one mesh; None if it has no faces. Between two steps nothing of Blender's meshes is held."""
    with part.opened(depsgraph) as opened:
        if opened is None:
            return None
        mesh, slots = opened
        positions = read(mesh, "position")
        if not np.isfinite(positions).all():
            raise SceneError(f'"{part.name}" has vertices that are not finite numbers; delete them')
        mesh.calc_loop_triangles()
        faces = len(mesh.polygons)
        loops = members(mesh.loop_triangles, "loops", 3, np.int32)
        face = members(mesh.loop_triangle_polygons, "value", dtype=np.int32)
        corner_verts = read(mesh, ".corner_vert")
        looks = reader.prepare(mesh, slots)
    yield 0.0
    found = yield from looks.steps(faces, positions, loops, corner_verts, face)
    # Vertices of triangles from their corners, in the same array.
    for start in range(0, len(loops), _TRIANGLES):
        piece = loops[start : start + _TRIANGLES]
        piece[:] = np.take(corner_verts, piece)
    return AssetSurface(name=part.name, positions=positions, triangles=loops, face=face, **found)
