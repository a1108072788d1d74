# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Changing fields of plants that TetFlora made: points taken out and put in, with all that is stored with them.

Whole arrays throughout. A field whose points come from nodes, or that has edges and faces, belongs to somebody else's
modeling and is left alone.
"""

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Integers32, Mask, quaternions
from ...planting.places import new_seeds
from ..attributes import KINDS, read, values_of, write
from ..scene.field_sizes import has_history
from ..scene.fields import FIELD_ATTRIBUTES, field_kinds
from ..scene.skeletons import kind_of_choice

FIELD_MARK = "tetflora_field"  # on the objects of fields that TetFlora made and may remove

Points = dict[str, tuple[str, NDArray]]


def editable(obj: bpy.types.Object) -> bool:
    """Whether points of a field can be taken and added: it is of TetFlora's making, and still as simple."""
    return (
        bool(obj.get(FIELD_MARK))
        and obj.type == 'MESH'
        and obj.library is None
        and obj.data.library is None
        and obj.override_library is None
        and obj.mode == 'OBJECT'
        and not obj.modifiers
        and not obj.vertex_groups
        and not obj.data.edges
        and not obj.data.polygons
        and obj.data.shape_keys is None
        and not has_history(obj)
        and all(a.data_type in KINDS for a in obj.data.attributes if not a.is_internal)
        and all(a.data_type == FIELD_ATTRIBUTES.get(a.name, a.data_type) for a in obj.data.attributes)
    )


def positions(obj: bpy.types.Object) -> Floats:
    """Where the points of an editable field are in world space, (n, 3), without reading what grows there."""
    world = np.array(obj.matrix_world, dtype=np.float64)
    return read(obj.data, "position") @ world[:3, :3].T + world[:3, 3]


def take_points(obj: bpy.types.Object, keep: Mask) -> None:
    """Keep some of a field's points, (n,) bool, with all their attributes."""
    points = {name: (kind, values[keep]) for name, (kind, values) in _points(obj.data).items()}
    _write(obj, points, int(keep.sum()))


def add_points(
    obj: bpy.types.Object,
    position: Floats,
    frame: Floats,
    scale: Floats,
    kinds: Integers32,
    seed: Integers32,
    species: Sequence[str],
) -> None:
    """Add plants to a field, at the end; other attributes of theirs are zero.

    Parameters
    ----------
    obj : bpy.types.Object
        `editable`.
    position, frame, scale : (n, 3), (n, 3, 3), (n,) float64
        In world space.
    kinds : (n,) int32
        Index into ``species``.
    seed : (n,) int32
    species : sequence of str
        Identifiers; those that the field's list lacks are added to it.
    """
    numbers = np.array([_kind_number(obj, identifier) for identifier in species], np.int32)
    world = np.array(obj.matrix_world, dtype=np.float64)
    size = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    turn = np.array(obj.matrix_world.to_3x3().normalized(), dtype=np.float64)
    own = {
        "position": (position - world[:3, 3]) @ np.linalg.inv(world[:3, :3]).T,
        "rotation": quaternions(turn.T @ frame),
        "scale": np.asarray(scale) / size,
        "species": numbers[kinds],
        "seed": np.asarray(seed),
    }
    points, before = _points(obj.data), len(obj.data.vertices)
    for name, kind in FIELD_ATTRIBUTES.items():
        if name not in points:
            points[name] = (kind, np.full((before, *own[name].shape[1:]), name == "scale", KINDS[kind].dtype))
    joined: Points = {}
    for name, (kind, values) in points.items():
        new = own.get(name, np.zeros((len(seed), *values.shape[1:])))
        joined[name] = (kind, np.concatenate([values, new.astype(values.dtype)]))
    _write(obj, joined, before + len(seed))


def assign_field_species(obj: bpy.types.Object, identifier: str) -> bool:
    """Make all plants of a field belong to a species; whether that changed anything. Forms and seeds stay."""
    group = obj.tetflora
    if obj.library is not None:
        return False
    entries = list(group.field_species) or [group]
    changed = [entry for entry in entries if entry.species != identifier]
    for entry in changed:
        entry.species = identifier
    if changed and editable(obj) and obj.data.attributes.get("species"):
        _join_equal_kinds(obj)
    return bool(changed)


def reseed_field(obj: bpy.types.Object, place: int, roll: int) -> None:
    """Make other individuals of all plants of a field, by the number that joins all of their seeds."""
    group = obj.tetflora
    group.seed = int(new_seeds(np.array([group.seed + (place << 32)], np.int64), roll)[0]) or 1


def own_mesh(obj: bpy.types.Object) -> bpy.types.Mesh:
    """The mesh of a field, to be changed: a copy of its own where a linked duplicate shares it."""
    if obj.data.users > 1:
        obj.data = obj.data.copy()
    return obj.data


def _join_equal_kinds(obj: bpy.types.Object) -> None:
    """Let a field's list name each kind once."""
    entries = obj.tetflora.field_species
    kinds = [kind_of_choice(entry) for entry in entries]
    unique = list(dict.fromkeys(kinds))
    if len(unique) == len(kinds):
        return
    to = np.array([unique.index(kind) for kind in kinds], np.int32)
    attribute = own_mesh(obj).attributes["species"]
    values = values_of(attribute)
    # Numbers that the list does not have stay wrong: reading the field tells of them.
    known = (values >= 0) & (values < len(to))
    values[known] = to[values[known]]
    values[~known] += np.int32(len(kinds))
    write(obj.data, "species", values)
    for index in range(len(kinds) - 1, -1, -1):
        if kinds.index(kinds[index]) != index:
            entries.remove(index)
    obj.data.update()


def _kind_number(obj: bpy.types.Object, identifier: str) -> int:
    kinds = field_kinds(obj) if obj.tetflora.field_species else ()
    if identifier in kinds:
        return kinds.index(identifier)
    obj.tetflora.field_species.add().species = identifier
    return len(obj.tetflora.field_species) - 1


def _points(mesh: bpy.types.Mesh) -> Points:
    out: Points = {}
    for attribute in mesh.attributes:
        if attribute.domain != 'POINT' or attribute.is_internal:
            continue
        out[attribute.name] = (attribute.data_type, values_of(attribute))
    return out


def _write(obj: bpy.types.Object, points: Points, number: int) -> None:
    mesh = own_mesh(obj)
    mesh.clear_geometry()
    mesh.vertices.add(number)
    for name, (kind, values) in points.items():
        write(mesh, name, values, data_type=kind)
    mesh.update()
