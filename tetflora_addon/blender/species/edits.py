# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species that an artist changed in this file: JSON text on the scene, in place of the catalog's species.

The text is what a species file holds, so it passes the same checks, and a key that comes in another version of the
format needs no migration of its own. `species_for` is the one door: refinement, previews and panels load through it.

Blender links and appends collections without the scene that has the species. So whenever a file is written, collections
get a page of each species of their plants that is not shipped: edited, made here, litter, or of the user's own folder.
Pages of linked collections are read where they are; those of appended ones become edits of the scene.
"""

import copy
import json
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from itertools import chain, count
from pathlib import Path
from typing import Any, NamedTuple

import bpy

from ...errors import NAME, SpeciesError, readable
from ...files import is_identifier, parse_json
from ...species.catalog import (
    FileInfo,
    checked_identifier,
    in_order,
    info_of,
    list_species,
    load_species,
    odd_files,
    species_file,
    species_from_json,
)
from ...species.species import Species
from ..declare import string
from ..preferences import species_folders
from ..runtime import Listeners, handlers
from .asset_species import asset_infos, asset_species, copy_asset, find_asset, listed_in, name_of, refuse_asset

#: Custom property of collections: JSON of species by their identifiers, see `pack`.
PAGES = "tetflora_pages"
_FALLBACK_HEIGHT = 5.0  # meters, of the arrow of a plant whose species cannot be read
#: What identifiers of trees in a wood end in, how far they are its trees, and the least height of a tree, meters.
_IN_WOOD, _HABIT, _TREE = "_in_wood", 0.6, 4.0

#: Called after every change of a species, without arguments; the preview listens.
listeners = Listeners()

# In the background nothing is drawn, and scripts expect to find what they have just written.
_TRUSTED = 0.0 if bpy.app.background else 0.3
_seen: dict[str, FileInfo] | None = None
_seen_at = 0.0
_assets: dict[str, FileInfo] | None = None  # of the open file
_assets_at = 0.0
_looking = True  # False within `looked_at_once`
_read: dict[str, dict[str, Any]] = {}  # decoded files, as long as what was seen is trusted
_odd: list[str] = []  # files of the folders that are no species, each with the reason


class TetFloraSpeciesEdit(bpy.types.PropertyGroup):
    """A species as this file has it."""

    identifier: string("Identifier", "Catalog species that the text replaces in this file, or a new species")
    text: string("Text", "The species in JSON, as in a species file")


def listed() -> dict[str, FileInfo]:
    """Species that files hold, edits aside.

    A panel asks often: in the window folders are looked at every `_TRUSTED` seconds, and when a file was changed.
    """
    global _seen, _seen_at, _odd
    now = time.monotonic()
    if _seen is None or (_looking and now - _seen_at >= _TRUSTED):
        _seen, _seen_at = list_species(species_folders()), now
        _read.clear()
        told, _odd = _odd, odd_files(species_folders())
        for text in _odd:
            if text not in told:
                print(f"TetFlora: warning: species folder: {text}", file=sys.stderr, flush=True)
    return _seen


def skipped_files() -> list[str]:
    """Files of the user's species folder that are not used, each with the reason and what to do."""
    listed()
    return _odd


@contextmanager
def looked_at_once() -> Iterator[None]:
    """Folders are looked at now, and not again meanwhile unless TetFlora itself has changed a file.

    Where a whole scene is read, each of its species would ask several times.
    """
    global _looking
    look_again()
    listed()
    _looking = False
    try:
        yield
    finally:
        _looking = True


def look_again() -> None:
    """A species file has changed."""
    global _seen, _assets
    _seen = _assets = None


class Page(NamedTuple):
    """A species that came with a collection, as `TetFloraSpeciesEdit` has it."""

    identifier: str
    text: str


def find_edit(scene: bpy.types.Scene | None, identifier: str) -> TetFloraSpeciesEdit | Page | None:
    """What this file has in place of a species.

    Parameters
    ----------
    scene : bpy.types.Scene or None
        Looked at before the file's other scenes: a species is the same in all of them unless two scenes disagree.
    """
    return next((edit for edit in _edits(scene) if edit.identifier == identifier), None)


def _edits(scene: bpy.types.Scene | None) -> Iterator[TetFloraSpeciesEdit | Page]:
    """Edits of this file, then species of linked plants, then those of others that are nowhere else."""
    yield from listed_in("species_edits", scene)
    left: list[Page] = []
    for collection in getattr(bpy.data, "collections", ()):
        if PAGES in collection:
            if collection.library is not None or collection.override_library is not None:
                yield from pages_of(collection)
            else:
                left += pages_of(collection)
    yield from (page for page in left if page.identifier not in listed())


def pages_of(collection: bpy.types.Collection) -> tuple[Page, ...]:
    """Species that a collection holds; none where these are not as TetFlora writes them."""
    return _pages(str(collection.get(PAGES, "")))


@lru_cache(maxsize=256)
def _pages(text: str) -> tuple[Page, ...]:
    try:
        document = parse_json(text)
    except ValueError:
        document = {}
    entries = document.items() if isinstance(document, dict) else ()
    return tuple(Page(name, page) for name, page in entries if is_identifier(name) and isinstance(page, str))


def species_for(scene: bpy.types.Scene | None, identifier: str) -> Species:
    """A species as this file has it: edited here, else the catalog's.

    Raises
    ------
    SpeciesError
        Unknown, or broken; the message names the key and what is allowed. Or an asset, which does not grow.
    """
    refuse_asset(scene, identifier)
    edit = find_edit(scene, identifier)
    return load_species(identifier, known=listed()) if edit is None else _species(edit.text, identifier)


def display_height(identifier: str) -> float:
    """Height of a species' trunk in meters, for the arrow that stands for a plant in the viewport."""
    asset = find_asset(None, identifier)
    if asset is not None:
        return asset.height
    try:
        return float(species_for(None, identifier).orders[0].length.mean)
    except SpeciesError:
        return _FALLBACK_HEIGHT


@lru_cache(maxsize=64)
def _species(text: str, identifier: str) -> Species:
    return species_from_json(text, identifier, f"{identifier} (edited in this file)")


def problem_of(scene: bpy.types.Scene | None, identifier: str) -> str:
    """What is wrong with a species, or an empty text; cheap enough for a panel."""
    try:
        species_for(scene, identifier)
    except SpeciesError as error:
        return str(error)
    return ""


def species_data(scene: bpy.types.Scene | None, identifier: str) -> dict[str, Any]:
    """The decoded JSON of a species, edited or not, valid or not.

    Returns
    -------
    dict
        Shared with other callers: look, do not touch. Use `change_species` to change it.

    Raises
    ------
    SpeciesError
        Unknown species, an asset, or a file that holds no JSON object.
    """
    refuse_asset(scene, identifier)
    edit = find_edit(scene, identifier)
    if edit is not None:
        return _decoded(edit.text, identifier)
    known = listed()
    if identifier not in known:
        raise SpeciesError(f'Unknown species "{readable(identifier, NAME)}"; available: {", ".join(known) or "none"}')
    if identifier not in _read:
        path = known[identifier].path
        _read[identifier] = _decoded(species_file(path), path.name)
    return _read[identifier]


@lru_cache(maxsize=64)
def _decoded(text: bytes | str, name: str) -> dict[str, Any]:
    try:
        data = parse_json(text)
    except ValueError as error:
        raise SpeciesError(f"{name}: {error}") from None
    if not isinstance(data, dict):
        raise SpeciesError(f"{name}: must be a JSON object")
    return data


def change_species(scene: bpy.types.Scene, identifier: str, change: Callable[[dict[str, Any]], None]) -> None:
    """Change a species in this file; the catalog's file stays as it is. Errors are those of `species_data`.

    Parameters
    ----------
    scene : bpy.types.Scene
        Receives the edit if no scene of the file has one yet.
    change : callable
        Changes the decoded JSON that it is given. What comes of it need not be valid; `problem_of` tells.
    """
    data = copy.deepcopy(species_data(scene, identifier))
    change(data)
    store_species(scene, identifier, data)


def store_species(scene: bpy.types.Scene, identifier: str, data: dict[str, Any]) -> None:
    """Keep a decoded species in this file under an identifier, in place of an earlier one.

    Raises
    ------
    SpeciesError
        The identifier breaks the rule for them.
    """
    checked_identifier(identifier)
    text = json.dumps(data, ensure_ascii=False)
    edit = next((edit for edit in listed_in("species_edits", scene) if edit.identifier == identifier), None)
    if edit is None:
        edit = scene.tetflora.species_edits.add()
        edit.identifier = identifier
    if edit.text != text:
        edit.text = text
        tell_listeners()


def grow_in_wood(scene: bpy.types.Scene, entries: Iterable[bpy.types.PropertyGroup]) -> None:
    """Let trees in lists of species be those that grow between others; if all are, those that stand free.

    Raises
    ------
    SpeciesError
        There are none.
    """
    trees = [e for e in entries if find_asset(None, e.species) is None and display_height(e.species) > _TREE]
    if not trees:
        raise SpeciesError("The layer has no trees of the catalog; stands are woods already")
    habit = 0.0 if all(entry.species.endswith(_IN_WOOD) for entry in trees) else _HABIT
    names = [in_wood(scene, entry.species.removesuffix(_IN_WOOD), habit) for entry in trees]  # all, or an error
    for entry, name in zip(trees, names, strict=True):
        entry.species = name


def in_wood(scene: bpy.types.Scene, identifier: str, habit: float) -> str:
    """Identifier of a species with a forest habit, kept in the file, or without; errors are those of `species_data`."""
    page, name = species_data(scene, identifier), identifier + _IN_WOOD
    if habit and find_edit(scene, name) is None:
        store_species(scene, name, {**page, "name": f"{page['name']} in a Wood", "habit": habit})
    return name if habit else identifier


def revert_species(identifier: str) -> int:
    """Forget what this file has in place of a species, in all scenes; how many edits there were."""
    removed = 0
    for scene in bpy.data.scenes:
        edits = scene.tetflora.species_edits
        for index in [i for i, edit in enumerate(edits) if edit.identifier == identifier][::-1]:
            edits.remove(index)
            removed += 1
    for collection in bpy.data.collections:  # or what was made here would come back from where it was packed
        left = {page.identifier: page.text for page in pages_of(collection)}
        if collection.library is None and left.pop(identifier, None) is not None:
            collection[PAGES] = json.dumps(left, ensure_ascii=False)
    if removed:
        tell_listeners()
    return removed


def tell_listeners() -> None:
    """Some species has changed."""
    look_again()
    listeners.notify()


def new_identifier(name: str, taken: Callable[[str], bool]) -> str:
    """An identifier for a name, fit for a file's name on every system, that nothing has yet."""
    stem = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:50] or "species"
    names = chain([stem], (f"{stem}_{number}" for number in count(2)))
    return next(name for name in names if is_identifier(name) and not taken(name))


def catalog() -> dict[str, FileInfo]:
    """All species that this user or this file has, by identifier, in the order in which they are offered.

    Assets are among them; `grown` leaves them out.
    """
    global _assets, _assets_at
    known, now = listed(), time.monotonic()
    if _assets is None or now - _assets_at >= _TRUSTED:  # as often as folders
        _assets, _assets_at = asset_infos(), now
    infos = edited_infos() | _assets
    return in_order(known | infos) if infos else known


def unknown_text(identifier: str) -> str:
    """What is said of an identifier that the catalog does not have: which asset is gone, or what there is."""
    if find_asset(None, identifier) is not None:
        name = readable(name_of(identifier), NAME)
        return f'"{name}", which was used as a species, was deleted; undo, or choose another species'
    return f'Unknown species "{readable(identifier, NAME)}"; choose one of {", ".join(catalog())}'


def grown() -> dict[str, FileInfo]:
    """The species of the catalog that grow, and not the assets."""
    known = listed()
    edited = edited_infos()
    return in_order(known | edited) if edited else known


def edited_infos() -> dict[str, FileInfo]:
    """What menus show of the species that this file has; the first scene's where scenes disagree."""
    infos: dict[str, FileInfo] = {}
    for edit in _edits(None):
        if edit.identifier not in infos:
            try:
                data = _decoded(edit.text, edit.identifier)
            except SpeciesError:
                data = {}
            infos[edit.identifier] = info_of(edit.identifier, data, Path())
    return infos


def pack(_path: object = None, _other: object = None) -> None:
    """Before a file is written: bring the pages of its collections up to date."""
    custom = {name for name, info in listed().items() if info.is_own}
    custom |= {edit.identifier for edit in listed_in("species_edits")}
    assets = asset_species()
    for collection in bpy.data.collections:
        if collection.library is not None or not (custom or assets or PAGES in collection):
            continue
        plants = [group for obj in collection.objects if (group := obj.tetflora).is_plant or group.is_field]
        needed = {name for plant in plants for name in (plant.species, *(e.species for e in plant.field_species))}
        # What came by another way, such as Make Local, goes on.
        pages = {page.identifier: page.text for page in pages_of(collection) if page.identifier in needed}
        for name in sorted(custom & needed):
            with suppress(SpeciesError):  # broken, which is told elsewhere
                pages[name] = json.dumps(species_data(None, name), ensure_ascii=False)
        text = json.dumps(pages, ensure_ascii=False)
        if collection.get(PAGES, "{}") != text:
            collection[PAGES] = text
        held = collection.tetflora_assets
        for index in [i for i, entry in enumerate(held) if entry.identifier not in needed][::-1]:
            held.remove(index)
        for name in sorted(assets.keys() & needed - {entry.identifier for entry in held}):
            copy_asset(assets[name], held)


def _on_import(context: bpy.types.BlendImportContext, _other: object = None) -> None:
    """After Append: what its plants are becomes this file's, unless the scene has something of that name."""
    scene = bpy.context.scene
    for item in context.import_items:
        if isinstance(item.id, bpy.types.Collection) and item.id.library is None:
            for page in pages_of(item.id):
                if all(page.identifier != edit.identifier for edit in listed_in("species_edits", scene)):
                    with suppress(ValueError, SpeciesError):
                        store_species(scene, page.identifier, json.loads(page.text))
            for entry in item.id.tetflora_assets:
                if entry.object is not None:
                    entry.object.use_fake_user = True  # nothing else may hold it here


register, unregister = handlers(save_pre=pack, blend_import_post=_on_import)
