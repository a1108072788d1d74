# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species of the catalogue as items of menus and enumerations."""

from collections.abc import Mapping, Sequence
from zlib import crc32

import bpy

from ..errors import SpeciesError
from ..plants.catalogue import SpeciesInfo
from .species_edits import catalogue, species_for
from .thumbnails import FALLBACK_ICON, icon_of

# What an enumeration says when there is nothing to choose.
NO_SPECIES = "NONE"
FALLBACK_HEIGHT = 5.0  # metres, of the arrow of a plant whose species cannot be read

Item = tuple[str, str, str, str | int, int]

# Blender keeps no copy of the strings of dynamic items, so somebody has to.
_kept: dict[tuple, list[Item]] = {}


def number_of(identifier: str) -> int:
    """A number that stays the same when species come and go, so that a stored choice keeps its meaning."""
    return crc32(identifier.encode()) & 0x7FFFFFFF


def items_for(present: str = "") -> list[Item]:
    """Items of an enumeration: the catalogue, and the present choice if the catalogue does not have it.

    Parameters
    ----------
    present : str
        Identifier that is chosen now; it survives although its file is missing.
    """
    known = catalogue()
    icons = {identifier: icon_of(identifier) for identifier in known}
    missing = present if present not in known else ""
    stamp = (missing, *((i.identifier, i.name, i.description, icons[i.identifier]) for i in known.values()))
    if stamp not in _kept:
        _kept[stamp] = _items(known, icons, present)
    return _kept[stamp]


def _items(known: Mapping[str, SpeciesInfo], icons: Mapping[str, int], present: str) -> list[Item]:
    items = [
        (i.identifier, i.name, i.description, icons[i.identifier] or FALLBACK_ICON, number_of(i.identifier))
        for i in known.values()
    ]
    if present and present not in known:
        text = "This species is not in the catalog; Refine fails until you add it or choose another"
        items.append((present, f"{present} (missing)", text, 'ERROR', number_of(present)))
    return items or [(NO_SPECIES, "No species found", "The catalog is empty", 'ERROR', 0)]


def operator_items(_operator: bpy.types.OperatorProperties, _context: bpy.types.Context | None) -> list[Item]:
    """Items for an operator's ``species``."""
    return items_for()


def display_height(identifier: str) -> float:
    """Height of a species' trunk in metres, for the arrow that stands for a plant in the viewport."""
    try:
        return float(species_for(None, identifier).orders[0].length.mean)
    except SpeciesError:
        return FALLBACK_HEIGHT


def default_species() -> str:
    """First species of the catalogue.

    Raises
    ------
    SpeciesError
        There is none.
    """
    known: Sequence[str] = tuple(catalogue())
    if not known:
        raise SpeciesError("The catalog has no species; reinstall TetFlora, or set a Species Folder in the preferences")
    return known[0]
