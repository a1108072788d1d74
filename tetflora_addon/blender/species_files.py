# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species as files: saved for other scenes, taken from others, given away, deleted. Only sound ones get in or out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy

from ..errors import SpeciesError
from ..plants.schema import read_species
from ..whole_files import write_whole
from .preferences import own_species_folder, species_folders
from .species_edits import species_data, species_for, tell_listeners

ENDING = ".json"


def own_file(identifier: str) -> Path | None:
    """The user's own file of a species, if there is one."""
    for folder in species_folders():
        path = folder / (identifier + ENDING)
        if identifier and path.is_file():
            return path
    return None


def as_text(data: dict[str, Any]) -> str:
    """A decoded species as a person would write it: a key a line, except within ranges and leaves."""

    def line(key: str, value: Any) -> str:
        return f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}"

    parts = []
    for key, value in data.items():
        if key == "orders":
            orders = [",\n     ".join(line(k, v) for k, v in order.items()) for order in value]
            parts.append('"orders": [\n    ' + ",\n    ".join(f"{{{text}}}" for text in orders) + "\n  ]")
        else:
            parts.append(line(key, value))
    return "{\n  " + ",\n  ".join(parts) + "\n}\n"


def write_species(scene: bpy.types.Scene, identifier: str, path: Path) -> Path:
    """Write a species as this file has it.

    Raises
    ------
    SpeciesError
        The species is broken, or the file cannot be written.
    """
    species_for(scene, identifier)
    try:
        write_whole(path, as_text(species_data(scene, identifier)))
    except OSError as error:
        raise SpeciesError(f"Cannot write {path.name}: {error.strerror}") from None
    return path


def save_species(scene: bpy.types.Scene, identifier: str) -> Path:
    """Save a species into the user's own folder, over an earlier file of that name.

    Raises
    ------
    SpeciesError
        As `write_species`; or there is no folder.
    """
    return write_species(scene, identifier, own_species_folder() / (identifier + ENDING))


def load_species_file(path: Path, replace: bool = False) -> str:
    """Take a species file into the user's own folder; returns the identifier.

    Parameters
    ----------
    path : Path
        Anywhere; a file that lies in the folder already is only checked.
    replace : bool
        Whether an own file of the same name and other content gives way.

    Raises
    ------
    SpeciesError
        The file breaks a rule of the format, as the message says, or another one of its name is there.
    """
    read_species(path)
    target = own_species_folder() / (path.stem + ENDING)
    try:
        content = path.read_bytes()
        if target.is_file() and target.read_bytes() == content:
            return path.stem
        if target.exists() and not replace:
            raise SpeciesError(
                f'Your species folder already has another "{path.stem}"; turn on Replace in the file browser, or '
                "rename it"
            )
        write_whole(target, content)
    except OSError as error:
        raise SpeciesError(f"Cannot write {target.name}: {error.strerror}") from None
    tell_listeners()
    return path.stem


def delete_species_file(identifier: str) -> Path:
    """Delete the user's own file of a species; shipped ones stay.

    Raises
    ------
    SpeciesError
        There is none, or it cannot be deleted.
    """
    path = own_file(identifier)
    if path is None:
        raise SpeciesError(f'"{identifier}" has no file in your species folder; built-in species cannot be deleted')
    try:
        path.unlink()
    except OSError as error:
        raise SpeciesError(f"Cannot delete {path.name}: {error.strerror}") from None
    tell_listeners()
    return path
