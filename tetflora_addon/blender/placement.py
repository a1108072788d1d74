# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that moved to `planting.places`, for callers that have not yet followed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..planting import places
from ..planting.ground import Ground
from ..planting.places import Placement, new_seeds
from ..planting.rules import Rules

__all__ = ["Placement", "new_seeds", "place"]


def place(
    triangles: NDArray[np.float64],
    *,
    count: int,
    seed: int,
    slope_limit: float,
    min_distance: float,
    scale_range: tuple[float, float],
    shares: Sequence[float] = (1.0,),
    occupied: NDArray[np.float64] | None = None,
) -> Placement:
    """Scatter plants over triangles; see `planting.places.place`."""
    rules = Rules(
        count=count,
        seed=seed,
        slope_max=slope_limit,
        min_distance=min_distance,
        scale_min=scale_range[0],
        scale_max=scale_range[1],
        shares=tuple(shares),
    )
    older = None if occupied is None else places.Occupied(np.asarray(occupied))
    return places.place(Ground(triangles), rules, older)
