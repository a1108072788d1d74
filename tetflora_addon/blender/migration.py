# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of earlier versions: bring stored properties up to date, one step at a time."""

import sys
from collections.abc import Callable

import bpy

VERSION = 2

Step = Callable[[bpy.types.Object | bpy.types.Scene], None]


def _stamp_only(_owner: bpy.types.Object | bpy.types.Scene) -> None:
    """Version 1 stores what was there before there were numbers; version 2 changes only scenes."""


def _slope_as_range(scene: bpy.types.Scene) -> None:
    """Version 2 has a flattest slope beside the steepest, among the settings for new populations."""
    settings = scene.tetflora.populate
    if settings.is_property_set("slope_limit"):
        settings.slope_max = settings.slope_limit
        settings.property_unset("slope_limit")


# Step n turns properties of version n into those of version n + 1.
OBJECT_STEPS: list[Step] = [_stamp_only, _stamp_only]
SCENE_STEPS: list[Step] = [_stamp_only, _slope_as_range]


def _migrate(owner: bpy.types.Object | bpy.types.Scene, steps: list[Step]) -> bool:
    group = owner.tetflora
    if owner.library is not None or group.version >= VERSION:
        return group.version > VERSION
    for step in steps[group.version : VERSION]:
        step(owner)
    group.version = VERSION
    return False


def migrate() -> None:
    """Bring all plants, fields, occluders and scenes of the open file up to date.

    What a newer TetFlora stored is left alone, and said on stderr. Linked data belongs to another file.
    """
    owners = [
        (o, OBJECT_STEPS)
        for o in bpy.data.objects
        if o.tetflora.is_plant or o.tetflora.is_field or o.tetflora.is_occluder
    ]
    owners += [(s, SCENE_STEPS) for s in bpy.data.scenes if s.is_property_set("tetflora")]
    newer = sum([_migrate(owner, steps) for owner, steps in owners])
    if newer:
        print(
            f"TetFlora: {newer} objects or scenes were saved by a newer TetFlora; update the extension",
            file=sys.stderr,
        )
