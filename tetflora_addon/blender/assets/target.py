# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is instanced: an object, a collection, or geometry that nodes instance without an object of its own."""

from __future__ import annotations

from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Target:
    """What is instanced; equal where it is the same datablock, or the same geometry."""

    datablock: bpy.types.Object | bpy.types.Collection | None
    geometry: bpy.types.GeometrySet | None
    owner: bpy.types.Object | None
    name: str


def digest_of(target: Target, depsgraph: bpy.types.Depsgraph) -> str:
    """Stands in until there is one of all that the target shows."""
    shown = target.datablock
    data = getattr(shown, "data", None)
    return f"{target.name}|{getattr(shown, 'name_full', '')}|{len(getattr(data, 'polygons', ()))}"
