# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Libraries of species and of biomes: the user's own files, how they are written, and pictures in menus."""

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bpy.utils import previews

from ..errors import NAME, TetFloraError, quoted, readable
from ..files import IDENTIFIER_RULE, is_identifier, is_regular, path_in, read_whole, write_whole

ENDING = ".json"
MAX_FILE_BYTES = 4_000_000
_MAX_PICTURE_BYTES = 4_000_000


class Pictures:
    """Pictures for items and layouts; ``loaded`` while the add-on is enabled."""

    def __init__(self) -> None:
        self.loaded: previews.ImagePreviewCollection | None = None

    def register(self) -> None:
        """Open an empty collection."""
        self.loaded = previews.new()

    def unregister(self) -> None:
        """Free them."""
        if self.loaded is not None:
            previews.remove(self.loaded)
        self.loaded = None

    def icon_of(self, path: Path | None) -> int:
        """Number of a file's picture, loaded at first use; 0 without one."""
        if path is None or self.loaded is None:
            return 0
        name = f"{path}|{path.stat().st_mtime_ns}"  # so that a replaced file is loaded again
        return (self.loaded.get(name) or self.loaded.load(name, str(path), 'IMAGE')).icon_id


def file_of(folders: Iterable[Path], identifier: str, ending: str = ENDING) -> Path | None:
    """The first file of an identifier in some folders, if there is one."""
    paths = (folder / (identifier + ending) for folder in folders) if is_identifier(identifier) else ()
    return next((path for path in paths if is_regular(path)), None)


@dataclass(frozen=True)
class OwnFiles:
    """The user's own files of a library."""

    #: noun, nouns: What they are, in errors
    noun: str
    nouns: str
    error: type[TetFloraError]
    folders: Callable[[], tuple[Path, ...]]  # gives the folders that exist
    folder: Callable[[], Path]  # gives the one that files are written to, which is made if it is missing
    changed: Callable[[], None]  # called without arguments after each change
    pictures: tuple[str, ...] = ()  # endings of pictures beside the files, which come and go with them

    def place(self, identifier: str) -> Path:
        """Where a file belongs.

        Raises
        ------
        TetFloraError
            It would not lie in the folder, or there is no folder.
        """
        if not is_identifier(identifier):
            raise self.error(f"{quoted(identifier)} cannot name a {self.noun}. Use only {IDENTIFIER_RULE}")
        try:
            return path_in(self.folder(), identifier + ENDING)
        except OSError as error:
            raise self.error(f"Your {self.noun} folder: {error.strerror}") from None

    def store(self, identifier: str, content: bytes | str, replace: bool, picture: Path | None = None) -> Path:
        """Put content, which was checked, into the folder, with a picture.

        Raises
        ------
        TetFloraError
            Another file of this name is there and shall not be replaced, or it cannot be written.
        """
        target = self.place(identifier)
        try:
            if os.path.lexists(target) and not replace:
                if is_regular(target) and read_whole(target, MAX_FILE_BYTES) == content:
                    return target
                raise self.error(
                    f'Your {self.noun} folder already has another "{identifier}"; turn on Replace, or choose another '
                    "name"
                )
            data = None if picture is None else read_whole(picture, _MAX_PICTURE_BYTES)
            write_whole(target, content)
            if data is not None:
                self._drop_pictures(target)
                write_whole(target.with_suffix(picture.suffix.lower()), data)
        except OSError as error:
            raise self.error(f"Cannot write {target.name}: {error.strerror}") from None
        self.changed()
        return target

    def delete(self, identifier: str) -> Path:
        """Delete a file with its picture; shipped ones stay.

        Raises
        ------
        TetFloraError
            There is none, or it cannot be deleted.
        """
        if file_of(self.folders(), identifier) is None:
            raise self.error(
                f'"{readable(identifier, NAME)}" has no file in your {self.noun} folder; built-in {self.nouns} cannot '
                "be deleted"
            )
        path = self.place(identifier)
        try:
            self._drop_pictures(path)
            path.unlink()
        except OSError as error:
            raise self.error(f"Cannot delete {path.name}: {error.strerror}") from None
        self.changed()
        return path

    def _drop_pictures(self, path: Path) -> None:
        for ending in self.pictures:
            path.with_suffix(ending).unlink(missing_ok=True)


def as_text(data: Any) -> str:
    """JSON as a person would write it: what is short, as ranges and colors, on one line."""
    return _text(data, "") + "\n"


def _text(data: Any, indent: str) -> str:
    line = json.dumps(data, ensure_ascii=False)
    if not isinstance(data, dict | list) or not data or len(indent) + len(line) <= 100:
        return line
    inner = indent + "  "
    if isinstance(data, list):
        return "[\n" + ",\n".join(inner + _text(one, inner) for one in data) + f"\n{indent}]"
    parts = [f"{inner}{json.dumps(key)}: {_text(value, inner)}" for key, value in data.items()]
    return "{\n" + ",\n".join(parts) + f"\n{indent}}}"
