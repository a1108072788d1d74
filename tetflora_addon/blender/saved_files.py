# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether .blend files that Blender wrote are whole.

Where a disk is full, Blender notices when it writes a plain file, but takes a compressed one that ends in the middle
for saved and puts it in place of the earlier one (tried on 4.5 and 5.2). Here such files are found out.

Source: Zstandard seekable format (github.com/facebook/zstd, contrib/seekable_format), which Blender writes: the file
ends with the magic number of the table of its frames.

Whether pictures that Blender wrote are whole.

Blender renders on where a disk is full: PNG and OpenEXR files end in the middle, and nobody is told (tried on 5.2).

Which version of the layout of properties a file has. A later version adds steps from earlier ones here.
"""

from __future__ import annotations

import os
import sys
import uuid
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import bpy

from ..errors import SceneError
from ..storage import PART
from .runtime import Handlers, complain

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
    """Let Blender write a .blend beside its place, and put it there when it is whole.

    Parameters
    ----------
    write : callable
        Gets the path to write to.

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
        part.replace(path)
    except (OSError, RuntimeError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        # What Blender says of a full disk.
        reason = "check the free disk space" if reason == "Success" else reason
        raise SceneError(f"Cannot write {path}: {reason}") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _on_save_post(path: str, _other: object = None) -> None:
    """Blender has said that it saved the file; say so if it has not."""
    saved = Path(path)
    if saved.name.endswith(PART[1]) or not cut_off(saved):
        return
    text = f"{saved} is incomplete because the disk is full. Free some space and save again now"
    older = saved.with_name(saved.name + "1")
    if older.is_file():
        text += f". The previous version is in {older.name} until you save twice"
    complain(text)


_HANDLERS = Handlers(save_post=_on_save_post)
register, unregister = _HANDLERS.register, _HANDLERS.unregister


def damaged(scene: bpy.types.Scene, files: Iterable[Path]) -> list[Path]:
    """Those of a scene's pictures that cannot be read; OpenEXR of several layers and films are not looked at."""
    render = scene.render
    # Blender reads no more of the former than their names until a layer is shown.
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


VERSION = 2


def migrate() -> None:
    """Stamp all plants, fields, occluders and scenes of the open file with the version of this layout.

    What a newer TetFlora saved is left alone and reported on stderr. Linked data belongs to another file.
    """
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
