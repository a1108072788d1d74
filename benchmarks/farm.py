# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A farm of one worker and of two: how much sooner two are done, and that they make the same images.

``farm/write_job.py`` writes the job, Open Job Description's own runner does the work. Each
worker is bound to one core and installs the extension first, as on a machine of its own; two workers take turns with
the frames. Needs Linux, two cores, and a full Blender in ``BLENDER``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from farm import write_job

from .report import Targets

FRAMES, QUICK_FRAMES = 16, 8
SIZE, SAMPLES = (320, 180), 16

TARGETS: Targets = {"time_ratio_2_to_1": {"max": 0.6}, "different_channels": {"max": 0}}
#: Fewer frames for the same installation.
QUICK_TARGETS: Targets = {"time_ratio_2_to_1": {"max": 0.7}, "different_channels": {"max": 0}}


def run(quick: bool) -> dict[str, float]:
    """Measure; see ``docs/results.md`` for what the figures mean.

    Raises
    ------
    RuntimeError
        There is no full Blender, there are not two cores, or a worker failed; with its output.
    """
    cores = sorted(os.sched_getaffinity(0))[:2]
    if not os.environ.get("BLENDER") or len(cores) < 2:
        raise RuntimeError("the farm needs BLENDER=/path/to/blender and two cores")
    frames = list(range(1, (QUICK_FRAMES if quick else FRAMES) + 1))
    with tempfile.TemporaryDirectory() as folder:
        bundle = _bundle(Path(folder), len(frames))
        parts = {"one": [frames], "two": [frames[0::2], frames[1::2]]}
        one, two = (_timed(bundle, Path(folder) / name, part, cores) for name, part in parts.items())
        names = [f"frame_{n:04d}.png" for n in frames]
        pairs = [[_pixels(Path(folder) / name / picture) for name in parts] for picture in names]
        different = sum(int((a != b).sum()) for a, b in pairs)
    return {
        "frames": len(frames),
        "one_worker_s": one[0],
        "two_workers_s": two[0],
        "time_ratio_2_to_1": two[0] / one[0],
        "one_worker_processor_s": one[1],
        "two_workers_processor_s": two[1],
        "processor_ratio_2_to_1": two[1] / one[1],
        "different_channels": different,
    }


def _bundle(folder: Path, frames: int) -> Path:
    """The job, written by an installed extension."""
    import bpy

    from devtools import build
    from examples import row80

    scene = bpy.context.scene
    row80.build(scene, count=12)
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.cycles.samples, scene.cycles.seed = SAMPLES, 3
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.frame_start, scene.frame_end = 1, frames
    camera = scene.camera
    for frame in (1, frames):
        camera.keyframe_insert("location", frame=frame)
        camera.location.x += 6.0
    scene.frame_set(1)
    scene.render.filepath = "//frame_####"
    blend = folder / "film.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    home = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "home")}
    blender = os.environ["BLENDER"]
    archive = build.build(folder)
    _call([blender, "-b", "--command", "extension", "install-file", "-r", "user_default", "-e", str(archive)], home)
    _call(
        [
            blender,
            str(blend),
            "-b",
            "--python-exit-code",
            "1",
            "--python",
            write_job.__file__,
            "--",
            str(folder / "job"),
            "--copy",
        ],
        home,
    )
    return folder / "job"


def _timed(bundle: Path, output: Path, parts: Sequence[Sequence[int]], cores: Sequence[int]) -> tuple[float, float]:
    """Seconds until as many workers as there are parts of the frames are done, each bound to a core.

    By the clock, and of the processor for the one that had most to do: on a machine that others use as well, only the
    latter is the job's own.
    """
    workers = []
    begun = time.perf_counter()
    for core, frames in zip(cores, parts, strict=False):
        tasks = json.dumps([{"Frame": str(n)} for n in frames])
        command = [sys.executable, "-m", "openjd", "run", str(bundle / "template.json"), "--step", "Render"]
        command += ["-p", f"Blender={os.environ['BLENDER']}", "-p", f"OutputDir={output}", "--tasks", tasks]
        log = output.with_name(f"{output.name}_{core}.log")
        with log.open("w") as lines:
            bound = ["taskset", "--cpu-list", str(core), *command]
            workers.append((subprocess.Popen(bound, stdin=subprocess.DEVNULL, stdout=lines, stderr=lines), log))
    processor = 0.0
    for worker, log in workers:
        _, status, used = os.wait4(worker.pid, 0)
        worker.returncode = os.waitstatus_to_exitcode(status)
        processor = max(processor, used.ru_utime + used.ru_stime)
        if worker.returncode:
            raise RuntimeError(f"a worker ended with code {worker.returncode}:\n{log.read_text()}")
    return time.perf_counter() - begun, processor


def _call(command: Sequence[str], environment: dict[str, str]) -> None:
    done = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")


def _pixels(path: Path) -> np.ndarray:
    """Channels of an image, 0 to 255."""
    import bpy

    image = bpy.data.images.load(str(path))
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return np.rint(values * 255.0).astype(np.uint8)
