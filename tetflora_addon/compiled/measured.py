# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights and crown widths of single plants as one would measure them, and crown forms of plants that were measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..growth.crown_forms import LEAST, MOST, PLAIN, WIDTH
from ..growth.formed import MOST_LEANING, along, are_stools
from ..growth.growth import trunks
from ..growth.seeds import Seeds
from ..parallel import each_on_all_cores
from .flora import Flora
from .outermost import Beyond, Outermost, beyond_limbs, outermost

_AT_ONCE = 2_000
_BISECTIONS = 11
#: Factors that would change by less are found.
_CLOSE = 0.015
_known: WeakKeyDictionary[Flora, dict[int, Beyond]] = WeakKeyDictionary()


def measured(flora: Flora, seeds: Seeds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights of plants, to the highest leaf or wood, and means of the extents of their crowns to east and north.

    Returns
    -------
    height, width : (n,) float64
        Metres, about as plants are when all of them has grown.
    """
    height, width = np.zeros((2, len(seeds)))

    def work(some: NDArray[np.intp]) -> None:
        height[some], width[some], _ = _sizes(flora.in_leaf, seeds.take(some))

    _by_kind(flora, seeds, work)
    return height, width


def fitted(
    flora: Flora, seeds: Seeds, height: NDArray[np.float64], width: NDArray[np.float64], times: int = 4
) -> NDArray[np.float64]:
    """Factors that give plants the heights and crown widths that were measured.

    Parameters
    ----------
    flora : Flora
    seeds : Seeds of n
    height, width : (n,) float64
        Metres.
    times : int
        How often plants are measured at most.

    Returns
    -------
    (n, 2) float64
        Factors on the scale, and on the lengths of limbs (the first column of crown forms), which stay within their
        limits; heights are met even then.
    """
    out = np.ones((len(seeds), 2))

    def work(some: NDArray[np.intp]) -> None:
        own, wanted, factor = seeds.take(some), width[some] / height[some], np.ones(len(some))
        crown = np.tile(PLAIN, (len(own), 1)) if own.crown is None else own.crown
        row = flora.first_row[own.species]
        most = np.where(are_stools(flora.rows, row), MOST_LEANING, MOST[WIDTH])
        tall, left = np.ones(len(own)), np.arange(len(own))
        for _ in range(times):
            formed = crown[left]
            formed[:, WIDTH] *= factor[left]
            tall[left], _, found = _sizes(flora.in_leaf, replace(own.take(left), crown=formed))
            if found is None:
                break
            more = _solved(found, wanted[left], LEAST[WIDTH] / formed[:, WIDTH], most[left] / formed[:, WIDTH])
            far = np.abs(more - 1) > _CLOSE  # plants that are close are left alone, whatever others need
            tall[left] = np.where(far, found.sizes(more)[0], tall[left])
            factor[left] *= np.where(far, more, 1.0)
            left = left[far]
            if not len(left):
                break
        out[some] = np.stack([height[some] / tall, factor], axis=1)

    _by_kind(flora, seeds, work)
    return out


def _by_kind(flora: Flora, seeds: Seeds, work: Callable[[NDArray[np.intp]], None]) -> None:
    """Do some work on some plants (k,) at a time, each kind apart, as kinds have more or fewer limbs."""
    order = np.argsort(seeds.species, kind="stable")
    ends = np.flatnonzero(np.diff(seeds.species[order])) + 1
    kinds = np.split(order, ends)
    for some in kinds:
        if len(some):
            _beyond(flora.in_leaf, int(seeds.species[some[0]]))
    each_on_all_cores(work, [some[i : i + _AT_ONCE] for some in kinds for i in range(0, len(some), _AT_ONCE)])


def _beyond(flora: Flora, species: int) -> Beyond:
    known = _known.setdefault(flora, {})
    if species not in known:
        known[species] = beyond_limbs(flora.rows, int(flora.first_row[species]), species)
    return known[species]


def _sizes(flora: Flora, seeds: Seeds) -> tuple[NDArray[np.float64], NDArray[np.float64], Outermost | None]:
    """Heights and crown widths (n,), (n,) of plants of one species, and what reaches farthest, if they have limbs."""
    plants, beyond = trunks(flora.rows, seeds), _beyond(flora, int(seeds.species[0]))
    if beyond.whole[0] > 0:
        length = plants.length if plants.crown is None else plants.length / along(flora.rows, plants.row, plants.crown)
        return beyond.whole[0] * length, beyond.whole[1] * length, None
    found = outermost(flora.rows, plants, beyond)
    return *found.sizes(), found


def _solved(
    found: Outermost, wanted: NDArray[np.float64], least: NDArray[np.float64], most: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Factors (n,) on limbs, between limits (n,), by which crown widths over heights become what is wanted (n,)."""
    low, high = least, np.maximum(most, least)
    for _ in range(_BISECTIONS):
        middle = np.sqrt(low * high)
        height, width = found.sizes(middle)
        narrow = width < wanted * height
        low, high = np.where(narrow, middle, low), np.where(narrow, high, middle)
    return np.sqrt(low * high)
