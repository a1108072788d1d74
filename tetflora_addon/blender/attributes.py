# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays from and to Blender's datablocks: attributes of geometry, transforms of objects, pixels of images.

Attributes of meshes, point clouds and hair curves are plain memory, read and written at the speed of a copy.
``foreach_get`` of a mesh's vertices, edges or corners is many times slower, but in Edit Mode, where attributes are
empty, it still returns what there was when the mode was entered.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from bpy.types import ID, Attribute, Curves, Depsgraph, Image, Mesh, Object, PointCloud, bpy_prop_collection
from numpy.typing import DTypeLike, NDArray

from ..arrays import Floats, Floats32, Integers32, Mask, linear_of

Geometry = Mesh | PointCloud | Curves


class AttributeType(NamedTuple):
    """How Blender stores one value of an attribute."""

    field: str  # name of the value among the properties of an element
    dtype: type
    width: int = 1  # numbers of a value


#: By Blender's name of the type. Byte colors as they are stored; their field "color" is linear.
KINDS = {
    'FLOAT': AttributeType("value", np.float32),
    'INT': AttributeType("value", np.int32),
    'INT8': AttributeType("value", np.int8),
    'BOOLEAN': AttributeType("value", np.bool_),
    'FLOAT2': AttributeType("vector", np.float32, 2),
    'FLOAT_VECTOR': AttributeType("vector", np.float32, 3),
    'QUATERNION': AttributeType("value", np.float32, 4),
    'FLOAT_COLOR': AttributeType("color", np.float32, 4),
    'BYTE_COLOR': AttributeType("color_srgb", np.float32, 4),
    'FLOAT4X4': AttributeType("value", np.float32, 16),
    'INT32_2D': AttributeType("value", np.int32, 2),
    'INT16_2D': AttributeType("value", np.int16, 2),
}
# Geometry without elements lacks these.
_BUILT_IN = {"position": 'FLOAT_VECTOR', ".edge_verts": 'INT32_2D', ".corner_vert": 'INT', ".corner_edge": 'INT'}
# Types of attributes by dtype and trailing shape of the arrays.
_TYPES = {
    (np.dtype(np.float32), ()): 'FLOAT',
    (np.dtype(np.float32), (2,)): 'FLOAT2',
    (np.dtype(np.float32), (3,)): 'FLOAT_VECTOR',
    (np.dtype(np.int32), ()): 'INT',
    (np.dtype(np.bool_), ()): 'BOOLEAN',
}
_TINY = 1e-9  # shortest axis of an object's matrix that is not taken for a scale of 0
_HUGE = 1e5  # longest: a fern 100 km long would have millions of polygons in any view


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
    return empty(KINDS[_BUILT_IN[name]], 0) if attribute is None else values_of(attribute)


def values_of(attribute: Attribute, field: str = "") -> NDArray:
    """Values as stored, (n,) or (n, width), in the type's own dtype; of another field of the elements if named."""
    kind = KINDS[attribute.data_type]
    values = empty(kind, len(attribute.data))
    attribute.data.foreach_get(field or kind.field, values.reshape(-1))
    return values


def write(geometry: Geometry, name: str, values: NDArray, domain: str = 'POINT', data_type: str = "") -> None:
    """Write an attribute, made if there is none.

    Parameters
    ----------
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


def members(collection: bpy_prop_collection, name: str, width: int = 1, dtype: DTypeLike = np.float32) -> NDArray:
    """A property of all members of a collection, (n,) or (n, width)."""
    values = empty(AttributeType(name, dtype, width), len(collection))
    collection.foreach_get(name, values.reshape(-1))
    return values


def empty(kind: AttributeType, size: int) -> NDArray:
    """Zeros in place of so many values of a type, (n,) or (n, width)."""
    return np.zeros(size if kind.width == 1 else (size, kind.width), kind.dtype)


#: While somebody asks for another moment: matrices (4, 4) that take objects, by `session_uid`, from where they are now
#: to where they are then, see `scene.motion`.
elsewhere: dict[int, Floats] = {}


def world_matrix(obj: Object, depsgraph: Depsgraph) -> Floats:
    """As `_matrix_now`, or at another moment while somebody asks for that."""
    matrix = _matrix_now(obj, depsgraph)
    return elsewhere[obj.session_uid] @ matrix if obj.session_uid in elsewhere else matrix


def _matrix_now(obj: Object, depsgraph: Depsgraph) -> Floats:
    """An object's evaluated matrix in world space, (4, 4); float32 in some versions of Blender.

    Objects that are disabled in viewports but render are not evaluated, and their stored matrix may be old. Then it
    follows from the transforms of the object and its parents; constraints do not count.
    """
    evaluated = obj.evaluated_get(depsgraph)
    if evaluated.is_evaluated:
        return np.array(evaluated.matrix_world)
    basis = np.array(obj.matrix_basis)
    parent = obj.parent
    return basis if parent is None else _matrix_now(parent, depsgraph) @ np.array(obj.matrix_parent_inverse) @ basis


def is_animated(datablock: ID | None) -> bool:
    """Whether keys, drivers or strips animate a datablock."""
    animation = getattr(datablock, "animation_data", None)
    return animation is not None and bool(animation.action or animation.drivers or animation.nla_tracks)


def moves(obj: Object | None) -> bool:
    """Whether anything may move an object or one of its parents, and motion blur is on for it."""
    if obj is not None and not getattr(getattr(obj, "cycles", None), "use_motion_blur", True):
        return False
    while obj is not None:
        if len(obj.constraints) or is_animated(obj):
            return True
        obj = obj.parent
    return False


def frames_of(linear: Floats) -> tuple[Floats, Floats, Mask]:
    """Rotations and uniform scales of linear maps.

    Parameters
    ----------
    linear : (n, 3, 3) float64
        Upper left part of object matrices, with any scale, shear and mirroring.

    Returns
    -------
    frame : (n, 3, 3) float64
        Proper rotations that keep the direction of z and the azimuth of x, without shear and mirroring.
    scale : (n,) float64
        Mean length of the three axes.
    sound : (n,) bool
        False where an axis has no length, one beyond all measure, or is not a number; the frame is then meaningless.
    """
    lengths = np.linalg.norm(linear, axis=1)  # (n, 3): of the columns
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        z = linear[:, :, 2] / lengths[:, 2:]
        x = linear[:, :, 0] / lengths[:, :1]
        x = x - z * np.sum(x * z, axis=1, keepdims=True)
        rest = np.linalg.norm(x, axis=1, keepdims=True)
        x = x / rest
        frame = np.stack([x, np.cross(z, x), z], axis=2)
        sized = ((lengths > _TINY) & (lengths < _HUGE)).all(axis=1)
        sound = sized & (rest[:, 0] > _TINY) & np.isfinite(frame).all(axis=(1, 2))
    return frame, lengths.mean(axis=1), sound


def image_pixels(image: Image) -> Floats32:
    """Pixels (height, width, channels) of an image that has some, row 0 lowest, in its own color space.

    Pixels with a channel that is not finite, such as the sun in an EXR, are black and transparent, as in Cycles.
    """
    width, height, channels = *image.size, image.channels
    pixels = np.zeros(width * height * channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, channels)
    if image.is_float:
        pixels[~np.isfinite(pixels).all(axis=2)] = 0.0
    return pixels


def linear_rgb(image: Image, pixels: NDArray[np.floating]) -> NDArray[np.floating]:
    """Linear RGB (..., 3) of some pixels (..., channels) of an image."""
    color = pixels[..., :3] if pixels.shape[-1] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    if image.colorspace_settings.name == "sRGB" and not image.is_float:
        color = linear_of(color)
    return color


def face_offsets(mesh: Mesh) -> Integers32:
    """First corner of each face, and the number of corners: (faces + 1,)."""
    return np.append(members(mesh.polygons, "loop_start", dtype=np.int32), np.int32(len(mesh.loops)))


@contextmanager
def mesh_of(obj: Object) -> Iterator[Mesh | None]:
    """The mesh of an object, evaluated or not, while the context lasts; None for what cannot have any."""
    try:
        mesh = obj.to_mesh()
    except RuntimeError:  # hair, of which nodes may have made a mesh all the same
        mesh = None
    try:
        yield mesh
    finally:
        obj.to_mesh_clear()
