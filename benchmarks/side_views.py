# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of plants from beside, in parallel projection and all around: the same for each program that draws them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: How many views of a set there are, and their side, pixels.
VIEWS, SIDE = 2, 128
#: How far they look down, radians.
_DOWN = 0.2


def eyes(number: int) -> NDArray:
    """Unit vectors (n, 3) to the eyes."""
    turn = np.arange(number) * 2.0 * np.pi / number
    level = np.full(number, np.sin(_DOWN))
    return np.stack([np.sin(turn) * np.cos(_DOWN), -np.cos(turn) * np.cos(_DOWN), level], axis=1)


def frame_of(points: NDArray) -> tuple[NDArray, float]:
    """The middle (3,) of points (n, 3), and how many meters a picture of them shows."""
    width, depth, height = np.ptp(points, axis=0)
    return points.min(axis=0) / 2 + points.max(axis=0) / 2, float(1.05 * max(np.hypot(width, depth), height))
