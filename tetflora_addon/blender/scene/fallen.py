# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species of fallen leaves that are not there at the scene's frame: their plants are not read at all."""

from __future__ import annotations

from contextlib import suppress

import bpy

from ...errors import TetFloraError
from ...growth.fallen import is_gone
from ..settings import season_of
from ..species.edits import edited_infos, species_for


def gone_species(scene: bpy.types.Scene) -> set[str]:
    """Identifiers of those that populations of the scene strew, or that its file holds."""
    group, season = scene.tetflora, season_of(scene)
    names = set(edited_infos())
    names |= {e.species for p in group.populations for e in p.mix if e.habitat == 'FALLEN'}
    found = set()
    for name in names:
        with suppress(TetFloraError):  # which is told elsewhere
            if is_gone(species_for(scene, name), season):
                found.add(name)
    return found
