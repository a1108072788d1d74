# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plants and fields of plants stand as instances: of collections, and of what geometry nodes make.

Blender lists instances one by one (``Depsgraph.object_instances``). Here each thing that is instanced is visited once,
and all of its places are worked out at once as arrays, so that a million instances cost what their numbers do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from zlib import crc32

import bpy
import numpy as np
from numpy.typing import NDArray

from ..plants.hashing import child_key, key_of_seed
from .attributes import read, values_of
from .transforms import world_matrix
from .view_layers import has_nodes

_ONE_BY_ONE = {'VERTS', 'FACES'}  # ways to instance whose places only Blender knows


@dataclass(frozen=True)
class Copies:
    """All places of one plant or field within one instancer.

    Attributes
    ----------
    owner : bpy.types.Object
        The original object that is a plant or a field.
    geometry : bpy.types.GeometrySet or None
        None for the object itself; else geometry that its nodes instance, which counts for fields only.
    matrices : (n, 4, 4) float64
        To world space.
    keys : (n,) uint64
        Tell individuals apart.
    """

    owner: bpy.types.Object
    geometry: bpy.types.GeometrySet | None
    matrices: NDArray[np.float64]
    keys: NDArray[np.uint64]


class _OneByOne(Exception):
    """Something is instanced in a way that has no arrays."""


def copies_of(objects: Sequence[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> list[Copies]:
    """Places of all plants and fields that some objects instance, the objects themselves not included.

    Individuals are told apart by the instancer's name and by the ``id`` of the instance, which is its number where
    nodes set none, so that they stay the same while an animation goes on.

    Parameters
    ----------
    objects : sequence of bpy.types.Object
        Original objects that render, in an order that does not change.
    """
    found: list[Copies] = []
    left: set[bpy.types.Object] = set()
    groups: dict[bpy.types.Collection, list[bpy.types.Object]] = {}
    for obj in objects:
        if obj.instance_type in _ONE_BY_ONE or len(obj.particle_systems):
            left.add(obj)
        elif obj.instance_type == 'COLLECTION' and obj.instance_collection is not None:
            groups.setdefault(obj.instance_collection, []).append(obj)
        elif has_nodes(obj):
            try:
                walk = _Walk(depsgraph)
                walk.nodes(obj, world_matrix(obj, depsgraph)[None].astype(np.float64), _name_keys([obj]))
                found += walk.found
            except _OneByOne:
                left.add(obj)
    for collection, instancers in groups.items():
        try:
            walk = _Walk(depsgraph)
            matrices = np.array([world_matrix(obj, depsgraph) for obj in instancers], dtype=np.float64)
            walk.collection(collection, matrices, _name_keys(instancers))
            found += walk.found
        except _OneByOne:
            left.update(instancers)
    return found + (list(_one_by_one(left, depsgraph)) if left else [])


def geometry_of(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.GeometrySet | None:
    """What an object evaluates to; None if the dependency graph does not hold it (switched off in viewports)."""
    evaluated = obj.evaluated_get(depsgraph)
    return evaluated.evaluated_geometry() if evaluated.is_evaluated else None


def rendered_objects(collection: bpy.types.Collection) -> Iterator[bpy.types.Object]:
    """Objects of a collection, and of those in it, that are not hidden in renders."""
    waiting, seen = [collection], set()
    while waiting:
        inner = waiting.pop()
        if inner.hide_render:
            continue
        waiting += list(inner.children)
        for obj in inner.objects:
            if not obj.hide_render and (pointer := obj.as_pointer()) not in seen:
                seen.add(pointer)
                yield obj


class _Walk:
    """Follows references down to plants and fields, with all places at once."""

    def __init__(self, depsgraph: bpy.types.Depsgraph) -> None:
        self.depsgraph = depsgraph
        self.found: list[Copies] = []

    def object(self, obj: bpy.types.Object, matrices: NDArray[np.float64], keys: NDArray[np.uint64]) -> None:
        group = obj.tetflora
        if obj.hide_render:
            return
        if group.is_plant or group.is_field:
            self.found.append(Copies(obj, None, matrices, keys))
        if obj.instance_type in _ONE_BY_ONE or len(obj.particle_systems):
            raise _OneByOne
        if obj.instance_type == 'COLLECTION' and obj.instance_collection is not None:
            self.collection(obj.instance_collection, matrices, keys)
        if has_nodes(obj):
            self.nodes(obj, matrices, keys)

    def collection(self, collection: bpy.types.Collection, matrices: NDArray, keys: NDArray[np.uint64]) -> None:
        back = np.eye(4)
        back[:3, 3] = -np.array(collection.instance_offset)
        for n, obj in enumerate(sorted(rendered_objects(collection), key=lambda o: o.name_full)):
            self.object(obj, matrices @ (back @ world_matrix(obj, self.depsgraph)), child_key(keys, n))

    def nodes(self, obj: bpy.types.Object, matrices: NDArray[np.float64], keys: NDArray[np.uint64]) -> None:
        geometry = geometry_of(obj, self.depsgraph)
        if geometry is not None:
            self._instances(obj, geometry, matrices, keys)

    def _instances(self, owner, geometry: bpy.types.GeometrySet, matrices: NDArray, keys: NDArray[np.uint64]) -> None:
        points = geometry.instances_pointcloud()
        if points is None or not len(points.points):
            return
        references = geometry.instance_references()
        reference, transform, number = _read_instances(points)
        order = np.argsort(reference, kind="stable")
        bounds = np.searchsorted(reference[order], np.arange(len(references) + 1))
        for target, (start, end) in zip(references, pairwise(bounds), strict=True):
            if target is None or start == end:
                continue
            rows = order[start:end]
            # Columns one after the other: a single product for each place, not one for each instance.
            columns = transform[rows].reshape(-1, 4) @ matrices.transpose(0, 2, 1)
            places = columns.reshape(-1, 4, 4).transpose(0, 2, 1)
            names = child_key(keys[:, None], number[rows]).reshape(-1)
            if isinstance(target, bpy.types.Object):
                self.object(target.original, places, names)
            elif isinstance(target, bpy.types.Collection):
                # Of evaluated collections the objects are evaluated, too; the walk wants originals throughout.
                self.collection(target.original, places, names)
            else:
                if owner.tetflora.is_field:
                    self.found.append(Copies(owner, target, places, names))
                self._instances(owner, target, places, names)


def _read_instances(points: bpy.types.PointCloud) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int64]]:
    """Reference, columns of the transform (n, 4, 4) and identifier of each instance."""
    transform = read(points, "instance_transform").reshape(-1, 4, 4).astype(np.float64)
    own = points.attributes.get("id")
    known = own is not None and own.data_type == 'INT'
    return (
        read(points, ".reference_index"),
        transform,
        values_of(own).astype(np.int64) if known else np.arange(len(transform)),
    )


def _one_by_one(instancers: set[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> Iterator[Copies]:
    """Instances on vertices and faces, and of particles: Blender's own list is the only one that has them."""
    for instance in depsgraph.object_instances:
        if instance.is_instance and instance.show_self and instance.parent.original in instancers:
            obj, original = instance.object, instance.object.original
            group = original.tetflora
            # Parts of an object that are of another type come once more, as objects of that type.
            if (group.is_plant or group.is_field) and not original.hide_render and obj.type == original.type:
                key = key_of_seed(np.array([instance.random_id]))
                yield Copies(original, None, np.array(instance.matrix_world, dtype=np.float64)[None], key)


def _name_keys(objects: Sequence[bpy.types.Object]) -> NDArray[np.uint64]:
    return key_of_seed(np.array([crc32(obj.name_full.encode()) for obj in objects]))
