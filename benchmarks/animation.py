# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An animation at walking speed: what later frames cost, whether each is the frame alone, and whether it flickers.

Frames are prepared as a render prepares them, by the handler that Blender calls before each; what is measured is all of
it: reading the scene, refining, writing meshes, and what is kept.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from devtools import session
from examples import fly_through, landscape
from tetflora_addon.blender.job import contents, frame_cache, refine
from tetflora_addon.blender.job.render import on_render_end, on_render_pre
from tetflora_addon.blender.results.output import result_collections

from .pictures import flip_map, read_picture, render
from .report import Targets, apart, peak_mb

#: Frames that are timed: five seconds of animation, in which the camera goes some seven meters.
FRAMES = 120
#: Frames that are made alone, each in a process of its own, and compared with the animation's.
ALONE, QUICK_ALONE = 20, 3
#: Frames next to each other whose images are compared, around one at which the row is refined anew.
AROUND, QUICK_AROUND = 4, 1
SAMPLES, PERCENT = 16, 50
#: A flight over the landscape, at so many meters a second, so much higher than the landscape's own camera.
FLIGHT_SPEED, FLIGHT_HIGHER = 15.0, 32.0

TARGETS: Targets = {
    **{f"next_frame_ratio_{name}": {"max": 0.03} for name in fly_through.SCENES},
    "frames_differ": {"max": 0},
    "flicker": {"max": 0.01},
}


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/measurements.md`` for what the figures mean."""
    figures: dict[str, float] = {}
    for name in fly_through.SCENES:
        session.clean_file()
        figures |= {f"{key}_{name}": value for key, value in _timed(name).items()}
    session.clean_file()
    figures |= _flight()
    chosen = np.linspace(1, FRAMES, QUICK_ALONE if quick else ALONE).round().astype(int).tolist()
    session.clean_file()
    sequence, refined_at = _film(chosen)
    figures["frames_alone"] = len(chosen)
    figures["frames_differ"] = sum(apart(frame_alone, frame) != sequence[frame] for frame in chosen)
    session.clean_file()
    return figures | _flicker(refined_at, QUICK_AROUND if quick else AROUND)


def _timed(name: str) -> dict[str, float]:
    """Seconds of the first frame, and of later ones on average."""
    scene = bpy.context.scene
    fly_through.build(scene, FRAMES, name)
    seconds, cells = [], set()
    for frame in range(1, FRAMES + 1):
        scene.frame_set(frame)
        start = time.perf_counter()
        on_render_pre(scene)
        seconds.append(time.perf_counter() - start)
        cells.add(result_collections(scene, 'RENDER')[0].name)
    polygons = json.loads(scene.tetflora.statistics)["polygons_meshed"]
    on_render_end(scene)
    first, later = seconds[0], np.array(seconds[1:])
    return {
        "first_frame_s": first,
        "later_frame_s": float(later.mean()),
        "next_frame_ratio": float(later.mean() / first),
        "shared_frame_ratio": float(np.median(later) / first),
        "refinements": len(cells),
        "polygons_meshed": polygons,
        "peak_mb": peak_mb(),
    }


def _flight() -> dict[str, int]:
    """How often a flight is refined: in cells that are larger where plants are far, and in cells of the same size."""
    scene = bpy.context.scene
    landscape.build(scene)
    camera, layer = scene.camera, scene.view_layers[0]
    camera.location.z += FLIGHT_HIGHER
    for frame in (1, FRAMES):
        camera.location.y += FLIGHT_SPEED * (frame - 1) / fly_through.RATE
        camera.keyframe_insert("location", frame=frame)
    given = contents.read_scene(scene, layer.depsgraph)
    found = {}
    for name, near in (("flight_refinements", given), ("flight_refinements_small_cells", None)):
        eyes = []
        for frame in range(1, FRAMES + 1):
            scene.frame_set(frame)
            eyes.append(tuple(frame_cache.shared_camera(scene, layer.depsgraph, near).position))
        found[name] = len(set(eyes))
    return found


def fingerprint(scene: bpy.types.Scene) -> dict[str, list]:
    """Numbers of vertices and faces of all meshes of a frame, and hashes of where the vertices are."""
    found = {}
    for collection in result_collections(scene, 'RENDER'):
        for obj in collection.objects:
            if obj.type == 'MESH':
                places = np.empty(3 * len(obj.data.vertices), np.float32)
                obj.data.attributes["position"].data.foreach_get("vector", places)
                digest = hashlib.sha256(places.tobytes()).hexdigest()
                found[obj.name] = [len(obj.data.vertices), len(obj.data.polygons), digest]
    return found


def frame_alone(frame: int) -> dict[str, list]:
    """A frame of the row's animation, made in this process as its first."""
    scene = bpy.context.scene
    fly_through.build(scene, FRAMES, "row80")
    return _prepared(scene, frame)


def _prepared(scene: bpy.types.Scene, frame: int) -> dict[str, list]:
    scene.frame_set(frame)
    on_render_pre(scene)
    return fingerprint(scene)


def _film(chosen: list[int]) -> tuple[dict[int, dict[str, list]], int]:
    """Fingerprints of chosen frames in the course of the animation, and the second frame at which it was refined."""
    scene = bpy.context.scene
    fly_through.build(scene, FRAMES, "row80")
    found, names = {}, []
    for frame in range(1, FRAMES + 1):
        made = _prepared(scene, frame)
        names.append(min(made))
        if frame in chosen:
            found[frame] = made
    on_render_end(scene)
    changes = [n for n in range(1, FRAMES) if names[n] != names[n - 1]]
    return found, (changes[0] if changes else FRAMES // 2) + 1


def _flicker(changes_at: int, around: int) -> dict[str, float]:
    """FLIP between frames of the refined animation minus that of the expanded one; all samples have the same seed."""
    scene = bpy.context.scene
    fly_through.build(scene, FRAMES, "row80")
    scene.render.resolution_percentage = PERCENT
    frames = list(range(changes_at - around, changes_at + around))
    with tempfile.TemporaryDirectory() as folder:
        refined = _pictures(scene, frames, Path(folder))
        scene.tetflora.refine_at_render, scene.tetflora.expand_everything = False, True
        refine.refine(scene, bpy.context.evaluated_depsgraph_get())
        expanded = _pictures(scene, frames, Path(folder))
    steps = np.array([_steps(refined), _steps(expanded)])
    beyond = steps[0] - steps[1]
    return {
        "flip_steps_refined": float(steps[0].mean()),
        "flip_steps_expanded": float(steps[1].mean()),
        "flicker": float(beyond.mean()),
        "flicker_where_refined_anew": float(beyond[around - 1]),
        "flip": float(np.mean([flip_map(b, a).mean() for a, b in zip(refined, expanded, strict=True)])),
    }


def _pictures(scene: bpy.types.Scene, frames: list[int], folder: Path) -> list[np.ndarray]:
    found = []
    for frame in frames:
        scene.frame_set(frame)
        render(scene, folder / "frame.png", SAMPLES)
        found.append(read_picture(folder / "frame.png"))
    return found


def _steps(pictures: list[np.ndarray]) -> list[float]:
    return [float(flip_map(a, b).mean()) for a, b in itertools.pairwise(pictures)]
