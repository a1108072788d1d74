# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that hold all of a sub-plant, whatever its seed: what is in the scene is within them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled.flora import Flora
from ..growth.branches import Branches


def bounding_bodies(flora: Flora, subplants: Branches) -> NDArray[np.float64]:
    """Bodies that hold all vertices of sub-plants, from the compiled bounds alone.

    Returns
    -------
    (9, n) float64
        A cylinder, and how far whatever is not within it reaches beyond: centre (3), axis (3), radius, half of the
        height, and that pad. Metres, world space.
    """
    bound = (flora.bound[subplants.row] * subplants.length[:, None]).T
    out = np.empty((9, len(subplants)))
    out[3:6] = subplants.frame[:, :, 2].T
    out[:3] = subplants.position.T + (bound[1] + bound[2]) / 2 * out[3:6]
    out[6], out[7] = bound[0], (bound[2] - bound[1]) / 2
    out[8] = subplants.radius * flora.widest[subplants.row] + flora.leaf_reach[subplants.row] * subplants.scale
    return out
