# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of geometry as arrays: what nodes instance, and all places of it at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from zlib import crc32

import bpy
import numpy as np
from numpy.typing import NDArray

from ...growth.hashing import child_key, key_of_seed
from ..attributes import read, values_of

#: What nodes instance.
Reference = bpy.types.Object | bpy.types.Collection | bpy.types.GeometrySet

_PART = 4_096  # matrices of one product


@dataclass(frozen=True)
class Rows:
    """Instances of one reference: columns of their transforms (n, 4, 4), and their identifiers (n,)."""

    columns: NDArray[np.float32]
    number: NDArray[np.int64]

    def within(
        self, matrices: NDArray[np.float64], keys: NDArray[np.uint64]
    ) -> tuple[NDArray[np.float64], NDArray[np.uint64]]:
        """Places (k · n, 4, 4) and keys (k · n,) of the instances in each of k places with their keys."""
        many, own = len(matrices), len(self.number)
        names = child_key(keys[:, None], self.number).reshape(-1)
        if own == 1 and np.array_equal(self.columns[0], np.eye(4)):  # as nodes that bring an object make it
            return matrices, names
        places = np.zeros((many, own, 4, 4))
        # A product of two large matrices for each of the fewer, and not one of two small ones for each of the more; in
        # parts that stay in the processor's cache.
        if many <= own:
            for place, matrix in zip(places, matrices, strict=True):
                for part in _parts(own):
                    columns = self.columns[part].reshape(-1, 4).astype(np.float64) @ matrix.T
                    place[part] = columns.reshape(-1, 4, 4).transpose(0, 2, 1)
        else:
            for n, columns in enumerate(self.columns.astype(np.float64)):
                for part in _parts(many):
                    places[part, n] = (matrices[part].reshape(-1, 4) @ columns.T).reshape(-1, 4, 4)
        return places.reshape(-1, 4, 4), names


def _parts(number: int) -> Iterator[slice]:
    return (slice(first, first + _PART) for first in range(0, number, _PART))


def references_of(geometry: bpy.types.GeometrySet) -> Iterator[tuple[Reference, Rows]]:
    """What geometry instances at its first level, each with all of its instances; evaluated objects and collections."""
    points = geometry.instances_pointcloud()
    if points is None or not len(points.points):
        return
    references = geometry.instance_references()
    reference, transform, number = _read_instances(points)
    if len(references) == 1:
        if references[0] is not None:  # somebody has deleted it
            yield references[0], Rows(transform, number)
        return
    order = np.argsort(reference, kind="stable")
    bounds = np.searchsorted(reference[order], np.arange(len(references) + 1))
    for target, (start, end) in zip(references, pairwise(bounds), strict=True):
        if target is not None and start < end:
            yield target, Rows(transform[order[start:end]], number[order[start:end]])


def instanced(
    geometry: bpy.types.GeometrySet, matrices: NDArray[np.float64], keys: NDArray[np.uint64]
) -> Iterator[tuple[Reference, NDArray[np.float64], NDArray[np.uint64]]]:
    """As `references_of`, but originals, with places (k, 4, 4) and keys (k,) of all that stand in some places (n)."""
    for target, rows in references_of(geometry):
        original = target if isinstance(target, bpy.types.GeometrySet) else target.original
        yield original, *rows.within(matrices, keys)


def _read_instances(points: bpy.types.PointCloud) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.int64]]:
    """Reference, columns of the transform (n, 4, 4) and identifier of each instance."""
    transform = read(points, "instance_transform").reshape(-1, 4, 4)
    own = points.attributes.get("id")
    known = own is not None and own.data_type == 'INT'
    return (
        read(points, ".reference_index"),
        transform,
        values_of(own).astype(np.int64) if known else np.arange(len(transform)),
    )


def name_keys(objects: Sequence[bpy.types.Object]) -> NDArray[np.uint64]:
    """A key (n,) of each object, which follows from its name."""
    return key_of_seed(np.array([crc32(obj.name_full.encode()) for obj in objects]))
