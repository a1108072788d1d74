# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender that is killed while it refines, saves or renders leaves files that open as they were left, and refine.

Each is a process of its own that gets SIGKILL, as from a system that has run out of memory.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import bpy
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, tiny_render
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results.output import result_collections

Run = Callable[..., subprocess.CompletedProcess]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")

STEPS = Path(__file__).with_name("kill_steps.py")
BOUNCES = 8


@pytest.fixture(scope="module", params=[True, False], ids=["results in the file", "results not in the file"])
def forest(request: pytest.FixtureRequest, blender: object, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A refined scene of bushes and a mesh that takes part, and is hidden for its results."""
    session.clean_file()
    scene = tiny_render(size=96)
    for n in range(4):
        add_plant(f"bush {n}", "bush", seed=n, location=(n - 1.5, 0.0, 0.0))
    add_mesh("stone", size=0.5, z=0.2).tetflora.is_explicit = True
    add_camera(location=(0.0, -5.0, 1.0)).keyframe_insert("location", frame=1)
    scene.camera.location.x = 1.0
    scene.camera.keyframe_insert("location", frame=9)
    scene.frame_start, scene.frame_end = 1, 9
    scene.tetflora.proxy_kind = 'SHELLS'
    scene.tetflora.output.save_results = request.param
    scene.cycles.transparent_max_bounces = scene.cycles.min_transparent_bounces = BOUNCES
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    path = tmp_path_factory.mktemp("forest") / "forest.blend"
    scene.render.filepath = "//frame_####"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    return path


@pytest.fixture
def victim(run: Run, full_blender: str, forest: Path, tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """Kills a Blender some seconds after it has said NOW so often; returns its file."""
    home = run.keywords["home"]

    def killed(what: str, moment: str, times: int = 1, delay: float = 0.0) -> Path:
        path = Path(shutil.copy(forest, tmp_path / "forest.blend"))
        process = subprocess.Popen(
            [full_blender, "-b", str(path), "--python", str(STEPS), "--", what, moment, str(times)],
            env={**os.environ, "BLENDER_USER_RESOURCES": str(home)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        said = []
        try:
            for line in process.stdout:
                said.append(line)
                times -= line == "NOW\n"
                if times == 0:
                    break
            time.sleep(delay)
            assert process.poll() is None, "".join(said)
        finally:
            with suppress(ProcessLookupError):  # it has ended by itself, which the assertion tells
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        return path

    yield killed


def assert_sound(path: Path) -> None:
    """It opens in the state that the artist left, and refines."""
    session.clean_file()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    stone = bpy.data.objects["stone"]
    assert sum(obj.tetflora.is_plant for obj in scene.objects) == 4
    assert (scene.cycles.transparent_max_bounces, scene.cycles.min_transparent_bounces) == (BOUNCES, BOUNCES)
    assert scene.tetflora.refine_at_render
    assert result_collections(scene, 'RENDER') == []
    results = result_collections(scene, 'VIEW')
    assert len(results) == scene.tetflora.output.save_results
    assert not any(collection.hide_render for collection in results)
    assert stone.hide_render == stone.hide_viewport == bool(results)
    statistics = refine.refine(scene, depsgraph())
    assert statistics.plants == 4
    assert statistics.complete
    assert len(result_collections(scene, 'VIEW')) == 1
    assert stone.hide_render
    refine.clear(scene)
    assert not stone.hide_render
    assert not stone.hide_viewport


@pytest.mark.parametrize("moment", ["Compiling", "Refining", "Making polygons", "Keeping polygons", "Making proxies"])
def test_while_it_refines(victim: Callable[..., Path], moment: str) -> None:
    path = victim("refine", moment)
    assert_sound(path)
    assert_sound(path.with_name("forest.blend1"))


#: How often a file is saved, and seconds into the next save.
SAVES = ((1, 0.0), (1, 0.003), (2, 0.006), (2, 0.012), (3, 0.025), (3, 0.05))
#: Each of them of both forests, compressed of one and plain of the other; of each forest, half of them are.
CASES = [(kept, ("compressed", "plain")[(n + kept) % 2], *one) for kept in (True, False) for n, one in enumerate(SAVES)]


@pytest.mark.parametrize(("forest", "moment", "times", "delay"), CASES, indirect=["forest"])
def test_while_it_saves(victim: Callable[..., Path], moment: str, times: int, delay: float) -> None:
    path = victim("save", moment, times, delay)
    for file in (path, path.with_name("forest.blend1")):
        if file.exists():
            assert_sound(file)
    assert path.exists() or path.with_name("forest.blend1").exists()


@pytest.mark.parametrize(("moment", "delay"), [("render_pre", 0.05), ("render_pre", 0.3), ("render_post", 0.2)])
def test_while_it_renders(victim: Callable[..., Path], moment: str, delay: float) -> None:
    assert_sound(victim("render", moment, times=2, delay=delay))
