# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of species for menus and asset browsers: PNG files beside the species, made by ``examples.thumbnails``."""

from __future__ import annotations

import time
from pathlib import Path

import bpy
from bpy.utils import previews

from ..plants.catalogue import builtin_folder
from .preferences import species_folders

FOLDER = "thumbnails"
ENDING = ".png"
#: Where a species has no picture.
FALLBACK_ICON = 'OUTLINER_OB_EMPTY'

_pictures: previews.ImagePreviewCollection | None = None


def thumbnail_file(identifier: str) -> Path | None:
    """The picture of a species: ``thumbnails/identifier.png`` in the user's folder or among the shipped ones."""
    for folder in (*species_folders(), builtin_folder()):
        path = folder / FOLDER / (identifier + ENDING)
        if identifier and path.is_file():
            return path
    return None


# Seconds for which a picture is not looked for again: menus and panels ask for all of them at each redraw.
_TRUSTED = 0.0 if bpy.app.background else 1.0
_icons: dict[str, tuple[float, int]] = {}


def icon_of(identifier: str) -> int:
    """Number of a species' picture for items and layouts, loaded at first use; 0 where it has none."""
    now = time.monotonic()
    seen, icon = _icons.get(identifier, (-_TRUSTED, 0))
    if now - seen >= _TRUSTED:
        icon = _icon_of(identifier)
        _icons[identifier] = now, icon
    return icon


def _icon_of(identifier: str) -> int:
    path = thumbnail_file(identifier)
    if path is None or _pictures is None:
        return 0
    name = f"{path}|{path.stat().st_mtime_ns}"  # another picture under the same name is another one
    found = _pictures.get(name) or _pictures.load(name, str(path), 'IMAGE')
    return found.icon_id


def register() -> None:
    """Open an empty collection of pictures."""
    global _pictures
    _pictures = previews.new()


def unregister() -> None:
    """Free the pictures."""
    global _pictures
    if _pictures is not None:
        previews.remove(_pictures)
    _pictures = None
    _icons.clear()
