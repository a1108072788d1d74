# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The update step of polygons: those of divided tetrahedra are handed on to the children (paper, section 6.5).

What lies on one side of a plane goes there whole, polygons that cross it are clipped. Nothing smaller than a pixel of
the alpha buffer shows in the image: what reaches beyond a plane by less than such a *slack* does not cross it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..subplants.pieces import chunks
from ..tetrahedra.tree import TetrahedralTree
from .contents import Held, polygon_totals
from .polygons import Polygons, area_fractions

#: Metres (n,) at points (n, 3) that make no difference in the image.
Slack = Callable[[NDArray[np.float64]], NDArray[np.float64]]

#: Triangles of polygons that are lowered at a time; bounds what that takes to some hundred megabytes.
LOWERED_AT_ONCE = 200_000


def cut(
    polygons: Polygons, planes: NDArray[np.float64], slack: NDArray[np.float64] | float = 0.0
) -> tuple[NDArray[np.int64], NDArray[np.int64], Polygons]:
    """Clip polygons (n,) by a plane (n, 4) each.

    Triangles that reach beyond their plane by no more than ``slack`` (n,), in metres, stay whole.

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
    kept = np.flatnonzero(area_fractions(made) > 0)  # a cut through a corner leaves pieces of no size
    made, from_, side = made[kept], from_[kept], side[kept]
    new = Polygons.fragments(polygons.meshes, whole.face[from_], whole.instance[from_], whole.triangle[from_], made)
    larger = (high[stays] >= -low[stays]).astype(np.int64)
    parts = Polygons.concatenate([whole.take(stays), new])
    return np.concatenate([owner[stays], owner[from_]]), np.concatenate([larger, side]), parts


def push_down(tree: TetrahedralTree, held: Held[Polygons], slack: Slack | None = None) -> Held[Polygons]:
    """Hand polygons of divided nodes on until all lie in terminal ones.

    What reaches no further than ``slack`` beyond a plane stays whole. Nothing is lost or held twice.
    """
    placed = [Held.none(Polygons)]
    while len(held):
        polygons, cells, crosses = held.items, held.cell.copy(), np.zeros(len(held), bool)
        for some in chunks(polygons.triangle_counts, LOWERED_AT_ONCE):
            cells[some], crosses[some] = _lowered(tree, polygons.take(some), cells[some], slack)
        placed.append(replace(held, cell=cells).take(~crosses))
        polygons, cells, width = polygons.take(crosses), cells[crosses], held.totals.width[crosses]
        loose = 0.0 if slack is None else slack(polygons.centre)
        owner, side, polygons = cut(polygons, tree.planes(cells), loose)
        held = Held(polygons, tree.children[cells[owner], side], polygon_totals(polygons, width[owner]))
    return Held.concatenate(placed)


def _lowered(
    tree: TetrahedralTree, polygons: Polygons, cells: NDArray, slack: Slack | None
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Nodes (n,) that polygons come down to whole, and whether they cross the planes of these."""
    cells, crosses = cells.copy(), np.zeros(len(polygons), bool)
    centre, reach, touching = polygons.centre, polygons.reach, polygons.touching()
    moving = np.flatnonzero(tree.children[cells, 0] >= 0)
    while len(moving):
        planes = tree.planes(cells[moving])
        distance = np.einsum("ni,ni->n", np.take(centre, moving, axis=0), planes[:, :3]) + planes[:, 3]
        whole = np.abs(distance) > np.take(reach, moving)
        # The sphere is a first guess; slack and corners are computed only for what it leaves open.
        unclear = np.flatnonzero(~whole)
        some = moving[unclear]
        loose = touching[some] if slack is None else np.maximum(touching[some], slack(centre[some]))
        whole[unclear] = np.abs(distance[unclear]) > reach[some] - loose
        left = np.flatnonzero(~whole[unclear])
        if len(left):
            low, high = polygons.take(some[left]).distances(planes[unclear[left]])
            whole[unclear[left]] = np.minimum(-low, high) <= loose[left]
            distance[unclear[left]] = high + low  # the larger part says where it goes
        crosses[moving[~whole]] = True
        moving, side = moving[whole], (distance[whole] >= 0).astype(np.int64)
        cells[moving] = at = tree.children[cells[moving], side]
        moving = moving[tree.children[at, 0] >= 0]
    return cells, crosses
