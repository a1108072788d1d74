# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of meshes, point clouds and hair curves to arrays and back, at the speed of a copy.

Attributes are plain memory. ``foreach_get`` of a mesh's vertices, edges or corners is many times slower, but still
holds what there was when edit mode was entered, where attributes are empty.
"""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np
from numpy.typing import DTypeLike, NDArray

Geometry = bpy.types.Mesh | bpy.types.PointCloud | bpy.types.Curves


class Kind(NamedTuple):
    """How Blender stores one value of an attribute.

    Attributes
    ----------
    field : str
        Name of the value among the properties of an element.
    dtype : type
    width : int
        Numbers of a value.
    """

    field: str
    dtype: type
    width: int = 1


#: By Blender's name of the type. Colors of bytes as they are stored; their field "color" is linear.
KINDS = {
    'FLOAT': Kind("value", np.float32),
    'INT': Kind("value", np.int32),
    'INT8': Kind("value", np.int8),
    'BOOLEAN': Kind("value", np.bool_),
    'FLOAT2': Kind("vector", np.float32, 2),
    'FLOAT_VECTOR': Kind("vector", np.float32, 3),
    'QUATERNION': Kind("value", np.float32, 4),
    'FLOAT_COLOR': Kind("color", np.float32, 4),
    'BYTE_COLOR': Kind("color_srgb", np.float32, 4),
    'FLOAT4X4': Kind("value", np.float32, 16),
    'INT32_2D': Kind("value", np.int32, 2),
    'INT16_2D': Kind("value", np.int16, 2),
}
# Geometry without elements lacks these.
_BUILT_IN = {"position": 'FLOAT_VECTOR', ".edge_verts": 'INT32_2D', ".corner_vert": 'INT', ".corner_edge": 'INT'}
# What arrays become, by dtype and trailing shape.
_TYPES = {
    (np.dtype(np.float32), ()): 'FLOAT',
    (np.dtype(np.float32), (2,)): 'FLOAT2',
    (np.dtype(np.float32), (3,)): 'FLOAT_VECTOR',
    (np.dtype(np.int32), ()): 'INT',
    (np.dtype(np.bool_), ()): 'BOOLEAN',
}


def type_for(values: NDArray) -> str | None:
    """The type of attribute that holds an array unchanged, if any."""
    return _TYPES.get((values.dtype, values.shape[1:]))


def read(geometry: Geometry, name: str) -> NDArray:
    """Values of an attribute, see `values_of`; empty for those that only geometry without elements lacks.

    Raises
    ------
    KeyError
        There is no such attribute.
    """
    attribute = geometry.attributes.get(name)
    return _empty(KINDS[_BUILT_IN[name]], 0) if attribute is None else values_of(attribute)


def values_of(attribute: bpy.types.Attribute, field: str = "") -> NDArray:
    """Values as stored, (n,) or (n, width), in the type's own dtype; of another field of the elements if named."""
    kind = KINDS[attribute.data_type]
    values = _empty(kind, len(attribute.data))
    attribute.data.foreach_get(field or kind.field, values.reshape(-1))
    return values


def write(geometry: Geometry, name: str, values: NDArray, domain: str = 'POINT', data_type: str = "") -> None:
    """Write an attribute, made if there is none.

    Parameters
    ----------
    geometry : bpy.types.Mesh or bpy.types.PointCloud or bpy.types.Curves
    name : str
    values : (n,) or (n, width)
        As many as the domain has elements; converted to the dtype of the attribute.
    domain : {'POINT', 'EDGE', 'FACE', 'CORNER', 'CURVE'}
        Of a new attribute.
    data_type : str
        Of a new attribute, one of `KINDS`; by default what `type_for` returns.
    """
    attribute = geometry.attributes.get(name)
    if attribute is None:
        if not len(values) and name in _BUILT_IN:
            return
        attribute = geometry.attributes.new(name, data_type or type_for(values), domain)
    if len(values):
        kind = KINDS[attribute.data_type]
        attribute.data.foreach_set(kind.field, np.ascontiguousarray(values, kind.dtype).reshape(-1))


def members(
    collection: bpy.types.bpy_prop_collection, name: str, width: int = 1, dtype: DTypeLike = np.float32
) -> NDArray:
    """A property of all members of a collection, (n,) or (n, width)."""
    values = _empty(Kind(name, dtype, width), len(collection))
    collection.foreach_get(name, values.reshape(-1))
    return values


def _empty(kind: Kind, size: int) -> NDArray:
    return np.zeros(size if kind.width == 1 else (size, kind.width), kind.dtype)
