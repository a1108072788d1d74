# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Buds of shoots with leaves: one over the end of each, others in the axils of leaves, always at the same places.

They belong to near wood and grow with its size in the image from nothing. Averages leave them out: of the surface of a
twig they are some hundredths, and of a crown with leaves less than a hundredth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Integers, Keys, cross, dot, spread, unit
from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..growth.foliage import leaf_keys, leaf_places, place_leaves
from ..growth.growth import WholeBranches, leaf_counts, radius_at
from ..growth.hashing import Draw, child_key, uniform
from ..growth.rows import FORK
from .rings import Rings, without_places
from .wood_detail import Fineness

#: Rings of a bud, and where they are: fractions of its length, and radii over the largest.
BUD_RINGS = 7
_ALONG = np.array([-0.08, 0.06, 0.2, 0.42, 0.68, 0.9, 1.0])
_WIDTH = np.array([0.5, 0.76, 0.96, 1.0, 0.7, 0.27, 0.0])
#: Child index of the bud at the end, of which random numbers are drawn.
_LAST = (1 << 28) + 7
#: Length of the bud at the end over that of others; variation of lengths.
_AT_END, _VARIED = 1.3, 0.25
#: How far a bud in an axil leans away from its shoot, and how deep its base is in the wood, in radii of that.
_LEAN, _SUNK = 0.62, 0.75


def bud_numbers(flora: Flora, whole: WholeBranches) -> Integers:
    """Rings (n,) of the buds of near branches."""
    owner = _places(flora, whole)[0]
    return BUD_RINGS * np.bincount(owner, minlength=len(whole))


def bud_sides(sides: int | Integers) -> Integers:
    """Sides of the buds on twigs of so many."""
    return np.clip(2 * sides, 6, 24)


def bud_rings(flora: Flora, whole: WholeBranches, fine: Fineness) -> tuple[Rings, Integers] | None:
    """Rings of the buds of near branches (n), and the branch of each bud; None without any."""
    owner, index, key = _places(flora, whole)
    if not len(owner):
        return None
    rows, branches = flora.rows, whole.branches
    number = leaf_counts(rows, branches)
    at_end = index < 0
    t = np.ones(len(owner))
    side = np.flatnonzero(~at_end)
    # Leaves are placed branch row by branch row: the same for all where there is one.
    t[side] = leaf_places(rows, branches, owner[side], index[side], number, key[side])
    some = without_places(branches, owner)
    radius = radius_at(rows, some, t)
    sort = [species.bud for species in flora.species]
    table = np.array([(0.0, 0.0) if bud is None else (bud.length, bud.width) for bud in sort])
    color = np.array([(0.0, 0.0, 0.0) if bud is None else bud.color for bud in sort])
    species = rows["species"][some.row]
    varied = 1.0 + _VARIED * (2.0 * uniform(key, Draw.LENGTH) - 1.0)
    length = table[species, 0] * some.scale * varied * np.where(at_end, _AT_END, 1.0) * fine.weight[owner]
    thick = 0.5 * table[species, 1] * length

    def placed(lines: Arrays, bearers: Branches) -> tuple[NDArray, NDArray]:
        base, frame = lines.at(owner, t)
        x, along = frame[:, :, 0], frame[:, :, 2].copy()
        if len(side):
            leaves = place_leaves(rows, bearers, lines, owner[side], index[side], key[side], t[side])
            leaf = leaves.frame[:, :, 1].astype(np.float64)
            out = unit(leaf - dot(leaf, along[side]) * along[side] + 1e-6 * x[side])
            base = base.copy()
            base[side] += _SUNK * radius[side, None] * out
            along[side] = unit(along[side] + _LEAN * out)
        x = unit(x - dot(x, along) * along)
        center = base[:, None] + (length[:, None] * _ALONG)[..., None] * along[:, None]
        reach = np.stack([x, cross(along, x)])[:, :, None] * (thick[:, None] * _WIDTH)[None, :, :, None]
        return center.reshape(-1, 3), reach.reshape(2, -1, 3).transpose(0, 2, 1).astype(np.float32)

    center, reach = placed(whole.lines, branches)
    later = None if whole.lines.later is None else placed(whole.lines.later, branches.moved())
    wood = replace(branches.take(owner), radius=np.maximum(thick, 1e-9), length=np.maximum(length, 1e-9), later=None)
    bud = np.repeat(np.arange(len(owner)), BUD_RINGS)
    goes_on = np.tile(np.arange(BUD_RINGS) < BUD_RINGS - 1, len(owner))
    rings = Rings(wood, bud, np.tile(_ALONG, len(owner)), center, reach, goes_on, later, None, color[species])
    return rings, owner


def _places(flora: Flora, whole: WholeBranches) -> tuple[Integers, Integers, Keys]:
    """Branch (m,), leaf in whose axil it is, or -1 for the one at the end, and key of each bud of branches (n)."""
    rows, branches = flora.rows, whole.branches
    lateral = np.array([-1.0 if one.bud is None else one.bud.lateral for one in flora.species])
    # Leaves that fill a solid stand in no axils.
    lateral = np.where(rows["envelope"][branches.row] > 0, -1.0, lateral[rows["species"][branches.row]])
    number = leaf_counts(rows, branches)
    bears = (lateral >= 0.0) & (number > 0)
    ends = np.flatnonzero(bears & (rows["next"][branches.row, FORK] < 0))
    owner, index = spread(np.where(bears & (lateral > 0.0), number, 0))
    key = leaf_keys(branches, owner, index)
    kept = np.flatnonzero(uniform(key, Draw.BUD) < lateral[owner])
    owner = np.concatenate([ends, owner[kept]])
    index = np.concatenate([np.full(len(ends), -1), index[kept]])
    return owner, index, np.concatenate([child_key(branches.key[ends], _LAST), key[kept]])
