# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The year and the age of plants: whether proxies follow them, whether they are those of nature, and what they cost.

    python -m benchmarks year [--quick] [--json PATH]         # everything, with targets
    python -m benchmarks.year --parts wood birch              # of those in `PARTS`
    python -m benchmarks.year --keep --minutes 8              # what earlier runs left undone, as far as one comes
    python -m benchmarks.year --keep --json PATH              # figures of all that is there

Pictures and records are left in ``out/year``. Without ``--keep`` a part begins anew.

Reduced, since expanded plants take a processor long: the year of a wood is 320 × 180 pixels with 16 samples and 32
plants of 6 to 16 years, the life of a birch 200 × 280 with 24; plants whose facets are compared are 12, 50 and 200
pixels high. Frames whose meshes are those of the frame before, to the bit, are that frame's picture.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from devtools import session

from .report import ROOT, Targets

FOLDER = ROOT / "out" / "year"
PARTS = ("wood", "birch", "curves", "facets", "refining", "compiling", "summer")

TARGETS: Targets = {
    "flip_steps_max": {"max": 0.01},
    "leaf_area_error_max": {"max": 0.10},
    "heights_within": {"min": 1.0},
    "diameters_within": {"min": 1.0},
    "opacity_error_max": {"max": 0.01},
    "color_error_max": {"max": 0.01},
    "refine_ratio_max": {"max": 1.1},
    "compile_ratio_max": {"max": 1.5},
    "memory_ratio_max": {"max": 2.0},
    "summer_is_the_same": {"min": 1.0},
}
QUICK_TARGETS: Targets = {
    "flip_steps_max": {"max": 0.02},
    "leaf_area_error_max": {"max": 0.10},
    "heights_within": {"min": 1.0},
    "diameters_within": {"min": 1.0},
    "opacity_error_max": {"max": 0.03},
    "color_error_max": {"max": 0.03},
    "compile_ratio_max": {"max": 1.5},
    "memory_ratio_max": {"max": 2.0},
    "summer_is_the_same": {"min": 1.0},
}


def run(quick: bool) -> dict[str, float]:
    """Measure everything; see the table in ``docs/results.md`` for what the figures mean."""
    return measure(PARTS, quick, keep=False)


def measure(
    parts: Sequence[str], quick: bool, keep: bool, until: float = float("inf"), folder: Path = FOLDER
) -> dict[str, float]:
    """Figures of parts; keep: what earlier runs left is not made again, and figures of other parts are among these.

    What is not ready at a time of `time.monotonic` is left for a later run.
    """
    folder = folder / ("quick" if quick else "full")
    record = folder / "figures.json"
    done: dict[str, dict[str, float]] = json.loads(record.read_text()) if record.exists() else {}
    for part in parts:
        if not keep:
            done.pop(part, None)
            shutil.rmtree(folder / part, ignore_errors=True)
        if part not in done and time.monotonic() < until:
            print(f"{part} …", flush=True)
            session.clean_file()
            found = _part(part, quick, until)(folder / part)
            if found is not None:
                done[part] = found
                folder.mkdir(parents=True, exist_ok=True)
                record.write_text(json.dumps(done, indent=1) + "\n")
    chosen = [part for part in PARTS if part in done and (keep or part in parts)]
    figures = {name: value for part in chosen for name, value in done[part].items()}
    steps = [figures[f"{name}_flip_steps_max"] for name in ("wood", "birch") if f"{name}_flip_steps_max" in figures]
    return ({"flip_steps_max": max(steps)} if steps else {}) | figures


def _part(name: str, quick: bool, until: float) -> Callable[[Path], dict[str, float] | None]:
    from . import year_costs, year_curves, year_facets, year_frames

    few = {"species": ("birch",), "days": (20.0, 118.0, 285.0), "heights": (50,), "samples": 16} if quick else {}
    return {
        "wood": lambda at: year_frames.run(at, year_frames.year_of_a_wood(quick), until),
        "birch": lambda at: year_frames.run(at, year_frames.life_of_a_birch(quick), until),
        "curves": lambda _: year_curves.run(),
        "facets": lambda at: year_facets.run(at, **few, until=until),
        "refining": lambda _: year_costs.refining(quick, until),
        "compiling": lambda _: year_costs.compiling(quick),
        "summer": lambda _: year_costs.summer(quick),
    }[name]


def main() -> int:
    """Run parts of the benchmark, for some minutes if asked."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.year", description=__doc__)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--keep", action="store_true", help="go on with what earlier runs left")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing after so many")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the record here")
    arguments = parser.parse_args()
    session.start()
    from .report import report, table

    until = time.monotonic() + 60.0 * arguments.minutes
    figures = measure(arguments.parts, arguments.quick, arguments.keep, until)
    record = report("year", figures, QUICK_TARGETS if arguments.quick else TARGETS)
    print(table(record), flush=True)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(record, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
