# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors and frames of many things, laid out so that numpy is fast with them.

Shapes are (n, 3) and (n, 3, 3) everywhere, but memory holds one component of all n after the other. Arithmetic on such
arrays runs along n without strides, and its results keep the layout; only indexing and stacking have to take care of
it, which is done here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def by_component(array: NDArray) -> NDArray:
    """The same values (n, ...), with memory laid out component by component."""
    by = np.ascontiguousarray(array.transpose(*range(1, array.ndim), 0))  # np.moveaxis would take longer
    return by.transpose(-1, *range(array.ndim - 1))


def columns(x: NDArray, y: NDArray, z: NDArray) -> NDArray:
    """Frames (n, 3, 3) with columns x, y, z (n, 3)."""
    return np.stack([x.T, y.T, z.T], axis=1).transpose(2, 0, 1)


def dot(a: NDArray, b: NDArray) -> NDArray:
    """Scalar products (n, 1) of vectors (n, 3)."""
    return (a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])[:, None]


def cross(a: NDArray, b: NDArray) -> NDArray:
    """Vector products (n, 3); numpy's own shuffles axes."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ]
    ).T


def unit(a: NDArray) -> NDArray:
    """Vectors (n, 3) scaled to length 1, in the precision that they have; zero vectors stay."""
    return a / np.maximum(np.sqrt(dot(a, a)), np.finfo(a.dtype).tiny)


def perpendicular(axis: NDArray) -> NDArray:
    """A unit vector (n, 3) across each of unit vectors (n, 3), turned about it as may be."""
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    return unit(np.cross(axis, helper))
