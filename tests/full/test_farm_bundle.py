# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A job that ``farm/write_job.py`` wrote, run by Open Job Description's own runner: pictures are those of one machine.

The workers start a Blender that knows nothing of TetFlora; the job brings it along.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

from devtools import session
from farm import write_job
from tests.blender.scenes import add_camera, add_plant, tiny_render
from tests.full.test_animation import pixels

Run = Callable[..., subprocess.CompletedProcess]

OPENJD = (sys.executable, "-m", "openjd")
FRAMES = (1, 2)
TOOL = Path(write_job.__file__).parent


@pytest.fixture(scope="module")
def scene_file(blender: object, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bush and a camera that moves; pictures that are there already are to be left alone."""
    session.clean_file()
    scene = tiny_render(samples=2, size=48)
    scene.cycles.seed = 7
    add_plant("bush", "bush", seed=3)
    camera = add_camera(location=(0.0, -6.0, 1.5))
    camera.keyframe_insert("location", frame=FRAMES[0])
    camera.location.x = 1.0
    camera.keyframe_insert("location", frame=FRAMES[-1])
    scene.world = bpy.data.worlds.new("sky")
    scene.frame_start, scene.frame_end = FRAMES
    scene.render.use_overwrite = False
    scene.render.filepath = "//somewhere/frame_####"
    path = tmp_path_factory.mktemp("artist") / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture(scope="module")
def expected(run: Run, scene_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the pictures that one machine makes."""
    folder = tmp_path_factory.mktemp("expected")
    done = run(scene_file, "--command", "tetflora", "render", "--frames", "1-2", "--output", folder / "frame_####")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (pixels(folder, 1) != pixels(folder, 2)).any()
    return folder


def written(run: Run, scene_file: Path, folder: Path, *options: str | int) -> Path:
    """The job; checked by the runner, and nothing of the artist's is touched."""
    tool = shutil.copytree(TOOL, folder.with_name("copied") / "farm", dirs_exist_ok=True)  # as artists use it
    before = {path: path.read_bytes() for path in scene_file.parent.rglob("*") if path.is_file()}
    done = run(
        "-b", scene_file, "--python-exit-code", "1", "--python", tool / "write_job.py", "--", folder, "--json", *options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    figures = next(line for line in done.stdout.splitlines() if line.startswith("{"))
    assert json.loads(figures)["frames"] == len(FRAMES)
    assert {path: path.read_bytes() for path in scene_file.parent.rglob("*") if path.is_file()} == before
    checked = subprocess.run([*OPENJD, "check", folder / "template.json"], capture_output=True, text=True, timeout=60)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    return folder


def worker(bundle: Path, full_blender: str, *arguments: str) -> subprocess.Popen:
    """One machine of the farm."""
    command = [*OPENJD, "run", bundle / "template.json", "--step", "Render", "-p", f"Blender={full_blender}"]
    return subprocess.Popen(
        [*map(str, command), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def assert_same_pictures(folder: Path, expected: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == [f"frame_{n:04d}.png" for n in FRAMES]
    for frame in FRAMES:
        assert (pixels(folder, frame) == pixels(expected, frame)).all(), frame


def test_the_zip_of_the_job_is_that_of_the_build(
    run: Run, scene_file: Path, extension_zip: Path, tmp_path: Path
) -> None:
    bundle = written(run, scene_file, tmp_path / "job")
    (traveling,) = (bundle / "tetflora").glob("*.zip")
    assert traveling.name == extension_zip.name
    with zipfile.ZipFile(traveling) as ours, zipfile.ZipFile(extension_zip) as built:
        contents = [{name: z.read(name) for name in z.namelist() if not name.endswith("/")} for z in (ours, built)]
    assert contents[0] == contents[1]


def test_one_worker_renders_the_job_in_one_chunk(
    run: Run, scene_file: Path, expected: Path, full_blender: str, tmp_path: Path
) -> None:
    bundle = written(run, scene_file, tmp_path / "job", "--chunk", 8)
    one = worker(bundle, full_blender, "-p", f"SceneFile={scene_file}")
    said, _ = one.communicate(timeout=180)
    assert one.returncode == 0, said
    assert re.search(r"Chunks run: 1\b", said), said
    assert_same_pictures(bundle / "output", expected)


def test_two_workers_and_one_that_is_killed(
    run: Run, scene_file: Path, expected: Path, full_blender: str, tmp_path: Path
) -> None:
    """The copy of the scene travels with the job: the bundle is moved before it runs."""
    bundle = written(run, scene_file, tmp_path / "job", "--copy").rename(tmp_path / "elsewhere")
    first, second = (worker(bundle, full_blender, "--task-param", f"Frame={n}") for n in FRAMES)
    # The second dies as soon as its task has begun.
    rendering = False
    for line in second.stdout:
        rendering = rendering or "Running Task" in line
        started = re.search(r"Command started as pid: (\d+)", line)
        if rendering and started:
            os.killpg(int(started[1]), signal.SIGKILL)
            break
    second.communicate(timeout=60)
    assert second.returncode != 0
    said, _ = first.communicate(timeout=180)
    assert first.returncode == 0, said
    assert [path.name for path in (bundle / "output").iterdir()] == ["frame_0001.png"]
    # As if it had died in the middle of writing.
    (bundle / "output" / "frame_0002.png").write_bytes((expected / "frame_0002.png").read_bytes()[:200])
    again = worker(bundle, full_blender, "--task-param", "Frame=2")
    said, _ = again.communicate(timeout=180)
    assert again.returncode == 0, said
    assert_same_pictures(bundle / "output", expected)


def test_a_worker_that_cannot_make_the_plants_fails(
    run: Run, scene_file: Path, full_blender: str, tmp_path: Path
) -> None:
    """The job was sound when it was written; then the file changed behind its back."""
    bundle = written(run, scene_file, tmp_path / "job")
    bpy.ops.wm.open_mainfile(filepath=str(scene_file))
    bpy.data.objects["bush"].tetflora.species = "quercus"
    broken = tmp_path / "broken.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(broken), copy=True)
    one = worker(bundle, full_blender, "-p", f"SceneFile={broken}", "--task-param", "Frame=1")
    said, _ = one.communicate(timeout=180)
    assert one.returncode != 0
    assert "quercus" in said
