# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The library of biomes: files that are shipped, and those of the user's folder; their pictures in menus.

The user's are in the folder ``biomes`` within that of the user's own species; one of a shipped biome's name replaces
it. A picture has the file's name and lies beside it.
"""

import time
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ...errors import SceneError
from ...files import is_regular, parse_json
from ...species.catalog import FileInfo, files_in
from ..declare import HIDDEN, once, string
from ..file_library import OwnFiles, Pictures
from ..preferences import own_species_folder, species_folders
from ..species.catalog import Item, number_of

FOLDER = "biomes"
PICTURES = (".jpg", ".png")
#: Identifier of the only item when there is nothing to choose, and the icon of what has no picture.
NO_BIOME, FALLBACK_ICON = "NONE", 'WORLD'

# Seconds for which folders are not looked at again: menus and panels ask at each redraw.
_TRUSTED = 0.0 if bpy.app.background else 1.0
_seen: tuple[float, dict[str, FileInfo]] | None = None
_items: tuple[dict[str, FileInfo], list[Item]] | None = None
_kept: dict[tuple, list[Item]] = {}  # items by content: Blender keeps no copy of the strings of dynamic items
pictures = Pictures()

#: Ground: linear RGB of bare soil and of turf, the share that turf hides; and the shape of ground that is made for it:
#: hills in meters, slope in degrees, depth of a brook's valley in meters. Least and most of each number.
GROUND = {
    "earth": ((0.036, 0.025, 0.016), 0.0, 1.0),
    "turf": ((0.05, 0.08, 0.02), 0.0, 1.0),
    "turf_share": (0.0, 0.0, 1.0),
    "hills": (2.0, 0.0, 30.0),
    "slope": (0.0, 0.0, 45.0),
    "valley": (0.0, 0.0, 30.0),
}


def data_of(biome: bpy.types.PropertyGroup) -> dict[str, Any]:
    """What a biome keeps of its file beside its layers; nothing where that cannot be read."""
    try:
        data = parse_json(biome.data) if biome.data else {}
    except ValueError:
        data = {}
    return data if isinstance(data, dict) else {}


def builtin_folder() -> Path:
    """Folder of the biomes that are shipped."""
    return Path(__file__).resolve().parent.parent.parent / FOLDER


def look_again() -> None:
    """A file has changed."""
    global _seen
    _seen = None


def biomes() -> dict[str, FileInfo]:
    """All biomes by identifier, by name."""
    global _seen
    now = time.monotonic()
    if _seen is None or now - _seen[0] >= _TRUSTED:
        infos = files_in((builtin_folder(), *reversed(_own_folders())), "add the biome")
        _seen = now, dict(sorted(infos.items(), key=lambda item: item[1].name.lower()))
    return _seen[1]


def picture_file(path: Path) -> Path | None:
    """The picture beside a biome's file, if there is one."""
    return next((one for ending in PICTURES if is_regular(one := path.with_suffix(ending))), None)


def icon_of(info: FileInfo) -> int:
    """Number of a biome's picture for items and layouts, loaded at first use; 0 where it has none."""
    return pictures.icon_of(picture_file(info.path))


def items(_owner: object = None, _context: bpy.types.Context | None = None) -> list[Item]:
    """Items of an enumeration of all biomes; panels ask for them at each redraw."""
    global _items
    known = biomes()
    if _items is not None and _items[0] is known:
        return _items[1]
    entries = [
        (i.identifier, i.name, i.description, icon_of(i) or FALLBACK_ICON, number_of(i.identifier))
        for i in known.values()
    ] or [(NO_BIOME, "No biomes found", "The library is empty", 'ERROR', 0)]
    _items = known, _kept.setdefault(tuple(entries), entries)
    return _items[1]


#: An enumeration of all biomes, for property groups and operators.
BIOMES = partial(once.choice, "Biome", "Biome from the library", items)


class BiomeChoice:
    """Mix-in for property groups: a stored identifier, and an enumeration over it for panels, the first if none."""

    biome_file: string("Biome File", **HIDDEN)
    new_biome: BIOMES(get=lambda self: _number(self.biome_file), set=lambda self, number: _choose(self, number))


def _number(identifier: str) -> int:
    known = biomes()
    return number_of(identifier if identifier in known else next(iter(known))) if known else 0


def _choose(group: BiomeChoice, number: int) -> None:
    group.biome_file = next((one for one in biomes() if number_of(one) == number), "")


def _own_folder() -> Path:
    folder = own_species_folder() / FOLDER
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise SceneError(f"{folder}: {error.strerror}") from None
    return folder


def _own_folders() -> tuple[Path, ...]:
    return tuple(folder / FOLDER for folder in species_folders())


#: The user's own biomes.
OWN_FILES = OwnFiles("biome", "biomes", SceneError, _own_folders, _own_folder, look_again, PICTURES)
