# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of facets: means of several leaves, dimmed as in clusters, and balanced by light and view."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import gathered
from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..growth.colours import leaf_colours_at, mean_leaf_colours
from ..growth.hashing import Draw, signed
from ..growth.seasons import leaf_stages
from .hotspots import balanced_colours

OnDay = tuple[Branches, NDArray[np.integer]] | None


def leaf_colours_of_facets(
    flora: Flora, row: NDArray, key: NDArray, leaves: NDArray, outward: NDArray, young: NDArray, on_day: OnDay
) -> NDArray[np.float64]:
    """Colours of facets that stand for several leaves (n,) each: a mean varies less than the colour of one leaf.

    ``on_day`` are branches, and those (n,) whose leaves they are, where these may not be as in summer.
    """
    several = np.sqrt(np.maximum(leaves, 1))
    deviation = signed(key, Draw.LEAF_COLOUR) / several
    mean = mean_leaf_colours(flora.rows, row, outward, young)
    if on_day is not None:
        branches, owner = on_day
        summer, mean = mean, flora.day.own_colours(branches, flora.rows["leaf_kind"][row], mean, owner)
        day, hue = (gathered(branches.year[:, i], owner) for i in range(2))
        stages = leaf_stages(flora.rows, row, key, day)
        one = leaf_colours_at(flora.rows, row, summer, stages, hue)
        mean = mean + np.where(stages.there, 1.0 / several, 0.0)[:, None] * (one - mean)
    return np.clip(mean + gathered(flora.rows["leaf_colour"][:, 1], row) * deviation[:, None], 0, 1)


def dimmed(colour: NDArray, owner: NDArray, weight: NDArray, once: NDArray | None) -> NDArray[np.float64]:
    """Colours (m, 3) of facets of owners (m,), by the weights of these (n,) and what light and eye share of them."""
    colour = trapped(colour, weight[owner])
    return colour if once is None else balanced_colours(colour, once[owner])


def trapped(colour: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colour (n, 3) of clusters of surfaces that are seen by a fraction ``weight`` (n,) of their area.

    What one surface scatters meets another of its cluster with the probability p = 1 − weight, and is dimmed again:
    ω (1 − p) / (1 − p ω) (Smolander and Stenberg, "Simple parameterizations of the radiation budget of uniform
    broadleaved and coniferous canopies", 2005).
    """
    p = np.clip(1.0 - weight, 0.0, 1.0)[:, None]
    return colour * (1.0 - p) / (1.0 - p * colour)
