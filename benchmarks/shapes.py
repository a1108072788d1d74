# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light shapes in the real window: what a million plants cost to show, and how quickly the timeline goes by.

Needs ``BLENDER=/path/to/blender``, and a screen is made for it. One file with two lives, as devtools/window_pictures:
devtools/window_driver.py loads it again inside Blender for `steps`. Graphics are software. Seconds are the processor's,
of all threads together, because others may use the machine too: at rest none of them is longer. An empty window alone
takes 0.3 s to draw so, which is Blender's: frames a second are those of what plants add to it while the timeline plays.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT))

from devtools import session, window  # noqa: E402  (found only now)

PLANTS, SCRUBBED = 1_000_000, 100_000
SPECIES = ("birch", "spruce", "oak", "beech", "scots_pine")
ROOM = 9.0  # square meters for each plant
FRAMES, LAST = 16, 48  # that are timed, and how many there are

TARGETS = {
    "show_s": {"max": 1.0},
    "show_mb": {"max": 300.0},
    "scrub_fps": {"min": 10.0},
}


def run(_quick: bool) -> dict[str, float]:
    """Measure; see `steps` for what the figures mean."""
    with tempfile.TemporaryDirectory() as folder:
        result = window.run_in_window(os.environ["BLENDER"], Path(__file__), Path(folder), 1500.0)
    if not result["ok"]:
        raise RuntimeError(result["error"])
    return result["values"]


def steps(ui: Any) -> Iterator[float | None]:
    """Inside Blender: play nothing, show many plants, then play seasons and years of fewer."""
    import bpy

    session.start()
    from benchmarks.report import forget_peak, peak_mb
    from tetflora_addon.blender.viewport import levels, state

    scene, found = bpy.context.scene, ui.values
    for name in ("Cube", "Light"):
        bpy.data.objects.remove(bpy.data.objects[name])

    def draw(kind: str = 'DRAW_WIN_SWAP') -> None:
        with ui.override():
            bpy.ops.wm.redraw_timer(type=kind, iterations=1)

    def timed(action: Callable[[], object]) -> float:
        begin = time.process_time()
        action()
        draw('DRAW_SWAP')
        return time.process_time() - begin

    def show() -> None:
        levels.read_shapes(scene, bpy.context.evaluated_depsgraph_get())

    def still() -> float:
        return statistics.median(timed(lambda: None) for _ in range(5))

    _look(ui)
    yield 1.0
    draw()
    found["empty_draw_s"] = still()
    scene.frame_start, scene.frame_end, scene.render.fps = 1, LAST, 60
    found["empty_frame_s"] = yield from _a_frame(ui)
    _play(ui)
    field = _wood(PLANTS)
    yield 1.0
    draw()
    found["bare_draw_s"] = still()
    forget_peak()
    before = peak_mb()
    scene.tetflora.preview.plants = 'LIGHT'
    found["first_show_s"] = timed(show)  # species are compiled
    found["show_mb"] = peak_mb() - before
    found["show_s"] = statistics.median(timed(show) for _ in range(3))
    found["draw_s"] = still()
    found["shown"] = state.find(scene).shapes.plants
    yield from ui.picture("million")
    bpy.data.objects.remove(field)
    yield from _played(ui, found)
    session.stop()


def _played(ui: Any, found: dict[str, float]) -> Iterator[float | None]:
    """Play seasons and years of a wood."""
    import bpy

    from tetflora_addon.blender.viewport import levels, state

    scene = bpy.context.scene

    def resting() -> bool:
        return state.find(scene).shapes.plants == SCRUBBED

    _wood(SCRUBBED)
    year = scene.tetflora.year
    year.enabled = True
    for name, first, last in (("day", 60.0, 330.0), ("years", 1.0, 80.0)):
        for frame, value in ((1, first), (LAST, last)):
            setattr(year, name, value)
            year.keyframe_insert(name, frame=frame)
        for frame in range(LAST, 0, -1):  # species are compiled
            scene.frame_set(frame)
            levels.read_shapes(scene, bpy.context.evaluated_depsgraph_get())
        found[f"{name}_s"] = yield from _a_frame(ui)
        found[f"{name}_shown"] = state.find(scene).shapes.plants
        yield from ui.picture(name)
        _play(ui)
        yield from ui.until(resting, 60.0, "all plants after the timeline")
        yield from ui.picture(f"{name}_at_rest")
        scene.animation_data_clear()
        year.day = 200.0
    found["scrub_fps"] = 1.0 / max(max(found["day_s"], found["years_s"]) - found["empty_frame_s"], 1e-3)


def _play(ui: Any) -> None:
    """Play the timeline, or stop it."""
    import bpy

    with ui.override():
        bpy.ops.screen.animation_play()


def _a_frame(ui: Any) -> Iterator[float | None]:
    """Seconds of a frame of the timeline, which is left playing."""
    import bpy

    passed = [0]

    def count(*_: object) -> None:
        passed[0] += 1

    bpy.app.handlers.frame_change_post.append(count)
    _play(ui)
    yield from ui.until(lambda: passed[0] >= 4, 300.0, "first frames")
    first, begin = passed[0], time.process_time()
    yield from ui.until(lambda: passed[0] >= first + FRAMES, 300.0, "frames")
    seconds = (time.process_time() - begin) / (passed[0] - first)
    bpy.app.handlers.frame_change_post.remove(count)
    return seconds


def _look(ui: Any) -> None:
    """From the edge of the wood over it."""
    space = ui.area().spaces.active
    space.clip_end = 20_000.0
    space.region_3d.view_location = (400.0, 100.0, 0.0)
    space.region_3d.view_distance = 200.0


def _wood(plants: int) -> Any:
    """A field of plants of some species at random."""
    import bpy
    import numpy as np

    from tetflora_addon.blender.scene.fields import write_field

    rng, side = np.random.default_rng(1), (plants * ROOM) ** 0.5
    turn = rng.uniform(0.0, np.pi, plants)
    field = write_field(
        "Wood",
        np.column_stack([rng.uniform(0.0, side, (plants, 2)), np.zeros(plants)]),
        np.column_stack([np.cos(turn), np.zeros((plants, 2)), np.sin(turn)]),
        rng.uniform(0.7, 1.3, plants),
        rng.integers(0, len(SPECIES), plants).astype(np.int32),
        np.arange(plants, dtype=np.int32),
        SPECIES,
    )
    field.display_type = 'BOUNDS'  # as those of populations
    bpy.context.scene.collection.objects.link(field)
    return field
