# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of a year and of a life: by how much more refined frames differ from each other than expanded ones.

A year of a mixed forest goes by in steps of five days, and a birch grows from its first year to its eightieth. Camera,
light and seeds of noise stay the same, so that whatever differs between two frames is what the plants do. Two figures
tell whether proxies follow: FLIP between refined frames less FLIP between expanded ones, as the benchmark `dolly` has
it; and FLIP between a refined frame and the one before to which the change of the expanded plants was added, which also
sees where something else changes than should, and the noise of what changes. Both are means of the whole picture;
``where_plants`` is the first over pixels in which plants or their shadows are.

Pictures and ``frames.json`` are left in a folder, and frames that are there already are not made again.
"""

from __future__ import annotations

import itertools
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from .compare import flip_map, read_picture, render
from .row80 import timed_refine
from .year_scene import digest, lone, set_day, wood

KINDS = ("refined", "expanded")
#: The wood's plants, ground for each, m², and their ages: fully expanded, old trees are a million polygons each.
PLANTS, ROOM, AGES = 32, 14.0, (6.0, 16.0)
WOOD_SIZE, BIRCH_SIZE = (320, 180), (200, 280)
WOOD_SAMPLES, BIRCH_SAMPLES = 16, 24
#: Height that the birch's camera sees, meters; difference of a pixel from the empty place in which a plant is seen.
_BIRCH, _SEEN = 24.0, 0.02


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


def run(folder: Path, series: Series, until: float = float("inf")) -> dict[str, float] | None:
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
