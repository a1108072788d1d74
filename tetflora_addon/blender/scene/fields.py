# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of plants: objects whose points are plants, for numbers of plants that empties cannot handle.

A field is a mesh or point cloud whose object is marked as one. Attributes of its points define the plants, whatever
wrote them. Nothing here loops over plants.
"""

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...arrays import Floats, Integers, Integers32, Keys
from ...camera.camera import origin_near
from ...compiled.recorded_sizes import Sizes
from ...errors import SceneError
from ...growth.seeds import Seeds
from ...species.kinds import species_of
from ..attributes import values_of, write
from ..species.asset_species import find_asset
from .field_points import AGE, PREFIX, FieldPoints, parts_of, placed_frames, read_points, refuse
from .field_sizes import SIZE_ATTRIBUTES, in_year, read_records, read_sizes, year_curves, year_now
from .objects import geometry_of
from .skeletons import kind_of, kind_of_choice

#: Types of objects that can be marked as fields.
FIELD_TYPES = {'MESH', 'POINTCLOUD'}
#: Attributes of fields that TetFlora makes, with their types.
FIELD_ATTRIBUTES = {"rotation": 'QUATERNION', "scale": 'FLOAT', "species": 'INT', "seed": 'INT'}


def field_kinds(obj: bpy.types.Object) -> tuple[str, ...]:
    """Kinds of plants that the attribute ``species`` of a field is an index into; at least one."""
    return tuple(kind_of_choice(entry) for entry in obj.tetflora.field_species) or (kind_of(obj),)


def fields_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of the objects that are fields."""
    return [o for o in objects if o.tetflora.is_field]


def stored_size(obj: bpy.types.Object) -> int:
    """Number of points that a field stores, before modifiers; cheap."""
    return len(obj.data.points if obj.type == 'POINTCLOUD' else obj.data.vertices) if obj.type in FIELD_TYPES else 0


def read_field(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, matrices: Floats) -> Seeds:
    """Plants of a field as `read_aged_field`, without their ages and sizes."""
    return read_aged_field(obj, depsgraph, matrices)[0]


def read_aged_field(
    obj: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    matrices: Floats,
    keys: Keys | None = None,
    geometry: bpy.types.GeometrySet | None = None,
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
    points, sizes = _read(obj, depsgraph, geometry)
    kinds, position, rotation, own_scale = points.kinds, points.position, points.rotation, points.scale
    matrices = matrices.astype(np.float64)  # single precision in some versions of Blender
    world = matrices[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):  # what is no number is refused below
        # A library for matrices takes twenty times as long for a million of three numbers.
        place = (np.einsum("kij,nj->kni", world, position) + matrices[:, None, :3, 3]).reshape(-1, 3)
        frame, scale, sound = placed_frames(world, rotation, own_scale)
        sound &= np.isfinite(place.sum(axis=1))
    refuse(
        obj,
        ~sound.reshape(len(matrices), -1).all(axis=0),
        "zero scale, a scale above 100,000, or an invalid position or rotation",
    )
    species = np.tile(points.species.astype(np.int32), len(matrices))
    ages = None if points.age is None else np.tile(points.age, len(matrices))
    seeds = Seeds(kinds, species, points.seeds(keys), place, frame, scale)
    return seeds, ages, None if sizes is None else _placed_sizes(sizes, world)


def stored_points(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> dict[str, tuple[str, NDArray]]:
    """Attributes of the points of a field by name, each with its type and values, as they come from its modifiers.

    Only those by which points are plants; a field made of these, with the same matrix, has the same plants bit by bit.
    Empty for histories, of which one year is shown, and where a mesh and a point cloud hold points together.
    """
    held = geometry_of(obj, depsgraph)  # it owns its parts
    parts = parts_of(obj, depsgraph, held)
    if len(parts) != 1 or read_records(obj, parts) is not None:
        return {}
    names = {prefix + name for name in (*FIELD_ATTRIBUTES, "id", AGE) for prefix in ("", PREFIX)}
    found = {a.name: a for a in parts[0].attributes if a.name in {"position", *names, *SIZE_ATTRIBUTES}}
    return {name: (a.data_type, values_of(a)) for name, a in found.items() if a.domain == 'POINT'}


def _placed_sizes(sizes: Sizes, world: Floats) -> Sizes:
    """Sizes of the plants of a field in all of its places (k, 3, 3); offsets of crowns turn with the field."""
    out = sizes.take(np.tile(np.arange(len(sizes)), len(world)))
    turn = np.repeat(np.arctan2(world[:, 1, 0], world[:, 0, 0]), len(sizes))
    east, north = out.offset.T
    turned = np.stack([np.cos(turn) * east - np.sin(turn) * north, np.sin(turn) * east + np.cos(turn) * north], axis=1)
    return replace(out, offset=np.where(turn[:, None] == 0.0, out.offset, turned))


def read_field_matrices(
    obj: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    matrices: Floats,
    wanted: Container[str],
    keys: Keys | None = None,
    geometry: bpy.types.GeometrySet | None = None,
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
        own = np.flatnonzero(points.species == number)
        if species_of(kind) not in wanted or not len(own):
            continue
        local = np.zeros((len(own), 4, 4))
        stretch = points.scale[:, own] * (1.0 if sizes is None else _stretch(kind, sizes.take(own)))
        local[:, :3, :3] = np.moveaxis(points.rotation[:, :, own] * stretch, 2, 0)
        local[:, :3, 3], local[:, 3, 3] = points.position[own], 1.0
        placed = matrices.astype(np.float64)[:, None] @ local
        bad = np.zeros(len(points.species), bool)
        bad[own] = ~np.isfinite(placed).all(axis=(0, 2, 3))
        refuse(obj, bad, "an invalid position or rotation")
        yield kind, seeds[:, own].reshape(-1), placed.reshape(-1, 4, 4)


def _stretch(kind: str, sizes: Sizes) -> Floats:
    """Scales along their axes (3, n) with which assets have their recorded sizes; 1 where there are none."""
    asset, known = find_asset(None, species_of(kind)), sizes.height > 0.0
    if asset is None:
        return np.ones((3, len(known)))
    tall = sizes.height / asset.height
    wide = np.where(sizes.width > 0.0, sizes.width / (2.0 * asset.radius), tall)
    return np.where(known, np.stack([wide, wide, tall]), 1.0)


def _read(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, geometry: bpy.types.GeometrySet | None
) -> tuple[FieldPoints, Sizes | None]:
    """Points of a field that are plants, of a history those of its year, and their recorded sizes."""
    held = geometry or geometry_of(obj, depsgraph)  # it owns its parts
    if held is None and obj.evaluated_get(depsgraph).is_evaluated:
        raise SceneError(
            f'"{obj.name}" is no mesh or point cloud and cannot be a field of plants; turn off Field of Plants in the '
            "TetFlora tab of the sidebar"
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
    forms: Sequence[bpy.types.Object | None] | None = None,
    ages: NDArray[np.floating] | None = None,
) -> bpy.types.Object:
    """Make a field: an object with a mesh of vertices, not linked to any collection yet.

    A mesh rather than a point cloud: its vertices are dots in the viewport and invisible in renders, and every version
    of Blender can make it.

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
        entry.species, entry.skeleton = identifier, form
    return obj
