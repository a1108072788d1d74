# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shadow pass (paper, section 7): a scene as all of its lights see it, one buffer after the other."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..refinement.light_views import Light
from .illumination import Illumination, Lit
from .light_buffers import LightBuffer
from .light_clouds import Clouds
from .light_directions import DIRECTIONS
from .light_passes import Near, buffers_of
from .light_sheets import Sheets
from .light_sources import World, split_areas

#: Longer side in pixels of the sky's buffers, for each pixel of a lamp's: what comes from all sides has no edges.
SKY_SHARE = 0.1
#: Its limits, pixels, of clouds alone and of sheets.
SKY_PIXELS, SKY_SHEET_PIXELS = (32, 96), (32, 384)
#: Sheets that stand in the sky's light at most, each for several: it comes from all sides, and details drown in it.
SKY_SHEETS = 40_000
#: Orders of scattering that are gathered one by one.
ORDERS = 2


def shadow_steps(
    clouds: Clouds,
    lights: Sequence[Light],
    world: World,
    occluders: NDArray[np.float64] | None = None,
    resolution: int = 512,
    ground: ArrayLike = (0.0, 0.0, 0.0),
    orders: int = ORDERS,
    sheets: Sheets | None = None,
    near: Near | None = None,
) -> Generator[float, None, Illumination]:
    """Look at a scene from all of its lights.

    Parameters
    ----------
    clouds : Clouds
        All tetrahedra that hold something.
    lights : sequence of Light
    world : World
    occluders : (t, 3, 3) float64, optional
        Triangles of opaque polygons, metres.
    resolution : int
        Longer side of a lamp's buffer, pixels; see `light_resolution`. The sky's are `SKY_SHARE` of it.
    ground : (3,) float
        Mean colour of the polygons, which lights crowns from below.
    orders : int
        Orders of scattering that are gathered one by one, at least 1.
    sheets : Sheets, optional
        Facets and leaves as they are drawn. Clumps that are smaller than tetrahedra shadow themselves, which an even
        cloud does not know of; with sheets the resolution should be such that a pixel is about as large as one.

    near : Near, optional
        Part of the scene that gets buffers of its own from suns.

    Yields
    ------
    float
        Share that is done.

    Returns
    -------
    Illumination

    Notes
    -----
    Penumbras of the sun and of lamps that are no areas are as sharp as the buffer.
    """
    sheets = Sheets.none(len(clouds)) if sheets is None else sheets
    lamps = []
    split = split_areas(tuple(lights))
    for number, light in enumerate(split):
        buffers = buffers_of(light, clouds, sheets, occluders, resolution, near) if light.shadow else []
        lamps.append(Lit(light, buffers))
        yield 0.3 * (number + 1) / len(split)
    fewer, number = sheets.thinned(SKY_SHEETS)
    # Between sheets there are gaps that coarse pixels do not see.
    fine = fewer.pixels(SKY_SHEET_PIXELS) if len(sheets) else int(np.clip(resolution * SKY_SHARE, *SKY_PIXELS))
    sky: list[LightBuffer | None] = []
    for towards in DIRECTIONS:
        light = Light("SUN", np.zeros(3), -towards)
        views = buffers_of(light, clouds, fewer, occluders, fine)
        sky.append(views[0] if views else None)
        yield 0.3 + 0.3 * len(sky) / len(DIRECTIONS)
    found = Illumination(clouds, sheets, lamps, sky, world, (fewer, number))
    for share in found.scatter(np.asarray(ground, np.float64), max(orders, 1)):
        yield 0.6 + 0.4 * share
    return found
