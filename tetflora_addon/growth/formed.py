# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What crown forms change where plants grow: how far limbs reach, where they begin, and how trunks that fork spread.

Only trunks know the form of their plant, and the stems beyond their forks. Limbs are longer or shorter and bear more or
less for it, as those of any vigour do. Where the bare part of a trunk ends above its first fork, the fork moves up to
there: trees that grew in the shade fork late. Stems beyond forks set out more steeply where the crown is narrower. Of
shrubs, whose stems grow from a stool, the form changes how far these lean; drawn plants, and leaves that fill a solid,
have no crown forms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import by_component, dot
from .branches import Branches
from .crown_forms import BASE, EAST, GIRTH, NORTH, PLAIN, WIDTH
from .rows import DEAD, FORK, LATERAL

#: Stems of a stool lean at most so many times as far as described.
MOST_LEANING = 1.5
#: Laterals so many times as long as what bears them are the stems of a stool (see `species.ages`).
_STEMS = 2.0


def formed_trunks(
    rows: NDArray[np.void], row: NDArray[np.integer], forms: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """The column ``crown`` (n, 4) of trunks of rows (n,) with crown forms (n, 5), and factors (n,) on their radii."""
    own = np.where((rows["phantom"][row] | (rows["envelope"][row] > 0))[:, None], PLAIN, forms)
    own[are_stools(rows, row), BASE] = 0.0
    return by_component(own[:, :GIRTH].astype(np.float32)), own[:, GIRTH]


def are_formed(rows: NDArray[np.void], branches: Branches) -> bool:
    """Whether any of the branches are parts of trunks with crown forms."""
    return branches.crown is not None and bool((rows["order"] == 0)[branches.row].any())


def are_stools(rows: NDArray[np.void], row: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Whether rows (n,) are those of stools."""
    child = rows["next"][row, LATERAL]
    return (rows["order"][row] == 0) & (child >= 0) & (rows["length"][child, 0] > _STEMS)


def first_forks(rows: NDArray[np.void], row: NDArray[np.integer]) -> NDArray[np.float64]:
    """Where on the trunks of the plants of rows (n,) the first fork is, fractions of their height; 1 without any."""
    first = np.flatnonzero(np.diff(rows["species"], prepend=-1))
    return rows["part"][first[rows["species"][row]], 1]


def raised(base: ArrayLike, fork: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How many times as long as described trunks (...) are up to their first fork (...), and from there on."""
    fork = np.asarray(fork, np.float64)
    place = np.maximum(fork, base)
    above = np.where(fork < 1, (1 - place) / np.where(fork < 1, 1 - fork, 1.0), 1.0)
    return np.where(fork < 1, place / np.maximum(fork, 1e-9), 1.0), above


def along(rows: NDArray[np.void], row: NDArray[np.integer], crown: NDArray[np.float32]) -> NDArray[np.float64]:
    """How many times as long as described branches of rows (n,) are, which are parts of trunks; 1 for all others."""
    below, above = raised(crown[:, BASE], first_forks(rows, row))
    return np.where(rows["order"][row] > 0, 1.0, np.where(rows["continues"][row], above, below))


def bare_part(rows: NDArray[np.void], row: NDArray[np.integer], base: ArrayLike) -> NDArray[np.float64]:
    """Fraction (n,) of parts of trunks of rows (n,) that lies below crown bases (n,)."""
    low, high = rows["part"][row].T
    return np.clip((np.minimum(base, first_forks(rows, row)) - low) / (high - low), 0.0, 1.0)


def fractions(rows: NDArray[np.void], row: NDArray[np.integer], base: ArrayLike) -> NDArray[np.float64]:
    """Where laterals of parts of trunks of rows (n,) begin and end among all of them (n, 2), by crown bases (n,)."""
    base = np.minimum(base, first_forks(rows, row) * 0.999)[:, None]
    own = rows["fraction"][row, LATERAL]
    # Both are places on the trunk from where its limbs begin; that from the higher place is the smaller fraction.
    return np.where(base > 0, np.minimum(own, np.clip((rows["part"][row] - base) / (1 - base), 0.0, 1.0)), own)


def dead_end(rows: NDArray[np.void], row: NDArray[np.integer], base: ArrayLike) -> NDArray[np.float64]:
    """Where dead branches end on parts of trunks of rows (n,) with crown bases (n,): not below the living ones."""
    start, end = rows["start"][row, DEAD].T
    return np.where(end > start, np.maximum(end, bare_part(rows, row, base)), end)


def numbers(
    rows: NDArray[np.void], row: NDArray[np.integer], base: ArrayLike, sort: int, start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Number (n,) of children of a sort over that without crown bases (n,), by their own ``start`` (n,)."""
    if sort == DEAD:
        end = rows["start"][row, DEAD, 1]
        return np.where(end > start, (dead_end(rows, row, base) - start) / np.maximum(end - start, 1e-9), 1.0)
    if sort != LATERAL:
        return np.ones(len(row))
    whole = (1 - np.maximum(start, bare_part(rows, row, base))) / np.maximum(1 - start, 1e-9)
    return whole * sparser(rows, row, base)


def sparser(rows: NDArray[np.void], row: NDArray[np.integer], base: ArrayLike) -> NDArray[np.float64]:
    """How many limbs (n,) the stems beyond forks have because they are shorter; 1 for all others."""
    return np.where(rows["continues"][row] & (rows["order"][row] == 0), raised(base, first_forks(rows, row))[1], 1.0)


def leans(
    rows: NDArray[np.void],
    parent: Branches,
    frame: NDArray[np.float64],
    azimuth: NDArray[np.float64],
    sky: NDArray[np.float64] | None,
    sort: int,
) -> NDArray[np.float64]:
    """Factors (m,) on the angles at which children of a sort leave their parents (m,), there with frames (m, 3, 3)."""
    trunk = rows["order"][parent.row] == 0
    own = trunk if sort == FORK else trunk & are_stools(rows, parent.row) if sort == LATERAL else np.zeros_like(trunk)
    if not own.any():
        return np.ones(len(own))
    way = np.cos(azimuth)[:, None] * frame[:, :, 0] + np.sin(azimuth)[:, None] * frame[:, :, 1]
    most = 1.0 if sort == FORK else MOST_LEANING
    return np.where(own, np.minimum(_reaches(parent, way, sky), most), 1.0)


def longer(
    rows: NDArray[np.void], parent: Branches, way: NDArray[np.float64], sky: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Factors (m,) on the lengths of laterals of parents (m,) that set out in directions (m, 3)."""
    own = (rows["order"][parent.row] == 0) & ~are_stools(rows, parent.row)
    return np.where(own, _reaches(parent, way, sky), 1.0)


def _reaches(parent: Branches, way: NDArray[np.float64], sky: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """How far crowns (m,) reach in directions (m, 3) over what is described."""
    level = way[:, :2]
    if sky is not None:  # directions are those without wind, which turns z to the sky by the shortest way
        both = sky + [0.0, 0.0, 1.0]
        level = level - dot(both, way) / np.maximum(both[:, 2:], 1e-9) * sky[:, :2]
    level = level / np.maximum(np.hypot(level[:, 0], level[:, 1]), 1e-9)[:, None]
    crown = parent.crown.astype(np.float64)
    return crown[:, WIDTH] * (1.0 + crown[:, EAST] * level[:, 0] + crown[:, NORTH] * level[:, 1])


def handed_on(parent: Branches, sort: int, factor: ArrayLike) -> NDArray[np.float32]:
    """The column ``crown`` (m, 4) of children of a sort, by their parents (m,) and the factors on their lengths."""
    if sort == FORK:
        return parent.crown
    out = np.zeros((GIRTH, len(parent)), np.float32)
    out[WIDTH] = factor
    return out.T
