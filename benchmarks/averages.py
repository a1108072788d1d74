# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What compiled species foretell, against a thousand plants grown: areas, colours and orientation by order.

All sub-plants of one order together are foretold from their rows, and compared with the leaves and branches that really
grow on them. Errors are relative; that of orientation is the largest entry of the difference of both moments.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from devtools import session

from .plants import Targets
from .plants import plants as planted

SEEDS, QUICK_SEEDS = 1000, 100
#: Polygons that are grown at a time, and leaves of each species whose orientation is looked at.
AT_ONCE = 1_500_000
ORIENTED = 1_500_000

TARGETS: Targets = {
    "leaf_area_error_max": {"max": 0.01},
    "wood_area_error_max": {"max": 0.01},
    "colour_error_max": {"max": 0.01},
    "moment_error_max": {"max": 0.01},
}
QUICK_TARGETS: Targets = {name: {"max": 0.05} for name in TARGETS}

_FIELDS = 14  # leaf area, wood area, leaf area × colour, moment × leaf area of the oriented ones


def run(quick: bool) -> dict[str, float]:
    """Measure all species."""
    catalogue, compiled = (session.part(f"tetflora_addon.plants.{n}") for n in ("catalogue", "compiled"))
    figures: dict[str, float] = {}
    kinds = ("leaf_area", "wood_area", "colour", "moment")
    for name in catalogue.list_species():
        flora = compiled.compile_species([catalogue.load_species(name)])
        errors = species_errors(flora, QUICK_SEEDS if quick else SEEDS)
        figures |= {f"{kind}_error_{name}": value for kind, value in zip(kinds, errors, strict=True)}
    worst = {
        f"{kind}_error_max": max(v for k, v in figures.items() if k.startswith(f"{kind}_error_")) for kind in kinds
    }
    return worst | figures


def species_errors(flora: Any, seeds: int) -> tuple[float, float, float, float]:
    """Largest error over the orders, of leaf area, wood area, colour of leaves and their orientation."""
    part = session.part
    growth, expansion = part("tetflora_addon.plants.growth"), part("tetflora_addon.plants.expansion")
    trunks = growth.trunks(flora.rows, planted(flora, seeds * float(flora.polygons[flora.first_row[0]])))
    found, told = np.zeros((2, 8, _FIELDS))
    leaves = 0
    for chunk in expansion.chunks(flora.polygons[trunks.row], AT_ONCE):
        level, depth = trunks.take(chunk), 0
        while len(level):
            told[depth] += foretold(flora, level, leaves < ORIENTED)
            level, _, pieces, _ = expansion.open_subplants(flora, level)
            own, number = grown(flora, pieces, leaves < ORIENTED)
            found[depth] += own
            leaves += number
            depth += 1
    # What grows on an order is what its branches bear themselves and all that the orders beyond bear.
    found = np.cumsum(found[::-1], axis=0)[::-1]
    held = told[:, 0] > 1e-9
    wood = told[:, 1] > 1e-9
    ratio = np.abs(found[held, 0] / told[held, 0] - 1)
    colour = np.abs(found[held, 2:5] / found[held, :1] - told[held, 2:5] / told[held, :1])
    scale = (told[held, 2:5] / told[held, :1]).max(axis=1, keepdims=True)
    oriented = held & (told[:, 5:].sum(axis=1) != 0)
    moments = [m[oriented, 5:] / m[oriented, 5:][:, [0, 4, 8]].sum(axis=1, keepdims=True) for m in (found, told)]
    return (
        float(ratio.max(initial=0)),
        float(np.abs(found[wood, 1] / told[wood, 1] - 1).max()),
        float((colour / scale).max(initial=0)),
        float(np.abs(moments[0] - moments[1]).max(initial=0)),
    )


def foretold(flora: Any, subplants: Any, oriented: bool) -> np.ndarray:
    """Expected sums over sub-plants."""
    sizes, orientation = (session.part(f"tetflora_addon.{n}") for n in ("refinement.amounts", "plants.orientation"))
    amounts = sizes.subplant_amounts(flora, subplants)
    out = np.zeros(_FIELDS)
    out[0], out[1] = amounts.leaf_area.sum(), amounts.wood_area.sum()
    out[2:5] = amounts.leaf_area @ flora.leaf_colours(subplants)
    if oriented:
        each = orientation.leaf_moments(flora.orientation, subplants)
        out[5:] = np.einsum("n,nij->ij", amounts.leaf_area, each).ravel()
    return out


def grown(flora: Any, pieces: Any, oriented: bool) -> tuple[np.ndarray, int]:
    """The same sums over the branches' own leaves and wood as they are, and the number of leaves."""
    part = session.part
    foliage, growth = part("tetflora_addon.plants.foliage"), part("tetflora_addon.plants.growth")
    out = np.zeros(_FIELDS)
    out[1] = part("tetflora_addon.plants.pieces").wood_areas(flora, pieces).sum()
    rows = flora.rows
    bearers = pieces.take(pieces.t1 == 1).branches
    total = 0
    for row in np.unique(bearers.row):
        branches = bearers.take(bearers.row == row)
        counts = growth.leaf_counts(rows, branches)
        owner, index = growth.spread(counts)
        if len(owner) == 0:
            continue
        total += len(owner)
        key = foliage.leaf_keys(branches, owner, index)
        t = foliage.leaf_places(rows, branches, owner, index, counts, key)
        leaves = foliage.place_leaves(rows, branches, growth.axes(rows, branches), owner, index, key, t)
        forms = flora.forms[0][int(rows["leaf_kind"][row])]
        form = foliage.leaf_forms(len(forms), key)
        area = leaves.size**2 * np.array([m.area for m in forms])[form]
        out[0] += area.sum()
        only = np.array([row])
        out[2:5] += area @ foliage.leaf_colours(rows, only, key, foliage.outwardness(rows, branches, owner, t))
        if oriented:
            frame = foliage.settled(rows, only, leaves.frame, leaves.light, np.array([0.0, 0.0, 1.0])).astype(float)
            model = np.array([m.moment for m in forms])[form]
            out[5:] += np.einsum("n,nij,njk,nlk->il", area, frame, model, frame, optimize=True).ravel()
    return out, total
