# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalog: species files shipped with the extension, and folders of the user's own."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from ..errors import NAME, SpeciesError, quoted, readable
from ..files import IDENTIFIER_RULE, is_identifier, is_regular, parse_json
from .schema import read_species, species_file
from .species import Species

#: What lists begin with, and new plants are where nothing is chosen: a tree of which anybody expects a forest.
FIRST = "beech"


@dataclass(frozen=True)
class SpeciesInfo:
    """What a menu shows of a species, without reading it in full."""

    identifier: str
    name: str
    description: str
    path: Path


@cache
def builtin_folder() -> Path:
    """Folder of the species files that are shipped."""
    return Path(__file__).resolve().parent.parent / "catalog"


def info_of(identifier: str, data: Mapping[str, object], path: Path) -> SpeciesInfo:
    """What a menu shows of a decoded species, sound or not."""
    name, description = readable(str(data.get("name", "")), NAME).strip(), readable(str(data.get("description", "")))
    return SpeciesInfo(identifier, name or identifier, description, path)


def _info(path: Path) -> SpeciesInfo:
    try:
        data = parse_json(species_file(path))
        return info_of(path.stem, data, path)
    except (SpeciesError, ValueError, AttributeError):
        return info_of(path.stem, {"description": "This file cannot be read; choose the species to see why"}, path)


@lru_cache(maxsize=256)
def _species(path: Path, _stamp: tuple[int, int]) -> Species:
    return read_species(path)


def stamp(path: Path) -> tuple[int, int]:
    """When a file was written and its size: a change of it shows here."""
    try:
        status = os.lstat(path)
    except OSError:  # somebody has just deleted it
        return 0, 0
    return status.st_mtime_ns, status.st_size


def checked_identifier(text: str) -> str:
    """An identifier of a species, which may have come from any file.

    Raises
    ------
    SpeciesError
        It could name no file of a species.
    """
    if not is_identifier(text):
        raise SpeciesError(f"{quoted(text)} cannot name a species. Use only {IDENTIFIER_RULE}")
    return text


def _files(folder: Path) -> Iterator[tuple[Path, str]]:
    """Species files of a folder by name, and why each is no species; an empty text for those that may be one."""
    try:
        paths = sorted(folder.glob("*.json"))
    except (OSError, ValueError):
        paths = []
    for path in paths:
        if not is_identifier(path.stem):
            yield path, f"skipped; rename the file. Use only {IDENTIFIER_RULE}"
        else:
            yield path, "" if is_regular(path) else "skipped; it is a link or a folder. Put the file itself there"


def odd_files(folders: Sequence[Path]) -> list[str]:
    """Files of the user's own folders that `list_species` skips, each with the reason and what to do."""
    return [readable(f'"{path.name}": {reason}') for folder in folders for path, reason in _files(folder) if reason]


def in_order(found: Mapping[str, SpeciesInfo]) -> dict[str, SpeciesInfo]:
    """Species in the order in which they are offered: `FIRST`, then the others by name."""
    return dict(sorted(found.items(), key=lambda item: (item[0] != FIRST, item[1].name.lower())))


def list_species(folders: Sequence[Path] = ()) -> dict[str, SpeciesInfo]:
    """All species by identifier, as `in_order` sorts them.

    Parameters
    ----------
    folders : sequence of Path
        Folders of the user's own; a file there replaces a shipped one of the same name, and one of a later folder.
        Missing folders are passed over, and so are files that `odd_files` names.
    """
    found: dict[str, SpeciesInfo] = {}
    for folder in (builtin_folder(), *reversed(folders)):
        found |= _listed(folder, _entries(folder))
    return in_order(found)


def _entries(folder: Path) -> tuple[tuple[str, int, int, int], ...]:
    """What a folder holds: names, times, sizes and kinds of its files. A change of any shows here."""
    try:
        with os.scandir(folder) as entries:
            stats = [(entry.name, entry.stat(follow_symlinks=False)) for entry in entries]
    except (OSError, ValueError):
        return ()
    return tuple(sorted((name, stat.st_mtime_ns, stat.st_size, stat.st_mode) for name, stat in stats))


@lru_cache(maxsize=64)
def _listed(folder: Path, _entries: tuple[tuple[str, int, int, int], ...]) -> dict[str, SpeciesInfo]:
    return {path.stem: _info(path) for path, reason in _files(folder) if not reason}


def load_species(
    identifier: str, folders: Sequence[Path] = (), known: Mapping[str, SpeciesInfo] | None = None
) -> Species:
    """Read a species; unchanged files are read once.

    Parameters
    ----------
    identifier : str
    folders : sequence of Path
        As of `list_species`.
    known : mapping, optional
        What `list_species` returned a moment ago.

    Raises
    ------
    SpeciesError
        Unknown identifier (the message lists the known ones), or a broken file.
    """
    known = list_species(folders) if known is None else known
    if identifier not in known:
        raise SpeciesError(f'Unknown species "{readable(identifier, NAME)}"; available: {", ".join(known) or "none"}')
    path = known[identifier].path
    return _species(path, stamp(path))
