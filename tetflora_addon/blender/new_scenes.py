# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user's preferences give to a scene when its first plant is added."""

import bpy

from ..refinement.settings import QUALITIES
from .preferences import preferences
from .qualities import set_quality


def begin(scene: bpy.types.Scene) -> None:
    """Give a scene that has no plants yet the user's quality and memory limit, unless it has its own already."""
    group, chosen = scene.tetflora, preferences()
    if chosen is None:
        return
    values = QUALITIES[chosen.new_quality]
    if not any(group.is_property_set(name) for name in values):
        set_quality(group, list(QUALITIES).index(chosen.new_quality))
    if chosen.new_memory > 0.0 and not group.is_property_set("max_memory"):
        group.max_memory = chosen.new_memory
