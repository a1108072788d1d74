# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fallen leaves: a population of the ground cover on which lies in autumn what the trees above have shed.

It is one of its own, so that what grows there, and the litter of years before, keep their places.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing

import bpy

from ...errors import SceneError
from ...jobs import Progress
from ...planting.canopy import Canopy
from ...planting.cover import FULL
from ...species.fallen import KIND, shed_share
from ..runtime import JobData, job
from ..scene.crowns import crown_for, crown_steps
from ..species.edits import species_for
from .canopy import canopy_of, standing
from .cover import ANYBODY, UNDER, Ingredient, add_cover, again, cover_of, fallen_from, mix, restored, shedders
from .populations import Made, make_plants_steps, refuse_frozen
from .rules import grounds_of

NAME = "Fallen leaves"
_SQUARE = 0.976  # mean square of the scales of a cover's plants


@job("Strewing leaves")
def strew_steps(
    data: JobData, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, population: bpy.types.PropertyGroup
) -> Generator[Progress, object, Made | None]:
    """Strew the leaves that fall in autumn under a population; None where nothing above sheds its leaves.

    What an earlier run made for the same population is replaced; settings that were changed since stay. Closing the
    steps leaves everything as it was.

    Raises
    ------
    SceneError
        It has no ground, or the leaves are frozen; or something was deleted meanwhile.
    """
    yield (progress := Progress(0.0, UNDER))
    uid = population.uid or ANYBODY
    found = cover_of(scene, uid, fallen=True)
    if found is not None:
        refuse_frozen(found)
    grounds = grounds_of(scene, population)
    if not grounds:
        raise SceneError(f'"{population.name}" has no ground in this scene')
    data.add_objects(grounds)
    yield from crown_steps(progress, scene, standing(scene))
    population = again(data, scene, population, uid)
    with restored(scene, uid, fallen=True):
        canopy, above = canopy_of(scene, depsgraph)
        parts = _parts(scene, canopy, above)
        if not parts:
            return None
        found = cover_of(scene, uid, fallen=True) or add_cover(scene, population, grounds, {}, NAME)
        # Ground that is wholly suited, of all that falls on it.
        mix(found, parts, canopy.area.sum() / FULL / len(parts))
        with closing(make_plants_steps(scene, depsgraph, found)) as steps:
            return (yield from steps)


def _parts(scene: bpy.types.Scene, canopy: Canopy, above: tuple[str, ...]) -> list[Ingredient]:
    """Fallen leaves of each species: as many patches as have the area of what falls."""
    parts = []
    for name in shedders(canopy, above):
        patch = fallen_from(scene, name, KIND)
        share = shed_share(species_for(scene, name)) if patch else 0.0
        area = crown_for(scene, patch).leaves if share > 0.0 else 0.0
        if area > 0.0:
            parts.append(Ingredient(patch, 'FALLEN', FULL * share / (area * _SQUARE), name))
    return parts
