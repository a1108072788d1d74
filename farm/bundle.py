# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The open file as a job bundle for schedulers of Open Job Description.

A bundle is a folder with the three files of `template`, a folder with the extension's zip, its installer and the
user's own species, and optionally a copy of the .blend with its `assets`. Copies keep their relative places, so that
paths that begin with // stay valid, in linked libraries as well. The open file is only read.
"""

from __future__ import annotations

import fnmatch
import json
import os
import shutil
import tomllib
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from . import template
from .assets import approve, copy_files, places_of, used_files
from .extension import (
    EXTENSION,
    NoPlantsError,
    Run,
    SceneError,
    estimate,
    frame_numbers,
    read_camera,
    readable,
    species_folders,
)

#: What all files of a job may have together unless the artist says otherwise.
LIMIT_GB = 20.0
MANIFEST = "blender_manifest.toml"
#: What Blender excludes from an extension by default.
_LEFT_OUT = ("__pycache__/", ".*", "/*.zip")
#: Species files are no larger, see `species.catalog`.
_LARGEST_SPECIES = 4_000_000
#: Of all files in the zip, so that equal files give equal zips.
_DATE = (1980, 1, 1, 0, 0, 0)


def write_bundle(
    scene: bpy.types.Scene,
    folder: Path,
    chunk: int = 1,
    runs: list[Run] | None = None,
    copy: bool = False,
    outside: bool = False,
    limit: float = LIMIT_GB * 1e9,
    tell: Callable[[str], None] = print,
) -> dict[str, Any]:
    """Write the open file as a job bundle.

    Parameters
    ----------
    scene : Scene
        The scene that the .blend opens with.
    folder : Path
        New or empty.
    chunk : int
        Frames that a worker renders per task.
    runs : list of tuple, optional
        First, last and step of frames; by default the scene's.
    copy : bool
        Copy the .blend and its assets into the bundle instead of referring to them.
    outside : bool
        Include files that lie outside the folder of the .blend.
    limit : float
        Most bytes that all files may have together.
    tell : callable
        Takes lines of text: the files and their sizes before anything is written, then progress.

    Returns
    -------
    dict
        Figures and names, for the command line.

    Raises
    ------
    SceneError
        A farm cannot render the scene, or the folder cannot be used or written; nothing is left in it then.
    TetFloraError
        The plants cannot be made.
    """
    blend = _saved_file()
    _check_output(scene)
    runs = runs or [(scene.frame_start, scene.frame_end, scene.frame_step)]
    frames = template.frame_expression(runs)
    plants = _plants(scene)
    assets = used_files(blend)
    approve(blend, assets, outside, limit, tell)
    places = places_of(blend, assets.files) if copy else {}
    folder = folder.absolute()
    made = _empty_folder(folder)
    name = os.path.basename(scene.render.filepath.replace("\\", "/")) or "frame_####"
    inside = places[blend].as_posix() if copy else None
    texts = {
        "template": template.template(template.Job(blend.stem, frames, chunk, name, inside)),
        "parameter_values": template.parameter_values(None if copy else str(blend)),
        "asset_references": template.asset_references([] if copy else [str(path) for path in (blend, *assets.files)]),
    }
    try:
        _write_files(folder / template.FILES)
        if copy:
            inner = folder / template.SCENE_FOLDER
            sizes = {blend: blend.stat().st_size, **assets.files}
            copy_files({path: inner / place for path, place in places.items()}, sizes, tell)
        for title, content in texts.items():
            with (folder / f"{title}.json").open("x", encoding="utf-8") as file:
                file.write(json.dumps(content, indent=2) + "\n")
    except BaseException as error:
        _take_away(folder, made)
        if isinstance(error, OSError):
            raise SceneError(f"Cannot write the job {folder}: {_reason(error)}. Choose another folder") from None
        raise
    numbers = frame_numbers(runs)
    return {
        "bundle": str(folder),
        "plants": plants,
        "frames": len(numbers),
        "tasks": -(-len(numbers) // chunk),
        "assets": len(assets.files),
        "megabytes": (sum(assets.files.values()) + blend.stat().st_size) / 1e6,
        "missing": [readable(str(path)) for path in assets.missing],
        "skipped": [readable(str(path)) for path in assets.skipped],
        "absolute_paths": [readable(text) for text in assets.absolute],
    }


def write_zip(target: Path, root: Path = EXTENSION) -> None:
    """Pack an installed extension as Blender's own build does, with the exclusions of its manifest.

    Raises
    ------
    SceneError
        The folder is not an extension.
    """
    names = extension_files(root)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in names:
            info = zipfile.ZipInfo(name, _DATE)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(info, (root / name).read_bytes())


def extension_files(root: Path = EXTENSION) -> list[str]:
    """Names, with slashes, of an extension's files."""
    manifest = _manifest(root)
    patterns = tuple(manifest.get("build", {}).get("paths_exclude_pattern", _LEFT_OUT))
    names = []
    for folder, inner, files in os.walk(root):
        above = Path(folder).relative_to(root).as_posix()
        above = "" if above == "." else above + "/"
        inner[:] = sorted(n for n in inner if not _left_out(above + n, patterns, folder=True))
        names += [above + n for n in sorted(files) if not _left_out(above + n, patterns, folder=False)]
    return names


def _left_out(name: str, patterns: tuple[str, ...], folder: bool) -> bool:
    """Whether a pattern matches as in .gitignore: a leading slash means the root, a trailing one folders."""
    for pattern in patterns:
        if pattern.endswith("/") and not folder:
            continue
        wanted = pattern.strip("/")
        subject = name if pattern.startswith("/") or "/" in wanted else name.rsplit("/", 1)[-1]
        if fnmatch.fnmatchcase(subject, wanted):
            return True
    return False


def _manifest(root: Path) -> dict[str, Any]:
    try:
        return tomllib.loads((root / MANIFEST).read_text(encoding="utf-8"))
    except OSError:
        raise SceneError(f"{root} has no {MANIFEST}; install TetFlora as an extension from its zip file") from None


def _saved_file() -> Path:
    if not bpy.data.filepath:
        raise SceneError("The file has not been saved; save it before you write the job")
    blend = Path(os.path.normpath(bpy.data.filepath))
    if not blend.is_file():
        raise SceneError(f"{blend} no longer exists; save the file again")
    return blend


def _check_output(scene: bpy.types.Scene) -> None:
    if scene.render.is_movie_format:
        raise SceneError(
            f"The output format is a movie ({scene.render.image_settings.file_format}), which workers cannot write in "
            "parts; choose an image format in the Output properties"
        )
    read_camera(scene, bpy.context.evaluated_depsgraph_get())


def _plants(scene: bpy.types.Scene) -> int:
    """Number of plants; finds unknown species now instead of on each worker."""
    try:
        return estimate(scene, bpy.context.evaluated_depsgraph_get()).plants
    except NoPlantsError:
        return 0


def _empty_folder(folder: Path) -> bool:
    """Make sure that the folder exists, is empty and writable; returns whether it was made."""
    try:
        made = not folder.exists()
        if made:
            folder.mkdir(parents=True)
        if not folder.is_dir():
            raise SceneError(f"{folder} is a file; choose a folder for the job")
        if any(folder.iterdir()):
            raise SceneError(f"{folder} is not empty; choose an empty folder for the job")
        probe = folder / "template.json"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise SceneError(f"Cannot write to {folder}: {error.strerror}. Choose another folder") from None
    return made


def _reason(error: OSError) -> str:
    """Why a file, or the first of several, could not be written or copied."""
    if isinstance(error, shutil.Error):
        source, _, why = error.args[0][0]
        return f"{source}: {why}"
    return error.strerror or str(error)


def _take_away(folder: Path, made: bool) -> None:
    """Remove what was written, and the folder itself if it was made."""
    for name in (template.FILES, template.SCENE_FOLDER):
        shutil.rmtree(folder / name, ignore_errors=True)
    for path in folder.glob("*.json"):
        path.unlink(missing_ok=True)
    if made:
        folder.rmdir()


def _write_files(folder: Path) -> None:
    folder.mkdir()
    version = _manifest(EXTENSION)["version"]
    write_zip(folder / f"tetflora-{version}.zip")
    shutil.copyfile(Path(__file__).with_name("installer.py"), folder / template.INSTALLER)
    for own in reversed(species_folders()):  # files of an earlier folder replace those of a later one
        for path in sorted(p for p in own.glob("*.json") if p.is_file() and p.stat().st_size <= _LARGEST_SPECIES):
            (folder / "species").mkdir(exist_ok=True)
            shutil.copyfile(path, folder / "species" / path.name)
