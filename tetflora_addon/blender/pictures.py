# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether pictures that Blender wrote are whole.

Blender renders on where a disk is full: PNG and OpenEXR files end in the middle, and nobody is told (tried on 5.2).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import bpy


def damaged(scene: bpy.types.Scene, files: Iterable[Path]) -> list[Path]:
    """Those of a scene's pictures that cannot be read; OpenEXR of several layers and films are not looked at."""
    render = scene.render
    # Blender reads no more of the former than their names until a layer is shown.
    if render.is_movie_format or render.image_settings.file_format == 'OPEN_EXR_MULTILAYER':
        return []
    return [path for path in files if path.is_file() and not _whole(path)]


def _whole(path: Path) -> bool:
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError:
        return False
    try:
        return image.size[0] > 0
    finally:
        bpy.data.images.remove(image)
