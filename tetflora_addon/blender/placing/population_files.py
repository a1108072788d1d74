# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populations as JSON files: the rules by which plants are placed, for other scenes and other people.

Keys are the names of the settings in Python. Angles are degrees, lengths meters. Objects, images and collections are
named; those missing in another file are left empty and reported. Everything unknown is refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy

from ...errors import SceneError
from ...files import parse_json, read_whole, write_whole
from ...formats import FORMATS
from .population_data import (
    check_keys,
    check_population,
    fill_population,
    in_newest_format,
    list_of,
    population_data,
    refuse_constant,
)
from .populations import add_population
from .properties import TetFloraPopulation
from .rules import set_grounds

FORMAT = "TetFlora populations"

MAX_FILE_BYTES = 4_000_000


def as_data(populations: Iterable[TetFloraPopulation]) -> dict[str, Any]:
    """Populations as what a file of them holds."""
    return {
        "format": FORMAT,
        "version": FORMATS["populations"],
        "populations": [population_data(p) for p in populations],
    }


def write_populations(populations: Iterable[TetFloraPopulation], path: Path) -> Path:
    """Write populations to a file, whole or not at all.

    Raises
    ------
    SceneError
        The file cannot be written.
    """
    text = json.dumps(as_data(populations), indent=2, ensure_ascii=False) + "\n"
    try:
        write_whole(path, text)
    except OSError as error:
        raise SceneError(f"Cannot write {path.name}: {error.strerror}") from None
    return path


def read_populations(
    scene: bpy.types.Scene, path: Path, grounds: Iterable[bpy.types.Object] = ()
) -> tuple[int, list[str]]:
    """Add the populations of a file to a scene, without plants.

    Parameters
    ----------
    grounds : iterable of bpy.types.Object
        Where populations grow of whose own grounds the scene has none.

    Returns
    -------
    number : int
        Populations added.
    missing : list of str
        What the file names and this one does not have.

    Raises
    ------
    SceneError
        The file cannot be read, or breaks a rule of the format; names file and key. Nothing is added.
    """
    try:
        entries = _checked(parse_json(read_whole(path, MAX_FILE_BYTES), refuse_constant))
    except OSError as error:
        raise SceneError(f"{path.name}: cannot read the file: {error.strerror}") from None
    except ValueError as error:
        raise SceneError(f"{path.name}: {error}") from None
    grounds, missing, group = list(grounds), [], scene.tetflora
    before, active = len(group.populations), group.populations_index
    try:
        for entry in entries:
            population = add_population(scene, name=entry["name"])
            fill_population(population, entry, scene, missing)
            if not population.grounds and population.ground_collection is None:
                set_grounds(population, grounds)
    except BaseException:  # all or nothing
        while len(group.populations) > before:
            group.populations.remove(before)
        group.populations_index = active
        raise
    return len(entries), list(dict.fromkeys(missing))


def _checked(data: Any) -> list[dict[str, Any]]:
    """Populations of a decoded file.

    Raises
    ------
    ValueError
        Something is not as it must be; names the key.
    """
    data = in_newest_format(data, FORMAT, "populations", "population files")
    check_keys("the file", data, {"format", "version", "populations"}, {"format", "version", "populations"})
    entries = list_of("populations", data["populations"])
    for number, entry in enumerate(entries, 1):
        check_population(f"population {number}", entry)
    return entries
