# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of plants: objects whose points are plants, for numbers of plants that empties cannot handle.

A field is a mesh or point cloud whose object is marked as one. Attributes of its points define the plants, whatever
wrote them. Nothing here loops over plants.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...camera.camera import origin_near
from ...errors import SceneError
from ...growth.hashing import child_key, key_of_seed
from ...growth.seeds import Seeds
from ...planting.places import new_seeds
from ..attributes import frames_of, read, values_of, write
from .objects import geometry_of
from .own_ages import AGE, MOST_YEARS, sound_ages, stored_ages
from .skeletons import kind_of, kind_of_choice, species_of

#: Types of objects that can be marked as fields.
FIELD_TYPES = {'MESH', 'POINTCLOUD'}
#: Attributes with this prefix override those without, which other tools may use differently.
PREFIX = "tf_"
#: Attributes of fields that TetFlora makes, with their types.
FIELD_ATTRIBUTES = {"rotation": 'QUATERNION', "scale": 'FLOAT', "species": 'INT', "seed": 'INT'}

_INTEGERS = {'INT', 'INT8', 'BOOLEAN'}

Points = bpy.types.Mesh | bpy.types.PointCloud


def field_kinds(obj: bpy.types.Object) -> tuple[str, ...]:
    """Kinds of plants that the attribute ``species`` of a field is an index into; at least one."""
    return tuple(kind_of_choice(entry) for entry in obj.tetflora.field_species) or (kind_of(obj),)


def fields_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of the objects that are fields."""
    return [o for o in objects if o.tetflora.is_field]


def stored_size(obj: bpy.types.Object) -> int:
    """Number of points that a field stores, before modifiers; cheap."""
    return len(obj.data.points if obj.type == 'POINTCLOUD' else obj.data.vertices) if obj.type in FIELD_TYPES else 0


def read_field(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, matrices: NDArray[np.float64]) -> Seeds:
    """Plants of a field as `read_aged_field`, without their ages."""
    return read_aged_field(obj, depsgraph, matrices)[0]


def read_aged_field(
    obj: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    matrices: NDArray[np.float64],
    keys: NDArray[np.uint64] | None = None,
    geometry: bpy.types.GeometrySet | None = None,
) -> tuple[Seeds, NDArray[np.float64] | None]:
    """Plants of a field, once for each of its places, and their ages in years; None where all are full-grown.

    Transforms of points count as those of plants that are objects.

    Parameters
    ----------
    obj : bpy.types.Object
        Original object.
    depsgraph : bpy.types.Depsgraph
        Applies modifiers. A field that it does not evaluate is read without them.
    matrices : (k, 4, 4) float64
        Places of the field.
    keys : (k,) uint64, optional
        Make other individuals of each place; None where the field stands for itself.
    geometry : bpy.types.GeometrySet, optional
        Read this instead of what the object evaluates to.

    Raises
    ------
    SceneError
        An attribute of the wrong type or domain, or points with an invalid position or scale; the message names the
        object, the number of points and the first one.
    """
    points = _read_points(obj, depsgraph, geometry)
    kinds, position, rotation, own_scale = points.kinds, points.position, points.rotation, points.scale
    matrices = matrices.astype(np.float64)  # single precision in some versions of Blender
    world = matrices[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):  # what is no number is refused below
        place = (position @ world.transpose(0, 2, 1) + matrices[:, None, :3, 3]).reshape(-1, 3)
        frame, scale, sound = _frames(world, rotation, own_scale)
        sound &= np.isfinite(place.sum(axis=1))
    _refuse(obj, ~sound.reshape(len(matrices), -1).all(axis=0), "zero scale or an invalid position or rotation")
    species = np.tile(points.species.astype(np.int32), len(matrices))
    ages = None if points.age is None else np.tile(points.age, len(matrices))
    return Seeds(kinds, species, points.seeds(keys), place, frame, scale), ages


def read_field_matrices(
    obj: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    matrices: NDArray[np.float64],
    wanted: Container[str],
    keys: NDArray[np.uint64] | None = None,
    geometry: bpy.types.GeometrySet | None = None,
) -> Iterator[tuple[str, NDArray[np.int64], NDArray[np.float64]]]:
    """Plants of a field of some species, with all of their transform: stretched and mirrored as the points are.

    Parameters and errors are those of `read_aged_field`.

    Yields
    ------
    kind : str
        Of each of ``wanted`` that occurs; a kind whose species is not wanted is left out.
    seed : (m,) int64
    matrices : (m, 4, 4) float64
        To world space.
    """
    kinds = field_kinds(obj)
    if not any(species_of(kind) in wanted for kind in kinds):
        return
    points = _read_points(obj, depsgraph, geometry)
    seeds = points.seeds(keys).reshape(-1, len(points.species))
    seeds = np.broadcast_to(seeds, (len(matrices), seeds.shape[1]))
    for number, kind in enumerate(kinds):
        own = np.flatnonzero(points.species == number)
        if species_of(kind) not in wanted or not len(own):
            continue
        local = np.zeros((len(own), 4, 4))
        local[:, :3, :3] = np.moveaxis(points.rotation[:, :, own] * points.scale[:, own], 2, 0)
        local[:, :3, 3], local[:, 3, 3] = points.position[own], 1.0
        placed = matrices.astype(np.float64)[:, None] @ local
        bad = np.zeros(len(points.species), bool)
        bad[own] = ~np.isfinite(placed).all(axis=(0, 2, 3))
        _refuse(obj, bad, "an invalid position or rotation")
        yield kind, seeds[:, own].reshape(-1), placed.reshape(-1, 4, 4)


@dataclass(frozen=True)
class _Points:
    """Points of a field in its own space; a rotation (3, 3, n), scale (1, n) or (3, n) along its axes.

    ``age`` is None where all plants are full-grown.
    """

    kinds: tuple[str, ...]
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    scale: NDArray[np.float64]
    species: NDArray[np.int64]
    seed: NDArray[np.int64]
    age: NDArray[np.float64] | None

    def seeds(self, keys: NDArray[np.uint64] | None) -> NDArray[np.int64]:
        """Seeds of the points in all places with the given keys; those of the points themselves where it is None."""
        if keys is None:
            return self.seed
        return child_key(key_of_seed(self.seed), keys[:, None]).view(np.int64).reshape(-1)


def _read_points(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, geometry: bpy.types.GeometrySet | None
) -> _Points:
    geometry = geometry or geometry_of(obj, depsgraph)
    if geometry is not None and obj.type == 'MESH' and obj.data.is_editmode:
        # What is evaluated has no attributes then. Blender keeps this copy with the evaluated object, and frees it.
        parts = [obj.evaluated_get(depsgraph).to_mesh()]
    elif geometry is None:
        parts = [obj.data] if obj.type in FIELD_TYPES else []
    else:
        parts = [part for part in (geometry.mesh, geometry.pointcloud) if part is not None]
    sizes = [_size(part) for part in parts]
    sized = list(zip(parts, sizes, strict=True))
    position = _joined([read(part, "position").astype(np.float64) for part in parts], (0, 3))
    rotation = _joined([_rotations(obj, part, size) for part, size in sized], (3, 3, 0))
    own_scale = _joined([_scales(obj, part, size, 1 if len(parts) == 1 else 3) for part, size in sized], (3, 0))
    firsts = np.cumsum([0, *sizes]).tolist()
    seed = _joined([_seeds(obj, *part, first) for part, first in zip(sized, firsts, strict=False)], (0,))
    kinds = field_kinds(obj)
    species = _joined([_integers(obj, part, "species", size, 0) for part, size in sized], (0,))
    _refuse(obj, (species < 0) | (species >= len(kinds)), f"a species number outside the list of {len(kinds)} species")
    age = _joined([_ages(obj, part, size) for part, size in sized], (0,)).astype(np.float64)
    _refuse(obj, ~sound_ages(age), f"an age that is not from 0 to {MOST_YEARS:,.0f} years")
    return _Points(kinds, position, rotation, own_scale, species, seed, age if age.any() else None)


def write_field(
    name: str,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    scale: NDArray[np.float64],
    species: NDArray[np.int32],
    seed: NDArray[np.int32],
    identifiers: Sequence[str],
    forms: Sequence[bpy.types.Object | None] | None = None,
    ages: NDArray[np.floating] | None = None,
) -> bpy.types.Object:
    """Make a field: an object with a mesh of vertices, not linked to any collection yet.

    A mesh rather than a point cloud: its vertices are dots in the viewport and invisible in renders, and every version
    of Blender can make it.

    Parameters
    ----------
    position : (n, 3) float
        World space, metres.
    rotation : (n, 4) float
        Quaternions, w first.
    scale : (n,) float
    species : (n,) int32
        Index into ``identifiers``.
    seed : (n,) int32
    identifiers : sequence of str
    forms : sequence of objects or None, optional
        Form of each kind.
    ages : (n,) float, optional
        Years. An age that all of them have becomes that of the object.
    """
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(seed))
    origin = origin_near(position)
    write(mesh, "position", position - origin)
    own = {"rotation": rotation, "scale": scale, "species": species, "seed": seed}
    for attribute, kind in FIELD_ATTRIBUTES.items():
        write(mesh, attribute, own[attribute], data_type=kind)
    same = ages is None or np.ptp(ages) == 0.0
    if not same:
        write(mesh, AGE, ages, data_type='FLOAT')
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    obj.matrix_world = Matrix.Translation(origin)
    group = obj.tetflora
    group.is_field = True
    if ages is not None and same:
        group.age = ages[0]
    for identifier, form in zip(identifiers, forms or [None] * len(identifiers), strict=True):
        entry = group.field_species.add()
        entry.species, entry.form = identifier, form
    return obj


def upright(azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions, (n, 4), of turns about the vertical in radians, (n,)."""
    half, none = 0.5 * np.asarray(azimuth), np.zeros(len(azimuth))
    return np.stack([np.cos(half), none, none, np.sin(half)], axis=1)


def quaternions(frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternions, (n, 4) with w first, of rotations, (n, 3, 3).

    Each of the four ways to write it down is exact where its own component is large; the one with the largest is taken
    (Shepperd, Journal of Guidance and Control, 1978).
    """
    r = frame
    w = np.stack([1 + r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2], *(_axis(r, i) for i in range(3))], axis=1)
    a, b, c = r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]
    d, e, f = r[:, 1, 0] + r[:, 0, 1], r[:, 0, 2] + r[:, 2, 0], r[:, 2, 1] + r[:, 1, 2]
    rows = ((w[:, 0], a, b, c), (a, w[:, 1], d, e), (b, d, w[:, 2], f), (c, e, f, w[:, 3]))
    ways = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    best = ways[np.arange(len(r)), np.argmax(w, axis=1)]
    return best / np.linalg.norm(best, axis=1, keepdims=True)


def _axis(r: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    return 1.0 + 2.0 * r[:, axis, axis] - np.trace(r, axis1=1, axis2=2)


def _size(points: Points) -> int:
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


def _integers(
    obj: bpy.types.Object, points: Points, name: str, size: int, default: NDArray[np.int64] | int
) -> NDArray[np.int64]:
    attribute = _attribute(obj, points, name, _INTEGERS)
    if attribute is None:
        return np.broadcast_to(np.asarray(default, np.int64), size)
    return values_of(attribute).astype(np.int64)


def _seeds(obj: bpy.types.Object, points: Points, size: int, first: int) -> NDArray[np.int64]:
    """Stored seeds, hashed where the object has a seed; without stored ones, hashes of the points' ids."""
    roll = obj.tetflora.seed
    stored = _attribute(obj, points, "seed", _INTEGERS) is not None
    seeds = _integers(obj, points, "seed" if stored else "id", size, np.arange(first, first + size))
    return new_seeds(seeds, roll).astype(np.int64) if roll or not stored else seeds


def _ages(obj: bpy.types.Object, points: Points, size: int) -> NDArray[np.floating]:
    """Age of each point in years; that of the object without the attribute."""
    attribute = _attribute(obj, points, AGE, {'FLOAT', 'INT'})
    if attribute is not None:
        return values_of(attribute)
    own = stored_ages([obj])
    return np.broadcast_to(np.zeros(1) if own is None else own, size)


def _rotations(obj: bpy.types.Object, points: Points, size: int) -> NDArray[np.float64]:
    """Rotation of each point in the field's space, (3, 3, n): numpy is fast with long rows."""
    attribute = _attribute(obj, points, "rotation", {'QUATERNION', 'FLOAT_VECTOR'})
    if attribute is None:
        return np.repeat(np.eye(3)[:, :, None], size, axis=2)
    values = np.ascontiguousarray(values_of(attribute).T, np.float64)
    return _from_quaternions(values) if len(values) == 4 else _from_eulers(values)


def _scales(obj: bpy.types.Object, points: Points, size: int, least: int) -> NDArray[np.float64]:
    """Scale of each point along its axes, (3, n), or (1, n) if uniform and ``least`` is 1."""
    attribute = _attribute(obj, points, "scale", {'FLOAT', 'FLOAT_VECTOR'})
    if attribute is None:
        return np.ones((least, size))
    values = values_of(attribute)
    if values.ndim == 1:
        _refuse(obj, ~(values > 0.0), "a scale that is not greater than 0")
        values = np.broadcast_to(values[:, None], (size, least))
    return np.ascontiguousarray(values.T, np.float64)


def _from_quaternions(q: NDArray[np.float64]) -> NDArray[np.float64]:
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


def _from_eulers(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations, (3, 3, n), of XYZ Euler angles in radians, (3, n): first about x, last about z, as Blender's."""
    with np.errstate(invalid="ignore"):
        (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    rows = (
        (cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz),
        (cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz),
        (-sy, sx * cy, cx * cy),
    )
    return np.stack([np.stack(row) for row in rows])


def _frames(
    world: NDArray[np.float64], rotation: NDArray[np.float64], scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
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
    turned = (linear @ rotation.reshape(3, -1)).reshape(places, 3, 3, size).transpose(0, 3, 1, 2).reshape(-1, 3, 3)
    if found is None:
        return frames_of(turned)
    return turned, found, np.isfinite(turned.sum(axis=(1, 2))) & np.isfinite(found)


def _refuse(obj: bpy.types.Object, bad: NDArray[np.bool_], what: str) -> None:
    if bad.any():
        raise SceneError(
            f'"{obj.name}": {int(bad.sum()):,} of {len(bad):,} points have {what}; the first is point '
            f"{int(np.argmax(bad))}. Correct or delete them, or disable the field in the TetFlora tab of the sidebar"
        )


def _joined(parts: list[NDArray], empty: tuple[int, ...]) -> NDArray:
    """Arrays as one along the axis that is 0 in ``empty``, which is the shape where there are none."""
    if not parts:
        return np.zeros(empty, int)
    # Do not copy millions of frames where there is nothing to join.
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=empty.index(0))
