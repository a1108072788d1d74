# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --command tetflora``: figures, exit codes and errors."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import pytest

from tests.blender.scenes import add_camera, add_plant, datablocks, tiny_render
from tetflora_addon.blender.cli.command import main
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results.collection import has_results

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def forest():
    """Two bushes and a camera."""
    scene = tiny_render()
    add_camera(location=(0.0, -60.0, 2.0))
    for i in range(2):
        add_plant(f"p{i}", seed=i, location=(3.0 * i, 0.0, 0.0))
    return scene


def _run(*arguments) -> int:
    return main([str(a) for a in arguments])


def _figures(capfd) -> dict:
    return json.loads(capfd.readouterr().out.strip().splitlines()[-1])


def test_stats_changes_nothing(forest, capfd):
    before = datablocks()
    assert _run("stats", "--json") == 0
    figures = _figures(capfd)
    assert figures["plants"] == 2
    assert figures["polygons_full"] > 1000 and figures["instances"] == 0
    assert datablocks() == before
    assert _run("stats") == 0
    assert f"{figures['polygons_full']:,}" in capfd.readouterr().out


def test_refine_saves_a_copy_with_the_result(forest, tmp_path, capfd):
    path = tmp_path / "refined.blend"
    assert _run("refine", "--cutoff", 8, "--proxies", "shells", "--save", path, "--json") == 0
    figures = _figures(capfd)
    assert figures["plants"] == 2
    assert set(figures["seconds"]) >= {"read", "refine", "emit"}
    assert (forest.tetflora.cutoff, forest.tetflora.proxy_kind) == (8.0, 'SHELLS')
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert has_results(bpy.context.scene)
    assert refine.clear(bpy.context.scene) > 0


def test_two_slashes_lead_from_the_file(forest, tmp_path, capfd):
    (tmp_path / "shots").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shots" / "shot.blend"))
    assert _run("refine", "--save", "//../refined.blend") == 0
    assert (tmp_path / "refined.blend").is_file()
    assert _run("render", "--output", "//pictures/a", "--json") == 0
    assert Path(_figures(capfd)["files"][0]) == tmp_path / "shots" / "pictures" / "a.png"
    assert (tmp_path / "shots" / "pictures" / "a.png").is_file()


def test_light_is_baked_on_demand(forest, tmp_path, capfd):
    assert _run("refine", "--baked-light", "all", "--json") == 0
    assert "light" in _figures(capfd)["seconds"]
    assert forest.tetflora.baked_light == 'ALL'
    assert (
        _run("render", "--baked-light", "off", "--proxies", "shells", "--output", tmp_path / "lit.png", "--json") == 0
    )
    assert "light" not in _figures(capfd)["seconds"]
    assert (forest.tetflora.baked_light, forest.tetflora.proxy_kind) == ('OFF', 'SHELLS')


def test_render_writes_the_files_that_it_names(forest, tmp_path, capfd):
    before = datablocks()
    assert _run("render", "--frame", 7, "--output", tmp_path / "still_###", "--samples", 2, "--json") == 0
    figures = _figures(capfd)
    assert figures["files"] == [str(tmp_path / "still_007.png")]
    assert figures["plants"] == 2
    assert forest.cycles.samples == 2
    assert _run("render", "--frames", "2-3", "--output", tmp_path / "frame_", "--engine", "cycles", "--json") == 0
    figures = _figures(capfd)
    assert figures["files"] == [str(tmp_path / f"frame_000{n}.png") for n in (2, 3)]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["frame_0002.png", "frame_0003.png", "still_007.png"]
    assert datablocks() == before


def test_in_a_folder_pictures_are_named_by_their_frames(forest, tmp_path, capfd):
    for output, arguments in (
        (f"{tmp_path}/new/", ()),
        (tmp_path / "new", ("--frame", 12)),
        (tmp_path, ("--frames", 3)),
    ):
        assert _run("render", "--output", output, *arguments, "--json") == 0
        (name,) = _figures(capfd)["files"]
        assert name == f"{tmp_path}/{'' if output == tmp_path else 'new/'}{arguments[-1] if arguments else 1:04d}.png"
        assert Path(name).is_file()


def test_frames_below_zero_are_rendered_though_no_range_of_blender_has_them(forest, tmp_path, capfd):
    seen = []

    def rendered(scene, _depsgraph=None):
        seen.append(scene.frame_current)

    bpy.app.handlers.render_post.append(rendered)
    try:
        assert _run("render", "--frames=-3-2:2,-8", "--output", tmp_path / "f_##", "--json") == 0
    finally:
        bpy.app.handlers.render_post.remove(rendered)
    assert seen == [-3, -1, 1, -8]
    names = _figures(capfd)["files"]
    assert names == [str(tmp_path / f"f_{n}.png") for n in ("-03", "-01", "01", "-08")]
    assert all(Path(name).is_file() for name in names)


def test_a_file_that_blender_could_not_open_is_no_empty_scene(forest, monkeypatch, capfd):
    monkeypatch.setattr("sys.argv", ["blender", "-b", "misspelled.blend", "--command", "tetflora", "stats"])
    assert _run("stats") == 1
    assert "misspelled.blend cannot be opened" in capfd.readouterr().err
    monkeypatch.setattr("sys.argv", ["blender", "--command", "tetflora", "refine", "--save", "new.blend"])
    assert _run("stats") == 0


def test_a_render_without_its_plants_fails(forest, tmp_path, capfd):
    add_plant("Odd", "quercus")
    assert _run("render", "--output", tmp_path / "a.png") == 1
    lines = [line for line in capfd.readouterr().err.splitlines() if "error" in line]
    assert len(lines) == 1
    assert "quercus" in lines[0]


@pytest.mark.parametrize("command", ["refine", "stats", "render"])
def test_a_scene_that_cannot_be_used_is_one_line_and_exit_code_1(command, forest, capfd):
    if command == "stats":
        bpy.data.objects["p0"].tetflora.species = "quercus"
    else:
        forest.camera = None
    before = datablocks()
    assert _run(command) == 1
    lines = capfd.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("tetflora: error: ")
    assert datablocks() == before


def test_a_folder_that_does_not_exist_is_said_before_the_work(forest, tmp_path, capfd):
    before = datablocks()
    assert _run("refine", "--save", tmp_path / "missing" / "a.blend") == 1
    assert "does not exist" in capfd.readouterr().err
    assert _run("refine", "--save", tmp_path) == 1
    assert "is a folder" in capfd.readouterr().err
    assert datablocks() == before


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("grow",),
        ("refine", "--cutoff", "0"),
        ("refine", "--cutoff", "much"),
        ("refine", "--proxies", "cubes"),
        ("render", "--frames", "9-2"),
        ("render", "--frame", "1", "--frames", "1-2"),
        ("render", "--samples", "0"),
        ("render", "--samples", "99999999999"),
        ("render", "--frame", "2000000"),
        ("render", "--frames", "1-2000000"),
    ],
)
def test_wrong_arguments_are_one_line_and_exit_code_2(arguments, capfd):
    assert _run(*arguments) == 2
    lines = capfd.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "--help" in lines[0]


@pytest.mark.parametrize("arguments", [("--help",), ("refine", "--help"), ("render", "-h"), ("stats", "--help")])
def test_help_is_no_error(arguments, capfd):
    assert _run(*arguments) == 0
    assert "usage: blender FILE --command tetflora" in capfd.readouterr().out


def test_export_writes_a_forest_and_tells_its_levels(forest, tmp_path, capfd, coarsely_looked_at):
    assert _run("export", tmp_path / "f.obj", "--variants", 1, "--polygons", 1000, "--flat", "--json") == 0
    figures = _figures(capfd)
    assert (figures["plants"], figures["variants"], figures["path"]) == (2, 1, str(tmp_path / "f.obj"))
    written = [p for p in tmp_path.rglob("*") if p.is_file()]
    assert {p.suffix for p in written} == {".csv", ".mtl", ".obj", ".png"}
    assert figures["megabytes"] == pytest.approx(sum(p.stat().st_size for p in written) / 1e6)
    polygons = [level["polygons"] for level in figures["levels"]]
    assert polygons == sorted(polygons, reverse=True) and 0 < polygons[0] <= 1000
    assert _run("export", tmp_path / "f.xyz") == 1
    assert 'choose a name that ends in' in capfd.readouterr().err
    assert _run("export", tmp_path / "f.obj", "--levels", 9) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["f.csv", "f.mtl", "f.obj", "f_textures"]
