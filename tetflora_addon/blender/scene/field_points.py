# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of a field of plants and their attributes, in the field's own space, checked and with defaults; and ages
of plants as they are stored.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Integers, Keys, Mask
from ...errors import SceneError
from ...growth.hashing import child_key, key_of_seed
from ...planting.places import new_seeds
from ...species.kinds import MOST_YEARS
from ..attributes import frames_of, read, values_of

#: Attribute of fields whose plants differ in their ages; one with `PREFIX` overrides it.
AGE = "age"


def stored_ages(plants: Sequence[bpy.types.Object]) -> Floats | None:
    """Ages (n,) of plants that are objects, or of fields without the attribute; None where all are full-grown.

    Raises
    ------
    SceneError
        An age that a script has stored and no slider gives; names the object.
    """
    ages = np.array([obj.tetflora.age for obj in plants], dtype=np.float64)
    bad = np.flatnonzero(~sound_ages(ages))
    if len(bad):
        raise SceneError(
            f'"{plants[bad[0]].name}": Age is {ages[bad[0]]:g}; it must be from 0 to {MOST_YEARS:,.0f} years. Set it '
            "again in the TetFlora tab of the sidebar"
        )
    return ages if ages.any() else None


def has_ages(field: bpy.types.Object) -> bool:
    """Whether points of a field have ages of their own, as far as they are stored."""
    return any(name in field.data.attributes for name in (PREFIX + AGE, AGE))


def sound_ages(ages: NDArray[np.floating]) -> Mask:
    """Which ages are numbers within the limits."""
    return (ages >= 0.0) & (ages <= MOST_YEARS)


#: Attributes with this prefix override those without, which other tools may use differently.
PREFIX = "tf_"

_INTEGERS = {'INT', 'INT8', 'BOOLEAN'}
#: Seeds may also have 64 bits, as those of instances that have come back from a file.
_SEEDS = {*_INTEGERS, 'INT32_2D'}
_BLOCK = 4_096  # points whose rotations are found at a time, so that they stay in the cache

Points = bpy.types.Mesh | bpy.types.PointCloud


@dataclass(frozen=True)
class FieldPoints:
    """Points of a field in its own space; a rotation (3, 3, n), scale (1, n) or (3, n) along its axes.

    ``age`` is None where all plants are full-grown.
    """

    kinds: tuple[str, ...]
    position: Floats
    rotation: Floats
    scale: Floats
    species: Integers
    seed: Integers
    age: Floats | None

    def seeds(self, keys: Keys | None) -> Integers:
        """Seeds of the points in all places with the given keys; those of the points themselves where it is None."""
        if keys is None:
            return self.seed
        return child_key(key_of_seed(self.seed), keys[:, None]).view(np.int64).reshape(-1)


def parts_of(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, geometry: bpy.types.GeometrySet | None
) -> list[Points]:
    """What holds the points of a field: meshes and point clouds of geometry; what is stored where that is None."""
    if geometry is not None and obj.type == 'MESH' and obj.data.is_editmode:
        # What is evaluated has no attributes then. Blender keeps this copy with the evaluated object, and frees it.
        return [obj.evaluated_get(depsgraph).to_mesh()]
    if geometry is None:
        return [obj.data] if isinstance(obj.data, Points) else []
    return [part for part in (geometry.mesh, geometry.pointcloud) if part is not None]


def read_points(obj: bpy.types.Object, kinds: tuple[str, ...], parts: list[Points]) -> FieldPoints:
    """Points of a field of some kinds of plants.

    Raises
    ------
    SceneError
        An attribute of the wrong type or domain, or with values that cannot be.
    """
    sizes = [point_count(part) for part in parts]
    sized = list(zip(parts, sizes, strict=True))
    position = joined([read(part, "position").astype(np.float64) for part in parts], (0, 3))
    rotation = joined([_rotations(obj, part, size) for part, size in sized], (3, 3, 0))
    own_scale = joined([_scales(obj, part, size, 1 if len(parts) == 1 else 3) for part, size in sized], (3, 0))
    firsts = np.cumsum([0, *sizes]).tolist()
    seed = joined([_seeds(obj, *part, first) for part, first in zip(sized, firsts, strict=False)], (0,))
    species = joined([_integers(obj, part, "species", size, 0) for part, size in sized], (0,))
    refuse(obj, (species < 0) | (species >= len(kinds)), f"a species number outside the list of {len(kinds)} species")
    age = joined([_ages(obj, part, size) for part, size in sized], (0,)).astype(np.float64)
    refuse(obj, ~sound_ages(age), f"an age that is not from 0 to {MOST_YEARS:,.0f} years")
    return FieldPoints(kinds, position, rotation, own_scale, species, seed, age if age.any() else None)


def point_count(points: Points) -> int:
    """Number of points of a mesh or point cloud."""
    return len(points.points if isinstance(points, bpy.types.PointCloud) else points.vertices)


def _attribute(obj: bpy.types.Object, points: Points, name: str, kinds: Iterable[str]) -> bpy.types.Attribute | None:
    found = points.attributes.get(PREFIX + name) or points.attributes.get(name)
    if found is None:
        return None
    if found.domain != 'POINT' or found.data_type not in kinds:
        raise SceneError(
            f'"{obj.name}": attribute "{found.name}" is {found.data_type} on {found.domain}; a field requires '
            f"{' or '.join(sorted(kinds))} on POINT. Convert it, or store the values as {PREFIX}{name}"
        )
    return found


def _integers(obj: bpy.types.Object, points: Points, name: str, size: int, default: Integers | int) -> Integers:
    attribute = _attribute(obj, points, name, _SEEDS if name == "seed" else _INTEGERS)
    if attribute is None:
        return np.broadcast_to(np.asarray(default, np.int64), size)
    values = values_of(attribute)
    return values.view(np.int64)[:, 0] if values.ndim > 1 else values.astype(np.int64)


def _seeds(obj: bpy.types.Object, points: Points, size: int, first: int) -> Integers:
    """Stored seeds, hashed where the object has a seed; without stored ones, hashes of the points' ids."""
    roll = obj.tetflora.seed
    stored = _attribute(obj, points, "seed", _SEEDS) is not None
    seeds = _integers(obj, points, "seed" if stored else "id", size, np.arange(first, first + size))
    return new_seeds(seeds, roll).astype(np.int64) if roll or not stored else seeds


def _ages(obj: bpy.types.Object, points: Points, size: int) -> NDArray[np.floating]:
    """Age of each point in years; that of the object without the attribute."""
    attribute = _attribute(obj, points, AGE, {'FLOAT', 'INT'})
    if attribute is not None:
        return values_of(attribute)
    own = stored_ages([obj])
    return np.broadcast_to(np.zeros(1) if own is None else own, size)


def _rotations(obj: bpy.types.Object, points: Points, size: int) -> Floats:
    """Rotation of each point in the field's space, (3, 3, n): numpy is fast with long rows."""
    attribute = _attribute(obj, points, "rotation", {'QUATERNION', 'FLOAT_VECTOR'})
    if attribute is None:
        return np.repeat(np.eye(3)[:, :, None], size, axis=2)
    values, out = values_of(attribute), np.empty((3, 3, size))
    turned = _from_quaternions if values.shape[1] == 4 else _from_eulers
    for first in range(0, size, _BLOCK):
        some = slice(first, first + _BLOCK)
        out[:, :, some] = turned(np.ascontiguousarray(values[some].T, np.float64))
    return out


def _scales(obj: bpy.types.Object, points: Points, size: int, least: int) -> Floats:
    """Scale of each point along its axes, (3, n), or (1, n) if uniform and ``least`` is 1."""
    attribute = _attribute(obj, points, "scale", {'FLOAT', 'FLOAT_VECTOR'})
    if attribute is None:
        return np.ones((least, size))
    values = values_of(attribute)
    if values.ndim == 1:
        refuse(obj, ~(values > 0.0), "a scale that is not greater than 0")
        values = np.broadcast_to(values[:, None], (size, least))
    return np.ascontiguousarray(values.T, np.float64)


def _from_quaternions(q: Floats) -> Floats:
    """Rotations, (3, 3, n), of quaternions of any length, (4, n); that of length 0 is no rotation."""
    with np.errstate(invalid="ignore", divide="ignore"):
        squared = np.einsum("in,in->n", q, q)
        twice = np.where(squared == 0.0, 0.0, 2.0 / squared)
        w, x, y, z = q
        out = np.zeros((3, 3, q.shape[1]))
        xx, yy, zz = twice * x * x, twice * y * y, twice * z * z
        out[0, 0], out[1, 1], out[2, 2] = 1.0 - yy - zz, 1.0 - xx - zz, 1.0 - xx - yy
        for (i, j), product, turn in (((0, 1), x * y, z), ((0, 2), x * z, -y), ((1, 2), y * z, x)):
            out[i, j] = twice * (product - w * turn)
            out[j, i] = twice * (product + w * turn)
    return out


def _from_eulers(angles: Floats) -> Floats:
    """Rotations, (3, 3, n), of XYZ Euler angles in radians, (3, n): first about x, last about z, as Blender's."""
    with np.errstate(invalid="ignore"):
        (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    rows = (
        (cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz),
        (cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz),
        (-sy, sx * cy, cx * cy),
    )
    return np.stack([np.stack(row) for row in rows])


def placed_frames(world: Floats, rotation: Floats, scale: Floats) -> tuple[Floats, Floats, Mask]:
    """Frames, scales and soundness, as `frames_of`, of all points (3, 3, n) in all places (k, 3, 3): k · n of each."""
    places, size = len(world), rotation.shape[2]
    frames, scales, sound = frames_of(world)
    even = np.allclose(frames * scales[:, None, None], world, rtol=0.0, atol=1e-6 * np.abs(scales).max(initial=0.0))
    if even and sound.all() and len(scale) == 1:
        # Nothing is sheared, mirrored or stretched: what comes out are rotations already.
        linear, found = frames, (scales[:, None] * scale).reshape(-1)
    else:
        # Of a scale along axes a column each; a scale alone holds for all of them.
        linear, rotation, found = world, rotation * scale, None
    if not np.array_equal(linear, np.eye(3)[None]):  # most fields stand where the world begins
        rotation = linear @ rotation.reshape(3, -1)
    turned = rotation.reshape(places, 3, 3, size).transpose(0, 3, 1, 2).reshape(-1, 3, 3)
    if found is None:
        return frames_of(turned)
    return turned, found, np.isfinite(turned.sum(axis=(1, 2))) & np.isfinite(found)


def refuse(obj: bpy.types.Object, bad: Mask, what: str) -> None:
    """Raise `SceneError` where some points (n,) of a field are bad, with their number and the first one."""
    if bad.any():
        raise SceneError(
            f'"{obj.name}": {int(bad.sum()):,} of {len(bad):,} points have {what}; the first is point '
            f"{int(np.argmax(bad))}. Correct or delete them, or disable the field in the TetFlora tab of the sidebar"
        )


def joined(parts: list[NDArray], empty: tuple[int, ...]) -> NDArray:
    """Arrays as one along the axis that is 0 in ``empty``, which is the shape where there are none."""
    if not parts:
        return np.zeros(empty, int)
    # Do not copy millions of frames where there is nothing to join.
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=empty.index(0))
