# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a file to an image of 64 samples, refined against expanded: all that an artist waits for.

    python -m benchmarks time_to_picture [--quick]                                # everything, with targets
    python -m benchmarks.time_to_picture row80 refined --engine EEVEE             # one case, as lines of JSON

A case opens a .blend file in a process of its own, refines and renders (the *cold* frame), and once more in the same
process (the *second*). Figures are seconds of all processors, which others that use the machine change less than
the clock; those by the clock end in ``_s`` alone. The first sample tells preparation (Blender's objects to the
renderer, its BVH, its lights) from samples. Seconds of more samples than are rendered are extrapolated, nothing else.

Fully expanded, the landscape does not fit. Its plants are expanded and rendered in `PARTS` parts, every sixteenth plant
to one, each part in a process of its own, a single frame: their sums are measured, and less than what all at once would
take, as a BVH takes longer than its parts. Samples are those of the slowest part, and count once. EEVEE expands a
single part, which the whole refined landscape is held against. So the landscape's ratios are limits: true ones are
smaller.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from devtools import session

from .report import ROOT, Targets, cpu_s, peak_mb, records_of

SCENES = ("row80", "stand", "landscape")
WHATS = ("refined", "expanded")
ENGINES = ("CYCLES", "EEVEE")
FRAMES = ("cold", "second")
#: Of the image that seconds are told for.
SAMPLES = 64
#: Samples that are rendered; EEVEE in software takes seconds for each.
TIMED = {"CYCLES": {"row80": 16, "stand": 4, "landscape": 4}, "EEVEE": {"row80": 4, "stand": 3, "landscape": 3}}
QUICK_TIMED = 4
#: Size of EEVEE's images in software, and of quick ones, percent.
EEVEE_PERCENT, QUICK_PERCENT = 50, 50
#: Each of the landscape's expanded parts fits into 8 GB.
PARTS = 16
_STEPS = ("refine", "setup", "sample", "total")
_CLOCKS = ("_cpu_s", "_s")

TARGETS: Targets = {
    "row80_cycles_cold_ratio": {"max": 0.85},
    "row80_cycles_second_ratio": {"max": 0.85},
    "row80_cycles_cold_sample_ratio": {"max": 1.0},
    "row80_cycles_cold_setup_ratio": {"max": 0.45},
    "stand_cycles_cold_ratio": {"max": 0.4},
    "stand_cycles_cold_refine_ratio": {"max": 0.6},
    "stand_cycles_cold_setup_ratio": {"max": 0.6},
    "stand_cycles_cold_sample_ratio": {"max": 0.6},
    "landscape_cycles_cold_ratio": {"max": 0.1},
    "row80_eevee_cold_ratio": {"max": 0.5},
    "stand_eevee_cold_ratio": {"max": 0.5},
    "landscape_eevee_cold_ratio": {"max": 0.5},
}
QUICK_TARGETS: Targets = {
    "row80_cycles_cold_sample_ratio": {"max": 1.1},
    "row80_cycles_cold_setup_ratio": {"max": 0.45},
}


def run(quick: bool) -> dict[str, float]:
    """Measure all cases; quick: the row of eighty in Cycles, half as wide."""
    figures: dict[str, float] = {}
    for engine in ENGINES[:1] if quick else ENGINES:
        for scene in SCENES[:1] if quick else SCENES:
            figures |= compared(scene, engine, quick)
    return figures


def compared(scene: str, engine: str, quick: bool = False) -> dict[str, float]:
    """Figures of a scene, refined and expanded, and ratios of both."""
    refined = apart(scene, "refined", engine, quick)
    parts = tuple(range(PARTS if engine == "CYCLES" else 1)) if scene == "landscape" else (None,)
    expanded = together([apart(scene, "expanded", engine, quick, part) for part in parts])
    name = f"{scene}_{engine.lower()}"
    figures = {
        f"{name}_{what}_peak_mb": made["peak_mb"] for what, made in (("refined", refined), ("expanded", expanded))
    }
    for frame in [frame for frame in FRAMES if frame in expanded]:
        for what, made in (("refined", refined), ("expanded", expanded)):
            figures |= {
                f"{name}_{frame}_{what}_{step}{end}": made[frame][step + end] for step in _STEPS for end in _CLOCKS
            }
        ours, theirs = refined[frame], expanded[frame]
        # Fewer plants to a part hide less, so that its samples cannot be compared.
        for step in _STEPS[:-1] if parts == (None,) else _STEPS[:-2]:
            figures[f"{name}_{frame}_{step}_ratio"] = ours[f"{step}_cpu_s"] / theirs[f"{step}_cpu_s"]
        figures[f"{name}_{frame}_start_ratio"] = _start(ours) / _start(theirs)
        figures[f"{name}_{frame}_ratio"] = ours["total_cpu_s"] / theirs["total_cpu_s"]
    if parts != (None,):
        return figures
    # Whoever has expanded plants once keeps them.
    kept = expanded["second"]["total_cpu_s"] - expanded["second"]["refine_cpu_s"]
    figures[f"{name}_second_kept_ratio"] = refined["second"]["total_cpu_s"] / kept
    return figures


def together(parts: list[dict]) -> dict:
    """Figures of parts that make a scene: sums, but samples and memory of the part that takes most."""
    most = {"peak_mb": max(part["peak_mb"] for part in parts)}
    for frame in [frame for frame in FRAMES if frame in parts[0]]:
        every = [part[frame] for part in parts]
        most[frame] = made = {}
        for end in _CLOCKS:
            for step in ("read", "refine", "setup"):
                made[step + end] = sum(one[step + end] for one in every)
            made["sample" + end] = max(one["sample" + end] for one in every)
            made["total" + end] = total(made, end)
    return most


def total(frame: dict[str, float], end: str) -> float:
    """Seconds of the whole image, by one of both clocks."""
    return sum(frame[step + end] for step in ("read", "refine", "setup")) + SAMPLES * frame["sample" + end]


def _start(frame: dict[str, float]) -> float:
    """Seconds of all processors before the first sample."""
    return sum(frame[step] for step in ("read_cpu_s", "refine_cpu_s", "setup_cpu_s"))


def apart(scene: str, what: str, engine: str, quick: bool, part: int | None = None) -> dict:
    """Figures of one case, by a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        for only in (["--store"], []):
            command = ["benchmarks.time_to_picture", scene, what, "--engine", engine]
            command += ["--folder", folder, *only, *(["--quick"] if quick else [])]
            command += [] if part is None else ["--part", str(part)]
            found = records_of(command)
    return found[-1]


def store(path: Path, name: str, part: int | None) -> None:
    """Save the file that an artist would have."""
    import bpy

    from examples import landscape, row80

    from .picture_scenes import keep_part, stand

    scene = bpy.context.scene
    {"row80": row80.build, "landscape": landscape.build, "stand": stand}[name](scene)
    scene.tetflora.refine_at_render = False
    if part is not None:
        keep_part(scene, part, PARTS)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)


def measure(path: Path, what: str, engine: str, samples: int, percent: int, frames: tuple[str, ...] = FRAMES) -> dict:
    """Frames from the file to the image: seconds by both clocks, and memory."""
    import bpy

    begun = _clocks()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    kind = session.eevee() if engine == "EEVEE" else engine
    scene.render.engine, scene.render.resolution_percentage = kind, percent
    read = _since(begun)
    figures: dict = {}
    for frame in frames:
        figures[frame] = _frame(scene, path.with_suffix(".png"), what, kind, samples)
        # Of the first frame alone: the second one has the first image's result beside its own.
        figures.setdefault("peak_mb", peak_mb())
        figures[frame] |= dict(zip(("read_cpu_s", "read_s"), read if frame == "cold" else (0.0, 0.0), strict=True))
        for end in _CLOCKS:
            figures[frame]["total" + end] = total(figures[frame], end)
    return figures


def _frame(scene: object, image: Path, what: str, engine: str, samples: int) -> dict[str, float]:
    from .row80 import timed_refine

    begun = _clocks()
    timed_refine(scene, expand_everything=what == "expanded")
    figures = dict(zip(("refine_cpu_s", "refine_s"), _since(begun), strict=True))
    return figures | of_render(scene, image, engine, samples)


def of_render(scene: object, image: Path, engine: str, samples: int) -> dict[str, float]:
    """Seconds by both clocks before the first sample, and of each sample.

    Two renders of different numbers of samples do not tell: the first one prepares more.
    """
    from .row80 import timed_render

    figures: dict[str, float] = {}
    begun = _clocks()
    with marked() as marks:
        timed_render(scene, image, samples, engine=engine)
    # Cycles tells when it begins with samples and EEVEE when it has the first, which is not as long as others: shaders
    # are compiled before it.
    before = engine == "CYCLES"
    for end, first, last, zero in zip(_CLOCKS, marks["first"], marks["last"], begun, strict=True):
        each = (last - first) / (samples if before else samples - 1)
        figures["sample" + end] = each
        figures["setup" + end] = first - zero - (0.0 if before else each)
    return figures


@contextmanager
def marked() -> Iterator[dict[str, tuple[float, float]]]:
    """Both clocks at the first and at the last word of the renderer about samples, while the context lasts."""
    import bpy

    marks: dict[str, tuple[float, float]] = {}

    def listen(*words: object) -> None:
        if any(isinstance(text, str) and ("Sample " in text or "samples" in text) for text in words):
            now = _clocks()
            marks.setdefault("first", now)
            marks["last"] = now

    bpy.app.handlers.render_stats.append(listen)
    try:
        yield marks
    finally:
        bpy.app.handlers.render_stats.remove(listen)


def _clocks() -> tuple[float, float]:
    """Seconds of all processors, and of the clock."""
    return cpu_s(), time.perf_counter()


def _since(begun: tuple[float, float]) -> tuple[float, ...]:
    return tuple(now - then for now, then in zip(_clocks(), begun, strict=True))


def main() -> int:
    """Measure one case and print lines of JSON."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.time_to_picture",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", choices=SCENES)
    parser.add_argument("what", choices=WHATS)
    parser.add_argument("--engine", choices=ENGINES, default=ENGINES[0])
    parser.add_argument("--part", type=int, help=f"every {PARTS}th plant alone, beginning with this one")
    parser.add_argument("--quick", action="store_true", help="a smaller image")
    parser.add_argument("--folder", type=Path, default=ROOT / "out" / "time_to_picture", help="of the file and image")
    parser.add_argument("--store", action="store_true", help="only save the file, which is measured in the next call")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    path = (given.folder / f"{given.scene}-{given.what}-{given.part}.blend").resolve()
    session.start()
    session.clean_file()
    if given.store or not path.exists():
        store(path, given.scene, given.part)
    if not given.store:
        samples = QUICK_TIMED if given.quick else TIMED[given.engine][given.scene]
        percent = QUICK_PERCENT if given.quick else EEVEE_PERCENT if given.engine == "EEVEE" else 100
        frames = FRAMES if given.part is None else FRAMES[:1]
        print(json.dumps(measure(path, given.what, given.engine, samples, percent, frames)), flush=True)
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
