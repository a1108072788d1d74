# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of plants: objects whose points are plants, for numbers of plants that empties cannot handle.

A field is a mesh or point cloud whose object is marked as one. Attributes of its points define the plants, whatever
wrote them; they are read in the field's own space, checked, and with defaults. Nothing here loops over plants.

Recorded sizes of plants, and records of plants in the years of a stand, are attributes with the prefix ``tf_``: without
it, they belong to other tools. Attributes that are absent, and numbers that are 0, say nothing.
"""

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace

import bpy
import numpy as np
from bpy.types import Attribute, Depsgraph, FCurve, GeometrySet, Mesh, Object, PointCloud, Scene
from mathutils import Matrix
from numpy.typing import NDArray

from ...arrays import Floats, Integers, Integers32, Keys, Mask
from ...camera.camera import origin_near
from ...compiled.recorded_sizes import Lives, Sizes
from ...errors import SceneError
from ...growth.hashing import child_key, key_of_seed
from ...growth.seeds import Seeds
from ...planting.places import new_seeds
from ...species.kinds import MOST_YEARS, species_of
from ..attributes import frames_of, read, values_of, write
from ..species.asset_species import find_asset
from .motion import bags_of, curves_of
from .objects import geometry_of
from .skeletons import kind_of, kind_of_choice

#: Attributes with this prefix override those without, which other tools may use differently.
PREFIX = "tf_"
#: Attribute of fields whose plants differ in their ages; one with `PREFIX` overrides it.
AGE = "age"
_INTEGERS = {'INT', 'INT8', 'BOOLEAN'}
#: Seeds may also have 64 bits, as those of instances that have come back from a file.
_SEEDS = {*_INTEGERS, 'INT32_2D'}
_BLOCK = 4_096  # points whose rotations are found at a time, so that they stay in the cache
#: Attributes of fields that TetFlora makes, with their types.
FIELD_ATTRIBUTES = {"rotation": 'QUATERNION', "scale": 'FLOAT', "species": 'INT', "seed": 'INT'}
Points = Mesh | PointCloud
#: Types of objects that can be marked as fields.
FIELD_TYPES = {'MESH', 'POINTCLOUD'}
HEIGHT = "tf_height"
#: Attributes of numbers, with the most that is sound: meters, and years since death.
NUMBERS = {HEIGHT: 200.0, "tf_diameter": 20.0, "tf_crown_width": 200.0, "tf_crown_base": 200.0, "tf_dead": 10_000.0}
OFFSET, FIT = "tf_crown_offset", "tf_fit"
#: Attributes of histories: the year of the stand that a point is a record of, and the plant whose record it is.
YEAR, PLANT = "tf_year", "tf_plant"
#: Where an object has the year at which its history is shown.
YEAR_PATH = "tetflora.stand_year"
#: All of them with their types, in the order in which they are written.
SIZE_ATTRIBUTES = dict.fromkeys(NUMBERS, 'FLOAT')
SIZE_ATTRIBUTES |= {OFFSET: 'FLOAT_VECTOR', FIT: 'FLOAT_VECTOR', YEAR: 'FLOAT', PLANT: 'INT'}
_MOST_FIT, _MOST_OFFSET = 10.0, 10.0
_STEADY = np.cos(np.radians(30.0))  # trunks that turn further from one record to the next have fallen


def stored_ages(plants: Sequence[Object]) -> Floats | None:
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


def has_ages(field: Object) -> bool:
    """Whether points of a field have ages of their own, as far as they are stored."""
    return any(name in field.data.attributes for name in (PREFIX + AGE, AGE))


def sound_ages(ages: NDArray[np.floating]) -> Mask:
    """Which ages are numbers within the limits."""
    return (ages >= 0.0) & (ages <= MOST_YEARS)


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


def parts_of(obj: Object, depsgraph: Depsgraph, geometry: GeometrySet | None) -> list[Points]:
    """What holds the points of a field: meshes and point clouds of geometry; what is stored where that is None."""
    if geometry is not None and obj.type == 'MESH' and obj.data.is_editmode:
        # What is evaluated has no attributes then. Blender keeps this copy with the evaluated object, and frees it.
        return [obj.evaluated_get(depsgraph).to_mesh()]
    if geometry is None:
        return [obj.data] if isinstance(obj.data, Points) else []
    return [part for part in (geometry.mesh, geometry.pointcloud) if part is not None]


def read_points(obj: Object, kinds: tuple[str, ...], parts: list[Points]) -> FieldPoints:
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
    return len(points.points if isinstance(points, PointCloud) else points.vertices)


def _attribute(obj: Object, points: Points, name: str, kinds: Iterable[str]) -> Attribute | None:
    """An attribute, or the one that overrides it."""
    attributes, ours = points.attributes, name.startswith(PREFIX)
    stored = attributes.get(name) if ours else attributes.get(PREFIX + name) or attributes.get(name)
    if stored is not None and (stored.domain != 'POINT' or stored.data_type not in kinds):
        raise SceneError(
            f'"{obj.name}": attribute "{stored.name}" is {stored.data_type} on {stored.domain}; a field requires '
            f"{' or '.join(sorted(kinds))} on POINT. "
            + ("Convert or rename it" if ours else f"Convert it, or store the values as {PREFIX}{name}")
        )
    return stored


def _integers(obj: Object, points: Points, name: str, size: int, default: Integers | int) -> Integers:
    attribute = _attribute(obj, points, name, _SEEDS if name == "seed" else _INTEGERS)
    if attribute is None:
        return np.broadcast_to(np.asarray(default, np.int64), size)
    values = values_of(attribute)
    return values.view(np.int64)[:, 0] if values.ndim > 1 else values.astype(np.int64)


def _seeds(obj: Object, points: Points, size: int, first: int) -> Integers:
    """Stored seeds, hashed where the object has a seed; without stored ones, hashes of the points' ids."""
    roll = obj.tetflora.seed
    stored = _attribute(obj, points, "seed", _SEEDS) is not None
    seeds = _integers(obj, points, "seed" if stored else "id", size, np.arange(first, first + size))
    return new_seeds(seeds, roll).astype(np.int64) if roll or not stored else seeds


def _ages(obj: Object, points: Points, size: int) -> NDArray[np.floating]:
    """Age of each point in years; that of the object without the attribute."""
    attribute = _attribute(obj, points, AGE, {'FLOAT', 'INT'})
    if attribute is not None:
        return values_of(attribute)
    age = stored_ages([obj])
    return np.broadcast_to(np.zeros(1) if age is None else age, size)


def _rotations(obj: Object, points: Points, size: int) -> Floats:
    """Rotation of each point in the field's space, (3, 3, n): numpy is fast with long rows."""
    attribute = _attribute(obj, points, "rotation", {'QUATERNION', 'FLOAT_VECTOR'})
    if attribute is None:
        return np.repeat(np.eye(3)[:, :, None], size, axis=2)
    values, out = values_of(attribute), np.empty((3, 3, size))
    turned = _from_quaternions if values.shape[1] == 4 else _from_eulers
    for first in range(0, size, _BLOCK):
        block = slice(first, first + _BLOCK)
        out[:, :, block] = turned(np.ascontiguousarray(values[block].T, np.float64))
    return out


def _scales(obj: Object, points: Points, size: int, least: int) -> Floats:
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
        linear, factors = frames, (scales[:, None] * scale).reshape(-1)
    else:
        # Of a scale along axes a column each; a scale alone holds for all of them.
        linear, rotation, factors = world, rotation * scale, None
    if not np.array_equal(linear, np.eye(3)[None]):  # most fields stand where the world begins
        rotation = linear @ rotation.reshape(3, -1)
    turned = rotation.reshape(places, 3, 3, size).transpose(0, 3, 1, 2).reshape(-1, 3, 3)
    if factors is None:
        return frames_of(turned)
    return turned, factors, np.isfinite(turned.sum(axis=(1, 2))) & np.isfinite(factors)


def refuse(obj: Object, bad: Mask, what: str) -> None:
    """Raise `SceneError` where some points (n,) of a field are bad, with their number and the first one."""
    if bad.any():
        raise SceneError(
            f'"{obj.name}": {int(bad.sum()):,} of {len(bad):,} points have {what}; the first is point '
            f"{int(np.argmax(bad))}. Correct or delete them, or disable the field in Properties > Object"
        )


def joined(parts: list[NDArray], empty: tuple[int, ...]) -> NDArray:
    """Arrays as one along the axis that is 0 in ``empty``, which is the shape where there are none."""
    if not parts:
        return np.zeros(empty, int)
    # Do not copy millions of frames where there is nothing to join.
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=empty.index(0))


@dataclass(frozen=True)
class History:
    """Which points are records of which plant."""

    year: Floats  # (n,)
    first: Integers  # (n,): first record of the same plant

    def chosen(self, now: float) -> tuple[Integers, Integers, Floats]:
        """Records (m,) before and after a year of those plants that are there, and how far it is from the first."""
        first, last = self.year.min(initial=np.inf), self.year.max(initial=-np.inf)
        now = last if first == last else min(float(now), last)  # what has one year has no others
        plant, before = self.first, self.year <= now
        following = np.append(plant[1:] == plant[:-1], False)
        exact = before & (self.year == now)
        between = before & following & ~exact & (np.append(self.year[1:], now) > now)
        a = np.flatnonzero(exact | between)
        b = a + between[a]
        return a, b, (now - self.year[a]) / np.maximum(self.year[b] - self.year[a], 1e-9)


def has_history(obj: Object) -> bool:
    """Whether the points that a field stores are records of a history; cheap."""
    return isinstance(obj.data, Points) and YEAR in obj.data.attributes


def year_curves(obj: Object) -> list[FCurve]:
    """Curves of keys of a stand's year."""
    return [curve for curve in curves_of(obj) if curve.data_path == YEAR_PATH]


def clear_years(obj: Object) -> None:
    """Remove all keys of a stand's year."""
    for bag in bags_of(obj):
        for curve in [curve for curve in bag.fcurves if curve.data_path == YEAR_PATH]:
            bag.fcurves.remove(curve)


def year_now(obj: Object, depsgraph: Depsgraph) -> float:
    """Year in which a history is shown; also where the object is disabled in viewports, and Blender evaluates none."""
    evaluated = obj.evaluated_get(depsgraph) if obj.animation_data else obj
    curve = next((curve for curve in year_curves(obj) if not curve.mute), None)
    if curve is None or evaluated.is_evaluated:
        return evaluated.tetflora.stand_year
    return max(curve.evaluate(depsgraph.scene.frame_current_final), 0.0)


def stand_years(scene: Scene) -> list[float]:
    """Present years of all histories of a scene; at little cost where the file has none, whatever objects there are."""
    if not any(YEAR in data.attributes for data in (*bpy.data.meshes, *bpy.data.pointclouds)):
        return []
    meshes = (obj for obj in scene.objects if isinstance(obj.data, Points))
    return [group.stand_year for obj in meshes if (group := obj.tetflora).is_field and has_history(obj)]


def stored_now(obj: Object) -> Integers:
    """Numbers (m,) of the stored points of a field that are plants now: of a history, those of the present year."""
    points = obj.data
    if not has_history(obj):
        return np.arange(point_count(points))
    try:
        records = read_records(obj, [points])
    except SceneError:  # told where the field is read
        return np.zeros(0, np.int64)
    return records.chosen(obj.tetflora.stand_year)[0]


def read_sizes(obj: Object, parts: Sequence[Points]) -> Sizes | None:
    """Recorded sizes of the points of a field; None where none are stored.

    Raises
    ------
    SceneError
        An attribute of the wrong type, or values that are no sizes; names the object, their number and the first one.
    """
    names = (*NUMBERS, OFFSET, FIT)
    if not any(name in part.attributes for part in parts for name in names):
        return None
    columns = []
    for name in names:
        values = joined([_values(obj, part, name) for part in parts], (0,) if name in NUMBERS else (0, 3))
        most = NUMBERS.get(name, _MOST_FIT if name == FIT else _MOST_OFFSET)
        least = -most if name == OFFSET else 0.0
        bad = ~((values >= least) & (values <= most))
        bad = bad.any(axis=1) if bad.ndim > 1 else bad
        refuse(obj, bad, f"{name} that is not from {least:g} to {most:,.0f}")
        columns.append(values[:, :2] if values.ndim > 1 else values)
    *rest, fit = columns
    return Sizes(*rest, np.where(fit > 0.0, fit, 1.0))  # in the order of the names


def size_columns(sizes: Sizes) -> dict[str, Floats]:
    """Values of attributes, (n,) and (n, 3), by their names, from recorded sizes."""
    numbers = sizes.height, sizes.diameter, sizes.width, sizes.base, sizes.dead
    pairs = {OFFSET: sizes.offset, FIT: sizes.fit}
    return dict(zip(NUMBERS, numbers, strict=True)) | {n: np.pad(of, ((0, 0), (0, 1))) for n, of in pairs.items()}


def read_records(obj: Object, parts: Sequence[Points]) -> History | None:
    """Which records the points of a field are; None where they are plants.

    Raises
    ------
    SceneError
        As `read_sizes`; years of a plant that do not ascend; years without numbers of plants.
    """
    if not any(YEAR in part.attributes for part in parts):
        return None
    if not all(name in part.attributes for part in parts for name in (YEAR, PLANT)):
        raise SceneError(f'"{obj.name}": a field with {YEAR} requires {PLANT} too; add it, or rename {YEAR}')
    year = joined([_values(obj, part, YEAR) for part in parts], (0,))
    plant = joined([_values(obj, part, PLANT) for part in parts], (0,))
    refuse(obj, ~(np.abs(year) <= 1e6), f"{YEAR} that is not a year")
    same = np.append(False, plant[1:] == plant[:-1])[: len(plant)]
    back = same & np.append(False, year[1:] <= year[:-1])[: len(plant)]
    refuse(obj, back, f"{YEAR} that is not after that of the record before, of the same plant")
    return History(year, np.maximum.accumulate(np.where(same, 0, np.arange(len(plant)))))


def in_year(
    points: FieldPoints, sizes: Sizes | None, records: History, now: float, smooth: bool
) -> tuple[FieldPoints, Sizes | None]:
    """The plants that are there in a year, between their records.

    Positions and sizes go evenly from record to record. A trunk that falls between two records stands until the second.
    """
    a, b, part = records.chosen(now)
    scale = points.scale[:, a] + part * (points.scale[:, b] - points.scale[:, a])
    position, rotation = _between(points.position, a, b, part), _turned(points.rotation, a, b, part)
    age = None if points.age is None else _between(points.age, a, b, part)
    chosen = FieldPoints(points.kinds, position, rotation, scale, points.species[a], points.seed[a], age)
    if sizes is None:
        return chosen, None
    names = {column.name for column in fields(sizes)} - {"plant", "lives"}
    columns = {name: _between(getattr(sizes, name), a, b, part) for name in names}
    for name in ("height", "diameter", "width"):  # what is known of one of them only holds for both
        one, other = getattr(sizes, name)[a], getattr(sizes, name)[b]
        columns[name] = np.where((one > 0.0) & (other > 0.0), columns[name], np.maximum(one, other))
    left = (1.0 - part) * (records.year[b] - records.year[a])
    columns["dead"] = np.where(sizes.dead[b] > 0.0, np.maximum(sizes.dead[b] - left, 0.0), sizes.dead[a])
    if smooth:
        columns["plant"] = records.first[a]
        measures = sizes.height, sizes.width, sizes.base, sizes.dead
        columns["lives"] = Lives(now, records.year, *measures, records.first, points.species)
    return chosen, Sizes(**columns)


def _between(values: NDArray, a: Integers, b: Integers, part: Floats) -> NDArray:
    one, other = values[a], values[b]
    return one + part.reshape(-1, *[1] * (values.ndim - 1)) * (other - one)


def _turned(rotation: NDArray, a: Integers, b: Integers, part: Floats) -> NDArray:
    """Rotations (3, 3, m) between those of records; those before where a trunk falls."""
    one, other = rotation[:, :, a], rotation[:, :, b]
    leans = np.flatnonzero(((one[:, 2] * other[:, 2]).sum(axis=0) > _STEADY) & (one != other).any(axis=(0, 1)))
    if len(leans):
        mixed = one[:, :, leans] + part[leans] * (other[:, :, leans] - one[:, :, leans])
        z = mixed[:, 2] / np.linalg.norm(mixed[:, 2], axis=0)
        x = mixed[:, 0] - z * (z * mixed[:, 0]).sum(axis=0)
        x /= np.maximum(np.linalg.norm(x, axis=0), 1e-9)
        one = one.copy()
        one[:, :, leans] = np.stack([x, np.cross(z, x, axis=0), z], axis=1)
    return one


def _values(obj: Object, points: Points, name: str) -> Floats:
    """An attribute in double precision; 0 where it is absent."""
    size, vector = point_count(points), SIZE_ATTRIBUTES[name] == 'FLOAT_VECTOR'
    attribute = _attribute(obj, points, name, {'FLOAT_VECTOR'} if vector else {'FLOAT', 'INT'})
    return np.zeros((size, 3) if vector else size) if attribute is None else values_of(attribute).astype(np.float64)


def field_kinds(obj: Object) -> tuple[str, ...]:
    """Kinds of plants that the attribute ``species`` of a field is an index into; at least one."""
    return tuple(kind_of_choice(entry) for entry in obj.tetflora.field_species) or (kind_of(obj),)


def fields_of(objects: Iterable[Object]) -> list[Object]:
    """Those of the objects that are fields."""
    return [o for o in objects if o.tetflora.is_field]


def stored_size(obj: Object) -> int:
    """Number of points that a field stores, before modifiers; cheap."""
    return point_count(obj.data) if isinstance(obj.data, Points) else 0


def read_field(obj: Object, depsgraph: Depsgraph, matrices: Floats) -> Seeds:
    """Plants of a field as `read_aged_field`, without their ages and sizes."""
    return read_aged_field(obj, depsgraph, matrices)[0]


def read_aged_field(
    obj: Object, depsgraph: Depsgraph, matrices: Floats, keys: Keys | None = None, geometry: GeometrySet | None = None
) -> tuple[Seeds, Floats | None, Sizes | None]:
    """Plants of a field, once for each of its places.

    Transforms of points count as those of plants that are objects; where a height is recorded, without their scale.

    Returns
    -------
    Seeds
    ages : (n,) float64 or None
        Years; None where all are full-grown.
    sizes : Sizes or None
        None where none is recorded.

    Parameters
    ----------
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
    points, sizes = _read(obj, depsgraph, geometry)
    kinds, position, rotation, own_scale = points.kinds, points.position, points.rotation, points.scale
    matrices = matrices.astype(np.float64)  # single precision in some versions of Blender
    world = matrices[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):  # what is no number is refused below
        # A library for matrices takes twenty times as long for a million of three numbers.
        place = (np.einsum("kij,nj->kni", world, position) + matrices[:, None, :3, 3]).reshape(-1, 3)
        frame, scale, sound = placed_frames(world, rotation, own_scale)
        sound &= np.isfinite(place.sum(axis=1))
    odd = "zero scale, a scale above 100,000, or an invalid position or rotation"
    refuse(obj, ~sound.reshape(len(matrices), -1).all(axis=0), odd)
    species = np.tile(points.species.astype(np.int32), len(matrices))
    ages = None if points.age is None else np.tile(points.age, len(matrices))
    seeds = Seeds(kinds, species, points.seeds(keys), place, frame, scale)
    return seeds, ages, None if sizes is None else _placed_sizes(sizes, world)


def stored_points(obj: Object, depsgraph: Depsgraph) -> dict[str, tuple[str, NDArray]]:
    """Attributes of the points of a field by name, each with its type and values, as they come from its modifiers.

    Only those by which points are plants; a field made of these, with the same matrix, has the same plants bit by bit.
    Empty for histories, of which one year is shown, and where a mesh and a point cloud hold points together.
    """
    held = geometry_of(obj, depsgraph)  # it owns its parts
    parts = parts_of(obj, depsgraph, held)
    if len(parts) != 1 or read_records(obj, parts) is not None:
        return {}
    names = {prefix + name for name in (*FIELD_ATTRIBUTES, "id", AGE) for prefix in ("", PREFIX)}
    attributes = {a.name: a for a in parts[0].attributes if a.name in {"position", *names, *SIZE_ATTRIBUTES}}
    return {name: (a.data_type, values_of(a)) for name, a in attributes.items() if a.domain == 'POINT'}


def _placed_sizes(sizes: Sizes, world: Floats) -> Sizes:
    """Sizes of the plants of a field in all of its places (k, 3, 3); offsets of crowns turn with the field."""
    out = sizes.take(np.tile(np.arange(len(sizes)), len(world)))
    turn = np.repeat(np.arctan2(world[:, 1, 0], world[:, 0, 0]), len(sizes))
    east, north = out.offset.T
    turned = np.stack([np.cos(turn) * east - np.sin(turn) * north, np.sin(turn) * east + np.cos(turn) * north], axis=1)
    return replace(out, offset=np.where(turn[:, None] == 0.0, out.offset, turned))


def read_field_matrices(
    obj: Object,
    depsgraph: Depsgraph,
    matrices: Floats,
    wanted: Container[str],
    keys: Keys | None = None,
    geometry: GeometrySet | None = None,
) -> Iterator[tuple[str, Integers, Floats]]:
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
    points, sizes = _read(obj, depsgraph, geometry)
    seeds = points.seeds(keys).reshape(-1, len(points.species))
    seeds = np.broadcast_to(seeds, (len(matrices), seeds.shape[1]))
    for number, kind in enumerate(kinds):
        plants = np.flatnonzero(points.species == number)
        if species_of(kind) not in wanted or not len(plants):
            continue
        local = np.zeros((len(plants), 4, 4))
        stretch = points.scale[:, plants] * (1.0 if sizes is None else _stretch(kind, sizes.take(plants)))
        local[:, :3, :3] = np.moveaxis(points.rotation[:, :, plants] * stretch, 2, 0)
        local[:, :3, 3], local[:, 3, 3] = points.position[plants], 1.0
        placed = matrices.astype(np.float64)[:, None] @ local
        bad = np.zeros(len(points.species), bool)
        bad[plants] = ~np.isfinite(placed).all(axis=(0, 2, 3))
        refuse(obj, bad, "an invalid position or rotation")
        yield kind, seeds[:, plants].reshape(-1), placed.reshape(-1, 4, 4)


def _stretch(kind: str, sizes: Sizes) -> Floats:
    """Scales along their axes (3, n) with which assets have their recorded sizes; 1 where there are none."""
    asset, known = find_asset(None, species_of(kind)), sizes.height > 0.0
    if asset is None:
        return np.ones((3, len(known)))
    tall = sizes.height / asset.height
    wide = np.where(sizes.width > 0.0, sizes.width / (2.0 * asset.radius), tall)
    return np.where(known, np.stack([wide, wide, tall]), 1.0)


def _read(obj: Object, depsgraph: Depsgraph, geometry: GeometrySet | None) -> tuple[FieldPoints, Sizes | None]:
    """Points of a field that are plants, of a history those of its year, and their recorded sizes."""
    held = geometry or geometry_of(obj, depsgraph)  # it owns its parts
    if held is None and obj.evaluated_get(depsgraph).is_evaluated:
        raise SceneError(
            f'"{obj.name}" is no mesh or point cloud and cannot be a field of plants; click Stop Using as Field in '
            "Properties > Object"
        )
    parts = parts_of(obj, depsgraph, held)
    points, sizes, records = read_points(obj, field_kinds(obj), parts), read_sizes(obj, parts), read_records(obj, parts)
    if records is not None:
        refuse(obj, ~np.isfinite(points.position).all(axis=1), "an invalid position")
        smooth = obj.tetflora.stand_smooth or bool(year_curves(obj))  # stills are best without
        points, sizes = in_year(points, sizes, records, year_now(obj, depsgraph), smooth)
    if sizes is not None and (sizes.height > 0.0).any():
        points = replace(points, scale=np.where(sizes.height > 0.0, 1.0, points.scale))
    return points, sizes


def write_field(
    name: str,
    position: Floats,
    rotation: Floats,
    scale: Floats,
    species: Integers32,
    seed: Integers32,
    identifiers: Sequence[str],
    forms: Sequence[Object | None] | None = None,
    ages: NDArray[np.floating] | None = None,
) -> Object:
    """Make a field: an object with a mesh of vertices, not linked to any collection yet.

    A mesh, no point cloud: its vertices are dots in viewports, not seen in renders, and every Blender can make it.

    Parameters
    ----------
    position : (n, 3) float
        World space, meters.
    rotation : (n, 4) float
        Quaternions, w first.
    scale : (n,) float
    species : (n,) int32
        Index into ``identifiers``.
    seed : (n,) int32
    forms : sequence of objects or None, optional
        Form of each kind.
    ages : (n,) float, optional
        Years. An age that all of them have becomes that of the object.
    """
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(seed))
    origin = origin_near(position)
    write(mesh, "position", position - origin)
    columns = {"rotation": rotation, "scale": scale, "species": species, "seed": seed}
    for attribute, kind in FIELD_ATTRIBUTES.items():
        write(mesh, attribute, columns[attribute], data_type=kind)
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
        entry.species, entry.skeleton = identifier, form
    return obj
