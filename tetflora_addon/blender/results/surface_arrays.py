# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All that renderers read of a mesh, as arrays: attributes, slots, normals, texture space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..attributes import KINDS, face_offsets, members, read, values_of

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
