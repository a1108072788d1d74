# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Clipping explicit polygons by the planes of divided tetrahedra (paper, section 6.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .polygons import Polygons, shares


def cut(
    polygons: Polygons, planes: NDArray[np.float64], slack: NDArray[np.float64] | float = 0.0
) -> tuple[NDArray[np.int64], NDArray[np.int64], Polygons]:
    """Clip polygons by a plane each.

    Parameters
    ----------
    polygons : Polygons of n
    planes : (n, 4) float64
        Signed distances are n·x + d.
    slack : (n,) float64
        Triangles that reach beyond their plane by no more than this stay whole, metres.

    Returns
    -------
    owner : (k,) int64
        Polygon that each fragment comes from.
    side : (k,) int64
        0 where the distance is negative, 1 elsewhere.
    fragments : Polygons of k
        A triangle that crosses leaves one fragment on one side and two on the other.
    """
    owner, whole = polygons.as_fragments()
    distance = whole.corner_distances(planes[owner])
    low, high = distance.min(axis=1, initial=np.inf), distance.max(axis=1, initial=-np.inf)
    loose = np.broadcast_to(slack, len(polygons))[owner]
    crosses = np.minimum(-low, high) > np.maximum(loose, whole.touching())
    stays, some = np.flatnonzero(~crosses), np.flatnonzero(crosses)
    positive = distance[some] >= 0
    # The corner that is alone on its side comes first.
    alone = np.where(positive.sum(axis=1) == 1, positive.argmax(axis=1), positive.argmin(axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    w = np.take_along_axis(whole.weights[some], turn[:, :, None], axis=1)
    d = np.take_along_axis(distance[some], turn, axis=1)
    first, second = (
        w[:, 0] + (w[:, k] - w[:, 0]) * np.clip(d[:, :1] / (d[:, :1] - d[:, k : k + 1]), 0.0, 1.0) for k in (1, 2)
    )
    made = np.concatenate(
        [
            np.stack([w[:, 0], first, second], axis=1),
            np.stack([first, w[:, 1], w[:, 2]], axis=1),
            np.stack([first, w[:, 2], second], axis=1),
        ]
    )
    sides = (d[:, 0] >= 0).astype(np.int64)
    from_, side = np.tile(some, 3), np.concatenate([sides, 1 - sides, 1 - sides])
    kept = np.flatnonzero(shares(made) > 0)  # a cut through a corner leaves pieces of no size
    made, from_, side = made[kept], from_[kept], side[kept]
    new = Polygons.fragments(polygons.meshes, whole.face[from_], whole.instance[from_], whole.triangle[from_], made)
    larger = (high[stays] >= -low[stays]).astype(np.int64)
    parts = Polygons.concatenate([whole.take(stays), new])
    return np.concatenate([owner[stays], owner[from_]]), np.concatenate([larger, side]), parts
