# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A real forest at full HD: seconds, memory and image of what an artist tries first.

    python -m benchmarks forest [--quick]          # everything, with targets
    python -m benchmarks.forest birch --no-render  # one case, as a line of JSON
    python -m benchmarks.forest mix --size 480x270 --side 50 --samples 2 --cover
    python -m benchmarks.forest eye --what part    # against expansion, where it can be expanded
    python -m benchmarks.forest missing            # everything that an earlier run has not left in out/forest

A case is a species, ``mix`` (five species, 5 m apart), ``eye`` (inside a wood of five species), ``million`` (that of
the README) or ``light`` (``light-ground``, ``light-shadow``, ``light-pond``). Each is measured
in a process of its own, so that the largest memory is its own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from devtools import session

ROOT = Path(__file__).resolve().parent.parent
#: Left by a run: what each process has measured.
FOLDER = ROOT / "out" / "forest"
QUICK_FOLDER = ROOT / "out" / "forest-quick"
WHATS = ("refine", "instances", "part")
QUICK = ("birch", "mix")
#: Cases whose noise is measured as well; it is about the same in all.
NOISY = ("birch", "mix", "eye")
#: Samples of timed images, of images that are compared (with 64, FLIP of noise alone is .075), and where light is
#: measured.
SAMPLES, COMPARED, LIT = 4, 256, 16
#: Gigabytes that the process may have.
LIMITS = (2, 4, 8)
_LONGEST = 3600  # seconds of one process

TARGETS: dict[str, dict[str, float]] = {
    "refine_emit_s_max": {"max": 20.0},
    "peak_mb_max": {"max": 3000.0},
    "polygons_max": {"max": 6e6},
    "mix_s": {"max": 15.0},
    "eye_s": {"max": 15.0},
    "longest_step_s": {"max": 0.2},
    "render_ratio_max": {"max": 1.1},
    "total_ratio_max": {"max": 1.05},
    "memory_ratio_max": {"max": 2.0},
    "hidden_open_ratio_max": {"max": 1.0},
    "flip_mean": {"max": 0.05},
    "flip_max": {"max": 0.08},
    "limit_ratio_max": {"max": 1.0},
    "light_error_max": {"max": 0.02},
    "million_s": {"max": 60.0},
    "million_mb": {"max": 6000.0},
}
QUICK_TARGETS = {key: TARGETS[key] for key in ("longest_step_s", "hidden_open_ratio_max", "flip_max")}


def run(quick: bool) -> dict[str, float]:
    """Measure; quick: a smaller wood in a smaller image, of birches and of five species."""
    for path in _folder(quick).glob("*.json"):
        path.unlink()
    return measure(quick)


def measure(quick: bool) -> dict[str, float]:
    """Figures of all cases; what an earlier run has left is not measured again."""
    from .forest_scene import trees
    from .forest_sums import sums

    cases = QUICK if quick else (*trees(), "mix", "eye")
    small = ("--size", "480x270", "--side", "60") if quick else ()
    brief = ("--quick",) if quick else ()
    records = {}
    for case in cases:
        for what in WHATS:
            # A part of a small wood would be a tree or two.
            samples, of = (COMPARED // (8 if quick else 1), ()) if what == "part" else (SAMPLES, small)
            records[case, what] = measured(_folder(quick), case, "--what", what, "--samples", str(samples), *of, *brief)
    if not quick:
        records["light", "light"] = measured(_folder(quick), "light", "--samples", str(LIT))
        records["million", "refine"] = measured(_folder(quick), "million", "--no-render", "--at-once")
        for limit in LIMITS:
            limited = ("--set", f"max_memory={limit}", "--samples", "1")
            records["birch", f"limit_{limit}"] = measured(_folder(quick), "birch", *limited)
    return sums(records)


def _folder(quick: bool) -> Path:
    return QUICK_FOLDER if quick else FOLDER


def measured(folder: Path, *words: str) -> dict:
    """What a process of its own measures, or has left in a folder in an earlier run; ``words`` as of `main`."""
    path = folder / ("-".join(words).replace("--", "").replace("=", "-") + ".json")
    if path.exists():
        return json.loads(path.read_text())
    command = [sys.executable, "-m", "benchmarks.forest", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=_LONGEST, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} failed with {done.returncode}:\n{done.stderr[-2000:]}")
    line = next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{"))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(line + "\n")
    print(line, flush=True)
    return json.loads(line)


def one(arguments: argparse.Namespace) -> dict:
    """Measure one case in this process."""
    import bpy

    from . import forest_case, forest_instances, forest_light, forest_part, forest_scene

    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if arguments.case.startswith("light"):
            names = tuple(arguments.case.split("-")[1:]) or tuple(forest_light.SCENES)
            return forest_light.run(folder, arguments.samples, names, again=not arguments.quick)
        if arguments.case == "million":
            planted = forest_scene.build_million(scene, arguments.asked)
        else:
            case = forest_scene.case_of(arguments.case)
            changes = {name: getattr(arguments, name) for name in ("asked", "side", "distance", "eye", "away", "cover")}
            case = replace(case, **{name: value for name, value in changes.items() if value})
            planted = forest_scene.build(scene, case, arguments.size)
        for name, value in arguments.set:
            kind = type(getattr(scene.tetflora, name))
            setattr(scene.tetflora, name, value == "True" if kind is bool else kind(value))
        figures = {"case": arguments.case, "what": arguments.what, "planted": planted}
        if arguments.what == "part":
            return figures | forest_part.measure(
                scene, folder, arguments.samples, noise=arguments.case in NOISY and not arguments.quick
            )
        if arguments.what == "instances":
            figures |= forest_instances.build(scene)
        else:
            figures |= forest_case.refined(scene, arguments.run_to_end)
        if not arguments.no_render:
            figures |= forest_case.rendered(scene, folder, arguments.samples)
            figures["peak_render_mb"] = max(figures["peak_mb"], figures["peak_render_mb"])
        return figures


def _size(text: str) -> tuple[int, int]:
    width, height = text.lower().split("x")
    return int(width), int(height)


def _setting(text: str) -> tuple[str, str]:
    name, value = text.split("=")
    return name, value


def main() -> int:
    """Measure one case and print a line of JSON, or finish a run that was interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.forest", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("case", help="a species, mix, eye, million, light, or missing")
    add("--what", choices=WHATS, default="refine", help="refine, variants as instances, or a part against expansion")
    add("--asked", "--plants", type=int, help="plants that Populate is asked for, by default 100,000")
    add("--side", type=float, help="of the ground, by default 300 m: a smaller wood of the same density")
    add("--distance", type=float, help="minimum distance between plants, meters")
    add("--eye", type=float, help="height of the camera, meters")
    add("--away", type=float, help="least distance of the camera from the middle, meters; it looks so far")
    add("--cover", action="store_true", help="with ground cover")
    add("--size", type=_size, default=(1920, 1080), metavar="WxH")
    add("--set", type=_setting, nargs="+", default=[], metavar="NAME=VALUE", help="settings of the scene")
    add("--at-once", action="store_true", help="as scripts and renders refine, not in steps as the window does")
    add("--no-render", action="store_true")
    add(
        "--samples", type=int, default=SAMPLES, help="of images that are timed (beside one with one sample) or compared"
    )
    add("--keep", type=Path, metavar="FOLDER", help="leave images there")
    add("--quick", action="store_true")
    arguments = parser.parse_args()
    session.start()
    session.clean_file()
    if arguments.case == "missing":
        print(json.dumps(measure(arguments.quick), indent=1))
    else:
        print(json.dumps(one(arguments)), flush=True)
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
