# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Clumps: noise on the map from hashes of a lattice, so that a seed means the same clumps everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..plants.hashing import child_key, uniform

# The lattice's cell for a metre from clump to clump: peaks of the noise are counted in the tests.
CELL = 0.73
_OCTAVES = ((1.0, 1.0), (2.17, 0.35))  # frequency and weight; not a multiple, or lattices would coincide
_BARE, _FULL = -0.1, 0.25  # values of the noise below which nothing grows, and above which all does


def gradient_noise(points: NDArray[np.float64], key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Smooth noise with mean 0 between -1 and 1 (K. Perlin, "Improving noise", SIGGRAPH 2002, in two dimensions).

    Parameters
    ----------
    points : (n, 2) float64
        In cells of the lattice.
    key : uint64
        Of the whole lattice.
    """
    corner = np.floor(points)
    part = points - corner
    corner = corner.astype(np.int64)
    sides = []
    for i in (0, 1):
        ends = []
        for j in (0, 1):
            name = (corner[:, 0] + i) * np.int64(2**32) + corner[:, 1] + j
            turn = 2.0 * np.pi * uniform(child_key(key, name.view(np.uint64)), 0)
            ends.append(np.cos(turn) * (part[:, 0] - i) + np.sin(turn) * (part[:, 1] - j))
        sides.append(ends)
    fade = part**3 * (part * (part * 6.0 - 15.0) + 10.0)
    along = [low + fade[:, 1] * (high - low) for low, high in sides]
    # A gradient of length 1 gives at most √½.
    return np.sqrt(2.0) * (along[0] + fade[:, 0] * (along[1] - along[0]))


def clumps(points: NDArray[np.float64], size: float, clumping: float, key: NDArray[np.uint64]) -> NDArray[np.float64]:
    """How suitable places are, 0 to 1, for plants that grow in clumps, (n,).

    Parameters
    ----------
    points : (n, 2) float64
        Places on the map, metres.
    size : float
        Metres from clump to clump, on average.
    clumping : float
        0: suitable everywhere; 1: nothing between the clumps.
    key : uint64
    """
    value = np.zeros(len(points))
    for octave, (frequency, weight) in enumerate(_OCTAVES):
        value += weight * gradient_noise(points * (frequency / (CELL * size)), child_key(key, octave))
    share = np.clip((value - _BARE) / (_FULL - _BARE), 0.0, 1.0)
    return 1.0 - clumping + clumping * share * share * (3.0 - 2.0 * share)
