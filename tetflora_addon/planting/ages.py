# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ages of the plants of a population: each plant's own, from its seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..growth.hashing import key_of_seed, uniform

_DRAWS = range(1 << 20, (1 << 20) + 12)  # beyond those of branches and leaves


def plant_ages(seed: ArrayLike, age: float, spread: float) -> NDArray[np.float32]:
    """Ages (n,) of plants with seeds (n,), years, in single precision as Blender stores them.

    They are log-normal, as sizes in uneven-aged stands are: the median is ``age``, and a standard deviation is a factor
    of 1 + ``spread``. The sum of twelve even numbers stands for a normal one, so that none is beyond six deviations.
    """
    if spread == 0.0:
        return np.full(np.shape(seed), age, np.float32)
    key = key_of_seed(seed)
    normal = np.clip(sum(uniform(key, draw) for draw in _DRAWS) - 6.0, -2.5, 2.5)
    return (age * np.exp(np.log1p(spread) * normal)).astype(np.float32)
