# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What expanding plants takes, before it is done: the leaves and the wood that are near a camera are far finer.

A spruce three meters away has a hundred times as many polygons as the same one from afar. Branches are few beside the
polygons on them, so the nearest plants are grown to their twigs to ask each branch how fine it will be.
"""

from collections.abc import Iterator

import numpy as np

from ..arrays import Floats
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..compiled.placed import extents
from ..growth.growth import WholeBranches, leaf_counts, trunks
from ..growth.seeds import Branches, Seeds
from ..leaves.levels import chosen_polygons
from ..subplants.pieces import expand
from ..subplants.tubes import tube_faces
from .leaf_detail import LeafDetail

#: Plants that are grown one and all, the nearest ones, and how many of the others tell about them.
_ALL, _SOME = 32, 16
#: Leaves count as so much shorter than they are, each by its own number, see `leaf_meshes`.
_LENGTHS = (0.75, 0.85, 0.95)


def coarse_faces(flora: Flora, seeds: Seeds) -> Floats:
    """Expected polygons (2,) of plants far from any camera, and the triangles that these consist of."""
    plants = trunks(flora.rows, seeds)
    every, wood = flora.face_counts(plants), flora.branch_faces(plants)
    each = np.array([sum(f.triangles for f in own[0]) / max(sum(f.polygons for f in own[0]), 1) for own in flora.forms])
    triangles = 2.0 * wood + (every - wood) * each[flora.species_of(plants.row)]
    return np.array([every.sum(), triangles.sum()])


def expanded_faces(flora: Flora, seeds: Seeds, camera: Camera) -> Iterator[Floats]:
    """Expected polygons (2,) of all plants as `expanded_blocks` makes them for a camera, and triangles.

    Yields
    ------
    (2,) float64
        Numbers that are more with each item, of which the last ones count; who waits for a limit may stop before.
    """
    plants, total = trunks(flora.rows, seeds), coarse_faces(flora, seeds)
    yield total
    bound = extents(flora, plants)
    across = np.maximum(bound[:, 0], np.abs(bound[:, 1:3]).max(axis=1)) * plants.length
    away = np.linalg.norm(plants.position - camera.position, axis=1) - across
    order = np.argsort(away, kind="stable")
    detail = LeafDetail(flora, camera)
    for number in range(min(_ALL, len(order))):
        total = total + _more(flora, plants.take(order[number : number + 1]), detail)
        yield total
    rest = order[_ALL:]
    some = rest[np.linspace(0, len(rest) - 1, min(_SOME, len(rest))).round().astype(np.int64)]
    for number in range(len(some)):
        total = total + _more(flora, plants.take(some[number : number + 1]), detail) * len(rest) / len(some)
        yield total


def _more(flora: Flora, plants: Branches, detail: LeafDetail) -> Floats:
    """Polygons and triangles (2,) of plants beyond those of the models of their species."""
    found = np.zeros(2)
    for whole in expand(flora, plants):
        found += _finer_leaves(flora, whole, detail) + _finer_wood(flora, whole, detail) * np.array([1.0, 2.0])
    return found


def _finer_leaves(flora: Flora, whole: WholeBranches, detail: LeafDetail) -> Floats:
    lengths, leaves = detail.lengths(whole), leaf_counts(flora.rows, whole.branches)
    found, near = np.zeros(2), np.flatnonzero((lengths > 0.0) & (leaves > 0))
    species = flora.rows["species"][whole.branches.row[near]]
    for s in np.unique(species):
        own = near[species == s]
        forms = flora.forms[s][0]
        each = [chosen_polygons(f, part * lengths[own]) for f in forms for part in _LENGTHS]
        plain = np.mean([(f.polygons, f.triangles) for f in forms], axis=0)
        found += (np.mean(each, axis=0) - plain[:, None]) @ leaves[own]
    return found


def _finer_wood(flora: Flora, whole: WholeBranches, detail: LeafDetail) -> float:
    return tube_faces(flora, whole, detail.wood) - tube_faces(flora, whole)
