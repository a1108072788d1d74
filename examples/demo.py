# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job from beginning to end: the row of eighty as a file of seeds, refined and rendered in both engines.

``python -m examples.demo --out FOLDER`` writes ``demo.blend``, ``cycles.png``, ``eevee.png``, ``top.png`` and
``stats.json``.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from devtools import session

if TYPE_CHECKING:
    from tetflora_addon.jobs import Progress

# Each sample of EEVEE draws all polygons anew, which takes seconds where the processor does it for want of a GPU.
CYCLES_SAMPLES, EEVEE_SAMPLES = 48, 8


def say(text: str) -> None:
    """Progress, at once even when the output is a file."""
    print(f"[{time.strftime('%H:%M:%S')}] {text}", flush=True)


def follow(steps: Iterator[Progress]) -> Any:
    """Take all steps and say how far they are, each state once; gives what they return."""
    said = ""
    while True:
        try:
            progress = next(steps)
        except StopIteration as stop:
            return stop.value
        line = f"{100 * progress.fraction:3.0f} %  {progress.message}"
        if line != said:
            say(line)
        said = line


def run(out: Path, width: int) -> dict:
    """Build, save, refine and render; returns what ``stats.json`` holds."""
    import bpy

    from tetflora_addon.blender import compat
    from tetflora_addon.blender.job import refine

    from . import row80
    from .top_view import render_top_view

    session.clean_file()
    scene = bpy.context.scene
    out.mkdir(parents=True, exist_ok=True)

    say("Planting eighty trees on the Jacksboro fault")
    row80.build(scene)
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = CYCLES_SAMPLES, False
    scene.eevee.taa_render_samples = EEVEE_SAMPLES
    scene.render.image_settings.file_format = 'PNG'
    scene.render.filepath = "//frame_"
    bpy.ops.wm.save_as_mainfile(filepath=str(out / "demo.blend"), compress=True)
    say(f"Saved the seeds: demo.blend, {(out / 'demo.blend').stat().st_size / 1000:.0f} kB")

    # The demo times refinement and rendering apart; a plain `blender -b demo.blend -f 1` does both by itself.
    scene.tetflora.refine_at_render = False
    statistics = follow(refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get()))
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
    seconds = dict(statistics.seconds)
    for engine, name in (('CYCLES', "cycles"), (compat.eevee_engine(), "eevee")):
        say(f"Rendering {name}.png")
        start = time.perf_counter()
        scene.render.engine = engine
        scene.render.filepath = str(out / f"{name}.png")
        bpy.ops.render.render(write_still=True)
        seconds[f"render_{name}"] = time.perf_counter() - start
    say("Rendering top.png, the partition seen from above")
    render_top_view(scene, out / "top.png")
    stats = {
        **{k: v for k, v in statistics.as_dict().items() if k != "seconds"},
        "seconds": seconds,
        "peak_mb": peak_mb,
        "blender": bpy.app.version_string,
    }
    (out / "stats.json").write_text(json.dumps(stats, indent=1) + "\n")
    fraction = statistics.polygons_meshed / statistics.polygons_full
    say(
        f"{statistics.plants} plants, {statistics.polygons_full:,} polygons if expanded; "
        f"{statistics.polygons_meshed:,} were made ({100 * fraction:.1f} %) "
        f"and {statistics.tetrahedra_proxy:,} tetrahedra are drawn as proxies"
    )
    say(f"Images and figures are in {out}")
    return stats


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m examples.demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder to write to")
    parser.add_argument("--width", type=int, default=800, help="width of the pictures in pixels")
    arguments = parser.parse_args()
    session.start()
    run(arguments.out.resolve(), arguments.width)
    return 0


if __name__ == "__main__":
    sys.exit(main())
