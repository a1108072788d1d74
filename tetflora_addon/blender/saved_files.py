# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that Blender wrote: whether they are complete, and which version of TetFlora's properties they hold.

On a full disk Blender reports plain .blend files that it cannot write, but not compressed ones: it takes a truncated
file for saved and replaces the earlier one (tried on 4.5 and 5.2). Truncated PNG and OpenEXR files go unreported too.

Source: Zstandard seekable format (github.com/facebook/zstd, contrib/seekable_format), which Blender writes: the file
ends with the magic number of the table of its frames.
"""

import os
import sys
import uuid
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path

import bpy

from ..errors import SceneError, quoted
from ..files import IDENTIFIER_RULE, PART, is_identifier, replace
from ..formats import FORMATS
from .runtime import complain, handlers

#: Of the properties of an object or a scene. Steps from earlier ones stand in `migrate`, when there are any.
VERSION = FORMATS["properties"]
_COMPRESSED = b"\x28\xb5\x2f\xfd"
_END = b"\xb1\xea\x92\x8f"


def cut_off(path: Path) -> bool:
    """Whether a file is a compressed .blend without its end."""
    try:
        with path.open("rb") as file:
            if file.read(len(_COMPRESSED)) != _COMPRESSED:
                return False
            file.seek(-len(_END), os.SEEK_END)
            return file.read() != _END
    except OSError:
        return False


def write_blend(path: Path, write: Callable[[str], object]) -> None:
    """Let Blender write a .blend to a path beside its place, and move it there when it is complete.

    Raises
    ------
    SceneError
        It cannot be written; an earlier file stays as it was.
    """
    part = path.with_name(uuid.uuid4().hex.join(PART))
    try:
        write(str(part))
        if cut_off(part):
            raise SceneError(f"Cannot write {path}: the disk is full")
        replace(part, path)
    except (OSError, RuntimeError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        # What Blender says of a full disk.
        reason = "check the free disk space" if reason == "Success" else reason
        raise SceneError(f"Cannot write {path}: {reason}") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _on_save_post(path: str, _other: object = None) -> None:
    """Report a file that Blender takes for saved but did not write completely."""
    saved = Path(path)
    if saved.name.endswith(PART[1]) or not cut_off(saved):
        return
    text = f"{saved} is incomplete because the disk is full. Free some space and save again now"
    older = saved.with_name(saved.name + "1")
    if older.is_file():
        text += f". The previous version is in {older.name} until you save twice"
    complain(text)


def damaged(scene: bpy.types.Scene, files: Iterable[Path]) -> list[Path]:
    """Rendered images of a scene that cannot be read; movies and multilayer OpenEXR are not checked."""
    render = scene.render
    # Blender reads only the names of layers until one is shown.
    if render.is_movie_format or render.image_settings.file_format == 'OPEN_EXR_MULTILAYER':
        return []
    return [path for path in files if path.is_file() and not _whole(path)]


def _whole(path: Path) -> bool:
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError:
        return False
    try:
        return image.size[0] > 0
    finally:
        bpy.data.images.remove(image)


@cache
def _parts(kind: type[bpy.types.PropertyGroup]) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Names of a group's stored texts, of groups within it, and of lists of groups."""
    names: dict[str, list[str]] = {'STRING': [], 'POINTER': [], 'COLLECTION': []}
    for prop in kind.bl_rna.properties:
        within = getattr(getattr(prop, "fixed_type", None), "base", None)
        stored = prop.type == 'STRING' and not prop.is_skip_save
        if stored or (prop.type in names and getattr(within, "identifier", "") == 'PropertyGroup'):
            names[prop.type].append(prop.identifier)
    return tuple(names['STRING']), tuple(names['POINTER']), tuple(names['COLLECTION'])


def _clear_unreadable(group: bpy.types.PropertyGroup) -> int:
    """Empty texts of a group, and of those within, that are not UTF-8: Python raises an error at each look at them."""
    cleared = 0
    texts, pointers, lists = _parts(type(group))
    for name in texts:
        if group.is_property_set(name):
            try:
                getattr(group, name)
            except UnicodeDecodeError:
                group.property_unset(name)
                cleared += 1
    within = [getattr(group, name) for name in pointers if group.is_property_set(name)]
    within += [entry for name in lists for entry in getattr(group, name)]
    return cleared + sum(map(_clear_unreadable, within))


def clear_unreadable() -> None:
    """Empty texts of the open file that cannot be read, and report on stderr what of it will be ignored."""
    owners = [o for o in (*bpy.data.objects, *bpy.data.scenes) if o.is_property_set("tetflora")]
    if cleared := sum(_clear_unreadable(owner.tetflora) for owner in owners):
        print(f"TetFlora: warning: {cleared} texts of this file are not UTF-8 and are empty now", file=sys.stderr)
    edits = [edit.identifier for scene in bpy.data.scenes for edit in scene.tetflora.species_edits]
    odd = [identifier for identifier in edits if identifier and not is_identifier(identifier)]
    if odd:
        print(
            f"TetFlora: warning: this file has species of its own that are ignored: {quoted(odd[0])} cannot name a "
            f"species. Use only {IDENTIFIER_RULE}",
            file=sys.stderr,
        )


def migrate() -> None:
    """Stamp the open file's own data with the version of this layout; data of a newer one is reported on stderr."""
    owners = [o for o in bpy.data.objects if o.tetflora.is_plant or o.tetflora.is_field or o.tetflora.is_occluder]
    owners += [s for s in bpy.data.scenes if s.is_property_set("tetflora")]
    newer = 0
    for owner in owners:
        if owner.tetflora.version > VERSION:
            newer += 1
        elif owner.library is None and owner.tetflora.version < VERSION:
            owner.tetflora.version = VERSION
    if newer:
        print(
            f"TetFlora: a newer version saved {newer} of this file's objects and scenes; update the extension",
            file=sys.stderr,
        )


register, unregister = handlers(save_post=_on_save_post)
