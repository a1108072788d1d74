# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The update step: handing contents of divided tetrahedra on to their children (paper, section 6.5).

What lies on one side of a plane goes there whole. Sub-plants that cross it are opened into the sub-plants of the next
order and the pieces of their own branch; pieces and polygons that cross are clipped. Nothing smaller than a pixel of
the alpha buffer shows in the image: what reaches beyond a plane by less than such a *slack* does not cross it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import gathered
from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..subplants.pieces import Pieces, clipped, open_subplants
from ..subplants.sides import body_distances, bounding_bodies, crossing, sampled_bodies
from ..tetrahedra.tree import TetrahedralTree
from .contents import Contents, Held, polygon_totals
from .polygons import Polygons, area_fractions

#: Metres (n,) at points (n, 3) that make no difference in the image.
Slack = Callable[[NDArray[np.float64]], NDArray[np.float64]]

#: Sub-plants that are opened, and that are lowered, at a time; bounds what that takes to some hundred megabytes.
OPENED_AT_ONCE = 40_000
LOWERED_AT_ONCE = 200_000
#: A sub-plant that reaches no further than this many slacks is known well enough by its samples.
_SMALL = 16.0
#: One whose middle is closer to a plane than this fraction of its reach crosses it, whatever its seed.
_DEEP = 0.3


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


def push_down(flora: Flora, tree: TetrahedralTree, contents: Contents, slack: Slack | None = None) -> Contents:
    """Hand contents of divided nodes on until all lie in terminal ones.

    What reaches no further than ``slack`` beyond a plane stays whole; without it everything is exact to the last leaf.
    Nothing is lost or held twice.
    """
    placed, placed_cells = [Branches.empty()], [np.zeros(0, np.int32)]
    loose, loose_cells = [contents.pieces.items], [contents.pieces.cell]
    subplants, cells = contents.subplants.items, contents.subplants.cell
    while len(subplants):
        cells, opened = _lowered(flora, tree, subplants, cells, slack)
        placed.append(subplants.take(~opened))
        placed_cells.append(cells[~opened])
        parts, part_cells = [Branches.empty()], [np.zeros(0, np.int32)]
        for chosen in _alike(flora, subplants, np.flatnonzero(opened)):
            grown, owner, pieces, piece_owner = open_subplants(flora, subplants.take(chosen))
            parts.append(grown)
            part_cells.append(cells[chosen[owner]])
            loose.append(pieces)
            loose_cells.append(cells[chosen[piece_owner]])
        subplants, cells = Branches.concatenate(parts), np.concatenate(part_cells)
    pieces, piece_cells = _push_down_pieces(tree, Pieces.concatenate(loose), np.concatenate(loose_cells), slack)
    plants = Contents.of(flora, Branches.concatenate(placed), np.concatenate(placed_cells), pieces, piece_cells)
    return replace(plants, polygons=_push_down_polygons(tree, contents.polygons, slack))


def _lowered(
    flora: Flora, tree: TetrahedralTree, subplants: Branches, cells: NDArray, slack: Slack | None
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Nodes (n,) that sub-plants come down to whole, and whether they cross the planes of these."""
    cells, crosses = cells.copy(), np.zeros(len(subplants), bool)
    order = np.argsort(subplants.row, kind="stable")  # tests run row by row
    for start in range(0, len(order), LOWERED_AT_ONCE):
        some = order[start : start + LOWERED_AT_ONCE]
        cells[some], crosses[some] = _lowered_together(flora, tree, subplants.take(some), cells[some], slack)
    return cells, crosses


def _lowered_together(
    flora: Flora, tree: TetrahedralTree, subplants: Branches, cells: NDArray, slack: Slack | None
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    crosses = np.zeros(len(subplants), bool)
    bodies = bounding_bodies(flora, subplants)
    loose = np.zeros(len(subplants)) if slack is None else slack(bodies[:3].T)
    sampled = None if slack is None else sampled_bodies(flora, subplants)
    moving = np.arange(len(subplants))
    while True:
        moving = moving[tree.children[cells[moving], 0] >= 0]
        if len(moving) == 0:
            return cells, crosses
        planes = tree.planes(cells[moving])
        distance, reach = body_distances(np.take(bodies, moving, axis=1), planes)
        side = (distance > 0).astype(np.int64)
        whole = np.abs(distance) > reach - loose[moving]
        unclear = np.flatnonzero(~whole)
        if sampled is not None and len(unclear):
            some = moving[unclear]
            middle, near = body_distances(np.take(sampled, some, axis=1), planes[unclear])
            small = reach[unclear] <= _SMALL * loose[some]
            within = small & (np.abs(middle) > near - loose[some])
            whole[unclear[within]] = True
            side[unclear[within]] = middle[within] > 0
            unclear = unclear[~small & (np.abs(middle) > _DEEP * near)]
        found, base = crossing(flora, subplants.take(moving[unclear]), planes[unclear], loose[moving[unclear]])
        whole[unclear[~found]] = True
        side[unclear] = base
        crosses[moving[~whole]] = True
        moving, side = moving[whole], side[whole]
        cells[moving] = tree.children[cells[moving], side]


def _alike(flora: Flora, subplants: Branches, chosen: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Runs of sub-plants whose branches have as many segments: bending takes as long for all as for the most."""
    segments = flora.rows["segments"][subplants.row[chosen]]
    for number in np.unique(segments):
        some = chosen[segments == number]
        yield from np.split(some, np.arange(OPENED_AT_ONCE, len(some), OPENED_AT_ONCE))


def _push_down_pieces(
    tree: TetrahedralTree, pieces: Pieces, cells: NDArray, slack: Slack | None
) -> tuple[Pieces, NDArray[np.int32]]:
    placed, placed_cells = [Pieces.empty()], [np.zeros(0, np.int32)]
    while len(pieces):
        cells, cut = cells.copy(), np.zeros(len(pieces), bool)
        loose = np.zeros(len(pieces)) if slack is None else slack(pieces.start)
        from_start, from_end = np.zeros((2, len(pieces)))
        moving = np.arange(len(pieces))
        while True:
            moving = moving[tree.children[cells[moving], 0] >= 0]
            if len(moving) == 0:
                break
            plane = tree.planes(cells[moving])
            start, end = (
                np.einsum("ni,ni->n", plane[:, :3], gathered(p, moving)) + plane[:, 3]
                for p in (pieces.start, pieces.end)
            )
            whole = (start < 0) == (end < 0)
            whole |= np.minimum(np.abs(start), np.abs(end)) < loose[moving]
            crossing_ones = moving[~whole]
            cut[crossing_ones] = True
            from_start[crossing_ones], from_end[crossing_ones] = start[~whole], end[~whole]
            moving, side = moving[whole], (start[whole] + end[whole] >= 0).astype(np.int64)
            cells[moving] = tree.children[cells[moving], side]
        placed.append(pieces.take(~cut))
        placed_cells.append(cells[~cut])
        children = tree.children[cells[cut]]
        lower, upper = clipped(pieces.take(cut), from_start[cut], from_end[cut])
        first, every = (from_start[cut] >= 0).astype(np.int64), np.arange(len(children))
        pieces = Pieces.concatenate([lower, upper])
        cells = np.concatenate([children[every, first], children[every, 1 - first]])
    return Pieces.concatenate(placed), np.concatenate(placed_cells)


def _push_down_polygons(tree: TetrahedralTree, held: Held[Polygons], slack: Slack | None) -> Held[Polygons]:
    placed = [Held.none(Polygons)]
    while len(held):
        polygons, cells, crosses = held.items, held.cell.copy(), np.zeros(len(held), bool)
        for start in range(0, len(polygons), LOWERED_AT_ONCE):
            some = slice(start, start + LOWERED_AT_ONCE)
            cells[some], crosses[some] = _lowered_polygons(tree, polygons.take(some), cells[some], slack)
        placed.append(replace(held, cell=cells).take(~crosses))
        polygons, cells, width = polygons.take(crosses), cells[crosses], held.totals.width[crosses]
        loose = 0.0 if slack is None else slack(polygons.centre)
        owner, side, polygons = cut(polygons, tree.planes(cells), loose)
        held = Held(polygons, tree.children[cells[owner], side], polygon_totals(polygons, width[owner]))
    return Held.concatenate(placed)


def _lowered_polygons(
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
