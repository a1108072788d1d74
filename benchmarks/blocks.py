# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long TetFlora holds the window at a time: 100,000 plants are populated, refined, and looked at by a camera that
moves, while they are refined again by themselves.

Each call of an operator, a timer or a handler is timed in a real window; redraws are Blender's own, and so are the
objects that it makes and removes. Needs a full Blender, named by the environment variable BLENDER, and a virtual screen
(devtools/window.py). Without, it says so and measures nothing: its targets do not count then.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

from devtools import window

from .report import Targets

PLANTS, QUICK_PLANTS = 100_000, 10_000
TIMEOUT = 900.0

TARGETS: Targets = {"block_ms_max": {"max": 50.0}}
QUICK_TARGETS: Targets = {}


def run(quick: bool) -> dict[str, float]:
    """Measure; the longest call of each kind goes to the terminal."""
    blender, missing = os.environ.get("BLENDER"), window.missing_tools()
    if not blender or missing:
        what = "BLENDER=/path/to/blender" if not blender else ", ".join(missing)
        print(f"blocks: nothing measured, it needs {what}", file=sys.stderr)
        TARGETS.clear()
        return {}
    with tempfile.TemporaryDirectory(prefix="tetflora-blocks-") as folder:
        out = Path(os.environ.get("TETFLORA_PICTURES", folder)) / "blocks"
        out.mkdir(parents=True, exist_ok=True)
        (out / "wanted.json").write_text(json.dumps({"plants": QUICK_PLANTS if quick else PLANTS}), encoding="utf-8")
        steps = Path(__file__).with_name("blocks_steps.py")
        result = window.run_in_window(str(Path(blender).absolute()), steps, out, TIMEOUT)
    if not result["ok"]:
        raise RuntimeError(result["error"])
    seen = result["values"]
    longest: dict[str, float] = {}
    for part, calls in seen["longest_ms"].items():
        for name, spent in sorted(calls.items(), key=lambda item: -item[1]):
            print(f"  {part:10s} {name:60s} {spent:8.1f} ms", file=sys.stderr)
        longest[f"{part}_ms"] = max(calls.values(), default=0.0)
    return {
        "plants": seen["plants"],
        "populate_s": seen["populate_s"],
        "refine_s": seen["refine_s"],
        **longest,
        "block_ms_max": max(longest.values()),
    }
