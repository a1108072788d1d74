# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the length of branches varies from the base of their parent to its tip."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CROWN_SHAPES = (
    "conical",
    "spherical",
    "hemispherical",
    "cylindrical",
    "tapered",
    "flame",
    "inverse conical",
    "tend flame",
    "receding",
)
"""Names of the shapes, in the order of their numbers (Weber and Penn, SIGGRAPH 1995, section 4.3), and one more."""


def crown_ratio(shape: NDArray[np.integer], r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length ratio of a child, 0 to 1.

    Parameters
    ----------
    shape : (...) int
        Index into `CROWN_SHAPES`.
    r : (...) float64
        1 at the lowest child, 0 at the parent's tip.

    Notes
    -----
    Weber and Penn 1995, table of ShapeRatio. "Receding" is their rule for the branches of branches (section 4.3):
    parent's length less 0.6 of the way to the child. Their number of leaves and of further branches, less by half
    towards the tip, is what ``count_by_length`` 5/6 makes of it. The lower end of the two flames is raised from 0 to
    0.05, so that no branch has zero length.
    """
    r = np.clip(r, 0.0, 1.0)
    return np.choose(
        shape,
        [
            0.2 + 0.8 * r,
            0.2 + 0.8 * np.sin(np.pi * r),
            0.2 + 0.8 * np.sin(0.5 * np.pi * r),
            np.ones_like(r),
            0.5 + 0.5 * r,
            np.maximum(np.where(r <= 0.7, r / 0.7, (1 - r) / 0.3), 0.05),
            1 - 0.8 * r,
            np.where(r <= 0.7, 0.5 + 0.5 * r / 0.7, 0.5 + 0.5 * (1 - r) / 0.3),
            0.4 + 0.6 * r,
        ],
    )
