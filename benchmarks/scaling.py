# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much faster a landscape is refined and made into meshes on two cores than on one.

Both numbers of threads take turns in one run, the fastest of each counts. ``serial_fraction`` is the part that one core
would do alone however many there were, by Amdahl's law; it foresees ``speedup_16``. Counts must be the same.
"""

from __future__ import annotations

import bpy

from examples import landscape

from .report import Targets, peak_mb
from .row80 import timed_refine

PLANTS, QUICK_PLANTS = landscape.PLANTS, landscape.PLANTS // 4
ROUNDS, QUICK_ROUNDS = 4, 2

TARGETS: Targets = {"speedup_2": {"min": 1.7}, "serial_fraction": {"max": 0.08}, "counts_differ": {"max": 0}}
QUICK_TARGETS: Targets = {"counts_differ": {"max": 0}}


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    scene = bpy.context.scene
    landscape.build(scene, QUICK_PLANTS if quick else PLANTS)
    scene.render.threads_mode = 'FIXED'
    seconds: dict[int, list[float]] = {1: [], 2: []}
    counts = set()
    for _ in range(QUICK_ROUNDS if quick else ROUNDS):
        for number, own in seconds.items():
            scene.render.threads = number
            statistics, taken = timed_refine(scene)
            own.append(taken)
            counts.add((statistics.polygons_meshed, statistics.polygons_proxy))
    one, two = (min(own) for own in seconds.values())
    serial = min(max(2.0 * two / one - 1.0, 0.0), 1.0)
    return {
        "one_s": one,
        "two_s": two,
        "speedup_2": one / two,
        "serial_fraction": serial,
        "speedup_16": 1.0 / (serial + (1.0 - serial) / 16.0),
        "counts_differ": len(counts) - 1,
        "peak_mb": peak_mb(),
    }
