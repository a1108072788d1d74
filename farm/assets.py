# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that a .blend uses, for jobs: which of them travel, and their copies.

A .blend may come from anybody and name any path. Therefore only regular files travel that end as files do which Blender
reads to render, folders only where a simulation keeps its cache, and the artist sees the list before it is copied. What
lies outside the folder of the .blend, links followed, needs the artist's consent.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from .extension import SceneError, readable

#: Most files of a job.
MOST_FILES = 100_000
#: Endings of files that Blender reads to render, beside those of images, movies and sounds.
_ENDINGS = {
    *(".blend", ".abc", ".usd", ".usda", ".usdc", ".usdz", ".vdb", ".mdd", ".pc2", ".btx"),
    *(".ttf", ".otf", ".ttc", ".pfb", ".woff", ".woff2", ".ies", ".osl", ".oso"),
}
#: Of those in the cache of a simulation.
_CACHED = {".vdb", ".uni", ".raw", ".gz", ".obj", ".bphys", ".exr", ".blob", ".json"}
_TILE = re.compile(r"<(UDIM|UVTILE)>")
_TILES = {"UDIM": "[0-9]{4}", "UVTILE": "u[0-9]{1,2}_v[0-9]{1,3}"}
#: Parts of names that other systems, and files that name them, cannot hold.
_UNFIT = re.compile("[\x00-\x1f\x7f\ud800-\udfff]")
#: Bytes that are copied at a time, and how often it is told how many.
_PIECE, _TOLD = 4 << 20, 10


@dataclass(frozen=True)
class Assets:
    """Files on disk that a scene uses besides its .blend; all paths absolute.

    Attributes
    ----------
    files : dict of Path to int
        Existing ones and their bytes.
    missing : tuple of Path
    skipped : tuple of Path
        What is there but not what Blender would read: special files, folders, files of other kinds.
    absolute : tuple of str
        Paths in the file that do not begin with //: they are valid only on machines with the same drives.
    """

    files: dict[Path, int]
    missing: tuple[Path, ...]
    skipped: tuple[Path, ...]
    absolute: tuple[str, ...]


def used_files(blend: Path) -> Assets:
    """Images, libraries, caches, sounds and fonts on disk that the open file uses, except packed ones.

    Raises
    ------
    SceneError
        There are more than `MOST_FILES`.
    """
    written = bpy.utils.blend_paths(absolute=False, packed=False, local=False)
    listed = {_normal(text) for text in bpy.utils.blend_paths(absolute=True, packed=False, local=False) if text}
    listed -= {_absolute(text) for text in bpy.data.texts if text.filepath}  # their lines are in the .blend
    endings = {*bpy.path.extensions_image, *bpy.path.extensions_movie, *bpy.path.extensions_audio, *_ENDINGS}
    caches = {*_cache_folders(), blend.with_name(f"blendcache_{blend.stem}")}
    numbered = {_absolute(user) for user in _numbered()}
    files: dict[Path, int] = {}
    missing, skipped = set(), set()
    for path in sorted(listed | numbered | caches):
        if path in caches:
            found, allowed = _within(path), _CACHED
        else:
            found, allowed = _files_of(path, path in numbered), endings
        some = False
        for one in found:
            some = True
            if _readable(one, allowed):
                files[one] = os.path.getsize(one)
            elif path not in caches:
                skipped.add(one)
            if len(files) > MOST_FILES:
                raise SceneError(f"The scene uses more than {MOST_FILES:,} files; pack or join some of them")
        if not some and path not in caches:
            missing.add(path)
    files.pop(blend, None)
    absolute = {text for text in written if text and not text.startswith("//")}
    return Assets(files, tuple(sorted(missing)), tuple(sorted(skipped)), tuple(sorted(absolute)))


def approve(blend: Path, assets: Assets, outside: bool, limit: float, tell: Callable[[str], None]) -> None:
    """Show what travels with a job, and refuse what the artist has not asked for.

    Parameters
    ----------
    blend : Path
    assets : Assets
    outside : bool
        Whether files outside the folder of the .blend may travel.
    limit : float
        Bytes.
    tell : callable
        Takes lines of text.

    Raises
    ------
    SceneError
        A file lies outside, or all together are larger than the limit.
    """
    folder = os.path.realpath(blend.parent)
    sizes = {blend: os.path.getsize(blend), **assets.files}
    far = [path for path in assets.files if not Path(os.path.realpath(path)).is_relative_to(folder)]
    tell("\n".join(f"{size / 1e6:12,.3f} MB  {readable(str(path))}" for path, size in sizes.items()))
    total = sum(sizes.values())
    tell(f"{total / 1e6:12,.3f} MB  in {len(sizes):,} files")
    if far and not outside:
        raise SceneError(
            f"{len(far):,} of the files lie outside the folder of {blend.name}, the first of them "
            f"{far[0]}; check the list, then use --outside to include them, or copy or pack them"
        )
    if total > limit:
        largest = max(sizes, key=lambda path: sizes[path])
        raise SceneError(
            f"The files have {total / 1e9:,.1f} GB together, the largest is {largest}; {limit / 1e9:g} GB is "
            "the limit, which --max-size changes"
        )


def copy_files(places: dict[Path, Path], sizes: dict[Path, int], tell: Callable[[str], None]) -> None:
    """Copy files to new places, and tell how far it is.

    Raises
    ------
    SceneError
        A file has grown since its size was shown.
    OSError
        It cannot be read or written, or something is in its place.
    """
    total, copied, told = sum(sizes[path] for path in places), 0, 0
    for path, target in places.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        left = sizes[path]
        with path.open("rb") as source, target.open("xb") as copy:
            while piece := source.read(_PIECE):
                left -= len(piece)
                if left < 0:
                    raise SceneError(f"{path} has grown since it was listed; wait until it is written")
                copy.write(piece)
                copied += len(piece)
                if copied * _TOLD >= (told + 1) * total:
                    told = copied * _TOLD // total
                    tell(f"copied {copied / 1e6:,.1f} of {total / 1e6:,.1f} MB")


def places_of(blend: Path, files: Iterable[Path]) -> dict[Path, Path]:
    """Place of the .blend and of each file in the bundle, with the same relative paths."""
    everything = (blend, *files)
    if other := next((path for path in everything if path.drive != blend.drive), None):
        raise SceneError(f"{other} is not on the drive of {blend.name}; pack it into the file, or copy it there")
    root = os.path.commonpath([path.parent for path in everything])
    return {path: path.relative_to(root) for path in everything}


def _normal(text: str) -> Path:
    return Path(os.path.normpath(text))


def _absolute(user: bpy.types.ID) -> Path:
    return _normal(bpy.path.abspath(user.filepath, library=user.library))


def _numbered() -> Iterator[bpy.types.ID]:
    """Datablocks that read one of several numbered files in each frame."""
    for user in (*bpy.data.images, *bpy.data.movieclips):
        if user.source == 'SEQUENCE' and user.filepath and not getattr(user, "packed_file", None):
            yield user
    yield from (user for user in (*bpy.data.volumes, *bpy.data.cache_files) if user.is_sequence and user.filepath)


def _cache_folders() -> Iterator[Path]:
    """Folders in which modifiers keep what they have simulated."""
    for obj in bpy.data.objects:
        for modifier in obj.modifiers:
            domain = getattr(modifier, "domain_settings", None)
            folder = domain.cache_directory if domain else getattr(modifier, "bake_directory", "")
            if modifier.type == 'OCEAN' and modifier.is_cached:
                folder = modifier.filepath
            if folder:
                yield _normal(bpy.path.abspath(folder, library=obj.library))


def _within(folder: Path) -> Iterator[Path]:
    """All that lies in a folder, whatever it is; links to folders are not followed."""
    for inside, folders, names in os.walk(folder):
        folders.sort()
        yield from (Path(inside, name) for name in sorted(names))


def _readable(path: Path, endings: set[str]) -> bool:
    """Whether Blender reads a file: a regular one, with a known ending, and a name that other systems can store."""
    if not os.path.isfile(path) or not path.name.lower().endswith(tuple(endings)):
        return False
    return not _UNFIT.search(str(path)) and os.access(path, os.R_OK)


def _files_of(path: Path, numbered: bool) -> Iterator[Path]:
    """What is there of a path: itself, all tiles of an image, or all files of a sequence."""
    if not os.path.isdir(path.parent):
        return
    tile = _TILE.search(path.name)
    if tile:
        before, after = path.name[: tile.start()], path.name[tile.end() :]
        wanted = re.compile(re.escape(before) + _TILES[tile[1]] + re.escape(after))
    elif numbered and (match := re.fullmatch(r"(.*?)([0-9]+)([^0-9]*)", path.stem)):
        # As many digits as in the name that is there; larger numbers have more.
        digits = rf"(?:[0-9]{{{len(match[2])}}}|[1-9][0-9]{{{len(match[2])},8}})"
        wanted = re.compile(re.escape(match[1]) + digits + re.escape(match[3] + path.suffix))
    else:
        if os.path.lexists(path):
            yield path
        return
    yield from (path.with_name(name) for name in sorted(os.listdir(path.parent)) if wanted.fullmatch(name))
