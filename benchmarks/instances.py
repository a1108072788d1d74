# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The landscape beside what artists do without the extension: eight variants of each species, instanced.

    python -m benchmarks instances [--quick]                                     # everything, with targets
    python -m benchmarks.instances refined --engine CYCLES --plants 8636         # one case, as a line of JSON

Both ways begin with a .blend file and end with an image in it. Each case is measured in a process of its own, so that
the largest memory is its own. Seconds of images with more samples than are rendered are extrapolated.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from devtools import session

from .report import ROOT, records_of

WHATS = ("refined", "instances")
ENGINES = ("CYCLES", "EEVEE")
#: Plants of the landscape; EEVEE takes many minutes for instances of more in software.
PLANTS = {"CYCLES": (8_636, 100_000, 1_000_000), "EEVEE": (8_636,)}
QUICK_PLANTS = {"CYCLES": (8_636,), "EEVEE": ()}
#: Different plants of each species.
VARIANTS = 8
#: Samples that images have, and those of timed images.
SAMPLES = {"CYCLES": 64, "EEVEE": 16}
TIMED = {"CYCLES": 9, "EEVEE": 5}
SIZE = 960, 540

TARGETS: dict[str, dict[str, float]] = {
    "cycles_time_ratio": {"max": 0.8},
    "cycles_memory_ratio": {"max": 0.6},
    "cycles_time_ratio_1000000": {"max": 1.5},
    "cycles_memory_ratio_1000000": {"max": 1.5},
    "eevee_time_ratio": {"max": 0.1},
}
QUICK_TARGETS = {key: TARGETS[key] for key in ("cycles_time_ratio", "cycles_memory_ratio")}


def run(quick: bool) -> dict[str, float]:
    """Measure all cases; quick: in Cycles, and no more plants than the landscape has."""
    found: dict[str, float] = {}
    for engine, counts in (QUICK_PLANTS if quick else PLANTS).items():
        for plants in counts:
            made = {what: _apart(what, engine, plants) for what in WHATS}
            end = "" if plants == counts[0] else f"_{plants}"
            name = engine.lower()
            for what, figures in made.items():
                for key in ("read_s", "refine_s", "setup_s", "sample_s", "total_s", "peak_mb", "flip_noise"):
                    found[f"{name}_{what}_{key}{end}"] = figures[key]
            ours, theirs = (made[what] for what in WHATS)
            found[f"{name}_time_ratio{end}"] = ours["total_s"] / theirs["total_s"]
            found[f"{name}_memory_ratio{end}"] = ours["peak_mb"] / theirs["peak_mb"]
    return found


def _apart(what: str, engine: str, plants: int) -> dict[str, float]:
    """Figures of one case, by a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        for only in (("--store",), ()):
            command = ["benchmarks.instances", what, "--engine", engine, "--plants", str(plants)]
            found = records_of([*command, "--folder", folder, *only])
    return found[-1]


def store(path: Path, what: str, plants: int) -> None:
    """Save the file that an artist would have: the field, or variants with the nodes that put them there."""
    import bpy

    from examples import landscape

    from . import forest_instances

    scene = bpy.context.scene
    landscape.build(scene, plants)
    scene.tetflora.refine_at_render = False
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    if what == "instances":
        forest_instances.build(scene, VARIANTS)
        for obj in [obj for obj in scene.objects if obj.tetflora.is_field]:
            bpy.data.objects.remove(obj)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)


def measure(path: Path, what: str, engine: str) -> dict[str, float]:
    """From the file to the image: seconds, memory, and noise between two images of equal samples."""
    import bpy

    from .compare import difference
    from .report import peak_mb
    from .row80 import timed_refine, timed_render
    from .time_to_picture import of_render

    begun = time.perf_counter()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    kind = session.eevee() if engine == "EEVEE" else engine
    scene.render.engine = kind
    read_s, refine_s = time.perf_counter() - begun, 0.0
    if what == "refined":
        refine_s = timed_refine(scene)[1]
    image = path.with_name(f"{what}-{engine}.png")
    times = of_render(scene, image, kind, TIMED[engine])
    peak = peak_mb()
    again = image.with_stem(f"{image.stem}-again")
    timed_render(scene, again, TIMED[engine], seed=1, engine=kind)
    return {
        "read_s": read_s,
        "refine_s": refine_s,
        "setup_s": times["setup_s"],
        "sample_s": times["sample_s"],
        "total_s": read_s + refine_s + times["setup_s"] + SAMPLES[engine] * times["sample_s"],
        "peak_mb": peak,
        "flip_noise": difference(image, again).flip,
    }


def main() -> int:
    """Measure one case and print a line of JSON."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.instances", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=WHATS)
    parser.add_argument("--engine", choices=ENGINES, default=ENGINES[0])
    parser.add_argument("--plants", type=int, default=PLANTS["CYCLES"][0])
    parser.add_argument("--folder", type=Path, default=ROOT / "out" / "instances", help="of the file and its images")
    parser.add_argument("--store", action="store_true", help="only save the file, which is measured in the next call")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path = (arguments.folder / f"{arguments.what}-{arguments.plants}.blend").resolve()
    session.start()
    session.clean_file()
    if arguments.store or not path.exists():
        store(path, arguments.what, arguments.plants)
    if not arguments.store:
        print(json.dumps(measure(path, arguments.what, arguments.engine)), flush=True)
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
