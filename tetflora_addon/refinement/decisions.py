# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The refinement step: what becomes of each terminal tetrahedron (paper, section 6.4)."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..tetrahedra.geometry import squared_edges
from .camera import Camera
from .contents import Amounts
from .settings import RefinementSettings
from .visibility import Visibility


class Decision(IntEnum):
    """What is done with a terminal tetrahedron."""

    EMPTY = 0
    PROXY = 1  # small on the picture: drawn as an approximation
    HIDDEN = 2  # not seen, or hardly: a coarse approximation
    EXPLICIT = 3  # polygons are made of all in it
    SPLIT = 4


def feature_pixels(vertices: NDArray[np.float64], width: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Size on the picture of what tetrahedra hold, where it is nearest to the eye.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
    width : (n,) float64
        Width of leaves or branches, metres.

    Returns
    -------
    (n,) float64
        Pixels.
    """
    return width / camera.pixel_extent(vertices).min(axis=1)


def decide(
    vertices: NDArray[np.float64], amounts: Amounts, seen: Visibility, camera: Camera, settings: RefinementSettings
) -> NDArray[np.int8]:
    """Decide for terminal tetrahedra.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
    amounts : Amounts of n
    seen : Visibility of n

    Returns
    -------
    (n,) int8
        Values of `Decision`.

    Notes
    -----
    A tetrahedron's *contribution* is the number of pixels that its contents change: its pixels × the share of them that
    is not hidden × its own opacity. Leaves wider than ``leaf_limit`` pixels can only be drawn as leaves; a tetrahedron
    full of them is divided down to ``block`` pixels so that its hidden parts are found out, and then made explicit.
    """
    contribution = seen.pixels * seen.transmittance * seen.opacity
    holds = amounts.leaf_area + amounts.wood_area > 0
    hidden = seen.transmittance <= settings.hidden  # out of view: transmittance is 0
    large_leaves = feature_pixels(vertices, amounts.width, camera) >= settings.leaf_limit
    no_gain = (amounts.polygons <= settings.few_polygons) | (seen.pixels <= settings.block**2)
    small = contribution <= settings.cutoff**2
    out = np.full(len(holds), Decision.SPLIT, dtype=np.int8)
    # Large leaves never become a proxy: a block of them that is hardly seen is divided until its hidden parts show.
    out[small & ~large_leaves] = Decision.PROXY
    out[large_leaves & no_gain] = Decision.EXPLICIT
    out[hidden] = Decision.HIDDEN
    if np.isfinite(settings.hidden_block):
        extent = np.sqrt(squared_edges(vertices).max(axis=1)) / camera.pixel_extent(vertices.mean(axis=1))
        out[hidden & (extent > settings.hidden_block)] = Decision.SPLIT
    out[~holds] = Decision.EMPTY
    return out
