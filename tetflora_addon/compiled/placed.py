# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the samples of given sub-plants are, how far these reach, and within which bounds they stay.

Without crown shapes that is what is known of their rows. A form moves the place where a limb leaves the trunk up, and
what is on the limb away from there, as it does when plants grow. Where limbs are longer, more is on each: samples there
stand for more, but all together for as much as is expected.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, Table, gathered
from ..growth.crown_effects import (
    LIGHT,
    MOST_LEANING,
    are_stools,
    bare_part,
    first_forks,
    length_factors,
    trunk_length_factors,
)
from ..growth.rows import FORK, LATERAL, lengths
from ..growth.seeds import BASE, WIDTH, Branches
from .flora import Flora
from .samples import LIMB, STEM, STEM_LIMB, Limbs, Points, Shares


def shaped_subplants(rows: Table, subplants: Branches) -> Integers:
    """Sub-plants (k,) of (n,) that are trunks, or stems of these, with a crown shape other than the plain one."""
    crown = subplants.crown
    if crown is None:
        return np.zeros(0, np.intp)
    trunk = np.flatnonzero((rows["order"] == 0)[subplants.row])
    return trunk[(crown[trunk, WIDTH] != 1) | crown[trunk, BASE : LIGHT.stop].any(axis=1)]


def placed_samples(
    flora: Flora, points: Points, subplants: Branches, owner: Integers, pick: Integers, turn: Floats | None = None
) -> tuple[NDArray[np.floating], Floats | None]:
    """Samples of sub-plants: places in units of their lengths and in their axes, and what each stands for.

    Parameters
    ----------
    flora : Flora
    points : Points
        Leaves or wood of its samples.
    subplants : Branches of n
    owner, pick : (m,) int
        Sub-plants, and samples of these.
    turn : (m,) float64, optional
        By how much the axes of the sub-plant are turned about the third for each.

    Returns
    -------
    (m, 3) float
    (m,) float64 or None
        Area over that of other samples of the same sub-plant, 1 on the mean; None where all stand for as much.
    """
    place, rows = gathered(points.position, pick), flora.rows
    some = shaped_subplants(rows, subplants)
    if not len(some):
        return place, None
    place, share = place.astype(np.float64), np.ones(len(owner))
    number = np.full(len(subplants), -1)
    number[some] = np.arange(len(some))
    mine = np.flatnonzero(number[owner] >= 0)
    own, which = subplants.take(some), number[owner[mine]]
    light = own.crown[which][:, LIGHT].astype(np.float64)[:, :2]
    if turn is not None:
        c, s = np.cos(turn[mine]), np.sin(turn[mine])
        light = np.stack([c * light[:, 0] + s * light[:, 1], c * light[:, 1] - s * light[:, 0]], axis=1)
    at, reach, sparse = _moved(rows, own, points.limbs.take(pick[mine]), place[mine], which, light)
    place[mine] = at / length_factors(rows, own.row, own.crown)[which, None]
    leafy = points is flora.samples.leaves
    share[mine] = _shares(flora, own, points.shares, points.limbs.take(pick[mine]), which, reach, sparse, leafy)
    return place, share


def _moved(
    rows: Table, own: Branches, on: Limbs, place: Floats, which: Integers, light: Floats
) -> tuple[Floats, Floats, Floats]:
    """Places (m, 3) of samples on limbs, ``which`` (m,) of sub-plants (n,), in lengths of those as described.

    ``light`` (m, 2) is where crowns reach farther.

    Also how far the limbs reach over what they do as described (m,), and how many of them are left (n, 4) by class.
    """
    row, root = own.row, np.where((on.kind >= LIMB)[:, None], on.root, place)
    crown = own.crown.astype(np.float64)
    start = rows["start"][row, LATERAL, 0]
    bare = np.maximum(start, bare_part(rows, row, crown[:, BASE]))
    left = (1 - bare) / np.maximum(1 - start, 1e-9)
    below, above = trunk_length_factors(crown[:, BASE], first_forks(rows, row))
    stretch = np.where(rows["continues"][row], above, below)
    stool, limb, stem = are_stools(rows, row)[which], on.kind >= LIMB, (on.kind == STEM) | (on.kind == STEM_LIMB)

    def reach(way: Floats) -> Floats:
        level = way[:, :2] / np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)[:, None]
        return crown[which, WIDTH] * (1 + level[:, 0] * light[:, 0] + level[:, 1] * light[:, 1])

    height = root[:, 2]
    higher = 1 - (1 - height) * left[which]
    lower = height * (bare / np.maximum(start, 1e-9))[which]  # dead branches
    begins = start[which]
    moved = root.copy()
    moved[:, 2] = np.where(limb & ~stool & ~stem, np.where(height >= begins, higher, np.minimum(lower, higher)), height)
    described = moved
    moved = moved * stretch[which, None]
    fork = np.array([0.0, 0.0, 1.0])  # about where the stems begin
    stems = above[which, None] * _tilted(root - fork, np.minimum(reach(root - fork), 1.0)) + stretch[which, None] * fork
    moved = np.where(stem[:, None], stems, moved)
    way = place - root
    longer = np.where(limb & ~stool, reach(way), 1.0)
    along_limb = longer * np.where(limb, _other_lengths(rows, own, which, root, described[:, 2], stem), 1.0)
    leaning = np.sqrt(np.minimum(reach(way), MOST_LEANING))  # half of what is aside is on stems that lean
    moved += np.where(stool[:, None], _tilted(way, leaning), along_limb[:, None] * way)
    # Trunks and stems are longer or shorter themselves, limbs are fewer.
    return moved, longer, np.stack([stretch, above, np.where(rows["continues"][row], above, left), above], axis=1)


def _other_lengths(
    rows: Table, own: Branches, which: Integers, root: Floats, height: Floats, stem: Mask
) -> Floats | float:
    """Factors (m,) on the lengths of limbs of trunks that fork, because these are higher or lower in the crown.

    ``height`` (m,) is where limbs at ``root`` (m, 3) are on the trunk, if they are not on a ``stem`` (m,).
    """
    if not ((rows["next"][own.row, FORK] >= 0) | rows["continues"][own.row]).any():
        return 1.0
    first = np.flatnonzero(np.diff(rows["species"], prepend=-1))[rows["species"][own.row]]
    start = rows["start"][first, LATERAL, 0] * first_forks(rows, own.row)
    base = np.maximum(start, np.minimum(own.crown[:, BASE], first_forks(rows, own.row)))
    low, high = rows["part"][own.row].T[:, which]
    above = np.linalg.norm(root - [0.0, 0.0, 1.0], axis=1) * (high - low) / np.maximum(1 - high, 1e-9)
    above = high + (1 - high) * np.minimum(above, 1.0)
    ratio = []
    for place, begin in ((height, base[which]), (root[:, 2], start[which])):
        place = np.where(stem, above, low + (high - low) * np.clip(place, 0.0, 1.0))
        fraction = np.clip((place - begin) / np.maximum(1 - begin, 1e-9), 0.0, 1.0)
        ratio.append(np.maximum(lengths(rows, own.row[which], fraction), 0.1))
    return np.clip(ratio[0] / ratio[1], 0.5, 2.0)


def _tilted(way: Floats, factor: Floats) -> Floats:
    """Vectors (m, 3) of the same lengths whose level parts are so many times (m,) as long, as far as they can be."""
    level = way[:, :2] * factor[:, None]
    rest = (way**2).sum(axis=1) - (level**2).sum(axis=1)
    upright = np.sign(way[:, 2]) * np.sqrt(np.maximum(rest, 0.09 * way[:, 2] ** 2))
    return np.concatenate([level, upright[:, None]], axis=1)


def _shares(
    flora: Flora, own: Branches, shares: Shares, on: Limbs, which: Integers, reach: Floats, sparse: Floats, leafy: bool
) -> Floats:
    """What samples (m,) stand for, 1 on the mean; see `_moved`."""
    totals, crown = flora.shaped_totals, own.crown.astype(np.float64)
    ratio = np.where(totals.shaped[own.row], totals.leaves(own) if leafy else totals.wood(own)[0], 1.0)
    follows, width = shares.follows[own.row], crown[:, WIDTH]
    bears = 1 - follows + follows * width
    if leafy:
        sparse = sparse.copy()
        sparse[:, :LIMB] = 1.0
    else:
        ratio = ratio * length_factors(flora.rows, own.row, own.crown)
        square = 1 + (crown[:, LIGHT][:, :2] ** 2).sum(axis=1) / 2
        bears = width * (1 - follows) + width**2 * square * follows
    each = shares.kinds[own.row] * sparse
    trunk, limbs = each[:, :LIMB].sum(axis=1), each[:, LIMB:].sum(axis=1) * bears
    # How many limbs there are is known exactly, by the sum that is expected.
    more = np.maximum(ratio - trunk, 0.0) / np.maximum(limbs, 1e-9)
    many = np.where(np.arange(4) < LIMB, 1.0, more[:, None]) * sparse / np.maximum(ratio, 1e-9)[:, None]
    bearing = 1 - on.follows + on.follows * reach
    bearing = np.where(on.kind < LIMB, 1.0, bearing if leafy else bearing * reach)
    return np.where(are_stools(flora.rows, own.row)[which], 1.0, many[which, on.kind] * bearing)


def extents(flora: Flora, subplants: Branches, farthest: bool = True) -> Floats:
    """Radius, lowest and highest place (n, 3) that hold the samples of sub-plants, in units of their lengths.

    Without ``farthest``, the radius of crowns that lean is about the mean of all sides.
    """
    bound = flora.sampled_bound[subplants.row]
    some = shaped_subplants(flora.rows, subplants)
    if len(some):
        own, rows = subplants.take(some), flora.rows
        crown, stool = own.crown.astype(np.float64), are_stools(rows, own.row)
        stretch = length_factors(rows, own.row, own.crown)
        lean = np.hypot(*crown[:, LIGHT].T[:2]) if farthest else 0.0
        reach = crown[:, WIDTH] * (1 + lean)
        reach = np.where(stool, np.sqrt(np.minimum(reach, MOST_LEANING)), reach)
        radius, low, high, root, down, up = bound[some].T
        start = rows["start"][own.row, LATERAL, 0]
        left = (1 - np.maximum(start, bare_part(rows, own.row, crown[:, BASE]))) / np.maximum(1 - start, 1e-9)
        longer = np.where(stool, 0.0, np.maximum(reach - 1, 0.0))
        top = high + longer * up
        top += (1 - left) * np.maximum(1 + reach * up - top, 0.0) + np.maximum(stretch - 1, 0.0)
        top = np.where(stool & (reach < 1), np.hypot(radius, high), top)
        radius = reach * radius + np.where(farthest, np.abs(reach - 1) * root, 0.0)
        bound[some, :3] = np.stack([radius, low + longer * down, top], axis=1) / stretch[:, None]
    return bound[:, :3]


def outlines(flora: Flora, plants: Branches, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """About how the crowns of plants (n,) differ from those of their species, whose ends are at heights (n,), (n,).

    Returns
    -------
    length : (n,) float64
        Unit of heights and widths of the species, meters.
    low : (n,) float64
        Where the crown begins, in such units.
    width : (n,) float64
        Factor on its width.
    light : (n, 2) float64
        By how much it reaches farther along the first two of the plant's axes.
    """
    if plants.crown is None:
        return plants.length, low, np.ones(len(plants)), np.zeros((len(plants), 2))
    rows, crown = flora.rows, plants.crown.astype(np.float64)
    start = rows["start"][plants.row, LATERAL, 0] * first_forks(rows, plants.row)
    left = np.minimum((1 - crown[:, BASE]) / (1 - start), 1.0)
    length = plants.length / length_factors(rows, plants.row, plants.crown)
    return length, high - (high - low) * left, crown[:, WIDTH], crown[:, LIGHT][:, :2]


def bounds(flora: Flora, subplants: Branches) -> tuple[Floats, Floats]:
    """Bounds of sub-plants (n, 3) as `Flora.bound`, and how far (n,) these may reach beyond that; meters."""
    bound = flora.bound[subplants.row] * subplants.length[:, None]
    out = subplants.radius * flora.widest[subplants.row] + flora.leaf_reach[subplants.row] * subplants.scale
    some = shaped_subplants(flora.rows, subplants)
    if len(some):
        own, rows = subplants.take(some), flora.rows
        crown = own.crown.astype(np.float64)
        raised = crown[:, BASE] > 0
        bound[some[raised]] = flora.raised_bound[own.row[raised]] * own.length[raised, None]
        stretch = length_factors(rows, own.row, own.crown)
        longer = crown[:, WIDTH] * (1 + np.linalg.norm(crown[:, LIGHT], axis=1))
        longer = np.where(are_stools(rows, own.row), np.minimum(longer, MOST_LEANING), longer)
        # Nothing on a limb moves farther than that is longer, and forks move as far as the trunk is to them.
        reach = flora.limb_reach[own.row] * np.maximum(longer - 1, 0.0)
        out[some] += (reach + 3 * np.abs(stretch - 1)) * own.length / stretch
        bound[some] /= stretch[:, None]
    return bound, out
