# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species of the catalog in Blender: thumbnails, items of menus, the property that stores a choice, and files.

Thumbnails are PNG files beside the species; an asset has Blender's own preview of it, or the picture that was made when
it became a species. Only sound species files are saved or loaded.
"""

import time
from collections.abc import Mapping
from pathlib import Path
from zlib import crc32

import bpy
import numpy as np

from ...errors import NAME, SpeciesError, readable
from ...files import write_whole
from ...species.catalog import FileInfo, builtin_folder, checked_identifier, species_file, species_from_json
from ..declare import once, string
from ..file_library import OwnFiles, Pictures, as_text, file_of
from ..preferences import own_species_folder, species_folders
from ..settings import season_name, season_of
from .asset_species import PICTURE_SIDE, PREFIX, TetFloraAssetSpecies, datablock_of, find_asset, name_of, picture_of
from .edits import catalog, grown, species_data, species_for, tell_listeners

FOLDER = "thumbnails"
THUMBNAIL_ENDING = ".png"
#: Where a species has no thumbnail.
FALLBACK_ICON = 'OUTLINER_OB_EMPTY'

#: Identifier of the only item when there is nothing to choose.
NO_SPECIES = "NONE"

Item = tuple[str, str, str, str | int, int]

# Seconds for which a thumbnail is not looked for again: menus and panels ask for all of them at each redraw.
_TRUSTED = 0.0 if bpy.app.background else 1.0
_icons: dict[tuple[str, str], tuple[float, int]] = {}  # by species and season
_kept: dict[tuple, list[Item]] = {}  # items by content: Blender keeps no copy of the strings of dynamic items
_OVERRIDABLE = {"override": {'LIBRARY_OVERRIDABLE'}, "options": {'HIDDEN', 'ANIMATABLE'}}
thumbnails = Pictures()
register = thumbnails.register


def thumbnail_file(identifier: str, season: str = "") -> Path | None:
    """The thumbnail of a species: ``thumbnails/identifier.png`` in the user's folder or among the shipped ones.

    That of a season, ``identifier.autumn.png``, comes before it where one is asked for.
    """
    folders = [folder / FOLDER for folder in (*species_folders(), builtin_folder())]
    endings = (f".{season}{THUMBNAIL_ENDING}", THUMBNAIL_ENDING) if season else (THUMBNAIL_ENDING,)
    return next((path for folder in folders for e in endings if (path := file_of([folder], identifier, e))), None)


def icon_of(identifier: str) -> int:
    """Number of a species' thumbnail for items and layouts, loaded at first use; 0 where it has none."""
    scene = getattr(bpy.context, "scene", None)  # none while add-ons are enabled
    shown = season_of(scene) if scene is not None else None
    now, season = time.monotonic(), "" if shown is None else season_name(shown)
    seen, icon = _icons.get((identifier, season), (-_TRUSTED, 0))
    if now - seen >= _TRUSTED:
        asset = find_asset(None, identifier)
        icon = thumbnails.icon_of(thumbnail_file(identifier, season)) if asset is None else _icon_of_asset(asset)
        _icons[identifier, season] = now, icon
    return icon


def _icon_of_asset(asset: TetFloraAssetSpecies) -> int:
    datablock = datablock_of(asset)
    if datablock is not None and datablock.preview is not None and datablock.preview.image_size[0]:
        return datablock.preview.icon_id
    if not asset.picture or thumbnails.loaded is None:
        return 0
    name = f"{asset.identifier}|{crc32(asset.picture.encode())}"
    preview = thumbnails.loaded.get(name)
    if preview is None:
        pixels = picture_of(asset)
        if pixels is None:
            return 0
        preview = thumbnails.loaded.new(name)
        preview.image_size = PICTURE_SIDE, PICTURE_SIDE
        preview.image_pixels_float.foreach_set(pixels.astype(np.float32).ravel() / 255.0)
    return preview.icon_id


def unregister() -> None:
    """Free the thumbnails."""
    thumbnails.unregister()
    _icons.clear()


def number_of(identifier: str) -> int:
    """A number that stays the same when species come and go, so that a stored choice keeps its meaning.

    Of 24 bits: popups and galleries hand numbers on as float32, and what they say of longer ones is no item's.
    """
    return crc32(identifier.encode(errors="backslashreplace")) & 0xFFFFFF


def items_for(present: str = "", assets: bool = True) -> list[Item]:
    """Items of an enumeration: the catalog, and the present choice if the catalog does not have it.

    Parameters
    ----------
    present : str
        Identifier that is chosen now; it survives although its file is missing.
    assets : bool
        Whether objects that are used as species are among the items.
    """
    known = catalog() if assets else grown()
    icons = {identifier: icon_of(identifier) for identifier in known}
    missing = present if present not in known else ""
    stamp = (missing, *((i.identifier, i.name, i.description, icons[i.identifier]) for i in known.values()))
    if stamp not in _kept:
        _kept[stamp] = _items(known, icons, present)
    return _kept[stamp]


def _items(known: Mapping[str, FileInfo], icons: Mapping[str, int], present: str) -> list[Item]:
    items = [
        (i.identifier, i.name, i.description, icons[i.identifier] or FALLBACK_ICON, number_of(i.identifier))
        for i in known.values()
    ]
    if present and present not in known:
        text = "This species is not in the catalog; Refine fails until you add it or choose another"
        if present.startswith(PREFIX):
            text = "The object of this species was deleted; Refine fails until you undo that or choose another species"
        items.append((present, f"{readable(name_of(present), NAME)} (missing)", text, 'ERROR', number_of(present)))
    return items or [(NO_SPECIES, "No species found", "The catalog is empty", 'ERROR', 0)]


def operator_items(_operator: bpy.types.OperatorProperties, _context: bpy.types.Context | None) -> list[Item]:
    """Items for an operator's ``species``."""
    return items_for()


def default_species() -> str:
    """The species that the catalog offers first.

    Raises
    ------
    SpeciesError
        There is none.
    """
    known = catalog()
    if not known:
        raise SpeciesError("The catalog has no species; reinstall TetFlora, or set a Species Folder in the preferences")
    return next(iter(known))


class SpeciesChoice:
    """A stored identifier, and an enumeration over it for panels.

    The identifier is a string, so that a species without its file survives; the enumeration only reads and writes it.
    """

    #: Whether the enumeration has assets.
    takes_assets = True

    species: string("Species", "File name of the species in the catalog, without extension", **_OVERRIDABLE)
    species_choice: once.choice(
        "Species",
        "Species from the catalog",
        lambda self, _context: items_for(self.species, self.takes_assets),
        get=lambda self: _chosen(self),
        set=lambda self, number: _choose(self, number),
    )


def _chosen(group: SpeciesChoice) -> int:
    identifier = group.species or items_for(assets=group.takes_assets)[0][0]
    return 0 if identifier == NO_SPECIES else number_of(identifier)


def _choose(group: SpeciesChoice, number: int) -> None:
    for identifier, *_, item_number in items_for(group.species, group.takes_assets):
        if item_number == number and number:
            group.species = identifier
            tell_listeners()


def gallery_of(entries: str, kind: type[SpeciesChoice]) -> object:
    """A choice that is a button in panels, a plus, and opens a gallery of pictures: what is clicked is added to a list.

    Parameters
    ----------
    entries : str
        Name of the list of species in the group of properties to which this is given.
    """
    return once.choice(
        "Add Species",
        "Add a species to the list by its picture",
        lambda _self, _context: _with_plus(items_for(assets=kind.takes_assets)),
        get=lambda _self: 0,
        set=lambda self, number: _add_to(self, entries, kind, number),
        options={'SKIP_SAVE', 'HIDDEN'},
    )


def _with_plus(items: list[Item]) -> list[Item]:
    return _kept.setdefault(("plus", id(items)), [("PLUS", "Add Species", "", 'ADD', 0), *items])


def _add_to(group: bpy.types.PropertyGroup, entries: str, kind: type[SpeciesChoice], number: int) -> None:
    for identifier, *_, item_number in items_for(assets=kind.takes_assets):
        if item_number == number and number:
            added = getattr(group, entries)
            added.add().species = identifier
            setattr(group, f"{entries}_index", len(added) - 1)
            tell_listeners()


#: The user's own species.
OWN_FILES = OwnFiles("species", "species", SpeciesError, species_folders, own_species_folder, tell_listeners)


def own_file(identifier: str) -> Path | None:
    """The user's own file of a species, if there is one."""
    return file_of(species_folders(), identifier)


def write_species(scene: bpy.types.Scene, identifier: str, path: Path) -> Path:
    """Write a species as this file has it.

    Raises
    ------
    SpeciesError
        The species is broken, the file's name is no identifier, or the file cannot be written.
    """
    species_for(scene, identifier)
    checked_identifier(path.stem)
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
    species_for(scene, identifier)
    return OWN_FILES.store(identifier, as_text(species_data(scene, identifier)), replace=True)


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
    content = species_file(path)
    species_from_json(content, checked_identifier(path.stem), path.name)
    return OWN_FILES.store(path.stem, content, replace).stem
