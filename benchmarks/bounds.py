# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether bounds of sub-plants hold, and how tight they are.

*Outside*: vertices of plants of many seeds that lie outside their compiled bounds. *Ratios*: the volume of these bounds
over that of the convex hull of the vertices; medians over the sub-plants of each species and order.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from tetflora_addon.arrays import spread
from tetflora_addon.compiled import bounds
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.growth import foliage, growth
from tetflora_addon.growth.branches import Branches
from tetflora_addon.species import catalog
from tetflora_addon.subplants import bodies, pieces, tubes

from .plants import plants_of
from .report import Targets

SEEDS, QUICK_SEEDS = 1000, 20
#: Sub-plants of each order whose hulls are measured, as far as their polygons allow.
SUBPLANTS, QUICK_SUBPLANTS = 24, 5
HULL_POLYGONS, QUICK_HULL_POLYGONS = 400_000, 50_000
BATCH = 400_000
_FLOAT32 = 1e-6

TARGETS: Targets = {"outside": {"max": 0}}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure all species; see the table in ``docs/results.md`` for what the figures mean."""
    beyond, begun = 0, time.perf_counter()
    ratios: dict[str, float] = {}
    seconds = 0.0
    for name in catalog.list_species():
        flora = compile_species([catalog.load_species(name)])
        begun = time.perf_counter()
        beyond += vertices_outside(flora, QUICK_SEEDS if quick else SEEDS)
        seconds += time.perf_counter() - begun
        polygons = QUICK_HULL_POLYGONS if quick else HULL_POLYGONS
        for order, some in sorted(subplants(flora, QUICK_SUBPLANTS if quick else SUBPLANTS, polygons).items()):
            ratios[f"hull_ratio_{name}_{order}"] = median(
                hull_ratio(flora, some.take(np.array([i]))) for i in range(len(some))
            )
    return {
        "outside": beyond,
        "hull_ratio_median": median(ratios.values()),
        "hull_ratio_max": max(ratios.values()),
        "outside_s": seconds,
        **ratios,
    }


def grown(flora: Any, branches: Any) -> NDArray[np.float64]:
    """All vertices (v, 3) of sub-plants of one species."""
    whole = list(pieces.expand(flora, branches))
    bark = tubes.tube_buffers(flora, whole)
    out = [] if bark is None else [bark.positions]
    for own, leaves in placed_leaves(flora, whole):
        row = own.row[:1]
        frame = foliage.settled(flora.rows, row, leaves.frame, leaves.light, np.array([0.0, 0.0, 1.0]))
        forms = flora.forms[0][flora.rows["leaf_kind"][row[0]]]
        which = foliage.leaf_forms(len(forms), leaves.key)
        for number, form in enumerate(forms):
            some = np.flatnonzero(which == number)
            shape = np.einsum("nij,vj->nvi", frame[some] * leaves.size[some, None, None], form.positions)
            out.append((leaves.position[some, None] + shape).reshape(-1, 3))
    return np.concatenate(out).astype(np.float64)


def placed_leaves(flora: Any, whole: list[Any]) -> Iterator[tuple[Any, Any]]:
    """Branches and all leaves on their own axes, row by row."""
    rows = flora.rows
    for some in whole:
        for row in np.unique(some.branches.row):
            if rows["leaves"][row].sum() > 0:
                own = some.take(some.branches.row == row)
                counts = growth.leaf_counts(rows, own.branches)
                owner, index = spread(counts)
                key = foliage.leaf_keys(own.branches, owner, index)
                t = foliage.leaf_places(rows, own.branches, owner, index, counts, key)
                yield own.branches, foliage.place_leaves(rows, own.branches, own.lines, owner, index, key, t)


def vertices_outside(flora: Any, seeds: int) -> int:
    """Vertices of plants of many seeds outside their bodies.

    Plants whose spheres around leaves and around the ends of wood lie inside have none; others are looked at whole.
    """
    trunks = growth.trunks(flora.rows, plants_of(flora, seeds * float(flora.polygons[0])))
    wide = np.maximum(1 + flora.rows["flare"], bounds.ring_stretch(flora.rows))
    out = 0
    for chunk in pieces.chunks(flora.polygons[trunks.row], BATCH):
        plants = trunks.take(chunk)
        around, first = bodies.bounding_capsules(flora, plants), plants.plant[0]
        whole = list(pieces.expand(flora, plants))
        doubtful = np.zeros(len(plants), bool)
        for some in whole:
            owner, _, position = some.knots(flora.rows)
            plant = some.branches.plant[owner] - first
            radius = (some.branches.radius * wide[some.branches.row])[owner]
            doubtful[plant[excess(around, plant, position) + radius > 0]] = True
        for own, leaves in placed_leaves(flora, whole):
            at, reach = own.plant[leaves.branch] - first, flora.leaf.reach[own.row[0]] * leaves.size
            doubtful[at[excess(around, at, leaves.position) + reach > 0]] = True
        for i in np.flatnonzero(doubtful):
            points = grown(flora, plants.take(np.array([i])))
            allowed = _FLOAT32 * (np.abs(points).max() + around[6:, i].sum())
            out += int((excess(around, np.full(len(points), i), points) > allowed).sum())
    return out


def excess(around: NDArray[np.float64], which: NDArray, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points (n, 3) lie outside some of `bodies.bounding_capsules`, meters; negative inside."""
    body = np.take(around, which, axis=1)
    offset = points.T - body[:3]
    along = np.einsum("in,in->n", offset, body[3:6])
    across = np.sqrt(np.maximum(np.einsum("in,in->n", offset, offset) - along**2, 0))
    return np.hypot(np.maximum(np.abs(along) - body[7], 0), np.maximum(across - body[6], 0)) - body[8]


def subplants(flora: Any, number: int, polygons: float) -> dict[int, Any]:
    """Sub-plants by order (100 for short shoots), from several plants."""
    rng = np.random.default_rng(0)
    level = growth.trunks(flora.rows, plants_of(flora, 30 * float(flora.polygons[0])))
    kinds: dict[int, list[Any]] = {}
    while len(level):
        orders = flora.rows["order"][level.row]
        for order in np.unique(orders):
            kinds.setdefault(int(order), []).append(level.take(orders == order))
        level = level.take(rng.permutation(len(level))[:120])
        level, *_ = pieces.open_subplants(flora, level)
    out = {}
    for order, found in kinds.items():
        every = Branches.concatenate(found)
        faces = flora.polygons[every.row].mean()
        out[order] = every.take(rng.permutation(len(every))[: int(np.clip(polygons / faces, 2, number))])
    return out


def hull_ratio(flora: Any, subplant: Any) -> float:
    """Volume of the compiled body of a sub-plant over that of its vertices' hull."""
    radius, half, pad = bodies.bounding_capsules(flora, subplant)[6:, 0]
    # A cylinder with rounded edges (Steiner's formula).
    area = 2 * np.pi * radius * (radius + 2 * half)
    mean_width = np.pi * (np.pi * radius + 2 * half)
    volume = np.pi * radius**2 * 2 * half + area * pad + mean_width * pad**2 + 4 / 3 * np.pi * pad**3
    return volume / ConvexHull(grown(flora, subplant)).volume
