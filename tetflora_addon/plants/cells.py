# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parallel rays: which polygons they meet, and their ways through a lattice of tetrahedra.

The lattice is made of unit cubes, each divided into six tetrahedra around its diagonal (Kuhn, "Some combinatorial
lemmas in topology", 1960): a point is in the one that the order of its coordinates within the cube says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread

#: Planes between the tetrahedra, as whole values of these sums.
_PLANES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -1, 0], [0, 1, -1], [1, 0, -1]], dtype=np.float64)
# Number of the tetrahedron by (x > y) + 2 (y > z) + 4 (x > z); two of the eight do not occur.
_NUMBER = np.array([0, 1, 2, 0, 0, 3, 4, 5])


def basis(direction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit vectors across a unit vector (3,), and across one another."""
    helper = np.eye(3)[2] if abs(direction[2]) < 0.9 else np.eye(3)[0]
    u = np.cross(helper, direction)
    u /= np.linalg.norm(u)
    return u, np.cross(direction, u)


def covered(
    corners: NDArray[np.float64], first: NDArray[np.integer], number: NDArray[np.integer]
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Points of whole coordinates that flat polygons cover, by the even-odd rule.

    Parameters
    ----------
    corners : (c, 2) float64
        Polygon after polygon, each in order.
    first, number : (f,) int
        First corner of each polygon, and how many it has.

    Returns
    -------
    polygon : (m,) int
    point : (m, 2) int64
    """
    if len(first) == 0:
        return np.zeros(0, np.intp), np.zeros((0, 2), np.int64)
    x, y = np.ascontiguousarray(corners.T)
    low = [np.ceil(np.minimum.reduceat(axis, first)).astype(np.int64) for axis in (x, y)]
    sizes = [
        np.maximum(np.floor(np.maximum.reduceat(axis, first)).astype(np.int64) - start + 1, 0)
        for axis, start in zip((x, y), low, strict=True)
    ]
    polygon, step = spread(sizes[0] * sizes[1])
    across = sizes[1][polygon]
    point = np.stack([low[0][polygon] + step // across, low[1][polygon] + step % across], axis=1)
    pair, corner = spread(number[polygon])
    start, count = first[polygon][pair], number[polygon][pair]
    here, there = start + corner, start + (corner + 1) % count
    px, py = point[pair].T
    ax, ay, bx, by = x[here] - px, y[here] - py, x[there] - px, y[there] - py
    crosses = np.flatnonzero((ay > 0) != (by > 0))
    ax, ay, bx, by = ax[crosses], ay[crosses], bx[crosses], by[crosses]
    right = ax - (bx - ax) * ay / (by - ay) > 0
    inside = np.bincount(pair[crosses], right, len(polygon)).astype(np.int64) % 2 == 1
    return polygon[inside], point[inside]


def cell_numbers(points: Sequence[NDArray[np.float64]], shape: NDArray[np.int64]) -> NDArray[np.int64]:
    """Tetrahedron (n,) of 6 × x × y × z that each point (3, n) is in; those beside the lattice are moved into it."""
    cube = [np.clip(along.astype(np.int64), 0, most - 1) for along, most in zip(points, shape, strict=True)]
    x, y, z = (along - low for along, low in zip(points, cube, strict=True))
    kind = _NUMBER[(x > y) + 2 * (y > z) + 4 * (x > z)]
    return ((cube[0] * shape[1] + cube[1]) * shape[2] + cube[2]) * 6 + kind


def path_lengths(
    origin: NDArray[np.float64], direction: NDArray[np.float64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Ways of parallel rays through the tetrahedra of a lattice.

    Parameters
    ----------
    origin : (n, 3) float64
        In units of the lattice's cubes.
    direction : (3,) float64
        Unit vector.
    shape : (3,) int64
        Cubes along each axis.

    Returns
    -------
    ray, cell : (m,) int64
    length : (m,) float64
        In the same units.
    """
    steep = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    ends = np.sort(np.stack([-origin / steep, (shape - origin) / steep]), axis=0)
    enter, leave = ends[0].max(axis=1), ends[1].min(axis=1)
    inside = np.flatnonzero(leave > enter)
    enter, leave, origin = enter[inside], leave[inside], origin[inside]
    every = np.arange(len(inside))
    ray, at = [every, every], [enter, leave]
    for plane in _PLANES:
        start, slope = origin @ plane, float(steep @ plane)
        if abs(slope) < 1e-9:
            continue
        reach = np.sort(np.stack([start + slope * enter, start + slope * leave]), axis=0)
        low = np.ceil(reach[0])
        owner, step = spread(np.maximum(np.floor(reach[1]) - low + 1, 0).astype(np.int64))
        ray.append(owner)
        at.append((low[owner] + step - start[owner]) / slope)
    ray, at = np.concatenate(ray), np.concatenate(at)
    order = np.lexsort([at, ray])
    ray, at = ray[order], at[order]
    part = np.flatnonzero((ray[1:] == ray[:-1]) & (at[1:] > at[:-1]))
    ray, length, middle = ray[part], at[part + 1] - at[part], (at[part] + at[part + 1]) / 2
    points = [np.take(origin[:, k], ray) + steep[k] * middle for k in range(3)]
    cell = cell_numbers(points, shape)
    return inside[ray], cell, length
