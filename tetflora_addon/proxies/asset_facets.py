# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets of the clusters of assets: places, orientations and colors are those of samples on their faces.

Sizes, numbers and the order in which facets come and go are those of plants (`facet_sizes`, `microsurfaces`).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, perpendicular, unit
from ..assets.asset import COUNTS
from ..growth.hashing import signed, uniform
from ..optics import recollision_albedo
from ..refinement.contents import Totals
from ..refinement.shared_parts import AssetParts, PlacedAssets
from .facet_weights import by_number
from .microsurfaces import Facets, facet_numbers

#: Child indices of facets of leaves and of wood start here; draws of their numbers, turns and places.
_LEAF_PATH, _WOOD_PATH = 1 << 42, 1 << 43
_LEAF_COUNT, _WOOD_COUNT, _TURN, _MOVE = 252, 253, 254, 255
#: Sides of a facet by which one is moved that has the sample of another.
_MOVED = 1.5


def facet_totals(placed: PlacedAssets, parts: AssetParts) -> Totals:
    """Totals (n,) of clusters, with closed leaves as if they were sheets: half of each is never seen."""
    totals, closed_leaves = parts.totals, placed.closed_leaves(parts)
    return replace(totals, leaf_area=totals.leaf_area + closed_leaves / 2, wood_area=totals.wood_area - closed_leaves)


def asset_weights(placed: PlacedAssets, parts: AssetParts, number: Floats) -> Floats:
    """Fraction (n,) of their area that facets of clusters (n,) get, of which there are so many (n,) each."""
    return by_number(placed.assets.clusters.weights, parts.cluster, number, COUNTS)


def facets_of_assets(
    placed: PlacedAssets, parts: AssetParts, totals: Totals, leaf: Floats, wood: Floats, left_out: Floats | None = None
) -> Facets:
    """Facets of clusters (n,) with `facet_totals`, of sides for leaves and for wood (n,), meters.

    A fraction (n,) of them is left out.
    """
    weight = asset_weights(placed, parts, totals.optical_area / np.maximum(leaf, 1e-12) ** 2)
    key = placed.keys(parts)
    kinds = (
        (True, totals.leaf_area, leaf, _LEAF_PATH, _LEAF_COUNT),
        (False, totals.wood_area / 2, wood, _WOOD_PATH, _WOOD_COUNT),
    )
    made = []
    for leafy, area, side, path, draw in kinds:
        owner, index, own, one = facet_numbers(key, area, side**2, path, draw, left_out)
        made.append(_placed(placed, parts, key, leafy, owner, index, own, np.sqrt(one * weight[owner]), weight[owner]))
    return Facets.concatenate(made)


def _placed(
    placed: PlacedAssets,
    parts: AssetParts,
    part_key: NDArray[np.uint64],
    leafy: bool,
    owner: Integers,
    index: Integers,
    key: NDArray[np.uint64],
    side: Floats,
    weight: Floats,
) -> Facets:
    """Facets (m,) of clusters: each at a sample, turned about its normal as may be."""
    samples, clusters = placed.assets.samples, placed.assets.clusters
    pick = placed.picked(parts, part_key, leafy, owner, index)
    instance = parts.instance[owner]
    center = placed.to_world(samples.position[pick], instance)
    local = samples.normal[pick].astype(np.float64)
    linear, some = placed.instances.linear, placed.stretched[instance]
    normal = np.zeros_like(center)
    for i in range(3):
        for k in range(3):
            normal[:, i] += linear[instance, i, k] * local[:, k]
    if some.any():
        at = np.flatnonzero(some)
        normal[at] = np.einsum("nij,nj->ni", placed.cofactors(instance[at]), local[at])
        # Faces of one cluster grow by different factors, and so do their facets.
        cluster = parts.cluster[owner[at]]
        mean = parts.totals.area[owner[at]] / (clusters.leaf_area[cluster] + clusters.wood_area[cluster])
        side = side.copy()
        side[at] *= np.sqrt(np.linalg.norm(normal[at], axis=1) / mean)
    normal = unit(normal)
    across = perpendicular(normal)
    turn = 2 * np.pi * uniform(key, _TURN)[:, None]
    across = np.cos(turn) * across + np.sin(turn) * np.cross(normal, across)
    along = np.cross(normal, across)
    # Where there are more facets than samples, none may lie upon another.
    number = (clusters.leaf_samples if leafy else clusters.wood_samples)[parts.cluster]
    again = np.flatnonzero(index >= number[owner])
    if len(again):
        for axis, by in ((across, _MOVE), (along, _MOVE + 1)):
            center[again] += (_MOVED * side[again] * signed(key[again], by))[:, None] * axis[again]
    color = recollision_albedo(samples.color[pick].astype(np.float64), weight)
    through, rough = (own[pick].astype(np.float64) for own in (samples.transmission, samples.roughness))
    dull = 1.0 - np.clip(weight, 0.0, 1.0)
    return Facets(center, across, along, side, color, through, roughness=rough, dull=dull)
