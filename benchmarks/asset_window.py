# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport part of the benchmark `assets`: redraws in solid shading of a refined wood and of a plain one.

Needs a full Blender, named by the environment variable BLENDER, and a virtual screen (devtools/window.py). Without, it
says so and measures nothing. Under software OpenGL seconds are those of the processor; what counts is their ratio.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from devtools import window

from .report import records_of

TIMEOUT, REDRAWS = 1500.0, 3


def redraws(folder: Path, refined: int, plain: int, quick: bool, plain_only: bool) -> dict[str, float]:
    """Seconds of a redraw of so many refined and so many plain instances, and their ratio."""
    blender, missing = os.environ.get("BLENDER"), window.missing_tools()
    if not blender or missing:
        what = "BLENDER=/path/to/blender" if not blender else ", ".join(missing)
        print(f"assets: nothing measured in the window, it needs {what}", file=sys.stderr)
        return {}
    files = {f"plain_{plain}": folder / "window-plain.blend", f"refined_{refined}": folder / "window-refined.blend"}
    cases = [("window_file", "plain", plain), ("window_file", "refined", refined)][: 1 if plain_only else 2]
    for case in cases:
        records_of(["benchmarks.assets", "--case", *map(str, case), *(["--quick"] if quick else [])])
    figures: dict[str, float] = {}
    for name, path in list(files.items())[: len(cases)]:
        out = folder / f"window-{name}"
        out.mkdir(parents=True, exist_ok=True)
        wanted = {"file": str(path), "redraws": REDRAWS, "refined": name.startswith("refined")}
        (out / "wanted.json").write_text(json.dumps(wanted), encoding="utf-8")
        steps = Path(__file__).with_name("asset_window_steps.py")
        result = window.run_in_window(str(Path(blender).absolute()), steps, out, TIMEOUT)
        if not result["ok"]:
            raise RuntimeError(result["error"])
        figures |= {f"viewport_{key}_{name}": value for key, value in result["values"].items()}
    if not plain_only:
        ours, theirs = (figures[f"viewport_redraw_s_{name}"] for name in (f"refined_{refined}", f"plain_{plain}"))
        figures["viewport_ratio"] = ours / theirs
    return figures
