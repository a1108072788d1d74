# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves of assets as kites: what is drawn for a leaf of very few pixels, as for those of species (`leaves.kites`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, unit
from ..buffers import MeshBuffers
from ..growth.hashing import key_of_seed, uniform
from .asset import AssetKites

#: Standard deviations along an ellipse's diameter, and the narrowest and the widest kite, of its length.
_DIAMETER, _NARROW, _WIDE = 4.0, 0.02, 1.5
#: Draw of the face in whose plane a kite lies.
_PLANE = 248


def kites_of(
    corners: Floats,
    optical: Floats,
    normal: Floats,
    color: NDArray[np.floating],
    transmission: NDArray[np.floating],
    roughness: NDArray[np.floating],
    first: Integers,
    number: Integers,
) -> AssetKites:
    """Kites for leaves that are runs of triangles.

    Parameters
    ----------
    corners : (t, 3, 3) float64
    optical : (t,) float64
        Area that each blocks, m².
    normal : (t, 3) float64
        Unit vectors.
    color, transmission, roughness : (t, 3), (t,), (t,) float
    first : (l,) int
        First triangle of each leaf, ascending from 0 on.
    number : (l,) int
        Of each leaf, from which the choice of its plane follows.
    """
    area = np.add.reduceat(optical, first)
    whole = np.maximum(area, 1e-300)[:, None]
    middle = corners.mean(axis=1)
    counted = np.maximum(optical, 1e-200)[:, None]  # leaves of no area are somewhere, too
    center = np.add.reduceat(counted * middle, first, axis=0) / np.add.reduceat(counted, first, axis=0)
    leaf = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(optical))))
    # Second moments of triangles: a twelfth of the sum over corners, and nine twelfths of the middle.
    away = np.concatenate([corners, np.sqrt(9.0) * middle[:, None]], axis=1)
    away[:, :3] -= center[leaf][:, None]
    away[:, 3] -= 3.0 * center[leaf]
    spread = np.zeros((len(first), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            own = (away[:, :, i] * away[:, :, j]).sum(axis=1) / 12.0
            spread[:, i, j] = spread[:, j, i] = np.add.reduceat(optical * own, first) / whole[:, 0]
    values, vectors = np.linalg.eigh(spread)
    done = np.cumsum(optical)
    at = (done - optical)[first] + uniform(key_of_seed(number), _PLANE) * area
    last = np.append(first[1:], len(optical)) - 1
    pick = np.clip(np.searchsorted(done, at, side="right"), first, last)
    plane, long = normal[pick], vectors[:, :, 2]
    along = long - np.einsum("ni,ni->n", long, plane)[:, None] * plane
    flat = np.linalg.norm(along, axis=1) < 0.1  # a face across the leaf, as of its rim: any direction will do
    along[flat] = vectors[flat, :, 1] - np.einsum("ni,ni->n", vectors[flat, :, 1], plane[flat])[:, None] * plane[flat]
    along = unit(along)
    length = _DIAMETER * np.sqrt(np.maximum(values[:, 2], 0.0))
    side = np.sqrt(area)
    length = np.clip(length, side * np.sqrt(2.0 / _WIDE), side * np.sqrt(2.0 / _NARROW))
    width = 2.0 * area / np.maximum(length, 1e-300)
    mean = np.add.reduceat(optical[:, None] * color, first, axis=0) / whole
    through, rough = (np.add.reduceat(optical * own, first) / whole[:, 0] for own in (transmission, roughness))
    along, across = length[:, None] / 2 * along, width[:, None] / 2 * np.cross(plane, along)
    return AssetKites.typed(center, along, across, mean, through, rough)


def kite_mesh(leaves: AssetKites) -> MeshBuffers:
    """Kites (l,) as a mesh with the attributes that the material of proxies reads."""
    count = len(leaves)
    points = [leaves.center - leaves.along, leaves.center - leaves.across]
    points += [leaves.center + leaves.along, leaves.center + leaves.across]
    every = np.arange(4 * count, dtype=np.int32).reshape(count, 4)
    return MeshBuffers(
        positions=np.stack(points, axis=1).reshape(-1, 3),
        edge_verts=np.stack([every, np.roll(every, -1, axis=1)], axis=2).reshape(-1, 2),
        corner_verts=every.ravel(),
        corner_edges=every.ravel().copy(),
        face_offsets=np.arange(count + 1, dtype=np.int32) * np.int32(4),
        attributes={
            "tf_color": ("FACE", leaves.color.astype(np.float32)),
            "tf_transmission": ("FACE", leaves.transmission.astype(np.float32)),
            "tf_roughness": ("FACE", leaves.roughness.astype(np.float32)),
        },
    )
