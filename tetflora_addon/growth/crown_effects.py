# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What crown shapes change where plants grow: how far limbs reach, where they begin, and how trunks that fork spread.

Only trunks know the form of their plant, and the stems beyond their forks. Limbs, dead ones too, are longer or shorter
and bear more or less for it, as those of any vigor do. Where the bare part of a trunk ends above its first fork, the
fork moves up to there: trees that grew in the shade fork late. Stems beyond forks set out more steeply where the crown
is narrower. Of shrubs, whose stems grow from a stool, the form changes how far these lean; drawn plants, and leaves
that fill a solid, have no crown shapes.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Floats32, Integers, Mask, Table, by_component
from .rows import DEAD, FORK, LATERAL, SPUR
from .seeds import BASE, EAST, LEAVES, NORTH, PLAIN, THICKNESS, WIDTH, Branches

#: Columns of ``crown`` of branches: the first two and the last are those of crown shapes, between them the vector
#: (east, north) in the branch's own axes.
COLUMNS, LIGHT = 6, slice(2, 5)
_SHORTEST = 0.05  # of their length, what limbs away from the light keep, however much a crown leans
#: Stems of a stool lean at most so many times as far as described.
MOST_LEANING = 1.5
#: Laterals so many times as long as what bears them are the stems of a stool (see `species.ages`).
_STEMS = 2.0


def shaped_trunks(rows: Table, row: Integers, frame: Floats, forms: Floats) -> tuple[Floats32, Floats]:
    """The column ``crown`` (n, 6) of trunks, and factors (n,) on their radii.

    Parameters
    ----------
    row : (n,) int
    frame : (n, 3, 3) float64
        Of the trunks.
    forms : (n, 6) float64
        Crown shapes.
    """
    shapes = np.where((rows["phantom"][row] | (rows["envelope"][row] > 0))[:, None], PLAIN, forms)
    stool = are_stools(rows, row)
    shapes[stool, BASE], shapes[stool, LEAVES] = 0.0, 1.0
    light = shapes[:, EAST, None] * frame[:, 0] + shapes[:, NORTH, None] * frame[:, 1]
    crown = np.concatenate([shapes[:, [WIDTH, BASE]], light, shapes[:, [LEAVES]]], axis=1)
    return by_component(crown.astype(np.float32)), shapes[:, THICKNESS]


def are_shaped(rows: Table, branches: Branches) -> bool:
    """Whether any of the branches are parts of trunks with crown shapes."""
    return branches.crown is not None and bool((rows["order"] == 0)[branches.row].any())


def are_stools(rows: Table, row: Integers) -> Mask:
    """Whether rows (n,) are those of stools."""
    child = rows["next"][:, LATERAL]
    return ((rows["order"] == 0) & (child >= 0) & (rows["length"][child, 0] > _STEMS))[row]


def first_forks(rows: Table, row: Integers) -> Floats:
    """Where on the trunks of the plants of rows (n,) the first fork is, fractions of their height; 1 without any."""
    return rows["part"][np.flatnonzero(np.diff(rows["species"], prepend=-1))[rows["species"]], 1][row]


def trunk_ratios(base: ArrayLike, fork: ArrayLike) -> tuple[Floats, Floats]:
    """How many times as long as described trunks (...) are up to their first fork (...), and from there on."""
    fork = np.asarray(fork, np.float64)
    place = np.maximum(fork, base)
    above = np.where(fork < 1, (1 - place) / np.where(fork < 1, 1 - fork, 1.0), 1.0)
    return np.where(fork < 1, place / np.maximum(fork, 1e-9), 1.0), above


def length_factors(rows: Table, row: Integers, crown: Floats32) -> Floats:
    """How many times as long as described branches of rows (n,) are, which are parts of trunks; 1 for all others."""
    below, above = trunk_ratios(crown[:, BASE], first_forks(rows, row))
    return np.where(rows["order"][row] > 0, 1.0, np.where(rows["continues"][row], above, below))


def bare_part(rows: Table, row: Integers, base: ArrayLike) -> Floats:
    """Fraction (n,) of parts of trunks of rows (n,) that lies below crown bases (n,)."""
    low, high = rows["part"][row].T
    return np.clip((np.minimum(base, first_forks(rows, row)) - low) / (high - low), 0.0, 1.0)


def lateral_fractions(rows: Table, row: Integers, base: ArrayLike) -> Floats:
    """Where laterals of parts of trunks of rows (n,) begin and end among all of them (n, 2), by crown bases (n,)."""
    base = np.minimum(base, first_forks(rows, row) * 0.999)[:, None]
    ends = rows["fraction"][row, LATERAL]
    # Both are places on the trunk from where its limbs begin; that from the higher place is the smaller fraction.
    return np.where(base > 0, np.minimum(ends, np.clip((rows["part"][row] - base) / (1 - base), 0.0, 1.0)), ends)


def dead_end(rows: Table, row: Integers, base: ArrayLike) -> Floats:
    """Where dead branches end on parts of trunks of rows (n,) with crown bases (n,): not below the living ones."""
    start, end = rows["start"][row, DEAD].T
    return np.where(end > start, np.maximum(end, bare_part(rows, row, base)), end)


def count_factors(rows: Table, row: Integers, base: ArrayLike, sort: int, start: Floats) -> Floats:
    """Number (n,) of children of a sort over that without crown bases (n,), by their own ``start`` (n,)."""
    if sort == DEAD:
        end = rows["start"][row, DEAD, 1]
        left = np.maximum(dead_end(rows, row, base) - start, 0.0)  # none where the crown begins below all of them
        return np.where(end > start, left / np.maximum(end - start, 1e-9), 1.0)
    if sort != LATERAL:
        return np.ones(len(row))
    whole = (1 - np.maximum(start, bare_part(rows, row, base))) / np.maximum(1 - start, 1e-9)
    return whole * limb_count_factors(rows, row, base)


def limb_count_factors(rows: Table, row: Integers, base: ArrayLike) -> Floats:
    """How many limbs (n,) the stems beyond forks have because they are shorter; 1 for all others."""
    stem = rows["continues"][row] & (rows["order"][row] == 0)
    return np.where(stem, trunk_ratios(base, first_forks(rows, row))[1], 1.0)


def child_factors(rows: Table, parent: Branches, azimuth: Floats, sort: int) -> tuple[Floats, Floats]:
    """What the form makes of children of a sort that leave parents (m,) at azimuths (m,).

    Returns
    -------
    lean, length : (m,) float64
        Factors on their angle with the parent, and on their length.
    """
    trunk, one = rows["order"][parent.row] == 0, np.ones(len(parent))
    light = parent.crown[:, LIGHT].astype(np.float64)
    # Toward which side the child leaves is known without the wind, which turns all of the parent.
    leaned = 1.0 + np.cos(azimuth) * light[:, 0] + np.sin(azimuth) * light[:, 1]
    reach = parent.crown[:, WIDTH] * np.maximum(leaned, _SHORTEST)
    if sort == FORK:
        return np.where(trunk, np.minimum(reach, 1.0), one), one
    if sort == SPUR:
        return one, one
    stool = are_stools(rows, parent.row)
    return np.where(stool, np.minimum(reach, MOST_LEANING), one), np.where(trunk & ~stool, reach, one)


def handed_on(rows: Table, parent: Branches, sort: int, length: ArrayLike, azimuth: Floats, angle: Floats) -> Floats32:
    """The column ``crown`` (m, 6) of children of a sort.

    Parameters
    ----------
    parent : Branches of m
    length : (m,) float64
        Factors on the lengths of the children.
    azimuth, angle : (m,) float64
        By which they are turned, see `growth.turned`.
    """
    out = np.zeros((COLUMNS, len(parent)), np.float32)
    on_limbs = (sort == SPUR) & (rows["order"][parent.row] > 0)
    out[WIDTH], out[LEAVES] = length, np.where(on_limbs | (sort == LATERAL), parent.crown[:, LEAVES], 1.0)
    if sort == FORK:
        crown = parent.crown.T
        x, y, z = crown[LIGHT]
        ca, sa, cd, sd = (f(v) for v in (azimuth, angle) for f in (np.cos, np.sin))
        away = ca * x + sa * y
        out[:] = crown
        out[LIGHT] = cd * away - sd * z, ca * y - sa * x, sd * away + cd * z
    return out.T
