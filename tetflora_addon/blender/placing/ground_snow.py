# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Snow on the ground of a population: in the artist's own materials, and only when asked for."""

from __future__ import annotations

import bpy

from ...errors import SceneError
from ..materials.snow import add_snow
from .rules import grounds_of


def cover_with_snow(scene: bpy.types.Scene, population: bpy.types.PropertyGroup) -> list[str]:
    """Put the snow of the scene on all materials of a population's ground; names of those that had none before.

    Raises
    ------
    SceneError
        The population has no ground, or the ground has no material of this file.
    """
    slots = [slot for obj in grounds_of(scene, population) for slot in obj.material_slots]
    materials = dict.fromkeys(slot.material for slot in slots if slot.material is not None)
    own = [one for one in materials if one.library is None and one.override_library is None and one.node_tree]
    if not own:
        raise SceneError(f'The ground of "{population.name}" has no material in this file; give it one first')
    return [material.name for material in own if add_snow(material)]
