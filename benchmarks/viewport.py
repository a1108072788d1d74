# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport in a real window: 10,000 previewed plants against 10,000 plain empties, and the draw of panels.

Needs a full Blender, named by the environment variable BLENDER, and a virtual screen (devtools/window.py). Without, it
says so and measures nothing: its targets do not count then. Under software OpenGL the seconds are those of the
processor; what counts is their ratio, from one run on one machine.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

from devtools import window

from .report import Targets

PLANTS, QUICK_PLANTS = 10_000, 2_000
REDRAWS, QUICK_REDRAWS = 15, 6
DRAWS = 12
TIMEOUT = 900.0

TARGETS: Targets = {
    # Empties stay in view, or are hidden in the viewport by Blender's own switch, which the panel shows.
    "rate_with_empties": {"min": 0.5},
    "rate_plants_alone": {"min": 0.5},
    "panel_ms": {"max": 1.0},
}
QUICK_TARGETS: Targets = TARGETS


def run(quick: bool) -> dict[str, float]:
    """Measure; rates are redraws of previewed plants for each redraw of empties, panels in milliseconds."""
    blender = os.environ.get("BLENDER")
    missing = window.missing_tools()
    if not blender or missing:
        what = "BLENDER=/path/to/blender" if not blender else ", ".join(missing)
        print(f"viewport: nothing measured, it needs {what}", file=sys.stderr)
        TARGETS.clear()
        return {}
    plants, redraws = (QUICK_PLANTS, QUICK_REDRAWS) if quick else (PLANTS, REDRAWS)
    with tempfile.TemporaryDirectory(prefix="tetflora-viewport-") as folder:
        out = Path(os.environ.get("TETFLORA_PICTURES", folder)) / "viewport"
        out.mkdir(parents=True, exist_ok=True)
        wanted = {"plants": plants, "redraws": redraws, "draws": DRAWS}
        (out / "wanted.json").write_text(json.dumps(wanted), encoding="utf-8")
        steps = Path(__file__).with_name("viewport_steps.py")
        result = window.run_in_window(str(Path(blender).absolute()), steps, out, TIMEOUT)
    if not result["ok"]:
        raise RuntimeError(result["error"])
    seen = result["values"]
    panels = seen["panels_ms"]
    slowest = max(panels, key=panels.get)
    for name, spent in sorted(panels.items(), key=lambda item: -item[1]):
        print(f"  {name:32s} {spent:8.3f} ms", file=sys.stderr)
    return {
        "plants": seen["plants"],
        "nothing_ms": 1e3 * seen["nothing_s"],
        "empties_ms": 1e3 * seen["empties_s"],
        "with_empties_ms": 1e3 * seen["both_s"],
        "plants_alone_ms": 1e3 * seen["plants_alone_s"],
        "bounds_ms": 1e3 * seen["bounds_s"],
        "rate_with_empties": seen["empties_s"] / seen["both_s"],
        "rate_plants_alone": seen["empties_s"] / seen["plants_alone_s"],
        "rate_bounds": seen["empties_s"] / seen["bounds_s"],
        "reading_s": seen["reading_s"],
        "levels": seen["levels"],
        "tetrahedra": seen["tetrahedra"],
        "levels_s": seen["levels_s"],
        "levels_mb": seen["levels_mb"],
        "wires_ms": 1e3 * seen["wires_s"],
        "translucent_ms": 1e3 * seen["translucent_s"],
        "panels": len(panels),
        "panels_ms": sum(panels.values()),
        "panel_ms": panels[slowest],
        "preview_panel_ms": panels["TETFLORA_PT_developer"],
    }
