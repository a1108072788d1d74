# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: the user's own species, limits of the machine, quality of new scenes, the cache on disk."""

import os
from pathlib import Path

import bpy

from .. import storage
from ..errors import SpeciesError
from ..parameters import within
from .declare import boolean, choice, integer, real, string

# Blender stores preferences under the name of the extension's root package, two levels above this one.
ROOT_PACKAGE = __package__.rsplit(".", 2)[0]
#: Environment variable with the cache folder, which overrides the preferences on farms; "off" for no cache.
CACHE_VARIABLE = "TETFLORA_CACHE"
#: Qualities of refinement for a menu.
QUALITY_ITEMS = (
    ('DRAFT', "Draft", "Takes seconds, for placing plants; about 30 times fewer polygons than Final"),
    ('PREVIEW', "Preview", "For judging light and composition"),
    ('FINAL', "Final", "For final renders: proxies are indistinguishable from real plants"),
)


def _use_cache(_preferences: object = None, _context: object = None) -> None:
    """Use the cache folder of the environment or the preferences, or none."""
    chosen, prefs = os.environ.get(CACHE_VARIABLE, ""), preferences()
    if chosen:
        storage.set_folder(None if chosen.lower() == "off" else Path(chosen).absolute())
    else:
        used = prefs is not None and prefs.use_cache
        storage.set_folder((_chosen("cache") or _cache_folder()) if used else None)


class TetFloraPreferences(bpy.types.AddonPreferences):
    """Settings of the user, not of a scene."""

    bl_idname = ROOT_PACKAGE

    species_folder: string(
        "Species Folder",
        "Folder of your own species files (*.json); if empty, datafiles/tetflora beside your Blender settings, which "
        "stays when the extension is removed. A file here replaces a built-in species of the same file name. Scenes "
        "store only the names of species: everyone who renders a scene needs the same files",
        subtype='DIR_PATH',
    )
    new_quality: choice(
        "Quality of New Scenes",
        "Refinement quality that a scene gets with its first plant; it can be changed in the sidebar",
        QUALITY_ITEMS,
        default='FINAL',
    )
    max_memory: real(
        "Max Memory",
        "Gigabytes that Blender may take to refine plants and render them. Plants that would not fit become "
        "coarser. 0 is automatic: half of the machine's memory",
        **within(0.0, 64.0),
        precision=1,
    )
    kept_memory: real(
        "Frame Cache",
        "Maximum size of the frame cache in gigabytes. A render keeps meshes for frames in which the camera "
        "returns; the least recently used go first. The current frame itself is not limited",
        1.0,
        **within(0.0, 64.0),
        precision=1,
    )
    threads: integer(
        "Threads",
        "Number of processor cores that refine plants. 0 follows the scene's render settings: Threads in the "
        "Performance panel. Results are the same unless memory is short; each core takes some of it",
        **within(0, 16, 64),
    )
    use_cache: boolean(
        "Cache Species Analysis",
        "Store the analysis of your own species on disk, so that it runs once instead of in every session. Results "
        "are the same without the cache",
        True,
        update=_use_cache,
    )
    cache_folder: string(
        "Cache Folder",
        "Folder of the cache, up to 64 MB; if empty, a folder beside your Blender settings. Several Blender "
        "instances can share it",
        subtype='DIR_PATH',
        update=_use_cache,
    )


def preferences() -> TetFloraPreferences | None:
    """The user's preferences; None outside of an extension."""
    addon = bpy.context.preferences.addons.get(ROOT_PACKAGE)
    return None if addon is None else addon.preferences


def species_folders() -> tuple[Path, ...]:
    """Existing folders of the user's own species, for the catalog's functions; none outside of an extension."""
    return (folder,) if preferences() is not None and (folder := _species_folder()).is_dir() else ()


def own_species_folder() -> Path:
    """The folder that the user's own species are saved in, created if missing; removing the extension leaves it alone.

    Raises
    ------
    SpeciesError
        It cannot be created, or TetFlora is not installed as an extension.
    """
    if preferences() is None:
        raise SpeciesError("No folder for your own species; install TetFlora as an extension")
    folder = _species_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SpeciesError(f"Cannot create the species folder: {error}. Choose another in the preferences") from None
    return folder


def _chosen(name: str) -> Path | None:
    """The folder in the preferences, if there is one."""
    chosen = getattr(preferences(), f"{name}_folder", "")
    return Path(bpy.path.abspath(chosen)) if chosen else None


def _species_folder() -> Path:
    """The folder in the preferences, or one that Blender neither updates nor deletes with the extension."""
    return _chosen("species") or Path(bpy.utils.user_resource('DATAFILES', path="tetflora"))


def _cache_folder() -> Path | None:
    """A folder of the extension, which updates keep and its removal deletes; None for an add-on of the old kind."""
    try:
        return Path(bpy.utils.extension_path_user(ROOT_PACKAGE, path="cache"))
    except ValueError:
        return None


def register() -> None:
    """Register the preferences and use their cache folder."""
    bpy.utils.register_class(TetFloraPreferences)
    _use_cache()


def unregister() -> None:
    """Unregister the preferences."""
    storage.set_folder(None)
    bpy.utils.unregister_class(TetFloraPreferences)
