# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --command tetflora farm``: what is written, what is refused, and that the open file stays as it is."""

from __future__ import annotations

import json
import os
import time
import zipfile
from pathlib import Path

import bpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from farm import assets, bundle, template, write_job
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, tiny_render
from tetflora_addon import errors
from tetflora_addon.blender import compat
from tetflora_addon.blender.cli import command

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    """A saved file of one bush, frames 1, 3, 5, 7."""
    scene = tiny_render()
    add_camera(location=(0.0, -60.0, 2.0))
    add_plant()
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 8, 2
    scene.render.filepath = "//pictures/shot_###"
    path = tmp_path / "project" / "shots" / "shot.blend"
    path.parent.mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def _run(*arguments) -> int:
    return write_job.main([str(argument) for argument in arguments])


def _read(folder: Path, title: str) -> dict:
    return json.loads((folder / f"{title}.json").read_text(encoding="utf-8"))


def _parameters(folder: Path) -> dict[str, object]:
    return {p["name"]: p.get("default") for p in _read(folder, "template")["parameterDefinitions"]}


def _error(capfd) -> str:
    lines = [line for line in capfd.readouterr().err.splitlines() if line.startswith("tetflora: error:")]
    assert len(lines) == 1
    return lines[0]


def test_frames_and_chunks_are_those_of_the_scene(shot, tmp_path, capfd):
    job = tmp_path / "job"
    assert _run(job, "--chunk", 3, "--json") == 0
    figures = json.loads(capfd.readouterr().out.strip().splitlines()[-1])
    assert (figures["frames"], figures["tasks"], figures["plants"]) == (4, 2, 1)
    parameters = _parameters(job)
    assert (parameters["Frames"], parameters["ChunkSize"], parameters["OutputName"]) == ("1-7:2", 3, "shot_###")
    assert _read(job, "template")["extensions"] == ["TASK_CHUNKING"]
    assert _run(tmp_path / "single", "--frames=-2-1,9") == 0
    assert _parameters(tmp_path / "single")["Frames"] == "-2-1,9"
    assert "extensions" not in _read(tmp_path / "single", "template")  # any scheduler of the specification takes it


def test_every_parameter_of_a_command_is_defined(shot, tmp_path):
    assert _run(tmp_path / "job", "--copy") == 0
    template = _read(tmp_path / "job", "template")
    text = json.dumps([template["steps"], template["jobEnvironments"]])
    used = {piece.split("}}")[0].removeprefix("Param.") for piece in text.split("{{")[1:] if piece.startswith("Param.")}
    assert used <= set(_parameters(tmp_path / "job"))
    assert used >= {"Blender", "Frames", "SceneFile", "OutputDir", "OutputName", "TetFloraFiles"}


def test_nothing_of_the_artist_is_changed(shot, tmp_path):
    before, content = datablocks(), shot.read_bytes()
    scene = bpy.context.scene
    settings = (scene.frame_start, scene.frame_end, scene.frame_step, scene.frame_current, scene.render.filepath)
    assert _run(tmp_path / "job", "--copy", "--frames", "20-30") == 0
    assert datablocks() == before
    now = (scene.frame_start, scene.frame_end, scene.frame_step, scene.frame_current, scene.render.filepath)
    assert now == settings
    assert bpy.data.filepath == str(shot)
    assert [path.name for path in shot.parent.iterdir()] == ["shot.blend"]
    assert shot.read_bytes() == content


def test_the_zip_holds_the_extension_and_nothing_else(shot, tmp_path):
    assert _run(tmp_path / "job") == 0
    (path,) = (tmp_path / "job" / "tetflora").glob("tetflora-*.zip")
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    assert {"blender_manifest.toml", "__init__.py", "tetflora_addon/blender/cli/command.py"} <= set(names)
    assert [n for n in names if "__pycache__" in n or n.startswith(("tests/", ".", "benchmarks/", "farm/"))] == []
    assert [n for n in names if n.startswith("docs/") and not n.startswith("docs/manual")] == []
    bundle.write_zip(tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == path.read_bytes()


def _with_assets(shot: Path) -> dict[str, Path]:
    """Give the scene a picture, a sequence of pictures, and a library that uses a picture itself."""
    project = shot.parents[1]
    files = {"leaf": "textures/leaf.png", "1": "plates/p_01.png", "2": "plates/p_02.png", "bark": "props/bark.png"}
    paths = {key: project / name for key, name in files.items()}
    for path in paths.values():
        path.parent.mkdir(exist_ok=True)
        image = bpy.data.images.new("made", 1, 1)
        image.filepath_raw, image.file_format = str(path), 'PNG'
        image.save()
        bpy.data.images.remove(image)
    paths["library"] = project / "props" / "props.blend"
    prop = add_mesh("prop")
    material = bpy.data.materials.new("bark")
    node = compat.shader_tree(material).nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(str(paths["bark"]))
    node.image.filepath = f"//{os.path.relpath(paths['bark'], paths['library'].parent)}"
    prop.data.materials.append(material)
    bpy.data.libraries.write(str(paths["library"]), {prop}, path_remap='NONE')
    bpy.data.objects.remove(prop)
    bpy.data.batch_remove([material, *bpy.data.images])
    with bpy.data.libraries.load(str(paths["library"]), link=True, relative=True) as (_, wanted):
        wanted.objects = ["prop"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    leaf = bpy.data.images.load(str(paths["leaf"]))
    leaf.filepath, leaf.use_fake_user = "//../textures/leaf.png", True
    plate = bpy.data.images.load(str(paths["1"]))
    plate.source, plate.filepath, plate.use_fake_user = 'SEQUENCE', "//../plates/p_01.png", True
    bpy.ops.wm.save_as_mainfile(filepath=str(shot))
    return paths


def test_files_of_the_scene_are_named(shot, tmp_path):
    paths = _with_assets(shot)
    assert _run(tmp_path / "job", "--outside") == 0
    inputs = _read(tmp_path / "job", "asset_references")["assetReferences"]["inputs"]
    assert sorted(inputs["filenames"]) == sorted(map(str, (shot, *paths.values())))
    assert _read(tmp_path / "job", "parameter_values")["parameterValues"] == [{"name": "SceneFile", "value": str(shot)}]


def test_a_copied_scene_finds_its_files_elsewhere(shot, tmp_path):
    paths = _with_assets(shot)
    assert _run(tmp_path / "job", "--copy", "--outside") == 0
    bundle = (tmp_path / "job").rename(tmp_path / "moved")
    assert _read(bundle, "asset_references")["assetReferences"]["inputs"]["filenames"] == []
    copied = bundle / str(_parameters(bundle)["SceneFile"])
    assert copied.read_bytes() == shot.read_bytes()
    bpy.ops.wm.open_mainfile(filepath=str(copied))
    found = {os.path.normpath(p) for p in bpy.utils.blend_paths(absolute=True)}
    assert found
    assert all(path.startswith(str(bundle)) and Path(path).is_file() for path in found)
    names = {path.name for path in (bundle / "scene").rglob("*") if path.is_file()}
    assert names == {"shot.blend", *(path.name for path in paths.values())}


def test_files_that_are_not_there_and_absolute_paths_are_told(shot, tmp_path, capfd):
    paths = _with_assets(shot)
    paths["leaf"].unlink()
    bpy.data.images["p_01.png"].filepath = str(paths["1"])
    assert _run(tmp_path / "job", "--json", "--outside") == 0
    said = capfd.readouterr()
    figures = json.loads(said.out.strip().splitlines()[-1])
    assert figures["missing"] == [str(paths["leaf"])]
    assert figures["absolute_paths"] == [str(paths["1"])]
    assert said.err.count("tetflora: warning:") == 2


def _image(path: str, source: str = 'FILE') -> None:
    """An image datablock that names a file."""
    image = bpy.data.images.new("named", 1, 1)
    image.source, image.filepath_raw, image.use_fake_user = source, path, True


def _files(folder: Path, *names: str, size: int = 3) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"x" * size)


def _traveling(job: Path, shot: Path) -> set[str]:
    """Names, within the folder of the .blend, of the files that a job names beside it."""
    inputs = _read(job, "asset_references")["assetReferences"]["inputs"]
    assert inputs["directories"] == []
    return {os.path.relpath(name, shot.parent) for name in inputs["filenames"]} - {shot.name}


def test_tiles_and_sequences_are_those_that_blender_reads(shot, tmp_path):
    """Four digits, and brackets as they are: what else begins alike stays where it is."""
    tiles = "t/a[1].1001.png", "t/a[1].1002.png"
    _files(shot.parent, *tiles, "t/a[1].secret.png", "t/a[1].10010.png", "t/a1.1001.png")
    parts = "t/b.u1_v1.exr", "t/b.u2_v1.exr"
    _files(shot.parent, *parts, "t/b.exr", "t/b.u1_v1_.exr")
    frames = "t/p_09.jp2", "t/p_10.jp2", "t/p_100.jp2"
    _files(shot.parent, *frames, "t/p_9.jp2", "t/p_010.jp2", "t/p_09.jp3", "t/q_09.jp2")
    for name in ("//t/a[1].<UDIM>.png", "//t/b.<UVTILE>.exr"):
        _image(name, 'TILED')
    _image("//t/p_09.jp2", 'SEQUENCE')
    assert _run(tmp_path / "job") == 0
    assert _traveling(tmp_path / "job", shot) == {*tiles, *parts, *frames}


def test_only_files_that_blender_reads_travel(shot, tmp_path, capfd):
    """A file from a stranger may name anything: keys, a whole home folder, a pipe that never ends."""
    _files(shot.parent, "leaf.png", "id_rsa", "home.png/notes.txt", "private/a.vdb", "odd\nname.png")
    os.mkfifo(shot.parent / "pipe.png")
    others = "id_rsa", "home.png", "private", "pipe.png"
    for name in ("leaf.png", *others):
        _image(f"//{name}")
    text = bpy.data.texts.new("diary")
    text.filepath = "//leaf.txt"
    _files(shot.parent, "leaf.txt")
    assert _run(tmp_path / "job", "--copy", "--json") == 0
    said = capfd.readouterr()
    assert {p.name for p in (tmp_path / "job" / "scene").rglob("*")} == {"shot.blend", "leaf.png"}
    figures = json.loads(said.out.strip().splitlines()[-1])
    assert figures["skipped"] == sorted(str(shot.parent / name) for name in others)
    assert said.err.count("not a file that Blender reads") == len(others)


def test_caches_of_simulations_travel_without_what_else_lies_there(shot, tmp_path):
    domain = add_mesh("domain").modifiers.new("Fluid", 'FLUID')
    domain.fluid_type = 'DOMAIN'
    domain.domain_settings.cache_directory = "//smoke"
    kept = {"smoke/data/fluid_0001.vdb", "blendcache_shot/0_000001_00.bphys"}
    _files(shot.parent, *kept, "smoke/diary.txt", "blendcache_shot/.netrc")
    assert _run(tmp_path / "job") == 0
    assert _traveling(tmp_path / "job", shot) == kept


def test_what_lies_outside_is_asked_for(shot, tmp_path, capfd):
    """Links count by what they lead to."""
    _files(tmp_path, "elsewhere/secret.png")
    (shot.parent / "leaf.png").symlink_to(tmp_path / "elsewhere" / "secret.png")
    _image("//leaf.png")
    for options in ((), ("--copy",)):
        assert _run(tmp_path / "job", *options) == 1
        assert "1 of the files lie outside the folder of shot.blend" in _error(capfd)
        assert not (tmp_path / "job").exists()
    assert _run(tmp_path / "job", "--copy", "--outside") == 0
    assert not (tmp_path / "job" / "scene" / "leaf.png").is_symlink()


def test_the_list_is_shown_with_sizes_before_anything_is_copied(shot, tmp_path, capfd, monkeypatch):
    _files(shot.parent, "large.exr", size=30_000_000)
    _image("//large.exr")
    assert _run(tmp_path / "job", "--copy", "--max-size", 0.02) == 1
    said = capfd.readouterr()
    assert "large.exr" in said.err
    assert "--max-size" in said.err
    assert not (tmp_path / "job").exists()
    listed = next(line for line in said.out.splitlines() if line.endswith("large.exr"))
    assert listed.split()[:2] == ["30.000", "MB"]
    assert _run(tmp_path / "job", "--copy") == 0
    lines = capfd.readouterr().out.splitlines()
    copied = [n for n, line in enumerate(lines) if line.startswith("copied ")]
    assert 5 <= len(copied) <= 10
    assert copied[0] > lines.index(listed)


def test_a_file_that_grows_while_it_is_copied_is_no_endless_job(shot, tmp_path, capfd, monkeypatch):
    _files(shot.parent, "leaf.png")
    _image("//leaf.png")
    monkeypatch.setattr(bundle, "approve", lambda *_: _files(shot.parent, "leaf.png", size=4))
    assert _run(tmp_path / "job", "--copy") == 1
    assert "leaf.png has grown" in _error(capfd)
    assert not (tmp_path / "job").exists()


def test_very_many_files_are_refused(shot, monkeypatch):
    _files(shot.parent, *(f"p_{n:02}.png" for n in range(10)))
    _image("//p_01.png", 'SEQUENCE')
    monkeypatch.setattr(assets, "MOST_FILES", 9)
    with pytest.raises(errors.SceneError, match="more than 9 files"):
        assets.used_files(shot)


@pytest.mark.parametrize("name", ["a" * 300, "\udc80.png", "new\nline.png", "\x1b[31m.png", "{{Param.X}}.png"])
def test_odd_names(shot, tmp_path, capfd, name):
    """They are told in one line that a terminal does not take for something else."""
    _image(f"//{name}")
    assert _run(tmp_path / "job", "--copy", "--json") == 0
    said = capfd.readouterr().err
    assert said.count("\n") == said.count("tetflora: warning: missing file") == 1
    assert "\x1b" not in said


def test_a_file_that_was_never_saved(tmp_path, capfd):
    tiny_render()
    add_camera()
    assert _run(tmp_path / "job") == 1
    assert "has not been saved" in _error(capfd)
    assert not (tmp_path / "job").exists()


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda scene: setattr(scene, "camera", None), "no active camera"),
        (lambda scene: setattr(scene.objects["plant"].tetflora, "species", "quercus"), "quercus"),
    ],
    ids=["no camera", "unknown species"],
)
def test_what_no_worker_could_render(shot, tmp_path, capfd, spoil, says):
    spoil(bpy.context.scene)
    assert _run(tmp_path / "job") == 1
    assert says in _error(capfd)
    assert not (tmp_path / "job").exists()


def test_no_frames_and_frames_named_twice(shot, tmp_path, capfd):
    with pytest.raises(errors.SceneError, match="No frames"):
        template.frame_expression([(5, 4, 1)])
    assert _run(tmp_path / "job", "--frames", "1-4,3") == 1
    assert "Frame 3 occurs twice" in _error(capfd)
    assert _run(tmp_path / "job", "--frames", "9-2") == 2
    assert "9-2" in _error(capfd)
    assert _run(tmp_path / "job", "--chunk", "0") == 2


def test_lists_of_very_many_frames():
    """A frame that occurs twice is found at once, and none are counted that Blender does not have."""
    begun = time.process_time()
    with pytest.raises(errors.SceneError, match="Frame 300000 occurs twice"):
        template.frame_expression([(1, 300_000, 1), (300_000, 300_000, 1)])
    with pytest.raises(ValueError, match="again and again"):
        command.frame_runs(",".join(["0-1048574"] * 10_000))
    with pytest.raises(ValueError, match=r"^9{57}\.\.\. is not a range"):
        command.frame_runs("9" * 100_000)
    assert time.process_time() - begun < 5


def test_folders_that_cannot_be_used(shot, tmp_path, capfd):
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine.txt").write_text("keep")
    assert _run(full) == 1
    assert f"{full} is not empty" in _error(capfd)
    assert (full / "mine.txt").read_text() == "keep"
    assert _run(full / "mine.txt") == 1
    assert "is a file" in _error(capfd)
    assert _run(full / "mine.txt" / "job") == 1
    assert "Cannot write to" in _error(capfd)


def test_a_failure_leaves_nothing_behind(shot, tmp_path, capfd, monkeypatch):
    def no_space(*_):
        raise OSError(28, "No space left on device", "x.zip")

    monkeypatch.setattr(bundle, "write_zip", no_space)
    assert _run(tmp_path / "job") == 1
    assert "No space left" in _error(capfd)
    assert not (tmp_path / "job").exists()
    (tmp_path / "job").mkdir()
    assert _run(tmp_path / "job") == 1
    assert list((tmp_path / "job").iterdir()) == []


RUNS = st.lists(
    st.tuples(st.integers(-99, 999), st.integers(0, 50), st.integers(1, 9)).map(lambda r: (r[0], r[0] + r[1], r[2])),
    min_size=1,
    max_size=4,
)


@given(RUNS)
def test_an_expression_names_the_frames_that_it_was_made_of(runs):
    numbers = command.frame_numbers(runs)
    if len(set(numbers)) < len(numbers):
        return
    assert command.frame_numbers(command.frame_runs(template.frame_expression(runs))) == numbers


@pytest.mark.parametrize("text", ["", "a", "1-", "3-1", "1-9:0", "1..4", "1-9:-1", "1,,2"])
def test_other_expressions_are_refused(text):
    with pytest.raises(ValueError, match="not a range of frames"):
        command.frame_runs(text)


def test_a_name_is_no_variable():
    assert template.job_name("a{{Param.X}}\n") == "a Param.X (TetFlora)"
    assert len(template.job_name("x" * 500)) == 128
