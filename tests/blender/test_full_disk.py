# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk that is full while something is written: an error names the file, and nothing is lost or left behind."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import bpy
import pytest

from devtools import session
from devtools.formats import set_format
from farm import write_job
from tests.blender.scenes import add_camera, add_plant, datablocks, tiny_render
from tests.limits import full_disk
from tetflora_addon.blender import preferences
from tetflora_addon.blender.cli import command
from tetflora_addon.species import catalog

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def own_folder(tmp_path):
    own = preferences.preferences()
    own.species_folder = str(tmp_path / "species")
    yield tmp_path / "species"
    own.species_folder = ""


def _contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def _species_to(path: Path) -> None:
    bpy.context.scene.tetflora.species_editor.species = "bush"
    bpy.ops.tetflora.export_species(filepath=str(path))


def _own_species_to(path: Path) -> None:
    bpy.context.scene.tetflora.species_editor.species = "bush"
    bpy.ops.tetflora.save_species()


def _loaded_species_to(path: Path) -> None:
    shipped = catalog.list_species()["bush"].path
    bpy.ops.tetflora.load_species(filepath=str(shipped), replace=True)


def _assets_to(path: Path) -> None:
    bpy.ops.tetflora.create_asset_library(directory=str(path.parent))


@pytest.mark.parametrize(
    ("write", "name", "most"),
    [
        (_species_to, "bush.json", 1000),
        (_own_species_to, "bush.json", 1000),
        (_loaded_species_to, "bush.json", 1000),
        (_assets_to, "tetflora_plants.blend", 20_000),
    ],
    ids=["species", "own species", "loaded species", "asset library"],
)
def test_an_earlier_file_stays(own_folder, write, name, most):
    own_folder.mkdir()
    write(own_folder / name)
    if name.endswith(".json"):  # another sound file of that name
        path = own_folder / name
        path.write_text(path.read_text(encoding="utf-8").replace("\n", "\n\n"), encoding="utf-8")
    before, blocks = _contents(own_folder), datablocks()
    with full_disk(most), pytest.raises(RuntimeError, match=f"Cannot write .*{name}"):
        write(own_folder / name)
    assert _contents(own_folder) == before
    assert datablocks() == blocks
    write(own_folder / name)
    assert _contents(own_folder) != before or name.endswith(".blend")


def _refined(samples: int = 1):
    """A bush with its results."""
    scene = tiny_render(samples)
    add_camera(location=(0.0, -6.0, 1.5))
    add_plant()
    scene.world = bpy.data.worlds.new("sky")
    scene.render.resolution_x = scene.render.resolution_y = 128
    scene.render.image_settings.compression = 0
    scene.tetflora.output.save_results = True
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    return scene


@pytest.mark.parametrize("keep", [True, False], ids=["with results", "without"])
def test_saving_the_file(tmp_path, keep):
    """The earlier file is whole, the open one has what it had, and saving again where there is room works."""
    path = tmp_path / "forest.blend"
    scene = tiny_render()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    _refined()
    scene.tetflora.output.save_results = keep
    before, blocks, statistics = path.read_bytes(), datablocks(), scene.tetflora.statistics
    with full_disk(50_000), pytest.raises(RuntimeError):
        bpy.ops.wm.save_mainfile(compress=False)
    assert _contents(tmp_path) == {"forest.blend": before}
    assert (datablocks(), scene.tetflora.statistics) == (blocks, statistics)
    bpy.ops.wm.save_mainfile(compress=False)
    _assert_saved(path, keep)
    assert (tmp_path / "forest.blend1").read_bytes() == before


def test_a_compressed_file_that_blender_takes_for_saved(tmp_path, capfd):
    path = tmp_path / "forest.blend"
    tiny_render()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    _refined()
    before = path.read_bytes()
    # Blender overlooks what fails while the last block of a compressed file is written.
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "whole.blend"), compress=True, copy=True)
    size = (tmp_path / "whole.blend").stat().st_size
    assert "error" not in capfd.readouterr().err
    with full_disk(size - 5_000):
        assert bpy.ops.wm.save_mainfile(compress=True) == {'FINISHED'}
    said = capfd.readouterr().err
    assert f"TetFlora: error: {path} is incomplete" in said
    assert "forest.blend1" in said
    assert (tmp_path / "forest.blend1").read_bytes() == before
    bpy.ops.wm.save_mainfile(compress=True)
    assert "error" not in capfd.readouterr().err
    _assert_saved(path, True)


def _assert_saved(path: Path, results: bool) -> None:
    session.clean_file()  # Blender refuses to look into the file that it has open
    with bpy.data.libraries.load(str(path)) as (held, _):
        assert ("TetFlora" in held.collections) == results
        assert "plant" in held.objects


def _command(*arguments: object) -> int:
    return command.main([*map(str, arguments)])


def _error(capfd: pytest.CaptureFixture) -> str:
    (line,) = [line for line in capfd.readouterr().err.splitlines() if line.startswith("tetflora: error:")]
    return line


@pytest.mark.parametrize("compress", [False, True])
def test_command_refine_saves_nothing_or_all(tmp_path, capfd, compress):
    _refined()
    target = tmp_path / "refined.blend"
    target.write_bytes(b"mine")
    bpy.context.preferences.filepaths.use_file_compression = compress
    with full_disk(50_000):
        assert _command("refine", "--save", target) == 1
    assert str(target) in _error(capfd)
    assert _contents(tmp_path) == {"refined.blend": b"mine"}
    assert _command("refine", "--save", target) == 0
    _assert_saved(target, True)
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("form", ['PNG', 'OPEN_EXR', 'JPEG'])
def test_command_render_does_not_take_half_a_picture_for_one(tmp_path, capfd, form):
    scene = _refined(samples=4)
    set_format(scene.render.image_settings, form)
    scene.render.image_settings.quality = 100
    arguments = ("render", "--frames", "1-2", "--output", tmp_path / "frame_####")
    with full_disk(4_000):
        assert _command(*arguments) == 1
    assert str(tmp_path / "frame_0001") in _error(capfd)
    before = datablocks()
    assert _command(*arguments, "--overwrite") == 0
    assert len(list(tmp_path.iterdir())) == 2
    assert datablocks() == before


def test_a_job_for_a_farm_is_written_or_not_there(tmp_path, capfd):
    scene = _refined()
    scene.render.filepath = "//frame_####"
    (tmp_path / "project").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "project" / "shot.blend"), compress=False)
    before = _contents(tmp_path)
    with full_disk(50_000):
        assert write_job.main([str(tmp_path / "job")]) == 1
    assert str(tmp_path / "job") in _error(capfd)
    assert _contents(tmp_path) == before
    assert not (tmp_path / "job").exists()
    assert write_job.main([str(tmp_path / "job"), "--copy"]) == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="asks for the device that is always full")
@pytest.mark.parametrize("options", [("--json",), ()])
def test_figures_that_cannot_be_printed_are_an_error(monkeypatch, capfd, options):
    _refined()
    full = io.TextIOWrapper(io.FileIO("/dev/full", "w"), write_through=True)
    monkeypatch.setattr(sys, "stdout", full)
    assert _command("stats", *options) == 1
    monkeypatch.undo()
    full.close()
    assert "statistics" in _error(capfd)
