# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which plants are shown while the timeline runs: some of those in view, with the cover of all.

In a view over a forest each crown hides most of those behind it, and drawing them all takes the longer the more they
hide each other. A random number of each place decides whether it is shown: the same ones in all frames, evenly spread.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Arrays, Floats, Integers
from ..growth.hashing import place_keys, uniform
from ..growth.seeds import Seeds

#: Plants that are shown at most.
MOST = 3_000
#: Crowns that lie behind each other in a view: of so many, all random, hardly anything is seen through.
LAYERS = 3.0
#: Parts of a view in which layers are counted, across and down. Who fills one always stays.
_PARTS = 16
#: Meters around the place of a plant that may show it in a view; a draw beyond those of growth.
_AROUND, _SHOWN = 15.0, 202


@dataclass(frozen=True)
class InView(Arrays):
    """Plants that viewports show."""

    seeds: Seeds
    part: Integers  # (n,): of the view that shows each one largest
    covered: Floats  # (n,): how much of that part a square meter covers
    draw: Floats  # (n,): random numbers, 0 to 1


def in_view(seeds: Seeds, views: Sequence[Floats]) -> InView:
    """Those of all plants that lie in one of the views, matrices (4, 4) from the world to clip space, or beside it."""
    covered, part = np.zeros(len(seeds)), np.zeros(len(seeds), np.int64)
    for number, matrix in enumerate(views):
        clip = seeds.position @ matrix[[0, 1, 3], :3].T + matrix[[0, 1, 3], 3]
        meter, ahead = np.linalg.norm(matrix[:2, :3], axis=1), clip[:, 2]  # below zero behind a perspective eye
        across, down = (np.abs(clip[:, k]) < ahead + _AROUND * meter[k] for k in (0, 1))
        inside = np.flatnonzero(across & down & (ahead > 0.0))
        screen = clip[inside, :2] / ahead[inside, None]
        area = 0.25 * meter[0] * meter[1] * (_PARTS / ahead[inside]) ** 2
        x, y = np.clip((0.5 + 0.5 * screen.T) * _PARTS, 0, _PARTS - 1).astype(np.int64)
        larger = np.flatnonzero(area > covered[inside])
        covered[inside[larger]] = area[larger]
        part[inside[larger]] = (x + _PARTS * (y + _PARTS * number))[larger]
    seen = np.flatnonzero(covered > 0.0)
    return InView(seeds.take(seen), part[seen], covered[seen], uniform(place_keys(seeds.position[seen]), _SHOWN))


def shown(plants: InView, areas: Floats, most: int = MOST) -> Seeds:
    """Plants that cover as much as all in view: fewer where many hide each other; larger where that is too many.

    Parameters
    ----------
    areas : (n,) float64
        Of their crowns from the side, m².
    most : int
        Number of those that are shown, about. No more are all shown, as they are.
    """
    if len(plants.part) <= most:
        return plants.seeds
    layer = areas * plants.covered
    layers = np.bincount(plants.part, layer)[plants.part]
    needed = np.minimum(np.maximum(LAYERS / np.maximum(layers, LAYERS), layer), 1.0)
    fewer = min(most / max(needed.sum(), 1.0), 1.0)
    kept = np.flatnonzero(plants.draw < needed * fewer)
    seeds = plants.seeds.take(kept[np.argsort(-plants.covered[kept])])  # the nearest hide what is drawn after them
    return seeds if fewer == 1.0 else replace(seeds, scale=seeds.scale * fewer**-0.5)
