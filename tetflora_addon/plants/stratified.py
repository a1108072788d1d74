# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Random choices that are spread more evenly than chance would spread them, so that few of them give good means.

Stratified and systematic sampling (Cochran, "Sampling Techniques", 1977).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .hashing import key_of_seed, uniform

# Multiples of it, less the whole part, are spread evenly, any run of them: the golden section.
_STEP = (np.sqrt(5) - 1) / 2
_THIN = 201  # a draw of this module, beyond those of growth and samples


def evenly(key: NDArray[np.uint64], draw: int) -> NDArray[np.float64]:
    """Numbers in [0, 1) as from `hashing.uniform`, but for all keys (n,) together one in each n-th of the interval."""
    out = np.empty(len(key))
    out[np.argsort(uniform(key, draw), kind="stable")] = (np.arange(len(key)) + 0.5) / len(key)
    return out


def thinned(number: int, places: int) -> NDArray[np.int64]:
    """Indices (places,) of some of a number of things in order, or all and some again; one of each run.

    Which one of the run is random: a fixed step could fall in with a pattern of the things.
    """
    each = np.arange(places)
    return ((each + uniform(key_of_seed(each), _THIN)) * (number / places)).astype(np.int64)


def systematic(
    weights: NDArray[np.float64], group: NDArray[np.int64], sort: NDArray[np.float64], numbers: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Draw things by their weights from each of several groups (systematic resampling).

    Parameters
    ----------
    weights : (n,) float64
    group : (n,) int64
    sort : (n,) float64
        Between −1 and 1. Draws are spread evenly over these values within a group.
    numbers : (groups,) int64
        How many to draw from each group; from a group without members they are of all others.

    Returns
    -------
    (sum of numbers,) int64 : indices, group after group, each in an order in which any run is spread over all of it
    """
    order = np.argsort(3 * group + sort, kind="stable")
    edges = np.concatenate([[0.0], np.cumsum(weights[order])])
    bounds = np.concatenate([[0], np.cumsum(np.bincount(group, minlength=len(numbers)))])
    low, high = edges[bounds[:-1]], edges[bounds[1:]]
    low, high = np.where(high > low, [low, high], [[0.0], [edges[-1]]])
    of = np.repeat(np.arange(len(numbers)), numbers)
    place = {number: np.argsort(np.argsort(np.arange(number) * _STEP % 1.0)) for number in set(numbers.tolist())}
    share = (np.concatenate([place[number] for number in numbers.tolist()]) + 0.5) / numbers[of]
    at = low[of] + (high - low)[of] * share
    return order[np.minimum(np.searchsorted(edges[1:], at, side="right"), len(order) - 1)]
