# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What days and ages cost: refining, compiling, and the memory of tables; and that summer is what it was.

Everything is measured side by side in one run, in turns, and the least of each counts. Refining takes one thread here,
so that its processor seconds are those of this process.
"""

from __future__ import annotations

import time
from dataclasses import is_dataclass

import bpy
import numpy as np

from devtools import session
from tetflora_addon.blender.job import refine
from tetflora_addon.compiled.flora import Flora, _compiled
from tetflora_addon.growth.seasons import Season
from tetflora_addon.species import ages, catalog

from .year_scene import MIX, digest, set_day, wood

PLANTS, QUICK_PLANTS, ROOM = 300, 24, 30.0
SIZE, QUICK_SIZE = (1920, 1080), (480, 270)
#: Days, and ages in years, that are compared with summer at full age.
DAYS, AGES = (15.0, 122.0, 145.0, 285.0, 300.0), (5.0, 20.0, 60.0, 150.0)
SUMMER = 231.0
TURNS = 2


def refining(quick: bool, until: float = float("inf")) -> dict[str, float] | None:
    """Seconds of Refine on days and at ages over those in summer at full age; None as in `year_frames.run`."""
    cases: list[tuple[str, float | None, float]] = [("", None, 0.0), (f"_day_{SUMMER:g}", SUMMER, 0.0)]
    cases += [(f"_day_{day:g}", day, 0.0) for day in DAYS] + [(f"_years_{age:g}", None, age) for age in AGES]
    session.clean_file()
    scene = bpy.context.scene
    wood(scene, QUICK_PLANTS if quick else PLANTS, QUICK_SIZE if quick else SIZE, ROOM)
    scene.render.threads_mode, scene.render.threads = 'FIXED', 1
    first: dict[str, float] = {}
    least: dict[str, float] = {}
    figures: dict[str, float] = {}
    # Each turn begins with what all are compared with; at first, tables are made and weights are measured.
    for turn in range(TURNS + 1):
        for name, day, age in cases:
            if time.monotonic() > until:
                return None
            set_day(scene, day, age)
            begun = time.process_time()
            statistics = refine.refine(scene, bpy.context.evaluated_depsgraph_get())
            taken = time.process_time() - begun
            if turn == 0:
                first[name] = taken
                figures[f"polygons{name}"] = statistics.polygons_meshed + statistics.polygons_proxy
            else:
                least[name] = min(taken, least.get(name, taken))
            print(f"  refine{name}: {taken:.2f} s", flush=True)
    figures |= {f"refine_cpu_s{name}": taken for name, taken in least.items()}
    ratios = {name: taken / least[""] for name, taken in least.items() if name}
    figures |= {f"refine_ratio{name}": ratio for name, ratio in ratios.items()}
    figures |= {f"refine_first_cpu_s{name}": taken for name, taken in first.items()}
    worst = max(ratios, key=ratios.get)
    print(f"  worst: {worst}", flush=True)
    return figures | {
        "refine_ratio_max": ratios[worst],
        "refine_ratio_days_max": max(ratio for name, ratio in ratios.items() if "day" in name),
        "refine_ratio_ages_max": max(ratio for name, ratio in ratios.items() if "years" in name),
    }


def compiling(quick: bool) -> dict[str, float]:
    """Seconds of compiling and the memory of tables, with a day and without, and at ages; worst of all species.

    Tables are all that a flora holds once it was refined; ``without_samples`` are those that compiling makes.
    """
    repeats = 3 if quick else 7
    figures: dict[str, float] = {}
    bare: dict[str, float] = {}
    names = tuple(MIX) if quick else tuple(catalog.list_species())
    for name in names:
        species = catalog.load_species(name)
        plain = _seconds(lambda one=species: _compiled.__wrapped__((one,)), repeats)
        flora = _compiled.__wrapped__((species,))
        slowest = max(_seconds(lambda d=day, f=flora: _on_day(f, d), repeats) for day in DAYS)
        bare[name] = max(nbytes(_on_day(flora, day)) for day in DAYS) / nbytes(flora)
        used(flora)
        held = max(nbytes(_on_day(flora, day)) for day in DAYS) / nbytes(flora)
        old = [ages.with_age(species, age) for age in AGES]
        aged = max(_seconds(lambda one=one: _compiled.__wrapped__((one,)), repeats) for one in old)
        figures |= {
            f"compile_ms_{name}": 1e3 * plain,
            f"compile_ratio_{name}": (plain + slowest) / plain,
            f"compile_ratio_age_{name}": aged / plain,
            f"memory_ratio_{name}": held,
            f"memory_kb_{name}": nbytes(flora) / 1e3,
        }
    mixed = tuple(catalog.load_species(name) for name in names)
    plain = _seconds(lambda: _compiled.__wrapped__(mixed), repeats)
    flora = _compiled.__wrapped__(mixed)
    slowest = max(_seconds(lambda d=day: _on_day(flora, d), repeats) for day in DAYS)
    used(flora)
    return {
        "compile_ratio_max": max(v for k, v in figures.items() if k.startswith("compile_ratio_")),
        "memory_ratio_max": max(v for k, v in figures.items() if k.startswith("memory_ratio_")),
        "memory_ratio_without_samples_max": max(bare.values()),
        "compile_all_ms": 1e3 * plain,
        "compile_all_ratio": (plain + slowest) / plain,
        "memory_all_ratio": max(nbytes(_on_day(flora, day)) for day in DAYS) / nbytes(flora),
    } | figures


def summer(quick: bool) -> dict[str, float]:
    """1 where what is refined in summer with seasons is, to the bit, what is refined without them."""
    session.clean_file()
    scene = bpy.context.scene
    wood(scene, QUICK_PLANTS, QUICK_SIZE if quick else (960, 540), ROOM)
    digests = []
    for day in (None, SUMMER):
        set_day(scene, day)
        refine.refine(scene, bpy.context.evaluated_depsgraph_get())
        digests.append(digest(scene))
    return {"summer_is_the_same": float(digests[0] == digests[1])}


def _on_day(flora: Flora, day: float) -> Flora:
    from tetflora_addon.compiled import flora as module

    return getattr(module._on_day, "__wrapped__", module._on_day)(flora, Season(day=day))


def used(flora: Flora) -> None:
    """Let a flora have all tables that proxies ask for."""
    _ = flora.samples, flora.sampled_bound, flora.orientation, flora.clumping


def nbytes(thing: object) -> int:
    """Bytes of all arrays that a flora holds, those that it shares with itself in summer counted once."""
    seen: dict[int, int] = {}
    _collect(thing, seen)
    return sum(seen.values())


def _collect(thing: object, seen: dict[int, int]) -> None:
    if isinstance(thing, np.ndarray):
        whole = thing.base if isinstance(thing.base, np.ndarray) else thing
        seen[id(whole)] = whole.nbytes
    elif is_dataclass(thing):
        # With what it has computed for itself.
        for value in vars(thing).values():
            _collect(value, seen)
    elif isinstance(thing, tuple | list):
        for one in thing:
            _collect(one, seen)


def _seconds(work: object, repeats: int) -> float:
    """Least processor seconds of several."""
    taken = []
    for _ in range(repeats):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return min(taken)
