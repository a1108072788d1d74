# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How time and memory grow: with the number of plants, up to a million, and with the pixels of the image.

Each measurement is a process of its own, whose largest memory the system reports. The plots go to
``docs/images/growth.png`` where ``--plot`` is given: ``python -m benchmarks.growth --plot``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from .report import ROOT, Targets

PLANTS = (1_000, 8_636, 86_360, 1_000_000)
PIXELS = (128, 256, 512, 1024)
SAMPLES = 4

TARGETS: Targets = {"time_ratio_10x": {"max": 1.5}, "million_peak_mb": {"max": 8000.0}}
QUICK_TARGETS: Targets = {"time_ratio_10x": {"max": 1.5}}


def measured(plants: int, pixels: int, render: bool = True) -> dict[str, float]:
    """Refine and render so many plants at so many pixels in a process of their own."""
    command = [sys.executable, "-m", "benchmarks.growth", "--one", str(plants), str(pixels), str(int(render))]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{")))


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/results.md`` for what the figures mean."""
    by_plants = {n: measured(n, 512, render=not quick) for n in (PLANTS[1:3] if quick else PLANTS)}
    few, many = (by_plants[n]["refine_emit_s"] for n in PLANTS[1:3])
    figures = {"time_ratio_10x": many / few}
    if not quick:
        figures["million_peak_mb"] = by_plants[PLANTS[-1]]["peak_mb"]
        figures["million_s"] = by_plants[PLANTS[-1]]["refine_emit_s"]
        figures["million_render_s"] = by_plants[PLANTS[-1]]["render_s"]
        figures["million_polygons_full"] = by_plants[PLANTS[-1]]["polygons_full"]
    by_pixels = {} if quick else {p: measured(PLANTS[1], p) for p in PIXELS}
    for unit, results in (("plants", by_plants), ("pixels", by_pixels)):
        for number, one in results.items():
            figures |= {f"{key}_{unit}_{number}": one[key] for key in ("refine_emit_s", "peak_mb", "polygons")}
    return figures


def one(plants: int, pixels: int, render: bool) -> dict[str, float]:
    """One measurement, in this process."""
    from devtools import session

    session.start()
    session.clean_file()
    import tempfile

    import bpy

    from examples import landscape

    from .report import peak_mb
    from .row80 import timed_refine, timed_render

    scene = bpy.context.scene
    landscape.build(scene, plants, pixels)
    scene.tetflora.refine_at_render = False
    statistics, seconds = timed_refine(scene)
    refined_mb, render_s = peak_mb(), 0.0
    if render:
        with tempfile.TemporaryDirectory() as folder:
            render_s = timed_render(scene, Path(folder) / "picture.png", SAMPLES)
    session.stop()
    return {
        "refine_emit_s": seconds,
        "render_s": render_s,
        "refine_peak_mb": refined_mb,
        "peak_mb": peak_mb(),
        "polygons": statistics.polygons_meshed + statistics.polygons_proxy,
        "polygons_full": statistics.polygons_full,
    }


def plot(path: Path, figures: dict[str, float]) -> None:
    """Time and memory against plants, and against pixels."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(9.6, 3.6), constrained_layout=True)
    for axis, unit, numbers, label in (
        (axes[0], "plants", PLANTS, "plants"),
        (axes[1], "pixels", PIXELS, "pixels along a side"),
    ):
        seconds, memory = ([figures[f"{key}_{unit}_{n}"] for n in numbers] for key in ("refine_emit_s", "peak_mb"))
        axis.loglog(numbers, seconds, "o-", color="#2a7f3f", label="refine and emit, seconds")
        axis.loglog(numbers, [m / 1000 for m in memory], "s-", color="#b5651d", label="peak with render, gigabytes")
        axis.set_xlabel(label)
        axis.grid(True, which="both", alpha=0.25)
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def main() -> int:
    """Measure one thing for another process, or draw the plots."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.growth", description=__doc__)
    parser.add_argument("--one", nargs=3, type=int, metavar=("PLANTS", "PIXELS", "RENDER"), help="measure and print")
    parser.add_argument("--plot", type=Path, nargs="?", const=ROOT / "docs" / "images" / "growth.png", metavar="PATH")
    parser.add_argument("--figures", type=Path, metavar="JSON", help="record to draw instead of measuring anew")
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(one(*arguments.one[:2], bool(arguments.one[2]))))
    elif arguments.plot:
        stored = json.loads(arguments.figures.read_text())["figures"] if arguments.figures else run(quick=False)
        plot(arguments.plot, stored)
    return 0


if __name__ == "__main__":
    sys.exit(main())
