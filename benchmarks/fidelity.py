# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far proxies are from the plants: species × height × light × engine × form, refined against fully expanded.

    python -m benchmarks fidelity [--quick]                   # everything, with targets
    python -m benchmarks.fidelity --heights 50 --lights side --engines cycles --forms MICROSURFACES
    python -m benchmarks.fidelity --parts time                # of formulas, frames, transitions, time
    python -m benchmarks.fidelity --keep --heights 200        # beside what earlier runs left, figures of all together
    python -m benchmarks.fidelity --sheet                     # docs/images/fidelity.jpg of the last run

Images, ``frames.json`` (written as it goes) and ``figures.json`` are left in ``out/fidelity``. Nothing is denoised.
Targets are those of the form that the extension takes by itself; figures of all forms stand beside them.

Reduced, since EEVEE on a processor takes seconds for each sample of expanded plants: EEVEE is compared in one light
(two at 50 pixels), one plant of each species, with `EEVEE_SAMPLES`; Cycles renders the same stands for the gap between
both. At 200 pixels Cycles takes 96 samples, where a pixel holds few leaves and is less noisy. From 50 pixels on, other
forms than the default are rendered in two lights; name a form alone to see it in all.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from devtools import session

from .report import ROOT, Targets

#: Left by a run: images and records.
FOLDER = ROOT / "out" / "fidelity"
PARTS = ("formulas", "frames", "transitions", "time")
EEVEE_SAMPLES = 16
#: Plants of each species and samples in Cycles by height.
CYCLES = {12: (4, 256), 50: (1, 384), 200: (1, 96)}
LIGHTS = ("front", "side", "back", "overcast")
EEVEE_LIGHTS = {12: ("side",), 50: ("side", "overcast"), 200: ("side",)}

TARGETS: Targets = {
    "flip_mean": {"max": 0.05},
    "flip_max": {"max": 0.08},
    "dT_max": {"max": 0.01},
    "color_error_mean": {"max": 0.03},
    "engine_gap": {"max": 0.02},
    "shell_rms": {"max": 0.005},
    "shell_stack_rms": {"max": 0.005},
    "furnace_error": {"max": 0.01},
    "transition_flip": {"max": 0.02},
    "time_ratio": {"max": 0.8},
    "equal_noise_time_ratio": {"max": 0.5},
    "memory_ratio": {"max": 0.1},
    "frame_time_ratio_max": {"max": 2.0},
}
QUICK_TARGETS: Targets = {
    "flip_mean": {"max": 0.09},
    "flip_max": {"max": 0.14},
    "dT_max": {"max": 0.03},
    "color_error_mean": {"max": 0.06},
    "time_ratio": {"max": 1.0},
}


def run(quick: bool) -> dict[str, float]:
    """Measure everything; quick: two species, two heights, side light, Cycles, the default form, a small forest."""
    from .fidelity_frames import Series, forms

    every, default = forms()
    if quick:
        series = (Series(50, 1, "cycles", 64, ("side",)), Series(12, 2, "cycles", 64, ("side",)))
        return measure(series, (default,), ("oak", "birch"), default, ("frames", "time"), quick=True)
    return measure(series_of(tuple(CYCLES), LIGHTS, ("cycles", "eevee")), every, None, default, PARTS)


def series_of(heights: tuple[int, ...], lights: tuple[str, ...], engines: tuple[str, ...]) -> tuple:
    """Series of images of the full bench, of these heights, lights and engines."""
    from .fidelity_frames import Series

    series = []
    for pixels in heights:
        each, samples = CYCLES[pixels]
        few = tuple(light for light in EEVEE_LIGHTS[pixels] if light in lights)
        if "cycles" in engines:
            series.append(Series(pixels, each, "cycles", samples, lights))
        if "eevee" in engines and few:
            series.append(Series(pixels, 1, "eevee", EEVEE_SAMPLES, few))
            if "cycles" in engines and each != 1:
                series.append(Series(pixels, 1, "cycles", samples, few))
    return tuple(series)


def measure(
    series: tuple,
    chosen: tuple[str, ...],
    species: tuple[str, ...] | None,
    default: str,
    parts: tuple[str, ...],
    quick: bool = False,
    keep: bool = False,
) -> dict[str, float]:
    """Figures of the named parts, in the order of `PARTS`; keep: together with those that earlier runs left."""
    from examples import stands

    from . import closed_form, fidelity_time, fidelity_transitions
    from .fidelity_frames import Frame, frames
    from .fidelity_sums import sums

    FOLDER.mkdir(parents=True, exist_ok=True)
    record, written = FOLDER / "figures.json", FOLDER / "frames.json"
    figures: dict[str, float] = json.loads(record.read_text()) if keep and record.exists() else {}
    if "formulas" in parts:
        figures |= closed_form.run(quick)
    if "frames" in parts:
        done = (
            {_key(f): f for f in (Frame(**f) for f in json.loads(written.read_text()))}
            if keep and written.exists()
            else {}
        )
        brief = tuple(form for form in chosen if form != default and len(chosen) > 1)
        for frame in frames(series, chosen, species or stands.SPECIES, FOLDER, brief):
            done[_key(frame)] = frame
            print(line(frame), flush=True)
            written.write_text(json.dumps([asdict(f) for f in done.values()], indent=1) + "\n")
        figures |= sums(tuple(done.values()), default)
    if "transitions" in parts:
        session.clean_file()
        figures |= fidelity_transitions.run(FOLDER, quick)
    if "time" in parts:
        session.clean_file()
        costs = fidelity_time.run(FOLDER, chosen, quick)
        for name in ("time_ratio", "equal_noise_time_ratio", "memory_ratio"):
            if f"{name}_{default.lower()}" in costs:
                figures[name] = costs[f"{name}_{default.lower()}"]
        figures |= costs
    record.write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def _key(frame: object) -> tuple:
    return frame.pixels, frame.each, frame.light, frame.engine, frame.form, frame.species


def line(frame: object) -> str:
    """A frame in a line."""
    return (
        f"{frame.pixels:4d} px {frame.light:9s}{frame.engine:7s}{frame.form:14s}{frame.species:8s}"
        f"FLIP {frame.flip:.3f} (noise {frame.noise:.3f})  dT {frame.dT:+.4f}  color {frame.color:.3f} "
        f"({frame.brightness:+.3f})  gap {frame.gap:.3f} ({frame.gap_expanded:.3f})  "
        f"{frame.seconds:.1f} of {frame.expanded_seconds:.1f} s  {frame.memory_mb:.0f} of {frame.expanded_mb:.0f} MB"
    )


def main() -> int:
    """Run parts of the bench, or make the contact sheet."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fidelity", description=__doc__)
    parser.add_argument("--sheet", action="store_true", help="make the contact sheet from pictures that are there")
    parser.add_argument("--keep", action="store_true", help="add to what earlier runs left instead of beginning anew")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=["frames"])
    parser.add_argument("--heights", nargs="+", type=int, choices=sorted(CYCLES), default=sorted(CYCLES))
    parser.add_argument("--lights", nargs="+", choices=LIGHTS, default=LIGHTS)
    parser.add_argument("--engines", nargs="+", choices=("cycles", "eevee"), default=("cycles", "eevee"))
    parser.add_argument("--forms", nargs="+", metavar="FORM", help="by default all that the extension has")
    parser.add_argument("--species", nargs="+", metavar="NAME", help="by default oak, birch, spruce and aspen")
    arguments = parser.parse_args()
    session.start()
    session.clean_file()
    from .fidelity_frames import forms

    if arguments.sheet:
        from .fidelity_sheet import make

        make(FOLDER, ROOT / "docs" / "images" / "fidelity.jpg")
        return 0
    every, default = forms()
    series = series_of(tuple(arguments.heights), tuple(arguments.lights), tuple(arguments.engines))
    chosen = tuple(arguments.forms or every)
    species = tuple(arguments.species) if arguments.species else None
    figures = measure(series, chosen, species, default, tuple(arguments.parts), keep=arguments.keep)
    for name, value in figures.items():
        print(f"  {name:40s} {value:.4g}")
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
