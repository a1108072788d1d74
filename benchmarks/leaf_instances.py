# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as polygons, as Refine writes them, against instances of one leaf on points: does an instance ever win?

    python -m benchmarks leaf_instances [--quick]                             # everything
    python -m benchmarks.leaf_instances crown:72:instances --engine CYCLES    # one case, as a line of JSON

The same leaves both ways, without wood: of one tree whose crown fills the image, and of a few trees from afar. A leaf
has as many polygons as the name says; a *twig* is 20 kites at a twentieth of the places. Instances are made by geometry
nodes, with their turn, size, color and transmission as attributes of points, and read those in their material.

Each case in Cycles has a process of its own, so that the most memory is its own. In EEVEE all cases share one, where
the first image of each, in which shaders are compiled, does not count. Seconds are those of all processors. ``_setup``
is all before the first sample: geometry nodes, Blender's objects to the renderer, the BVH; ``_write`` is making the
mesh. ``_wins`` is the seconds of polygons over those of instances, written and rendered with `SAMPLES`: above 1,
instances win.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from devtools import session

from .report import Targets, cpu_s, peak_mb, records_of

WAYS = ("polygons", "instances")
#: Polygons of a leaf: those of levels of the species, or a twig of kites, by view and engine.
UNITS = {
    "CYCLES": {"crown": ("1", "14", "26", "72", "391", "twig"), "stand": ("1", "14", "26", "twig")},
    "EEVEE": {"crown": ("1", "72"), "stand": ("1",)},
}
QUICK_UNITS = {"CYCLES": {"crown": ("1", "72")}, "EEVEE": {}}
#: Of the image that seconds are told for, and those that are rendered.
SAMPLES = 64
TIMED, EEVEE_TIMED = 8, 3
SIZE, EEVEE_SIZE = (640, 360), (320, 180)
_FIGURES = ("write", "setup", "sample", "total")

# What is asked is whether instances win. Refine writes polygons, so these must win where they do it most: kites.
TARGETS: Targets = {"cycles_crown_1_wins": {"max": 1.0}, "cycles_stand_1_wins": {"max": 1.0}}
QUICK_TARGETS: Targets = {"cycles_crown_1_wins": {"max": 1.0}}


def run(quick: bool) -> dict[str, float]:
    """Measure all cases; quick: a crown in Cycles, of kites and of fine leaves."""
    figures: dict[str, float] = {}
    for engine, views in (QUICK_UNITS if quick else UNITS).items():
        cases = [f"{view}:{unit}:{way}" for view, units in views.items() for unit in units for way in WAYS]
        together = [[case] for case in cases] if engine == "CYCLES" else [cases] if cases else []
        made = {name: found for some in together for name, found in _apart(some, engine).items()}
        for view, units in views.items():
            for unit in units:
                name = f"{engine.lower()}_{view}_{unit}"
                ours, theirs = (made[f"{view}:{unit}:{way}"] for way in WAYS)
                for way, found in zip(WAYS, (ours, theirs), strict=True):
                    figures |= {f"{name}_{way}_{step}_s": found[step] for step in _FIGURES}
                    if engine == "CYCLES":
                        figures[f"{name}_{way}_peak_mb"] = found["peak_mb"]
                figures[f"{name}_wins"] = ours["total"] / theirs["total"]
                figures[f"{name}_color_error"] = abs(theirs["mean"] / ours["mean"] - 1.0)
    return figures


def _apart(cases: list[str], engine: str) -> dict[str, dict[str, float]]:
    """Figures of cases by a process of their own."""
    command = ["benchmarks.leaf_instances", *cases, "--engine", engine]
    return {found["case"]: found for found in records_of(command)}


def measure(case: str, engine: str, folder: Path) -> dict:
    """Figures of one case: seconds, memory, and the mean of the image."""
    import bpy

    from . import leaf_points
    from .compare import linear_light, read_picture
    from .time_to_picture import of_render

    view, unit, way = case.split(":")
    session.clean_file()
    scene = bpy.context.scene
    leaves = leaf_points.leaves_of(view)
    eevee = engine == "EEVEE"
    kind = session.eevee() if eevee else engine
    leaf_points.add_view(scene, view, leaves, EEVEE_SIZE if eevee else SIZE)
    before, begun = peak_mb(), cpu_s()
    leaf_points.add_leaves(scene, leaves, unit, way)
    write = cpu_s() - begun
    samples, image = EEVEE_TIMED if eevee else TIMED, folder / "image.png"
    for _ in range(2 if eevee else 1):
        times = of_render(scene, image, kind, samples)
    setup, sample = times["setup_cpu_s"], times["sample_cpu_s"]
    return {
        "case": case,
        "leaves": len(leaves.size),
        "write": write,
        "setup": setup,
        "sample": sample,
        "total": write + setup + SAMPLES * sample,
        "peak_mb": peak_mb() - before,
        "mean": float(linear_light(read_picture(image)[..., :3]).mean()),
    }


def main() -> int:
    """Measure cases and print a line of JSON for each."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.leaf_instances",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("case", nargs="+", help="view:unit:way, as crown:72:instances")
    parser.add_argument("--engine", choices=tuple(UNITS), default="CYCLES")
    given = parser.parse_args()
    session.start()
    with tempfile.TemporaryDirectory() as folder:
        for case in given.case:
            print(json.dumps(measure(case, given.engine, Path(folder))), flush=True)
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
