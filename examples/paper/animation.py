# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The animation (section 8.2): a walk past the row of eighty, and the cost of a frame after the first.

Every fourth frame of a walk of four seconds is rendered, and shown twice as fast. As in any animation, plants are
refined before a frame if the results of the frames before it do not serve it as well (*Share Between Frames*). How many
tetrahedra a frame divides that the frame before did not is counted from each frame of the walk to the next, with space
divided alike in all of them (*Anchored*).
"""

from __future__ import annotations

import time
from pathlib import Path

import bpy
import numpy as np

from devtools import session
from devtools.formats import set_format
from devtools.partition import partition
from tetflora_addon.blender.results.output import result_collections

from .. import fly_through
from .pictures import save_sheet
from .scenes import choose_cycles

FRAMES, EVERY, SMALL_FRAMES = 96, 4, 5
RATE = 12  # of the animation
SIZE, SMALL_SIZE = (480, 270), (32, 18)
#: Frames between which divisions are counted.
COUNTED, SMALL_COUNTED = 9, 2
#: Images of the contact sheet.
SHOWN = 8


def make(out: Path, images: Path, small: bool) -> dict[str, float]:
    """Make ``paper-animation.mp4`` and its contact sheet, ``.jpg``; returns seconds of frames and divisions."""
    scene = _walk(SMALL_FRAMES if small else FRAMES, small)
    scene.tetflora.refine_at_render = True
    scene.frame_step = EVERY
    scene.render.use_persistent_data = True  # what frames share is not read again
    choose_cycles(scene, 1 if small else 8)
    folder = out / "film"
    scene.render.filepath = f"{folder}/"
    with _Frames() as frames:
        bpy.ops.render.render(animation=True)
    pictures = [folder / f"{frame:04d}.png" for frame in range(1, scene.frame_end + 1, EVERY)]
    refine_s, render_s = np.subtract(frames.ready, frames.begun), np.subtract(frames.written, frames.ready)
    anew, divided = divided_anew(small)
    save_film(pictures, RATE, images / "paper-film.mp4")
    shown = np.linspace(0, len(pictures) - 1, min(SHOWN, len(pictures))).round().astype(int)
    times = [(EVERY * i / fly_through.RATE, pictures[i]) for i in shown.tolist()]
    save_sheet([(path, f"{time:.1f} s") for time, path in times], 4, images / "paper-film.jpg", width=320)
    return {
        "frames": len(pictures),
        "refined": len(set(frames.results)),
        "first_refine_s": float(refine_s[0]),
        "first_render_s": float(render_s[0]),
        "later_refine_s": float(refine_s[1:].mean()),
        "later_render_s": float(render_s[1:].mean()),
        "divided": divided,
        "divided_anew_min": min(anew),
        "divided_anew_max": max(anew),
        "divided_anew_mean": float(np.mean(anew)),
    }


class _Frames:
    """When each frame of a render began, had its plants, and was written, by the clock; and whose plants it had.

    Attributes
    ----------
    begun, ready, written : list of float
        Seconds, one for each frame.
    results : list of str
        Names of the collections that the plants of the frames are in.
    """

    def __init__(self) -> None:
        self.begun, self.ready, self.written, self.results = [], [], [], []

    def __enter__(self) -> _Frames:
        handlers = bpy.app.handlers
        handlers.render_pre.insert(0, self._begin)
        handlers.render_pre.append(self._has_plants)
        handlers.render_write.append(self._write)
        return self

    def __exit__(self, *_: object) -> None:
        handlers = bpy.app.handlers
        handlers.render_pre.remove(self._begin)
        handlers.render_pre.remove(self._has_plants)
        handlers.render_write.remove(self._write)

    def _begin(self, *_: object) -> None:
        self.begun.append(time.perf_counter())

    def _has_plants(self, scene: bpy.types.Scene, *_: object) -> None:
        self.ready.append(time.perf_counter())
        found = result_collections(scene, 'RENDER')
        self.results += [collection.name for collection in found[:1]]

    def _write(self, *_: object) -> None:
        self.written.append(time.perf_counter())


def divided_anew(small: bool) -> tuple[list[int], int]:
    """Tetrahedra that each frame of a walk divides and the one before did not, and all that the first divides."""
    scene = _walk(SMALL_COUNTED if small else COUNTED, small)
    scene.tetflora.anchored = True
    before, anew = None, []
    for frame in range(1, scene.frame_end + 1):
        scene.frame_set(frame)
        now = _divided(scene)
        if before is None:
            first = len(now)
        else:
            anew.append(len(now - before))
        before = now
    return anew, first


def _divided(scene: bpy.types.Scene) -> set[tuple[int, ...]]:
    """Tetrahedra that a frame divides, by center (tenths of a millimeter) and level."""
    tree = partition(scene, bpy.context.evaluated_depsgraph_get())[1].tree
    nodes = np.flatnonzero(tree.children[:, 0] >= 0)
    centers = tree.vertices(nodes).mean(axis=1)
    whole = np.isfinite(centers).all(axis=1)
    keys = np.column_stack([np.round(centers[whole] * 1e4).astype(np.int64), tree.level[nodes[whole]]])
    return set(map(tuple, keys.tolist()))


def _walk(frames: int, small: bool) -> bpy.types.Scene:
    """A walk past the row in an empty file, at the size of the animation."""
    session.clean_file()
    scene = bpy.context.scene
    fly_through.build(scene, frames=frames)
    scene.tetflora.refine_at_render = False
    scene.render.resolution_x, scene.render.resolution_y = SMALL_SIZE if small else SIZE
    return scene


def save_film(pictures: list[Path], rate: int, path: Path) -> None:
    """Store images of one size as an MP4 (H.264), by Blender's sequencer."""
    scene = bpy.data.scenes.new("Film")
    first = bpy.data.images.load(str(pictures[0]))
    render = scene.render
    render.resolution_x, render.resolution_y = first.size
    bpy.data.images.remove(first)
    strip = scene.sequence_editor_create().strips.new_image(
        name="Film", filepath=str(pictures[0]), channel=1, frame_start=1
    )
    for picture in pictures[1:]:
        strip.elements.append(picture.name)
    scene.frame_start, scene.frame_end = 1, len(pictures)
    scene.view_settings.view_transform = 'Standard'  # images are what they should look like
    render.fps, render.filepath, render.use_file_extension = rate, str(path), False
    set_format(render.image_settings, 'FFMPEG')
    render.ffmpeg.format, render.ffmpeg.codec = 'MPEG4', 'H264'
    render.ffmpeg.constant_rate_factor = 'MEDIUM'
    bpy.ops.render.render(animation=True, scene=scene.name)
    bpy.data.scenes.remove(scene)
