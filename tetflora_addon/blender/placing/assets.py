# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalog as an asset library: a .blend with one plant of each species, to be dragged into any scene.

An asset is an empty like any other plant, so that what is dragged in takes part in refinement at once. Species that
only the open file has are left out: the file into which an asset is dragged would not know them.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...errors import SceneError
from ...files import read_whole, write_whole
from ...species.catalog import FileInfo, list_species, load_species
from ..preferences import species_folders
from ..runtime import handlers
from ..saved_files import VERSION, write_blend
from ..species.catalog import thumbnail_file
from .plant_objects import prepare_scene

FILE = "tetflora_plants.blend"
LIBRARY = "TetFlora"
_CATALOG = "6f1d3a52-8f0b-4d7e-9a43-0c5c7a2be901"
_CATALOGS_FILE = "blender_assets.cats.txt"
_MOST_BYTES = 4_000_000


def write_asset_library(folder: Path) -> tuple[Path, int]:
    """Write a .blend with a plant of each species of the catalog, marked as assets: its path, and how many there are.

    Parameters
    ----------
    folder : Path
        Made if there is none; an earlier file gives way. Blender's file of asset catalogs gets a line for TetFlora.

    Raises
    ------
    SceneError
        The folder cannot be written, or its file of catalogs cannot be read.
    SpeciesError
        A species of the catalog is broken.
    """
    known = list_species(species_folders())
    path = folder / FILE
    plants: list[bpy.types.Object] = []
    with _names_free({info.name for info in known.values()}):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for info in known.values():
                species = load_species(info.identifier, species_folders())
                plants.append(bpy.data.objects.new(info.name, None))
                _make_asset(plants[-1], info, species.orders[0].length.mean)
            write_blend(path, lambda p: bpy.data.libraries.write(p, set(plants), fake_user=True, compress=True))
            _write_catalog(folder / _CATALOGS_FILE)
        except (OSError, RuntimeError) as error:
            raise SceneError(f"Cannot write the asset library to {folder}: {error}") from None
        finally:
            bpy.data.batch_remove(plants)
    return path, len(known)


def add_to_preferences(folder: Path) -> bool:
    """Let Blender's asset browsers show a folder; false if they do already. The user saves preferences as usual."""
    libraries = bpy.context.preferences.filepaths.asset_libraries
    if any(library.path and Path(bpy.path.abspath(library.path)) == folder for library in libraries):
        return False
    libraries.new(name=LIBRARY, directory=str(folder))
    return True


@contextmanager
def _names_free(names: set[str]) -> Iterator[None]:
    """Keep names free for a while: what is written bears the name that it has in the open file."""
    taken = [(obj, name) for name in names if (obj := bpy.data.objects.get((name, None))) is not None]
    for obj, name in taken:
        obj.name = f"{name} (elsewhere)"
    try:
        yield
    finally:
        for obj, name in taken:
            obj.name = name


def _make_asset(obj: bpy.types.Object, info: FileInfo, height: float) -> None:
    obj.empty_display_type, obj.empty_display_size = 'SINGLE_ARROW', height
    group = obj.tetflora
    group.version, group.is_plant, group.species, group.seed = VERSION, True, info.identifier, 1
    obj.asset_mark()
    about = obj.asset_data
    about.description, about.author, about.catalog_id = info.description, "TetFlora", _CATALOG
    for tag in ("plant", "TetFlora", info.identifier):
        about.tags.new(tag, skip_if_exists=True)
    thumbnail = thumbnail_file(info.identifier)
    if thumbnail is not None:
        with bpy.context.temp_override(id=obj):
            bpy.ops.ed.lib_id_load_custom_preview(filepath=str(thumbnail))


def _write_catalog(path: Path) -> None:
    try:
        text = read_whole(path, _MOST_BYTES).decode() if os.path.lexists(path) else "VERSION 1\n"
    except UnicodeDecodeError:
        raise SceneError(f"{path} is not a UTF-8 text file, as asset catalogs must be; repair or move it") from None
    if _CATALOG not in text:
        write_whole(path, f"{text.rstrip()}\n{_CATALOG}:TetFlora:TetFlora\n")


def _on_import(context: bpy.types.BlendImportContext, _other: object = None) -> None:
    """Plants came from another file: this scene needs what a scene with plants needs."""
    # Dragged assets are still linked here, and become the file's own afterward.
    objects = [item.id for item in context.import_items if isinstance(item.id, bpy.types.Object)]
    if any(obj.tetflora.is_plant for obj in objects):
        prepare_scene(bpy.context.scene)


register, unregister = handlers(blend_import_post=_on_import)
