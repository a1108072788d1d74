# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""File formats of renders, for tests, benchmarks and examples."""

from __future__ import annotations

from typing import Any


def set_format(settings: Any, file_format: str) -> None:
    """Choose a file format, `'FFMPEG'` for movies, in ``render.image_settings``.

    From Blender 5.0 on, the media type has to allow the format first.
    """
    if hasattr(settings, "media_type"):
        media = {'FFMPEG': 'VIDEO', 'OPEN_EXR_MULTILAYER': 'MULTI_LAYER_IMAGE'}
        settings.media_type = media.get(file_format, 'IMAGE')
    settings.file_format = file_format
