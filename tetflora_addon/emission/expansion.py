# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What expanding plants takes, before it is done: the leaves and the wood that are near a camera are far finer.

A spruce three meters away has a hundred times as many polygons as the same one from afar. Branches are few beside the
polygons on them, so the nearest plants are grown to their twigs to ask each branch how fine it will be.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..compiled.placed import extents
from ..growth.branches import Branches
from ..growth.growth import WholeBranches, leaf_counts, trunks
from ..growth.seeds import Seeds
from ..leaves.levels import chosen_polygons
from ..subplants.pieces import expand
from ..subplants.tubes import tube_faces
from .leaf_detail import LeafDetail

#: Plants that are grown one and all, the nearest ones, and how many of the others tell about them.
_ALL, _SOME = 32, 16
#: Leaves count as so much shorter than they are, each by its own number, see `leaf_meshes`.
_LENGTHS = (0.75, 0.85, 0.95)


def expanded_faces(flora: Flora, seeds: Seeds, camera: Camera) -> Iterator[float]:
    """Expected polygons of all plants as `expanded_blocks` makes them for a camera.

    Yields
    ------
    float
        A number that is more with each item, of which the last one counts; who waits for a limit may stop before.
    """
    plants = trunks(flora.rows, seeds)
    total = float(flora.face_counts(plants).sum())
    yield total
    bound = extents(flora, plants)
    across = np.maximum(bound[:, 0], np.abs(bound[:, 1:3]).max(axis=1)) * plants.length
    away = np.linalg.norm(plants.position - camera.position, axis=1) - across
    order = np.argsort(away, kind="stable")
    detail = LeafDetail(flora, camera)
    for number in range(min(_ALL, len(order))):
        total += _more(flora, plants.take(order[number : number + 1]), detail)
        yield total
    rest = order[_ALL:]
    some = rest[np.linspace(0, len(rest) - 1, min(_SOME, len(rest))).round().astype(np.int64)]
    for number in range(len(some)):
        total += _more(flora, plants.take(some[number : number + 1]), detail) * len(rest) / len(some)
        yield total


def _more(flora: Flora, plants: Branches, detail: LeafDetail) -> float:
    """Polygons of plants beyond those of the models of their species."""
    return sum(
        _finer_leaves(flora, whole, detail) + _finer_wood(flora, whole, detail) for whole in expand(flora, plants)
    )


def _finer_leaves(flora: Flora, whole: WholeBranches, detail: LeafDetail) -> float:
    lengths, leaves = detail.lengths(whole), leaf_counts(flora.rows, whole.branches)
    found, near = 0.0, np.flatnonzero((lengths > 0.0) & (leaves > 0))
    species = flora.rows["species"][whole.branches.row[near]]
    for s in np.unique(species):
        own = near[species == s]
        forms = flora.forms[s][0]
        more = [chosen_polygons(f, part * lengths[own]) - f.polygons for f in forms for part in _LENGTHS]
        found += float(np.mean(more, axis=0) @ leaves[own])
    return found


def _finer_wood(flora: Flora, whole: WholeBranches, detail: LeafDetail) -> float:
    return tube_faces(flora, whole, detail.wood) - tube_faces(flora, whole)
