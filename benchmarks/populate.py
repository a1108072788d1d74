# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populate: processor seconds to find places for 10,000, 100,000 and 1,000,000 plants with all rules at once.

The engine's part only: what becomes objects or a field of them is Blender's. The ground is a hilly square that grows
with the number of plants, 250 of them a hectare, with a mask, an image, an area and a path.
"""

from __future__ import annotations

import time

import numpy as np

from tetflora_addon.planting.places import place
from tetflora_addon.planting.rules import Companion, Rules
from tetflora_addon.planting.terrain import Path, Terrain

from .report import Targets, peak_mb

COUNTS = {"10k": 10_000, "100k": 100_000, "1m": 1_000_000}
QUICK = ("10k", "100k")
CELLS = 300

TARGETS: Targets = {
    **{f"placed_{name}": {"min": 1.0} for name in COUNTS},
    "seconds_10k": {"max": 1.5},
    "seconds_100k": {"max": 3.0},
    "seconds_1m": {"max": 30.0},
}
QUICK_TARGETS: Targets = {name: t for name, t in TARGETS.items() if not name.endswith("1m")}

RULES = Rules(
    seed=3,
    min_distance=0.9,
    slope_max=np.radians(50.0),
    altitude_min=-35.0,
    altitude_max=38.0,
    altitude_falloff=5.0,
    aspect=0.3,
    aspect_spread=2.0,
    edge_falloff=60.0,
    clumping=0.8,
    clump_size=30.0,
    scale_at_top=0.5,
    tilt=0.3,
    weights=(3.0, 1.0, 1.0),
    companions=(Companion(1, 0, 1.0, 5.0), Companion(2, 0, -1.0, 2.0)),
)


def ground(width: float) -> Terrain:
    """Hills with a mask that follows the altitude, a chequered image, a lobed area and a winding path."""
    along = np.linspace(0.0, width, CELLS + 1)
    x, y = np.meshgrid(along, along, indexing="ij")
    z = 40.0 * np.sin(x / 90.0) * np.cos(y / 70.0) + 8.0 * np.sin(x / 13.0) * np.sin(y / 17.0)
    p = np.stack([x, y, z], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    triangles = np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    turn = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    radius = width * (0.45 + 0.02 * np.sin(9.0 * turn))
    area = width / 2.0 + radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    way = np.linspace(0.0, 1.0, 500)
    path = width * np.stack([way, 0.5 + 0.2 * np.sin(12.0 * way)], axis=1)
    texel = np.arange(512)
    image = np.where((texel[:, None] // 32 + texel // 32) % 2, 0.9, 0.3).astype(np.float32)
    return Terrain(
        triangles,
        weight=np.clip((triangles[..., 2] + 50.0) / 60.0, 0.0, 1.0),
        uv=triangles[..., :2] / width,
        image=image,
        areas=(area,),
        paths=(Path(path, 4.0),),
    )


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    figures: dict[str, float] = {}
    for name in QUICK if quick else COUNTS:
        count = COUNTS[name]
        for label, rules in (("", RULES), ("_plain", Rules(seed=3, min_distance=0.9))):
            terrain = ground(np.sqrt(count * 40.0))
            rules = Rules(**{**vars(rules), "count": count})
            begun = time.process_time()
            placed = place(terrain, rules)
            figures[f"seconds{label}_{name}"] = time.process_time() - begun
            figures[f"placed{label}_{name}"] = len(placed) / count
        figures[f"peak_mb_{name}"] = peak_mb()
    return figures
