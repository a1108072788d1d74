# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outliers: a few things far beyond all others that nobody sees, such as a plant that slipped to the end of the world.

The root of the tree holds all that there is. One plant 1,000 km away takes twenty levels of division before there is
anything of the size of the others, and with that what the settings allow. Outliers are left out, and named.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Floats, Integers, Mask
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.growth import trunks
from ..growth.seeds import Seeds
from .contents import PlantParts
from .polygons import Polygons
from .shared_parts import PlacedAssets

#: Outliers are so many times as far from the camera as all others, or as so many meters if these are nearer.
GAP, NEAR = 16.0, 1000.0
#: There are at most so many, or that fraction of all things, and never more than of the others.
MOST, FRACTION = 8, 0.01
#: Pixels under which nobody sees a thing.
UNSEEN = 1.0
_NONE = np.zeros(0, np.int64)


@dataclass(frozen=True)
class Outliers:
    """What is left out of a scene."""

    #: plants, assets and instances, (k,), (l,) and (m,): rows of the seeds, of instances of assets, and instances of
    #: other meshes.
    plants: Integers = field(default_factory=lambda: _NONE)
    assets: Integers = field(default_factory=lambda: _NONE)
    instances: Integers = field(default_factory=lambda: _NONE)
    away: Floats = field(default_factory=lambda: np.zeros(0))  # (k + l + m,): how far they are from the camera, meters

    def others(
        self, seeds: Seeds, polygons: Polygons | None, placed: PlacedAssets
    ) -> tuple[Seeds, Polygons | None, PlacedAssets]:
        """What is left of plants, polygons and instances of assets; None where no polygon is."""
        if len(self.plants):
            seeds = seeds.take(np.delete(np.arange(len(seeds)), self.plants))
        if len(self.instances):
            polygons = polygons.take(np.flatnonzero(~np.isin(polygons.instance, self.instances)))
        if len(self.assets):
            placed = placed.take(np.delete(np.arange(len(placed)), self.assets))
        return seeds, polygons if polygons is not None and len(polygons) else None, placed


def outliers_of(
    flora: Flora, seeds: Seeds, camera: Camera, polygons: Polygons | None = None, placed: PlacedAssets | None = None
) -> Outliers:
    """Outliers among plants, assets and instances of other meshes; nothing depends on their order."""
    center, reach = seeds.position, np.zeros(len(seeds))
    plants_end = assets_end = len(seeds)
    if placed is not None and len(placed):
        own = placed.wholes()
        center, reach = np.concatenate([center, own.center]), np.append(reach, own.reach)
        assets_end += len(placed)
    if polygons is not None and len(polygons):
        others = _around_instances(polygons)
        center, reach = np.concatenate([center, others[0]]), np.append(reach, others[1])
    away = np.linalg.norm(center - camera.eye, axis=1)
    some = far_off(away - reach)
    plants = some[some < plants_end]
    if len(plants):
        reach[plants] = PlantParts.of_subplants(flora, trunks(flora.rows, seeds.take(plants))).extent
    for eye in (camera, *camera.shutter):
        some = some[_unseen(eye, center[some], reach[some], away[some])]
    own, last = some < plants_end, some >= assets_end
    return Outliers(some[own], some[~own & ~last] - plants_end, some[last] - assets_end, away[some])


def far_off(away: Floats) -> Integers:
    """The few (k,) of things by their distances (n,) that are far beyond all others, meters."""
    most = min(max(MOST, int(FRACTION * len(away))), len(away) // 2)
    if most == 0:
        return _NONE
    first = len(away) - most - 1
    last = np.argpartition(away, first)[first:]
    last = last[np.argsort(away[last], kind="stable")]
    from_here = np.maximum(away[last], NEAR)
    gaps = np.flatnonzero(from_here[1:] > GAP * from_here[:-1])
    return np.sort(last[gaps[0] + 1 :]) if len(gaps) else _NONE


def _unseen(camera: Camera, center: Floats, reach: Floats, away: Floats) -> Mask:
    """Things (n,) that are specks, or out of the view and too far for their shadows to fall into it."""
    specks = 2.0 * reach < UNSEEN * camera.extent_around(center)
    depth = away if camera.kind == "PANO" else camera.to_camera_space(center)[:, 2]
    out = (depth - reach > camera.far) | (depth + reach < camera.near) | (camera.distance_to_view(center) > reach)
    return specks | (out & (GAP * reach < away))


def _around_instances(polygons: Polygons) -> tuple[Floats, Floats]:
    """Middles (i, 3) of all instances of meshes, and how far they reach from there (i,), meters."""
    number = len(polygons.meshes.surface)
    low, high = np.full((number, 3), np.inf), np.full((number, 3), -np.inf)
    np.minimum.at(low, polygons.instance, polygons.center - polygons.reach[:, None])
    np.maximum.at(high, polygons.instance, polygons.center + polygons.reach[:, None])
    return (low + high) / 2.0, np.linalg.norm(high - low, axis=1) / 2.0
