# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TetFlora, a Blender extension: entry points that Blender calls, nothing else."""

from . import operators, panels
from .tetflora_addon import blender

# Properties first: operators and panels refer to them.
_PARTS = (blender, operators, panels)


def register() -> None:
    """Make TetFlora known to Blender; an error in any part goes through to the user."""
    for part in _PARTS:
        part.register()


def unregister() -> None:
    """Take everything back in reverse order."""
    for part in reversed(_PARTS):
        part.unregister()
