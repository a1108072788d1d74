# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is instanced: an object, a collection, or geometry that nodes instance without an object of its own.

Its digest tells whether what it shows has changed since it was compiled.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import bpy
import numpy as np

from ..attributes import members, read, values_of
from .material_digests import attributes_of, material_digest
from .parts import AssetPart, Slots, parts_of

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


def digest_of(target: Target, depsgraph: bpy.types.Depsgraph, *, bake: bool = False) -> str:
    """Hexadecimal digest of all that a target shows: meshes, their attributes, materials and images, and places.

    Names of objects do not count, and of images in files only which file it is, how long and how old.

    Parameters
    ----------
    target : Target
    depsgraph : bpy.types.Depsgraph
    bake : bool
        Whether materials are baked when it is read.

    Raises
    ------
    SceneError
        As `parts.parts_of`.
    """
    parts, _ = target.parts(depsgraph)
    return digest_of_parts(parts, depsgraph, bake)


def digest_of_parts(parts: list[AssetPart], depsgraph: bpy.types.Depsgraph, bake: bool) -> str:
    """As `digest_of`."""
    content = hashlib.sha256(f"{_VERSION} {bake}".encode())
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
