# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender -b file -a`` over six frames of a moving camera: each frame is the frame rendered alone.

Frames are rendered alone, each by a Blender of its own: one in between and the last, as the first has nothing before
it. Their pixels are those of the animation, to the last bit of the file; with persistent data, of which the last frame
has most behind it, as without, and with motion blur, for which a frame needs one on each side.
"""

from __future__ import annotations

import itertools
import subprocess
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from devtools import session
from devtools.formats import set_format
from tests.blender.scenes import add_camera, add_plant

Run = Callable[..., subprocess.CompletedProcess]

FRAMES = 6
#: Largest difference of a channel, of 255: pictures of the same samples are the same.
MOST_DIFFERENCE = 0


def animation(path: Path, persistent: bool = False, blur: bool = False) -> Path:
    """Save a scene of three plants and a camera that passes them."""
    session.clean_file()
    scene = bpy.context.scene
    for n, species in enumerate(("bush", "conifer", "bush")):
        add_plant(f"plant {n}", species, seed=n, location=(3.0 * n - 3.0, 4.0 * n, 0.0))
    camera = add_camera(location=(-4.0, -12.0, 2.0), rotation=(1.45, 0.0, 0.0))
    camera.keyframe_insert("location", frame=1)
    camera.location = (4.0, -9.0, 2.5)
    camera.keyframe_insert("location", frame=FRAMES)
    scene.world = bpy.data.worlds.new("sky")
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", 'SUN'))
    sun.rotation_euler, sun.data.energy = (0.7, 0.2, 0.0), 3.0
    scene.collection.objects.link(sun)
    render = scene.render
    render.engine, render.use_persistent_data, render.use_motion_blur = 'CYCLES', persistent, blur
    render.resolution_x, render.resolution_y = 96, 54
    scene.cycles.samples, scene.cycles.seed = 4, 7
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    set_format(render.image_settings, "PNG")
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def rendered(run: Run, path: Path, output: Path, *arguments: str | int) -> None:
    done = run("-b", path, "-o", output / "frame_####", "--python-exit-code", 1, *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "TetFlora: error" not in done.stderr


def pixels(folder: Path, frame: int) -> np.ndarray:
    """Channels of a rendered frame, 0 to 255."""
    image = bpy.data.images.load(str(folder / f"frame_{frame:04d}.png"))
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return np.rint(values * 255.0).astype(int)


@pytest.mark.parametrize(
    ("persistent", "blur", "alone"),
    [(False, False, (3, 6)), (True, False, (6,)), (False, True, (3,))],
    ids=["plain", "persistent data", "blur"],
)
def test_each_frame_of_a_animation_is_the_frame_alone(
    blender: object, run: Run, tmp_path: Path, persistent: bool, blur: bool, alone: tuple[int, ...]
) -> None:
    path = animation(tmp_path / "animation.blend", persistent, blur)
    rendered(run, path, tmp_path / "animation", "-a")
    whole = [pixels(tmp_path / "animation", n) for n in range(1, FRAMES + 1)]
    for n in alone:
        rendered(run, path, tmp_path / "alone", "-f", n)
    differences = {n: int(np.abs(pixels(tmp_path / "alone", n) - whole[n - 1]).max()) for n in alone}
    steps = [float(np.abs(a - b).mean()) for a, b in itertools.pairwise(whole)]
    print(f"largest differences: {differences}; mean from frame to frame: {min(steps):.2f} to {max(steps):.2f}")
    assert max(differences.values()) <= MOST_DIFFERENCE
    assert min(steps) > 0.5  # no frame stands still
