# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees that no species of ours grew, scattered by geometry nodes: refined against the renderer's own instances.

    python -m benchmarks assets [--quick]                                  # everything, with targets
    python -m benchmarks.assets --only cycles eevee [--quick]              # some parts
    python -m benchmarks.assets --only pictures --keep                     # beside what earlier runs left
    python -m benchmarks.assets --only cycles --plain                      # without anything of the extension
    python -m benchmarks.assets --case time leaves plain CYCLES 20 near    # one case, as a line of JSON

Parts: ``compile`` (seconds, bytes, areas and bounds), ``pictures`` (FLIP), ``crown`` (light through a crown of cards,
color of its tenths), ``forest`` (10,000 and a million instances), ``cycles`` and ``eevee`` (from a .blend file to an
image of 64 samples, of which few are rendered, and of 2), ``many`` (different assets), ``window`` (redraws of the
viewport; needs a full Blender, named by the environment variable BLENDER, and a virtual screen).

Each case runs in a process of its own; memory is that of this process alone, and ``_others_mb`` that of processes that
work for it. ``_cached`` has compiled its asset in an earlier process. Images and records are left in ``out/assets``.
What plain EEVEE and plain Cycles cannot do here is extrapolated in proportion from what they can.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from devtools import session

from .report import ROOT, Targets, missed, records_of, report, table

FOLDER = ROOT / "out" / "assets"
KINDS = ("leaves", "cards", "nodes")
#: Triangles from which on seconds and bytes of compiling are told for each of them.
LARGE = 250_000
#: Instances and distances of the race in Cycles.
COUNTS, QUICK_COUNTS, ENDS = (20, 1_000, 10_000), (20,), ("near", "far")
#: Instances of plain images in EEVEE, and those that they are extrapolated to.
EEVEE_PLAIN, EEVEE_COUNTS = (4, 12), (200, 10_000)
#: Different assets, their triangles, how many of them plain Cycles takes here, and instances of each.
MANY, MANY_TRIANGLES, MANY_PLAIN, MANY_EACH = 60, 2_000_000, (2, 6), 10
QUICK_MANY, QUICK_MANY_TRIANGLES = 6, 300_000
#: How the file holds them, as of `asset_cases.store_many`: Blender loads all linked meshes when it opens a file.
LAYOUT = "grown"
#: Of images in EEVEE, which draws in software here.
EEVEE_SIZE = 640, 360
#: Instances in the window, refined and plain.
WINDOW, WINDOW_PLAIN = 10_000, 100
FOREST, MILLION = 10_000, 1_000_000

TARGETS: Targets = {
    "area_error": {"max": 1e-6},
    "beyond_bounds": {"max": 1e-5},
    "flip_mean": {"max": 0.05},
    "flip_max": {"max": 0.08},
    "dT_max": {"max": 0.01},
    "tenth_max": {"max": 0.03},
    "refine_emit_s_10k": {"max": 20.0},
    "peak_mb_10k": {"max": 4000.0},
    "refine_emit_s_1m": {"max": 60.0},
    "peak_mb_1m": {"max": 8000.0},
    "cycles_time_ratio": {"max": 1.05},
    "cycles_memory_ratio": {"max": 1.05},
    "peak_mb_60": {"max": 4000.0},
    "eevee_time_ratio": {"max": 0.15},
    "eevee_time_ratio_10000": {"max": 0.02},
    "viewport_ratio": {"max": 1.0},
    "compile_s_per_mtri": {"max": 8.0},
    "compile_again_s": {"max": 0.3},
    "bytes_per_triangle": {"max": 100.0},
}
QUICK_TARGETS: Targets = {
    "area_error": {"max": 1e-6},
    "beyond_bounds": {"max": 1e-5},
    "dT_max": {"max": 0.02},
    "compile_s_per_mtri": {"max": 10.0},
}


def run(quick: bool, parts: tuple[str, ...] = (), plain: bool = False) -> dict[str, float]:
    """Figures of parts, by default of all, or for a quick run of those that take least."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    figures: dict[str, float] = {}
    for name in parts or (QUICK_PARTS if quick else tuple(PARTS)):
        figures |= PARTS[name](quick, plain)
    return figures


def apart(*words: object, quick: bool = False, options: tuple[str, ...] = ()) -> dict[str, float]:
    """Figures of a case by a process of its own; none, and why not on stderr, where it fails."""
    command = ["benchmarks.assets", "--case", *map(str, words), *options, *(["--quick"] if quick else [])]
    try:
        if words[0] in {"time", "many"}:
            records_of([*command, "--store"])
        return records_of(command)[-1]
    except RuntimeError as error:
        print(error, file=sys.stderr, flush=True)
        return {}


def compiling(quick: bool, plain: bool) -> dict[str, float]:
    """Seconds, bytes and exactness of compiling each kind; the worst of all kinds has no name of a kind.

    Seconds and bytes a triangle count of kinds with more than `LARGE` triangles: others cost what any asset does.
    """
    if plain:
        return {}
    made = {kind: apart("compile", kind, quick=quick) for kind in KINDS}
    figures = {f"{key}_{kind}": value for kind, found in made.items() for key, value in found.items()}
    worst = {"area_error": "area_error", "beyond_bounds": "beyond_bounds", "compile_s_per_mtri": "compile_s_per_mtri"}
    worst |= {"compile_again_s": "again_s", "bytes_per_triangle": "bytes_per_triangle"}
    for name, key in worst.items():
        per = name.endswith(("per_mtri", "per_triangle"))
        values = [found[key] for found in made.values() if not per or found.get("triangles", 0) > LARGE]
        figures |= {name: max(values)} if all(made.values()) and values else {}
    return figures


def pictures(quick: bool, plain: bool) -> dict[str, float]:
    """FLIP of all kinds; quick: of one."""
    figures: dict[str, float] = {}
    for kind in KINDS[:1] if quick else KINDS:
        figures |= apart("plain_woods" if plain else "woods", kind, quick=quick)
    flips = [value for key, value in figures.items() if key.startswith("flip_")]
    noises = [value for key, value in figures.items() if key.startswith("noise_")]
    if flips:
        figures |= {"flip_mean": sum(flips) / len(flips), "flip_max": max(flips)}
    if noises:
        figures |= {"flip_noise_mean": sum(noises) / len(noises), "flip_noise_max": max(noises)}
    return figures


def crowns(quick: bool, plain: bool) -> dict[str, float]:
    """Transmittance of a crown of cards, and color of its tenths: of its surfaces, and as they are lit."""
    if plain:
        return {}
    found = apart("crown", "cards", quick=quick)
    for name, key in (("dT_max", "dT_"), ("tenth_max", "tenth_"), ("tenth_lit_max", "lit_")):
        values = [abs(value) for other, value in found.items() if other.startswith(key)]
        found |= {name: max(values)} if values else {}
    return found


def forest(quick: bool, plain: bool) -> dict[str, float]:
    """10,000 and a million instances, refined with all that the extension does to assets; quick: the former."""
    if plain:
        return {}
    figures: dict[str, float] = {}
    for count, end in ((FOREST, "10k"), *(() if quick else ((MILLION, "1m"),))):
        for cached in ("", "_cached"):
            options = ("--detail", "REFINE", *(("--cache", str(FOLDER / "cache")) if cached else ()))
            if cached:
                apart("time", "leaves", "refined", "CYCLES", 20, "far", options=options)
            found = apart("time", "leaves", "refined", "CYCLES", count, "near", options=options)
            if not found:
                continue
            figures |= {f"refine_emit_s_{end}{cached}": found["refine_s"], f"total_s_{end}{cached}": found["total_s"]}
            figures |= {f"peak_mb_{end}{cached}": found["peak_mb"], f"others_mb_{end}{cached}": found["others_mb"]}
    return figures


def cycles(quick: bool, plain: bool) -> dict[str, float]:
    """Refined beside plain in Cycles; the ratios without numbers are the worst of all."""
    figures: dict[str, float] = {}
    for count in QUICK_COUNTS if quick else COUNTS:
        for distance in ENDS:
            end = f"{count}_{distance}"
            theirs = apart("time", "leaves", "plain", "CYCLES", count, distance, quick=quick)
            ours = {} if plain else apart("time", "leaves", "refined", "CYCLES", count, distance, quick=quick)
            figures |= _named("cycles", "plain", end, theirs) | _named("cycles", "refined", end, ours)
            if ours and theirs:
                figures[f"cycles_time_ratio_{end}"] = ours["total_s"] / theirs["total_s"]
                figures[f"cycles_memory_ratio_{end}"] = ours["peak_mb"] / theirs["peak_mb"]
    for what in ("time", "memory"):
        ratios = [value for key, value in figures.items() if key.startswith(f"cycles_{what}_ratio_")]
        figures |= {f"cycles_{what}_ratio": max(ratios)} if ratios else {}
    return figures


def eevee(quick: bool, plain: bool) -> dict[str, float]:
    """Refined in EEVEE, beside plain instances that are extrapolated from few."""
    figures: dict[str, float] = {}
    seen = [apart("time", "leaves", "plain", "EEVEE", count, "middle", quick=quick) for count in EEVEE_PLAIN]
    for count, found in zip(EEVEE_PLAIN, seen, strict=True):
        figures |= _named("eevee", "plain", count, found)
    for count in EEVEE_COUNTS[:1] if quick else EEVEE_COUNTS:
        ours = {} if plain else apart("time", "leaves", "refined", "EEVEE", count, "middle", quick=quick)
        figures |= _named("eevee", "refined", count, ours)
        if all(seen):
            theirs = extrapolated(EEVEE_PLAIN, tuple(found["total_s"] for found in seen), count)
            figures[f"eevee_plain_total_s_{count}"] = theirs
            figures |= {f"eevee_time_ratio_{count}": ours["total_s"] / theirs} if ours else {}
    if f"eevee_time_ratio_{EEVEE_COUNTS[0]}" in figures:
        figures["eevee_time_ratio"] = figures[f"eevee_time_ratio_{EEVEE_COUNTS[0]}"]
    return figures


def many(quick: bool, plain: bool) -> dict[str, float]:
    """Different assets: plain memory extrapolated from few, and refined with all of them."""
    number, few = (QUICK_MANY, (1, 3)) if quick else (MANY, MANY_PLAIN)
    seen = [apart("many", count, "plain", LAYOUT, quick=quick) for count in few]
    figures: dict[str, float] = {}
    for count, found in zip(few, seen, strict=True):
        figures |= {f"many_{key}_plain_{count}": value for key, value in found.items()}
    if all(seen):
        for key in ("peak_mb", "opened_mb", "total_s"):
            figures[f"many_{key}_plain_{number}"] = extrapolated(few, tuple(f[key] for f in seen), number)
    ours = {} if plain else apart("many", number, "refined", LAYOUT, quick=quick)
    figures |= {f"many_{key}_refined_{number}": value for key, value in ours.items()}
    return figures | ({f"peak_mb_{number}": ours["peak_mb"]} if ours else {})


def viewport(quick: bool, plain: bool) -> dict[str, float]:
    """Seconds of a redraw in solid shading."""
    from .asset_window import redraws

    return redraws(FOLDER, *((200, 5) if quick else (WINDOW, WINDOW_PLAIN)), quick, plain)


def extrapolated(counts: tuple[int, int], values: tuple[float, float], wanted: int) -> float:
    """The value at a number, on the line through two."""
    slope = (values[1] - values[0]) / (counts[1] - counts[0])
    return values[0] + slope * (wanted - counts[0])


def _named(engine: str, what: str, end: object, found: dict[str, float]) -> dict[str, float]:
    return {f"{engine}_{what}_{key}_{end}": value for key, value in found.items()}


PARTS: dict[str, Callable[[bool, bool], dict[str, float]]] = {
    "compile": compiling,
    "pictures": pictures,
    "crown": crowns,
    "forest": forest,
    "cycles": cycles,
    "eevee": eevee,
    "many": many,
    "window": viewport,
}
QUICK_PARTS = ("compile", "crown")


def measure(words: list[str], given: argparse.Namespace) -> dict[str, float]:
    """Figures of one case, in this process."""
    from tetflora_addon import storage

    from . import asset_cases, asset_pictures, asset_scenes

    name, *rest = words
    if given.cache:
        storage.set_folder(given.cache)
    if name == "compile":
        return asset_cases.compiled(rest[0], given.quick)
    if name in {"woods", "plain_woods", "crown"}:
        return getattr(asset_pictures, name)(rest[0], FOLDER, given.quick)
    if name == "libraries":
        return asset_cases.libraries(FOLDER, int(rest[0]), _many_triangles(given.quick))
    if name == "window_file":
        return asset_cases.window_file(FOLDER, rest[0], int(rest[1]), given.quick)
    what, engine = (rest[1], "CYCLES") if name == "many" else rest[1:3]
    if name == "many":
        where = FOLDER, int(rest[0]), rest[2], _many_triangles(given.quick)
        path = asset_cases.many_file(*where)
        store = partial(asset_cases.store_many, *where, MANY_EACH)
    else:
        size = EEVEE_SIZE if engine == "EEVEE" else asset_scenes.SIZE
        wanted = asset_scenes.Scatter(rest[0], int(rest[3]), rest[4], size=size, quick=given.quick)
        path = asset_cases.wood_file(FOLDER, wanted)
        store = partial(asset_scenes.store, path, wanted)
    if not given.store:
        return asset_cases.timed(path, what, engine, given.detail)
    if not path.exists():
        store()
    return {}


def _many_triangles(quick: bool) -> int:
    return QUICK_MANY_TRIANGLES if quick else MANY_TRIANGLES


def main() -> int:
    """Measure one case and print a line of JSON, or parts and print their table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.assets", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=tuple(PARTS), default=(), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--case", nargs="+", metavar="WORD", help="one case in this process")
    parser.add_argument("--plain", action="store_true", help="only what needs nothing of the extension")
    parser.add_argument("--quick", action="store_true", help="trees of fewer triangles, fewer samples and parts")
    parser.add_argument("--keep", action="store_true", help="add to the figures that earlier runs left")
    parser.add_argument(
        "--store", action="store_true", help="only save the file of a case, which is timed in another call"
    )
    parser.add_argument("--detail", default="AUTO", choices=("AUTO", "REFINE"), help="what refinement may leave plain")
    parser.add_argument("--cache", type=Path, help="folder in which compiled assets are kept for later processes")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the record here")
    given = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    session.start()
    session.clean_file()
    if given.case:
        print(json.dumps(measure(given.case, given)), flush=True)
        return 0
    left = FOLDER / "figures.json"
    figures = json.loads(left.read_text()) if given.keep and left.exists() else {}
    for part in given.only or tuple(PARTS):
        figures |= run(given.quick, (part,), given.plain)
        left.write_text(json.dumps(figures, indent=1) + "\n")
    targets = QUICK_TARGETS if given.quick else TARGETS
    if given.only:
        targets = {key: target for key, target in targets.items() if key in figures}
    record = report("assets", figures, targets)
    print(table(record), flush=True)
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps(record, indent=1) + "\n")
    for text in missed(record):
        print("missed:", text, file=sys.stderr)
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
