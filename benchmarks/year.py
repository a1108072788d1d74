# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The year and the age of plants: whether proxies follow them, and what refining costs when one sees through.

    python -m benchmarks year [--quick] [--json PATH]         # everything, with targets
    python -m benchmarks year --parts wood birch              # of those in `PARTS`
    python -m benchmarks year --keep --minutes 8              # what earlier runs left undone, as far as one comes

``wood`` and ``birch``: FLIP between refined frames less FLIP between expanded ones, as the benchmark `dolly` has it;
and FLIP between a refined frame and the one before to which the change of the expanded plants was added, which also
sees where something else changes than should, and the noise of what changes. Both are means of the whole picture;
``where_plants`` is the first over pixels in which plants or their shadows are. ``refining``: processor seconds of days
and ages over those of summer at full age, measured in turns with one thread, of which the least counts.

Pictures and records are left in ``out/year``. Without ``--keep`` a part begins anew. Reduced, since expanded plants
take a processor long: the year of a wood is 320 × 180 pixels with 16 samples and 32 plants of 6 to 16 years, the life
of a birch 200 × 280 with 24. Frames whose meshes are those of the frame before, to the bit, are that frame's picture.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import radians, tan
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from devtools.result_hashes import datablock_hash
from examples import stage
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.growth.hashing import uniform

from .pictures import flip_map, read_picture, render, timed_refine
from .report import ROOT, Targets

FOLDER = ROOT / "out" / "year"
PARTS = ("wood", "birch", "refining")
KINDS = ("refined", "expanded")
#: The wood's plants, ground for each, m², and their ages: fully expanded, old trees are a million polygons each.
PLANTS, ROOM, AGES = 32, 14.0, (6.0, 16.0)
WOOD_SIZE, BIRCH_SIZE = (320, 180), (200, 280)
WOOD_SAMPLES, BIRCH_SAMPLES = 16, 24
#: Height that the birch's camera sees, meters; difference of a pixel from the empty place in which a plant is seen.
_BIRCH, _SEEN = 24.0, 0.02
#: Species of the wood with their relative numbers: two that turn yellow, one that turns brown, one evergreen, a shrub.
MIX = {"birch": 0.3, "beech": 0.2, "oak": 0.2, "spruce": 0.15, "hazel": 0.15}
#: Nearest distance to the eye and height of the eye, meters; horizontal field of view.
_NEAREST, _EYE, _VIEW = 7.0, 1.7, radians(54.0)
_ELEVATION, _AZIMUTH = 35.0, -60.0
#: Plants that are refined for time, few and quick, with ground for each, m²; days, and ages in years.
REFINED, QUICK_REFINED, _ROOM = 300, 24, 30.0
SIZE, QUICK_SIZE = (1920, 1080), (480, 270)
DAYS, YEARS, SUMMER = (15.0, 122.0, 145.0, 285.0, 300.0), (5.0, 20.0, 60.0, 150.0), 231.0
TURNS = 2

TARGETS: Targets = {"flip_steps_max": {"max": 0.01}, "refine_ratio_max": {"max": 1.1}}
QUICK_TARGETS: Targets = {"flip_steps_max": {"max": 0.02}}


def options(parser: argparse.ArgumentParser) -> None:
    """What may be asked for beside everything."""
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--keep", action="store_true", help="go on with what earlier runs left")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing after so many")


def run(given: argparse.Namespace) -> dict[str, float]:
    """Measure; see the table in ``docs/measurements.md`` for what the figures mean."""
    return measure(given.parts, given.quick, given.keep, time.monotonic() + 60.0 * given.minutes)


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
    return {
        "wood": lambda at: frames(at, year_of_a_wood(quick), until),
        "birch": lambda at: frames(at, life_of_a_birch(quick), until),
        "refining": lambda _: refining(quick, until),
    }[name]


@dataclass(frozen=True)
class Series:
    """Frames of one scene.

    Attributes
    ----------
    name : str
    build : callable
        Fills an empty scene.
    states : tuple of (day or None, years)
    samples : int
    """

    name: str
    build: Callable[[bpy.types.Scene], None]
    states: tuple[tuple[float | None, float], ...]
    samples: int


def year_of_a_wood(quick: bool = False) -> Series:
    """73 frames, every five days."""
    size = (160, 90) if quick else WOOD_SIZE
    days = np.arange(1.0, 366.0, 30.0 if quick else 5.0)
    plants = 8 if quick else PLANTS
    return Series(
        "wood",
        lambda scene: wood(scene, plants, size, ROOM, AGES),
        tuple((day, 0.0) for day in days.tolist()),
        4 if quick else WOOD_SAMPLES,
    )


def life_of_a_birch(quick: bool = False) -> Series:
    """80 frames, one for each year, in summer."""
    size = (100, 140) if quick else BIRCH_SIZE
    years = np.arange(0.0, 80.0, 10.0 if quick else 1.0)
    return Series(
        "birch",
        lambda scene: lone(scene, "birch", _BIRCH, size, age=1.0),
        tuple((None, passed) for passed in years.tolist()),
        6 if quick else BIRCH_SAMPLES,
    )


def frames(folder: Path, series: Series, until: float = float("inf")) -> dict[str, float] | None:
    """Make the frames and compare them; None where the clock (`time.monotonic`) was past ``until`` before the end."""
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "frames.json"
    made = json.loads(record.read_text()) if record.exists() else {}
    nothing = folder / "nothing.png"
    if not (nothing.exists() and all(_key(state) in made for state in series.states)):
        scene = bpy.context.scene
        series.build(scene)
        if not nothing.exists():
            render(scene, nothing, series.samples)
        # Refining first and expanding then, so that a scene's meshes are replaced by fewer of the same kind.
        for number, state in enumerate(series.states):
            if _key(state) in made:
                continue
            if time.monotonic() > until:
                return None
            before = made.get(_key(series.states[number - 1])) if number else None
            made[_key(state)] = _frame(scene, folder, series, state, before)
            record.write_text(json.dumps(made, indent=1) + "\n")
    return figures(folder, series, made)


def _frame(
    scene: bpy.types.Scene, folder: Path, series: Series, state: tuple[float | None, float], before: dict | None
) -> dict:
    """Make both pictures of a state; one whose meshes are those of the frame before is that frame's."""
    found: dict = {}
    set_day(scene, *state)
    for kind in KINDS:
        statistics, seconds = timed_refine(scene, expand_everything=kind == "expanded")
        path, content = _path(folder, state, kind), digest(scene)
        begin = time.perf_counter()
        if before is not None and before[f"{kind}_digest"] == content:
            shutil.copyfile(folder / before[f"{kind}_file"], path)
        else:
            render(scene, path, series.samples)
        found |= {
            f"{kind}_digest": content,
            f"{kind}_file": path.name,
            f"{kind}_s": seconds,
            f"{kind}_render_s": time.perf_counter() - begin,
            f"{kind}_polygons": statistics.polygons_meshed,
            f"{kind}_facets": statistics.polygons_proxy,
        }
    shown = " ".join(f"{key} {value:.4g}" for key, value in found.items() if isinstance(value, int | float))
    print(f"  {series.name} {_key(state)}: {shown}", flush=True)
    return found


def figures(folder: Path, series: Series, made: dict) -> dict[str, float]:
    """Figures of frames that are there."""
    pictures = {kind: [read_picture(_path(folder, state, kind))[:, :, :3] for state in series.states] for kind in KINDS}
    steps = {kind: np.array([_flip(a, b) for a, b in itertools.pairwise(pictures[kind])]) for kind in KINDS}
    beyond = steps["refined"] - steps["expanded"]
    nothing = read_picture(folder / "nothing.png")[:, :, :3]
    there = [np.abs(picture - nothing).max(axis=2) > _SEEN for picture in pictures["expanded"]]
    seen = np.array([max(float((a | b).mean()), 1e-3) for a, b in itertools.pairwise(there)])
    strange = np.array(
        [_flip(_changed(a, b), b[0]) for a, b in itertools.pairwise(zip(*pictures.values(), strict=True))]
    )
    apart = [_flip(expanded, refined) for refined, expanded in zip(*pictures.values(), strict=True)]
    at = [state[0] if state[0] is not None else state[1] + 1.0 for state in series.states]
    name = series.name
    rows = [made[_key(state)] for state in series.states]
    return {
        f"{name}_frames": len(series.states),
        f"{name}_pixels_x": pictures["refined"][0].shape[1],
        f"{name}_pixels_y": pictures["refined"][0].shape[0],
        f"{name}_samples": series.samples,
        f"{name}_frames_that_differ": int((steps["expanded"] > 0).sum()),
        f"{name}_flip_steps_max": float(beyond.max()),
        f"{name}_flip_steps_max_at": float(at[1 + int(beyond.argmax())]),
        f"{name}_flip_steps_mean": float(beyond.mean()),
        f"{name}_flip_steps_max_where_plants": float((beyond / seen).max()),
        f"{name}_flip_steps_mean_where_plants": float((beyond / seen).mean()),
        f"{name}_flip_refined_step_max": float(steps["refined"].max()),
        f"{name}_flip_expanded_step_max": float(steps["expanded"].max()),
        f"{name}_flip_other_change_max": float(strange.max()),
        f"{name}_flip_other_change_mean": float(strange.mean()),
        f"{name}_flip": float(np.mean(apart)),
        f"{name}_flip_max": float(np.max(apart)),
        f"{name}_flip_max_at": float(at[int(np.argmax(apart))]),
        f"{name}_refine_s_mean": float(np.mean([row["refined_s"] for row in rows])),
        f"{name}_refine_s_max": float(np.max([row["refined_s"] for row in rows])),
        f"{name}_polygons_expanded_max": max(row["expanded_polygons"] for row in rows),
        f"{name}_polygons_max": max(row["refined_polygons"] + row["refined_facets"] for row in rows),
    }


def _changed(before: tuple[NDArray, NDArray], after: tuple[NDArray, NDArray]) -> NDArray[np.float32]:
    """The refined picture (height, width, 3) before, changed as expanded plants have; pairs are refined, expanded."""
    return np.clip(before[0] + after[1] - before[1], 0.0, 1.0)


def _flip(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    return 0.0 if np.array_equal(a, b) else float(flip_map(a, b).mean())


def _key(state: tuple[float | None, float]) -> str:
    return f"day {state[0]:g}" if state[0] is not None else f"year {state[1]:g}"


def _path(folder: Path, state: tuple[float | None, float], kind: str) -> Path:
    return folder / f"{_key(state).replace(' ', '-')}-{kind}.png"


def refining(quick: bool, until: float = float("inf")) -> dict[str, float] | None:
    """Seconds of Refine on days and at ages over those in summer at full age; None as of `frames`."""
    cases: list[tuple[str, float | None, float]] = [("", None, 0.0), (f"_day_{SUMMER:g}", SUMMER, 0.0)]
    cases += [(f"_day_{day:g}", day, 0.0) for day in DAYS] + [(f"_years_{age:g}", None, age) for age in YEARS]
    scene = bpy.context.scene
    wood(scene, QUICK_REFINED if quick else REFINED, QUICK_SIZE if quick else SIZE, _ROOM)
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


def wood(
    scene: bpy.types.Scene, plants: int, size: tuple[int, int], room: float, ages: tuple[float, float] | None = None
) -> None:
    """Fill an empty scene with plants before the camera, evenly over the ground that it sees.

    Parameters
    ----------
    scene : bpy.types.Scene
    plants : int
    size : tuple of int
        Of the image, pixels.
    room : float
        Ground for each plant, m².
    ages : tuple of float, optional
        Youngest and oldest, in years; a handful of ages between them. Without it, plants are full-grown.
    """
    half = 0.94 * tan(_VIEW / 2)
    farthest = np.sqrt(_NEAREST**2 + plants * room / half)
    # A sequence of low discrepancy (Roberts, 2018), even over the ground that is seen.
    u, v = np.mod(0.5 + np.arange(1, plants + 1)[:, None] * [0.7548776662, 0.5698402910], 1.0).T
    away = np.sqrt(_NEAREST**2 + u * (farthest**2 - _NEAREST**2))
    x = (2.0 * v - 1.0) * half * away
    key = np.arange(plants).astype(np.uint64)
    kinds = tuple(MIX)
    edges = np.cumsum(tuple(MIX.values()))
    kind = np.minimum(np.searchsorted(edges, uniform(key, 1) * edges[-1]), len(kinds) - 1)
    scale = 0.85 + 0.3 * uniform(key, 2)
    years = np.zeros(plants) if ages is None else np.round(ages[0] + (ages[1] - ages[0]) * (key % 4) / 3.0)
    for i in range(plants):
        place = float(x[i]), float(away[i]), 0.0
        stage.plant(scene, kinds[kind[i]], i, place, 2.399963 * i, float(scale[i]), float(years[i]))
    stage.ground(20.0 * float(farthest))
    up = radians(9.0)
    stage.camera(scene, (0.0, 0.0, _EYE), (0.0, 1.0, _EYE + tan(up)), size, view=_VIEW, far=5000.0)
    _finish(scene)


def lone(scene: bpy.types.Scene, species: str, height: float, size: tuple[int, int], age: float) -> None:
    """Fill an empty scene with one plant, and a camera that sees so many meters of its height."""
    stage.plant(scene, species, 1, (0.0, 0.0, 0.0), 2.399963, age=age)
    stage.ground(60.0 * height)
    view = radians(24.0)
    away = 0.55 * height / tan(view / 2)
    stage.camera(scene, (0.0, -away, _EYE), (0.0, 0.0, _EYE), size, view=view * size[0] / size[1], far=5000.0)
    # The horizon is at the height of the eye.
    scene.camera.data.shift_y = (0.5 * height - _EYE) / (1.1 * height) * size[1] / max(size)
    _finish(scene)


def set_day(scene: bpy.types.Scene, day: float | None = None, years: float = 0.0) -> None:
    """Set the day of the year, or switch seasons off, and the years that have passed."""
    year = scene.tetflora.year
    year.enabled, year.years = day is not None, years
    if day is not None:
        year.day = day


def digest(scene: bpy.types.Scene) -> str:
    """Hash of all that Refine has made: every attribute of every mesh and point cloud, materials and places."""
    content = hashlib.sha256()
    for collection in result_collections(scene):
        for obj in sorted(collection.all_objects, key=lambda o: o.name):
            content.update(np.array(obj.matrix_world, np.float32).tobytes())
            content.update(" ".join(m.name if m else "" for m in getattr(obj.data, "materials", ())).encode())
            content.update(datablock_hash(obj.data).encode() if hasattr(obj.data, "attributes") else b"")
            if obj.type == 'MESH':
                offsets = np.zeros(len(obj.data.polygons), np.int32)
                obj.data.polygons.foreach_get("loop_start", offsets)
                content.update(offsets.tobytes())
    return content.hexdigest()


def _finish(scene: bpy.types.Scene) -> None:
    stage.daylight(scene, elevation=_ELEVATION, azimuth=_AZIMUTH)
    scene.render.engine = 'CYCLES'
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()
