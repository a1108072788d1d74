# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A file of seeds on a machine without a window: a full Blender renders what bpy renders, and keeps nothing of it.

The file is the demo's, with fewer plants, a smaller picture, and a camera that moves from frame 1 to frame 2.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

from benchmarks.pictures import difference
from devtools import session
from examples import row80
from tetflora_addon.blender.job import frame_cache, refine
from tetflora_addon.blender.job.contents import read_scene

Run = Callable[..., subprocess.CompletedProcess]

PLANTS = 5


@pytest.fixture(scope="module")
def seeds(blender: object, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file, saved by bpy before anything was refined."""

    session.clean_file()
    scene = bpy.context.scene
    row80.build(scene, count=PLANTS)
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = 240, 136
    scene.cycles.samples, scene.cycles.seed = 8, 3
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    camera = scene.camera
    camera.keyframe_insert("location", frame=1)
    camera.location.x += 6.0
    camera.keyframe_insert("location", frame=2)
    scene.frame_start, scene.frame_end = 1, 2
    scene.frame_set(1)
    path = tmp_path_factory.mktemp("seeds") / "row.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    return path


@pytest.fixture(scope="module")
def expected(seeds: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frame 1, refined for the camera of its cell and then rendered by bpy."""
    bpy.ops.wm.open_mainfile(filepath=str(seeds))
    scene = bpy.context.scene
    scene.tetflora.refine_at_render = False
    depsgraph = bpy.context.evaluated_depsgraph_get()
    given = read_scene(scene, depsgraph)
    camera = frame_cache.shared_camera(scene, depsgraph, given)
    refine.refine(scene, depsgraph, camera=camera)
    path = tmp_path_factory.mktemp("expected") / "expected.png"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return path


@pytest.fixture(scope="module")
def animation(run: Run, seeds: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Both frames by ``blender -b -a``; the file is saved again after the last."""
    folder = tmp_path_factory.mktemp("animation")
    save = f"import bpy; bpy.ops.wm.save_as_mainfile(filepath={str(folder / 'after.blend')!r})"
    done = run("-b", seeds, "-o", folder / "frame_####", "-a", "--python-exit-code", 1, "--python-expr", save)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "TetFlora: error" not in done.stderr
    return [folder / f"frame_000{n}.png" for n in (1, 2)]


def flip(reference: Path, test: Path) -> float:
    """Mean FLIP of two pictures."""
    return difference(reference, test).flip


def contents(path: Path) -> dict[str, list[str]]:
    """Names of what a file holds."""
    session.clean_file()  # Blender refuses to look into the file that it has open
    with bpy.data.libraries.load(str(path)) as (held, _):
        return {kind: sorted(getattr(held, kind)) for kind in ("objects", "meshes", "materials", "collections")}


def error_lines(done: subprocess.CompletedProcess) -> list[str]:
    # Sound drivers of a machine without sound also speak on stderr.
    return [line for line in done.stderr.splitlines() if "error" in line.lower() and "tetflora" in line.lower()]


def test_the_file_holds_seeds_only(seeds: Path) -> None:
    held = contents(seeds)
    assert seeds.stat().st_size < 300_000
    assert held["meshes"] == ["Ground"]
    assert len([name for name in held["objects"] if name.startswith("Tree")]) == PLANTS


def test_frame_1_is_what_bpy_renders_refined(expected: Path, animation: list[Path]) -> None:
    assert flip(expected, animation[0]) <= 0.02


def test_the_forest_is_in_the_picture(run: Run, seeds: Path, expected: Path, tmp_path: Path) -> None:
    bare = "import bpy; bpy.context.scene.tetflora.refine_at_render = False"
    done = run("-b", seeds, "--python-expr", bare, "-o", tmp_path / "bare_####", "-f", 1)
    assert done.returncode == 0, done.stdout + done.stderr
    assert flip(expected, tmp_path / "bare_0001.png") > 0.1


def test_a_frame_of_an_animation_is_the_frame_alone(
    run: Run, seeds: Path, animation: list[Path], tmp_path: Path
) -> None:
    done = run("-b", seeds, "-o", tmp_path / "alone_####", "-f", 2)
    assert done.returncode == 0, done.stdout + done.stderr
    assert flip(animation[1], tmp_path / "alone_0002.png") <= 1e-4
    assert flip(animation[0], animation[1]) > 0.05  # the camera did move


def test_nothing_that_was_made_is_saved(seeds: Path, animation: list[Path]) -> None:
    assert contents(animation[0].parent / "after.blend") == contents(seeds)


def test_command_stats(run: Run, seeds: Path) -> None:
    done = run(seeds, "--command", "tetflora", "stats", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    figures = json.loads(done.stdout.strip().splitlines()[-1])
    assert figures["plants"] == PLANTS
    assert figures["polygons_full"] / PLANTS == pytest.approx(3.79e6 / 80, rel=0.1)


def test_command_refine_saves_meshes(run: Run, seeds: Path, tmp_path: Path) -> None:
    saved = tmp_path / "refined.blend"
    before = seeds.read_bytes()
    done = run(seeds, "--command", "tetflora", "refine", "--cutoff", 4, "--json", "--save", saved)
    assert done.returncode == 0, done.stdout + done.stderr
    figures = json.loads(done.stdout.strip().splitlines()[-1])
    assert figures["polygons_meshed"] > 1_000
    held = contents(saved)
    assert "TetFlora" in held["collections"]
    assert len(held["meshes"]) > len(contents(seeds)["meshes"])
    assert seeds.read_bytes() == before


def test_command_export_writes_all_plants(run: Run, seeds: Path, tmp_path: Path) -> None:
    target = tmp_path / "Wald 7 ü.glb"
    done = run(
        seeds, "--command", "tetflora", "export", target, "--variants", 1, "--polygons", 20_000, "--flat", "--json"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout.strip().splitlines()[-1])["plants"] == PLANTS
    assert target.read_bytes().startswith(b"glTF")


def test_command_render_is_the_plain_render(run: Run, seeds: Path, animation: list[Path], tmp_path: Path) -> None:
    output = tmp_path / "still_##.png"
    done = run(seeds, "--command", "tetflora", "render", "--frame", 2, "--json", "--output", output)
    assert done.returncode == 0, done.stdout + done.stderr
    figures = json.loads(done.stdout.strip().splitlines()[-1])
    assert figures["files"] == [str(tmp_path / "still_02.png")]
    assert flip(animation[1], tmp_path / "still_02.png") <= 1e-4


@pytest.mark.parametrize(
    ("spoil", "arguments", "code", "says"),
    [
        ("bpy.context.scene.camera = None", ["refine"], 1, "no active camera"),
        ("pass", ["render", "--frames", "9-2"], 2, "9-2"),
    ],
    ids=["no camera", "wrong arguments"],
)
def test_command_errors(
    run: Run, seeds: Path, tmp_path: Path, spoil: str, arguments: list[str], code: int, says: str
) -> None:
    """Blender ends with the code of the command; tests/blender/cli tries the other errors."""
    bpy.ops.wm.open_mainfile(filepath=str(seeds))
    exec(spoil, {"bpy": bpy})
    bpy.context.scene.render.filepath = str(tmp_path / "never")
    path = tmp_path / "spoilt.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    done = run(path, "--command", "tetflora", *arguments)
    assert done.returncode == code, done.stdout + done.stderr
    lines = error_lines(done)
    assert len(lines) == 1
    assert says in lines[0]
    assert "Traceback" not in done.stdout + done.stderr
