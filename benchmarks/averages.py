# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Predictions of compiled species against a thousand grown plants: areas, colors and orientation by order.

All sub-plants of one order together are predicted from their rows and compared with the leaves and branches that grow
on them. Errors are relative; that of orientation is the largest entry of the difference of both moments.

A thousand plants have a mean that chance moves, too. Beside each error therefore stands its standard error ("noise"),
from how much groups of plants differ (ratio estimator; Cochran, "Sampling Techniques", 1977), and the excess: what the
error is above twice that. The targets are asked of the excess.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tetflora_addon.arrays import spread
from tetflora_addon.compiled import orientation
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.growth import colors, foliage, growth
from tetflora_addon.growth.axes import axes
from tetflora_addon.refinement import contents
from tetflora_addon.species import catalog
from tetflora_addon.subplants import pieces
from tetflora_addon.subplants.pieces import chunks, open_subplants

from .plants import Targets, plants_of

SEEDS, QUICK_SEEDS = 1000, 100
#: Polygons that are grown at a time, and leaves of each species whose orientation is looked at.
BATCH = 400_000
ORIENTED = 3_000_000
#: Groups into which the plants of a species are divided at least.
GROUPS = 20

KINDS = ("leaf_area", "wood_area", "color", "moment")
TARGETS: Targets = {f"{kind}_excess_max": {"max": 0.01} for kind in KINDS}
QUICK_TARGETS: Targets = {name: {"max": 0.05} for name in TARGETS}

_FIELDS = 14  # leaf area, wood area, leaf area × color, moment × leaf area of the oriented ones


def run(quick: bool) -> dict[str, float]:
    """Measure all species."""
    figures: dict[str, float] = {}
    for name in catalog.list_species():
        flora = compile_species([catalog.load_species(name)])
        for kind, found in species_errors(flora, QUICK_SEEDS if quick else SEEDS).items():
            figures |= {f"{kind}_{what}_{name}": value for what, value in found.items()}
    worst = {
        f"{kind}_{what}_max": max(v for k, v in figures.items() if k.startswith(f"{kind}_{what}_"))
        for what in ("error", "excess")
        for kind in KINDS
    }
    return worst | figures


def species_errors(flora: Any, seeds: int) -> dict[str, dict[str, float]]:
    """Largest error over the orders of each kind, its standard error, and the largest excess."""
    trunks = growth.trunks(flora.rows, plants_of(flora, seeds * float(flora.polygons[flora.first_row[0]])))
    polygons = flora.polygons[trunks.row]
    groups = list(chunks(polygons, min(BATCH, polygons.sum() / GROUPS)))
    found, predicted = np.zeros((2, len(groups), 8, _FIELDS))
    leaves, looked_at = 0, 0
    for g, group in enumerate(groups):
        level, depth = trunks.take(group), 0
        # Of a plant all orders or none: those beyond count for those before as well.
        oriented = leaves < ORIENTED
        looked_at += oriented
        while len(level):
            predicted[g, depth] = prediction(flora, level, oriented)
            level, _, pieces, _ = open_subplants(flora, level)
            found[g, depth], number = grown(flora, pieces, oriented)
            leaves += number
            depth += 1
    # What grows on an order is what its branches bear themselves and all that the orders beyond bear.
    found = np.cumsum(found[:, ::-1], axis=1)[:, ::-1]
    held, wood = predicted.sum(axis=0)[:, 0] > 1e-9, predicted.sum(axis=0)[:, 1] > 1e-9
    found, predicted, bark = found[:, held], predicted[:, held], (found[:, wood, 1:2], predicted[:, wood, 1:2])
    area = found[..., :1], predicted[..., :1]
    color = [deviations(sums[..., 2:5], whole) for sums, whole in zip((found, predicted), area, strict=True)]
    scale = color[1][0].max(axis=1, keepdims=True)
    turned = [sums[:looked_at, :, 5:] for sums in (found, predicted)]
    moment = [deviations(sums, sums[..., [0, 4, 8]].sum(axis=2, keepdims=True)) for sums in turned]
    return {
        "leaf_area": summed_up(*of_ratio(*area)),
        "wood_area": summed_up(*of_ratio(*bark)),
        "color": summed_up((color[0][0] - color[1][0]) / scale, (color[0][1] - color[1][1]) / scale),
        "moment": summed_up(moment[0][0] - moment[1][0], moment[0][1] - moment[1][1]),
    }


def deviations(sums: np.ndarray, whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ratio of sums (groups, orders, k) to others, and by how much each group moves it."""
    total = whole.sum(axis=0)
    ratio = sums.sum(axis=0) / np.where(total > 0, total, 1)
    return ratio, (sums - ratio * whole) / np.where(total > 0, total, 1)


def of_ratio(found: np.ndarray, predicted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Relative error of what is predicted, and by how much each group moves it."""
    ratio, each = deviations(found, predicted)
    return ratio - 1, each


def summed_up(error: np.ndarray, each: np.ndarray) -> dict[str, float]:
    """Largest of errors (orders, k), its standard error, and the largest excess."""
    if error.size == 0:
        return {"error": 0.0, "noise": 0.0, "excess": 0.0}
    noise = np.sqrt((each**2).sum(axis=0) * len(each) / max(len(each) - 1, 1))
    worst = np.abs(error).argmax()
    return {
        "error": float(np.abs(error).flat[worst]),
        "noise": float(noise.flat[worst]),
        "excess": float(np.maximum(np.abs(error) - 2 * noise, 0).max()),
    }


def prediction(flora: Any, subplants: Any, oriented: bool) -> np.ndarray:
    """Expected sums over sub-plants."""
    expected = contents.subplant_totals(flora, subplants)
    out = np.zeros(_FIELDS)
    out[0], out[1] = expected.leaf_area.sum(), expected.wood_area.sum()
    out[2:5] = expected.leaf_area @ flora.leaf_colors(subplants)
    if oriented:
        each = orientation.leaf_moments(flora.orientation, subplants)
        out[5:] = np.einsum("n,nij->ij", expected.leaf_area, each).ravel()
    return out


def grown(flora: Any, wood: Any, oriented: bool) -> tuple[np.ndarray, int]:
    """The same sums over the branches' own leaves and wood as they are, and the number of leaves."""
    out = np.zeros(_FIELDS)
    out[1] = pieces.wood_areas(flora, wood).sum()
    rows = flora.rows
    bearers = wood.take(wood.t1 == 1).branches
    total = 0
    for row in np.unique(bearers.row):
        branches = bearers.take(bearers.row == row)
        counts = growth.leaf_counts(rows, branches)
        owner, index = spread(counts)
        if len(owner) == 0:
            continue
        total += len(owner)
        key = foliage.leaf_keys(branches, owner, index)
        t = foliage.leaf_places(rows, branches, owner, index, counts, key)
        leaves = foliage.place_leaves(rows, branches, axes(rows, branches), owner, index, key, t)
        forms = flora.forms[0][int(rows["leaf_kind"][row])]
        form = foliage.leaf_forms(len(forms), key)
        area = leaves.size**2 * np.array([m.area for m in forms])[form]
        out[0] += area.sum()
        only = np.array([row])
        out[2:5] += area @ colors.leaf_colors(rows, only, key, foliage.outwardness(rows, branches, owner, t))
        if oriented:
            frame = foliage.settled(rows, only, leaves.frame, leaves.light, np.array([0.0, 0.0, 1.0])).astype(float)
            model = np.array([m.moment for m in forms])[form]
            out[5:] += np.einsum("n,nij,njk,nlk->il", area, frame, model, frame, optimize=True).ravel()
    return out, total
