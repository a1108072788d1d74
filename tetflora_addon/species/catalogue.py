# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalogue: species files shipped with the extension, and folders of the user's own."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from ..errors import SpeciesError
from .schema import MAX_FILE_BYTES, read_species
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


def builtin_folder() -> Path:
    """Folder of the species files that are shipped."""
    return Path(__file__).resolve().parent.parent / "catalogue"


@lru_cache(maxsize=512)
def _info(path: Path, stamp: tuple[int, int]) -> SpeciesInfo:
    try:
        if stamp[1] > MAX_FILE_BYTES:
            raise ValueError("larger than menus read")
        data = json.loads(path.read_text(encoding="utf-8-sig"))
        name, description = str(data.get("name", path.stem)), str(data.get("description", ""))
    except (OSError, ValueError, AttributeError, RecursionError):
        name, description = path.stem, "This file cannot be read; choose the species to see why"
    return SpeciesInfo(path.stem, name, description, path)


@lru_cache(maxsize=256)
def _species(path: Path, _stamp: tuple[int, int]) -> Species:
    return read_species(path)


def _stamp(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


def in_order(found: Mapping[str, SpeciesInfo]) -> dict[str, SpeciesInfo]:
    """Species in the order in which they are offered: `FIRST`, then the others by name."""
    return dict(sorted(found.items(), key=lambda item: (item[0] != FIRST, item[1].name.lower())))


def list_species(folders: Sequence[Path] = ()) -> dict[str, SpeciesInfo]:
    """All species by identifier, as `in_order` sorts them.

    Parameters
    ----------
    folders : sequence of Path
        Folders of the user's own; a file there replaces a shipped one of the same name. Missing folders are passed
        over.
    """
    found: dict[str, SpeciesInfo] = {}
    for folder in (builtin_folder(), *folders):
        if folder.is_dir():
            for path in sorted(folder.glob("*.json")):
                if path.is_file():  # neither a folder nor a link that leads nowhere
                    found[path.stem] = _info(path, _stamp(path))
    return in_order(found)


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
        raise SpeciesError(f"Unknown species \"{identifier}\"; available: {', '.join(known) or 'none'}")
    path = known[identifier].path
    return _species(path, _stamp(path))
