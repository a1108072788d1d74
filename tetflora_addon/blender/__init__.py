# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything below the operators that touches bpy: what the scene stores, reading it, writing results, rendering."""

from . import (
    asset_library,
    auto_refresh,
    command_line,
    handlers,
    point_preview,
    preferences,
    preview_job,
    preview_overlay,
    properties,
    saved_files,
    species_preview,
    thumbnails,
    translations,
)

# Handlers and commands read properties, so those come first.
_PARTS = (
    preferences,
    thumbnails,
    properties,
    handlers,
    saved_files,
    auto_refresh,
    preview_job,
    preview_overlay,
    species_preview,
    point_preview,
    asset_library,
    command_line,
    translations,
)


def register() -> None:
    """Register all parts in order."""
    for part in _PARTS:
        part.register()


def unregister() -> None:
    """Unregister all parts in reverse order."""
    for part in reversed(_PARTS):
        part.unregister()
